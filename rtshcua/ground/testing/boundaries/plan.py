"""Where the generated tests start from: a nominal, and for each skill and asker a scene that is allowed."""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

from rtshcua.decision.times import local_time
from rtshcua.ground.analysis.questions import Questions
from rtshcua.ground.testing.boundaries import written
from rtshcua.ground.testing.boundaries.base import Asker, askers, others, starts, wish
from rtshcua.ground.testing.boundaries.blocks import Frame, block
from rtshcua.ground.testing.boundaries.reading import Play, Read, allowed, read, scene_of
from rtshcua.ground.testing.boundaries.scene import Made, Variable
from rtshcua.ground.testing.boundaries.suite import Block, Draft
from rtshcua.ground.testing.boundaries.values import reported
from rtshcua.ground.testing.case import Case, Tested
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import DAY, FULL
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.situation import Now, State

T = TypeVar("T")

#: 2026-06-01T00:00:00Z, the day of generated tests, in us
_THE_DAY = 1_780_272_000_000_000
#: the phase of what may be in any
_ANY_PHASE = "flight"


class Plan(NamedTuple):
    """What to generate: for which skills (none: all), what the text imports, a nominal that is imported and its phase
    (None: one is made), and places that a vehicle may be sent to (local mm), the likeliest first.
    """

    skills: tuple[str, ...]
    imports: tuple[str, ...]
    nominal: str | None
    phase: str | None
    entries: tuple[tuple[int, int], ...]


class Planned(NamedTuple):
    """A frame, and whether its scene is allowed."""

    frame: Frame
    allowed: bool


def planned(tested: Tested, plan: Plan, asked: Questions, play: Play) -> tuple[Draft, list[Planned]]:
    """A draft with its nominal and without blocks, and a frame for each skill and asker. Raises `reading.Refused`."""
    policy = tested.lowered.policy
    draft = Draft(policy.name, policy.version, plan.imports, None, [])
    chosen = [each for each in askers(policy) if not plan.skills or policy.contracts[each.skill].name in plan.skills]
    if not chosen:
        return draft, []
    state, now = _beginning(policy)
    name = plan.nominal or f"{policy.name}_nominal"
    if plan.nominal is None:
        state = _agreed(chosen, tested, asked, state, now, plan.entries)
        draft.nominal = _nominal(tested, name, state, now, chosen[0])
    else:
        case = _case_of(draft, _frames(chosen[:1], tested, asked, state, now, plan, name), play)
        state, now = (state, now) if case is None else (case.state, case.now)
    frames = _frames(chosen, tested, asked, state, now, plan, name)
    draft.blocks = [block(each, str(number), each.made) for number, each in enumerate(frames)]
    first = _by_frame(frames, draft.blocks, read(draft, play))
    found = [Planned(frame._replace(scene=scene_of(cases[0])), allowed(cases[0])) for frame, cases in first]
    open_ = [each for each in found if not each.allowed]
    better = _tried([each.frame for each in open_], draft, play, plan.entries)
    draft.blocks = []
    return draft, [each if each.allowed else better.get(each.frame.label, each) for each in found]


def _frames(
    chosen: Sequence[Asker], tested: Tested, asked: Questions, state: State, now: Now, plan: Plan, nominal: str
) -> list[Frame]:
    """A frame for each asker, as far as the analysis tells; the place is the nominal's."""
    policy = tested.lowered.policy
    found: list[Frame] = []
    for asker in chosen:
        made = wish(asker, tested.prepared, asked, state, now, plan.entries)
        if made is None:
            continue
        contract = policy.contracts[asker.skill]
        label = contract.name
        if any(each.label == label for each in found):
            label += f" by {policy.roles[asker.role]} through {SourceKind(asker.source).name.lower()}"
        current = _ANY_PHASE if plan.nominal is None else plan.phase
        other = contract.phases and current not in contract.phases
        scene = made.scene.with_all({key: value for key, value in made.made.items() if key.argument})
        where = {Variable(False, policy.vehicle.position), Variable(False, policy.vehicle.height)}
        given = {key: value for key, value in made.made.items() if not key.argument and key not in where}
        phase = f"phase {contract.phases[0]} of {contract.phases[0]}" if other else None
        found.append(Frame(label, scene, given, nominal, phase))
    return found


