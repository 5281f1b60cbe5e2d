"""Generates the text of tests for both sides of every limit of a policy; they expect the present decisions.

Tests start from a nominal, and for each skill and requester from an allowed scene. The compiler reads each draft
(`draft`): to find the state of the nominal, places from which the planned path is allowed, and the decision of each
case. It reads the finished text again, and every case must be met.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from rtshcua.decision.times import local_time
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.analysis.solve import Questions
from rtshcua.ground.analysis.space import signals
from rtshcua.ground.checker.checks.tests import MAX_CASES
from rtshcua.ground.testing.boundaries import case_values
from rtshcua.ground.testing.boundaries.blocks import (
    CaseFrame,
    answers,
    block,
    over_time,
    phases,
    stretches,
    tables,
    times,
)
from rtshcua.ground.testing.boundaries.case_values import reported, writable
from rtshcua.ground.testing.boundaries.clause_limits import ClauseLimit
from rtshcua.ground.testing.boundaries.draft import (
    Block,
    Draft,
    DraftRefused,
    ReadBlock,
    ReadSource,
    allowed,
    expectation,
    read_draft,
    scene_of,
)
from rtshcua.ground.testing.boundaries.limit_search import search
from rtshcua.ground.testing.boundaries.scene import SceneChanges, SceneVariable, parts_of
from rtshcua.ground.testing.boundaries.starting_scene import (
    Requester,
    other_arguments,
    requesters,
    scene_candidate,
    start_places,
)
from rtshcua.ground.testing.case import CaseSuite, PolicyCase, PolicyUnderTest
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.testing.coverage_goals import clauses_of
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import DAY, FULL
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.situation import Now, State

T = TypeVar("T")

#: 2026-06-01T00:00:00Z, the day of generated tests, in us
_THE_DAY = 1_780_272_000_000_000
#: the phase of skills that are valid in any phase
_ANY_PHASE = "flight"


class GenerationPlan(NamedTuple):
    """What to generate: the skills (empty: all), the imports of the text, an imported nominal and its phase (None: a
    new one), and places to which a vehicle may be sent (local mm), the most likely first.
    """

    skills: tuple[str, ...]
    imports: tuple[str, ...]
    nominal: str | None
    phase: str | None
    entries: tuple[tuple[int, int], ...]


class PlannedFrame(NamedTuple):
    """A frame, and whether its scene is allowed."""

    frame: CaseFrame
    allowed: bool


def plan_frames(
    tested: PolicyUnderTest, plan: GenerationPlan, analysis: Questions, play: ReadSource
) -> tuple[Draft, list[PlannedFrame]]:
    """Return a draft with its nominal and no blocks, and a frame for each requester. Raises `DraftRefused`."""
    policy = tested.lowered.policy
    draft = Draft(policy.name, policy.version, plan.imports, None, [])
    chosen = [
        each for each in requesters(policy) if not plan.skills or policy.contracts[each.skill].name in plan.skills
    ]
    if not chosen:
        return draft, []
    state, now = _beginning(policy)
    name = plan.nominal or f"{policy.name}_nominal"
    if plan.nominal is None:
        state = _agreed(chosen, tested, analysis, state, now, plan.entries)
        draft.nominal = _nominal(tested, name, state, now, chosen[0])
    else:
        case = _case_of(draft, _frames(chosen[:1], tested, analysis, state, now, plan, name), play)
        state, now = (state, now) if case is None else (case.state, case.now)
    frames = _frames(chosen, tested, analysis, state, now, plan, name)
    draft.blocks = [block(each, str(number), each.made) for number, each in enumerate(frames)]
    first = _by_frame(frames, draft.blocks, read_draft(draft, play))
    found = [PlannedFrame(frame._replace(scene=scene_of(cases[0])), allowed(cases[0])) for frame, cases in first]
    open_ = [each for each in found if not each.allowed]
    better = _allowed_frames([each.frame for each in open_], draft, play, plan.entries)
    draft.blocks = []
    return draft, [each if each.allowed else better.get(each.frame.label, each) for each in found]


def _frames(
    chosen: Sequence[Requester],
    tested: PolicyUnderTest,
    analysis: Questions,
    state: State,
    now: Now,
    plan: GenerationPlan,
    nominal: str,
) -> list[CaseFrame]:
    """Return a frame for each requester for whom the analysis finds one; its place is the nominal's."""
    policy = tested.lowered.policy
    found: list[CaseFrame] = []
    for requester in chosen:
        made = scene_candidate(requester, tested.prepared, analysis, state, now, plan.entries)
        if made is None:
            continue
        contract = policy.contracts[requester.skill]
        label = contract.name
        if any(each.label == label for each in found):
            label += f" by {policy.roles[requester.role]} through {SourceKind(requester.source).name.lower()}"
        current = _ANY_PHASE if plan.nominal is None else plan.phase
        other = contract.phases and current not in contract.phases
        scene = made.scene.with_all({key: value for key, value in made.made.items() if key.argument})
        where = {SceneVariable(False, policy.vehicle.position), SceneVariable(False, policy.vehicle.height)}
        given = {key: value for key, value in made.made.items() if not key.argument and key not in where}
        phase = f"phase {contract.phases[0]} of {contract.phases[0]}" if other else None
        found.append(CaseFrame(label, scene, given, nominal, phase))
    return found


