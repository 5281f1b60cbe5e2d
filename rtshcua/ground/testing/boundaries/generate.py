"""Tests for both sides of every limit of a policy, as text; what they expect is what is decided now.

The language itself reads each draft (`reading`): where the nominal leads, from where the planned paths are content,
what each case is decided as, and at last the finished text, of which every case must be met.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.analysis.questions import Questions
from rtshcua.ground.analysis.space import signals
from rtshcua.ground.checker.checks.tests import MAX_CASES
from rtshcua.ground.testing.boundaries.blocks import answers, block, over_time, phases, stretches, tables, times
from rtshcua.ground.testing.boundaries.finding import search
from rtshcua.ground.testing.boundaries.limits import Limit
from rtshcua.ground.testing.boundaries.parts import parts
from rtshcua.ground.testing.boundaries.plan import Plan, Planned, planned
from rtshcua.ground.testing.boundaries.reading import Play, Refused, expectation, read
from rtshcua.ground.testing.boundaries.suite import Block
from rtshcua.ground.testing.boundaries.values import writable
from rtshcua.ground.testing.case import Tested
from rtshcua.ground.testing.coverage.universe import clauses_of
from rtshcua.ground.testing.run import run_case
from rtshcua.model.flat.policy import RuleKind


class Unreached(NamedTuple):
    """A limit, or a whole clause, that no case was found for: the skill, the role and the text of its clause, what it
    is about ("" for the whole clause), and whether the clause turns there, though nothing that is decided does.
    """

    skill: str
    role: str
    text: str
    about: str
    turned: bool = False

    @property
    def words(self) -> str:
        """For a person, on one line."""
        what = f"{self.skill}: {self.role}: {self.text}"
        if not self.about:
            return f"{what}: nothing of it"
        return f"{what}: {self.about}" + (" (turns it, and changes no decision)" if self.turned else "")


@dataclass(frozen=True, slots=True)
class Generated:
    """The finished text, how many cases it has, the limits that they surround, for whom no situation was found that is
    allowed, and the limits that no case reaches. Without a text there are too many cases, or none, or `refused` says
    why.
    """

    text: str | None
    cases: int = 0
    limits: tuple[Limit, ...] = ()
    without: tuple[str, ...] = ()
    unreached: tuple[Unreached, ...] = ()
    refused: tuple[Diagnostic, ...] = ()


def generate(tested: Tested, plan: Plan, play: Play) -> Generated:
    """The tests of a policy, or of some of its skills."""
    try:
        return _generated(tested, plan, play)
    except Refused as error:
        return Generated(None, refused=error.findings)


def _generated(tested: Tested, plan: Plan, play: Play) -> Generated:
    asked = Questions(tested.prepared)
    draft, frames = planned(tested, plan, asked, play)
    found: list[Limit] = []
    blocks: list[Block] = []
    unreached: list[Unreached] = []
    seen: set[object] = set()
    for each in frames:
        made, turned, missed = _blocks(each, asked, seen)
        blocks += made
        found += turned
        unreached += missed
    unreached += _never(tested, plan, seen)
    draft.unreached = tuple(each.words for each in unreached)
    draft.blocks = _titled(blocks)
    count = sum(len(each.rows) for each in blocks)
    if not blocks or count > MAX_CASES:
        return Generated(None, cases=count)
    expected = [expectation(case) for each in read(draft, play) for case in each.cases]
    text = draft.text(expected)
    again = play(text)
    wrong = [ran.finding for case in again.cases for ran in [run_case(case)] if ran.finding is not None]
    wrong += [each for each in again.diagnostics if each.severity is Severity.ERROR]
    if wrong or len(again.cases) != len(expected):
        return Generated(None, refused=tuple(wrong))
    without = tuple(each.frame.label for each in frames if not each.allowed)
    return Generated(text, len(expected), tuple(found), without, tuple(unreached))


def _blocks(one: Planned, asked: Questions, seen: set[object]) -> tuple[list[Block], list[Limit], list[Unreached]]:
    """The blocks of one frame; of a second frame for one skill only about rules that the first had none of.

    `seen` remembers what was asked about.
    """
    frame, invocation = one.frame, one.frame.scene.invocation
    skill = invocation.invocation.skill
    made = [block(frame, "as it is", frame.made)]
    if not one.allowed:
        return made, [], []
    every = list(parts(invocation))
    new = [part for part in every if (skill, part.role, part.clause) not in seen]
    first = skill not in seen
    seen |= {skill, *((skill, part.role, part.clause) for part in every)}
    bounds = [(low, high) for low, high, _, _ in signals(frame.policy)]

    def fits(limit: Limit) -> bool:
        return all(writable(side, limit.variable, invocation, bounds) for side in (limit.holds, limit.fails))

    found, missed = search(new, every, frame.scene, asked.space(skill), fits)
    name = invocation.invocation.contract.name
    unreached = [Unreached(name, each.part.role, each.part.text, each.about, each.turned) for each in missed]
    if first or found:
        made += tables(frame, new, found, bounds)
    made += [*times(frame, found), *answers(frame, found), *over_time(frame, new)]
    if first:
        made += [*stretches(frame), *phases(frame)]
    return made, list(found), unreached


def _never(tested: Tested, plan: Plan, seen: set[object]) -> Iterator[Unreached]:
    """The clauses that bear on no request of any frame that is allowed, of what a rule permits."""
    policy = tested.lowered.policy
    for skill, contract in enumerate(policy.contracts):
        rules = [rule for rule in policy.rules if skill in (rule.skills or (skill,))]
        asked = not plan.skills or contract.name in plan.skills
        if not asked or all(rule.kind != RuleKind.PERMIT for rule in rules):
            continue
        for rule in rules:
            role = RuleKind(rule.kind).name.lower()
            itself = rule.target is not None and rule.target.skill == skill
            if rule.when is not None and not itself and (skill, role, rule) not in seen:
                yield Unreached(contract.name, role, " ".join(rule.text.split()), "")
        for role, clause in clauses_of(contract):
            if (skill, role, clause) not in seen:
                yield Unreached(contract.name, role, " ".join(clause.text.split()), "")


def _titled(blocks: Iterable[Block]) -> list[Block]:
    """The same, each with a title of its own."""
    count: dict[str, int] = {}
    named: list[Block] = []
    for each in blocks:
        title = each.title
        count[title] = count.get(title, 0) + 1
        if count[title] > 1:
            each.title = f"{title} ({count[title]})"
        named.append(each)
    return named