def _tried(frames: Sequence[Frame], draft: Draft, play: Play, entries: Sequence[tuple[int, int]]) -> dict[str, Planned]:
    """Frames from other places and heights, and with other arguments, the first of each that is allowed."""
    tries = [
        (frame, _at(frame, start) | other)
        for frame in frames
        for other in others(frame.scene, entries)
        for start in starts(frame.scene.with_all(other))
    ]
    draft.blocks = [block(frame, str(number), made) for number, (frame, made) in enumerate(tries)]
    found: dict[str, Planned] = {}
    for (frame, made), cases in _by_frame(tries, draft.blocks, read(draft, play) if tries else []):
        if frame.label not in found and allowed(cases[0]):
            given = {variable: value for variable, value in made.items() if not variable.argument}
            found[frame.label] = Planned(frame._replace(scene=scene_of(cases[0]), made=given), True)
    return found


def _at(frame: Frame, start: tuple[int, int, int]) -> Made:
    """What a frame changes of the nominal, and that the vehicle is elsewhere."""
    x, y, height = start
    vehicle = frame.policy.vehicle
    return frame.made | {Variable(False, vehicle.position): (x, y), Variable(False, vehicle.height): height}


def _by_frame(frames: Sequence[T], blocks: Sequence[Block], found: Sequence[Read]) -> list[tuple[T, tuple[Case, ...]]]:
    """What was read of the block of each frame, but for those that the language refused."""
    by_block = {each.block: each.cases for each in found}
    return [(frame, by_block[one]) for frame, one in zip(frames, blocks, strict=True) if one in by_block]


def _case_of(draft: Draft, frames: Sequence[Frame], play: Play) -> Case | None:
    """The first frame as the nominal alone has it."""
    draft.blocks = [block(each, "probe", {}) for each in frames]
    return next((each.cases[0] for each in read(draft, play)), None)


def _beginning(policy: Policy) -> tuple[State, Now]:
    """At home, on the ground, fully charged, nothing else there; at noon, local time."""
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
    chosen: Sequence[Asker],
    tested: Tested,
    asked: Questions,
    state: State,
    now: Now,
    entries: tuple[tuple[int, int], ...],
) -> State:
    """The state with the values that skills ask for, of each signal what the first asks that asks for any."""
    policy = tested.lowered.policy
    values, settled = list(state.values), {policy.vehicle.position, policy.vehicle.height}
    for asker in chosen:
        made = wish(asker, tested.prepared, asked, State(tuple(values), state.ages), now, entries)
        for variable, value in {} if made is None else made.made.items():
            if not variable.argument and variable.at is not None and variable.at not in settled:
                assert value is None or isinstance(value, int)
                values[variable.at] = value
                settled.add(variable.at)
    return State(tuple(values), state.ages)


def _nominal(tested: Tested, name: str, state: State, now: Now, asker: Asker) -> str:
    """The text of the nominal: everything that the policy reads."""
    policy = tested.lowered.policy
    given: list[str] = []
    for signal in policy.signals:
        cells = state.values[signal.slot : signal.slot + 2]
        value = cells[0] if signal.kind != POSITION or None in cells else (cells[0] or 0, cells[1] or 0)
        words = written.signal(policy, signal, value)
        given += [] if words is None else [f"  given {signal.name} = {words}\n"]
    source = SourceKind(asker.source).name.lower()
    return (
        f"nominal {name} {{\n"
        f"  under {policy.name}\n  on {tested.lowered.vehicle.name.text}\n"
        f"  by role {policy.roles[asker.role]} through {source}\n"
        f'  at "{written.moment(now.utc_us)}"\n  phase {_ANY_PHASE}\n{"".join(given)}}}\n'
    )