def _allowed_frames(
    frames: Sequence[CaseFrame], draft: Draft, play: ReadSource, entries: Sequence[tuple[int, int]]
) -> dict[str, PlannedFrame]:
    """Return the first allowed frame of each label, from other places and heights and with other arguments."""
    tries = [
        (frame, _at(frame, start) | other)
        for frame in frames
        for other in other_arguments(frame.scene, entries)
        for start in start_places(frame.scene.with_all(other))
    ]
    draft.blocks = [block(frame, str(number), made) for number, (frame, made) in enumerate(tries)]
    found: dict[str, PlannedFrame] = {}
    for (frame, made), cases in _by_frame(tries, draft.blocks, read_draft(draft, play) if tries else []):
        if frame.label not in found and allowed(cases[0]):
            given = {variable: value for variable, value in made.items() if not variable.argument}
            found[frame.label] = PlannedFrame(frame._replace(scene=scene_of(cases[0]), made=given), True)
    return found


def _at(frame: CaseFrame, start: tuple[int, int, int]) -> SceneChanges:
    """The changes of a frame, with the vehicle at another place."""
    x, y, height = start
    vehicle = frame.policy.vehicle
    return frame.made | {SceneVariable(False, vehicle.position): (x, y), SceneVariable(False, vehicle.height): height}


def _by_frame(
    frames: Sequence[T], blocks: Sequence[Block], found: Sequence[ReadBlock]
) -> list[tuple[T, tuple[PolicyCase, ...]]]:
    """The cases of each frame's block, without the refused blocks."""
    by_block = {each.block: each.cases for each in found}
    return [(frame, by_block[one]) for frame, one in zip(frames, blocks, strict=True) if one in by_block]


def _case_of(draft: Draft, frames: Sequence[CaseFrame], play: ReadSource) -> PolicyCase | None:
    """The case of the first frame with the values of the nominal alone; None if it was refused."""
    draft.blocks = [block(each, "probe", {}) for each in frames]
    return next((each.cases[0] for each in read_draft(draft, play)), None)


def _beginning(policy: Policy) -> tuple[State, Now]:
    """The initial state: at home, on the ground, fully charged, all other signals 0; at noon, local time."""
    values: list[int | None] = [0] * policy.slots
    for signal in policy.signals:
        if signal.kind == ENUMERATION:
            values[signal.slot] = next(iter(reported(signal)), None)
        elif signal.kind == POSITION:
            values[signal.slot : signal.slot + 2] = (0, 0)
    if policy.vehicle.battery != -1:
        values[policy.vehicle.battery] = FULL
    noon = _THE_DAY + (DAY // 2 - local_time(policy.vehicle).offset(_THE_DAY)) % DAY
    return State(tuple(values), (0,) * policy.slots), Now(0, noon, 0)


def _agreed(
    chosen: Sequence[Requester],
    tested: PolicyUnderTest,
    analysis: Questions,
    state: State,
    now: Now,
    entries: tuple[tuple[int, int], ...],
) -> State:
    """The state with the values that the skills require; for each signal those of the first skill that requires one."""
    policy = tested.lowered.policy
    values, settled = list(state.values), {policy.vehicle.position, policy.vehicle.height}
    for requester in chosen:
        made = scene_candidate(requester, tested.prepared, analysis, State(tuple(values), state.ages), now, entries)
        for variable, value in {} if made is None else made.made.items():
            if not variable.argument and variable.at is not None and variable.at not in settled:
                assert value is None or isinstance(value, int)
                values[variable.at] = value
                settled.add(variable.at)
    return State(tuple(values), state.ages)


def _nominal(tested: PolicyUnderTest, name: str, state: State, now: Now, requester: Requester) -> str:
    """The text of a nominal with all signals that the policy reads."""
    policy = tested.lowered.policy
    given: list[str] = []
    for signal in policy.signals:
        cells = state.values[signal.slot : signal.slot + 2]
        value = cells[0] if signal.kind != POSITION or None in cells else (cells[0] or 0, cells[1] or 0)
        words = case_values.signal_text(policy, signal, value)
        given += [] if words is None else [f"  given {signal.name} = {words}\n"]
    source = SourceKind(requester.source).name.lower()
    return (
        f"nominal {name} {{\n"
        f"  under {policy.name}\n  on {tested.lowered.vehicle.name.text}\n"
        f"  by role {policy.roles[requester.role]} through {source}\n"
        f'  at "{case_values.moment_text(now.utc_us)}"\n  phase {_ANY_PHASE}\n{"".join(given)}}}\n'
    )


class UnreachedLimit(NamedTuple):
    """A limit, or a whole clause, without a case: the skill, the role and the text of its clause, the limit ("" for the
    whole clause), and whether the clause changes there but no decision does.
    """

    skill: str
    role: str
    text: str
    about: str
    turned: bool = False

    @property
    def words(self) -> str:
        """A description on one line."""
        clause = f"{self.skill}: {self.role}: {self.text}"
        if not self.about:
            return f"{clause}: no part of it"
        return f"{clause}: {self.about}" + (" (changes the clause, but no decision)" if self.turned else "")


@dataclass(frozen=True, slots=True)
class GeneratedTests:
    """The finished text, its number of cases and their limits, the labels of requesters without an allowed scene, and
    the limits without a case. The text is None if there are too many cases, no cases, or findings in `refused`.
    """

    text: str | None
    cases: int = 0
    limits: tuple[ClauseLimit, ...] = ()
    without: tuple[str, ...] = ()
    unreached: tuple[UnreachedLimit, ...] = ()
    refused: tuple[Diagnostic, ...] = ()


def generate(tested: PolicyUnderTest, plan: GenerationPlan, play: ReadSource) -> GeneratedTests:
    """Generate the tests of a policy, or of some of its skills."""
    try:
        return _generated(tested, plan, play)
    except DraftRefused as error:
        return GeneratedTests(None, refused=error.findings)


def _generated(tested: PolicyUnderTest, plan: GenerationPlan, play: ReadSource) -> GeneratedTests:
    analysis = Questions(tested.prepared)
    draft, frames = plan_frames(tested, plan, analysis, play)
    found: list[ClauseLimit] = []
    blocks: list[Block] = []
    unreached: list[UnreachedLimit] = []
    seen: set[object] = set()
    for each in frames:
        made, turned, missed = _blocks(each, analysis, seen)
        blocks += made
        found += turned
        unreached += missed
    unreached += _unused_clauses(tested, plan, seen)
    draft.unreached = tuple(each.words for each in unreached)
    draft.blocks = _titled(blocks)
    count = sum(len(each.rows) for each in blocks)
    if not blocks or count > MAX_CASES:
        return GeneratedTests(None, cases=count)
    expected = [expectation(case) for each in read_draft(draft, play) for case in each.cases]
    text = draft.text(expected)
    again = play(text)
    wrong = _unmet(again)
    if wrong or len(again.cases) != len(expected):
        return GeneratedTests(None, refused=wrong)
    without = tuple(each.frame.label for each in frames if not each.allowed)
    return GeneratedTests(text, len(expected), tuple(found), without, tuple(unreached))


def _unmet(suite: CaseSuite) -> tuple[Diagnostic, ...]:
    """The findings on unmet expectations, and the errors; empty if every case is met."""
    unmet = [ran.finding for case in suite.cases for ran in [run_case(case)] if ran.finding is not None]
    return (*unmet, *(each for each in suite.diagnostics if each.severity is Severity.ERROR))


def _blocks(
    one: PlannedFrame, analysis: Questions, seen: set[object]
) -> tuple[list[Block], list[ClauseLimit], list[UnreachedLimit]]:
    """Return the blocks, limits and unreached limits of one frame; of a second frame for a skill only those of new
    rules. `seen` holds the parts that were used before.
    """
    frame, invocation = one.frame, one.frame.scene.invocation
    skill = invocation.invocation.skill
    made = [block(frame, "as it is", frame.made)]
    if not one.allowed:
        return made, [], []
    every = list(parts_of(invocation))
    new = [part for part in every if (skill, part.role, part.clause) not in seen]
    first = skill not in seen
    seen |= {skill, *((skill, part.role, part.clause) for part in every)}
    bounds = [(low, high) for low, high, _, _ in signals(frame.policy)]

    def fits(limit: ClauseLimit) -> bool:
        return all(writable(side, limit.variable, invocation, bounds) for side in (limit.holds, limit.fails))

    found, missed = search(new, every, frame.scene, analysis.space(skill), fits)
    name = invocation.invocation.contract.name
    unreached = [UnreachedLimit(name, each.part.role, each.part.text, each.about, each.turned) for each in missed]
    if first or found:
        made += tables(frame, new, found, bounds)
    made += [*times(frame, found), *answers(frame, found), *over_time(frame, new)]
    if first:
        made += [*stretches(frame), *phases(frame)]
    return made, list(found), unreached


def _unused_clauses(tested: PolicyUnderTest, plan: GenerationPlan, seen: set[object]) -> Iterator[UnreachedLimit]:
    """Yield the clauses about permitted skills that no request of an allowed frame uses."""
    policy = tested.lowered.policy
    for skill, contract in enumerate(policy.contracts):
        rules = [rule for rule in policy.rules if skill in (rule.skills or (skill,))]
        chosen = not plan.skills or contract.name in plan.skills
        if chosen and any(rule.kind == RuleKind.PERMIT for rule in rules):
            for role, clause in (*_conditional(rules, skill), *clauses_of(contract)):
                if (skill, role, clause) not in seen:
                    yield UnreachedLimit(contract.name, role, " ".join(clause.text.split()), "")


def _conditional(rules: Iterable[Rule], skill: int) -> Iterator[tuple[str, Rule | Clause]]:
    """The rules with a condition, except those whose target is the skill itself."""
    for rule in rules:
        if rule.when and not (rule.target and rule.target.skill == skill):
            yield RuleKind(rule.kind).name.lower(), rule


def _titled(blocks: Iterable[Block]) -> list[Block]:
    """Make the titles of the blocks unique."""
    count: dict[str, int] = {}
    named: list[Block] = []
    for each in blocks:
        title = each.title
        count[title] = count.get(title, 0) + 1
        if count[title] > 1:
            each.title = f"{title} ({count[title]})"
        named.append(each)
    return named
