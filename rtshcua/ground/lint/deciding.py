"""Whether a rule's condition decides anything: asked of the analysis, over all that the vehicle can be met in.

A step is admitted or refused while the vehicle is within its reach, with at least its reserve of charge, in the ranges
of the skill's parameters and of what its sensors can report. What fails in no such situation restricts nothing,
whatever it looks like. A window that leaves out the last minute of the day alone counts as the whole day: who writes
`00:00 .. 23:59` means that. A missing reading makes a condition unknown and so refuses even here: that is the
language's doing, and no policy's.
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision.times import LocalTime
from rtshcua.decision.values import FALSE, MAYBE, TRUE, UNKNOWN, Truth, Value
from rtshcua.decision.values import Span as Between
from rtshcua.ground.analysis.box import clipped, present
from rtshcua.ground.analysis.solve import Goal, No
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.lint.reach import Reach, reach_of
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.contract import PLACE, Contract
from rtshcua.model.flat.limits import DAY, MAX_VALUE
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import NUMBER
from rtshcua.model.ir.policies import Delegation, Rule

_MINUTE = 60_000_000  # us


class Deciding:
    """The rules of a lowered policy, each with whether it ever makes a difference to a skill."""

    def __init__(self, ground: ProofContext) -> None:
        self.rules = Ruleset(ground)
        self._ground = ground
        self._spaces: dict[int, Space] = {}

    def always_permit(self, numbers: Sequence[int], skill: int) -> bool:
        """Whether it is proved that in each step of a skill one of some permits has its condition met."""
        return self._never([(number, FALSE | UNKNOWN) for number in numbers], skill)

    def acts(self, number: int, skill: int) -> bool:
        """Whether a rule that is no permit may act. A `degrade` is watched in flight, so there any state counts."""
        if self.rules.rule(number).kind == RuleKind.DEGRADE:
            return not isinstance(self.rules.ask([(number, TRUE)], skill), No)
        return not self._never([(number, TRUE | UNKNOWN)], skill)

    def is_vacuous(self, rule: Rule, skill: str) -> bool | None:
        """Whether the condition of a rule as it is written makes no difference to a skill; None where the policy has no
        such rule. A permit's never fails, that of any other rule is never met.
        """
        group = self.rules.at.get(rule.span)
        number = self._ground.lowered.skills.get(skill)
        about = [] if group is None or number is None else [each for each in group.rules if self._is_own(each, number)]
        if number is None or not about:
            return None
        if rule.kind == "permit":
            return all(self.always_permit([each], number) for each in about)
        return not any(self.acts(each, number) for each in about)

    def _is_own(self, number: int, skill: int) -> bool:
        """Whether a flat rule about a skill is as it was written, and not what a delegation narrowed."""
        origin = self._ground.lowered.rules[number].origin
        return skill in self.rules.skills(number) and not any(isinstance(each, Delegation) for each in origin)

    def _never(self, wanted: Sequence[tuple[int, Truth]], skill: int) -> bool:
        """Whether it is proved that the conditions of flat rules have such truths in no step of a skill."""

        def goals() -> list[Goal]:
            return [(self.rules.node(number), truth) for number, truth in wanted]

        key = ("within reach", skill, *((self.rules.code(number), truth) for number, truth in wanted))
        return isinstance(self._ground.questions.ask(key, goals, self._space(skill)), No)

    def _space(self, skill: int) -> Space:
        found = self._spaces.get(skill)
        if found is None:
            policy = self._ground.prepared.policy
            found = self._spaces[skill] = _narrowed(self.rules.space(skill), policy, policy.contracts[skill])
        return found


def _narrowed(space: Space, policy: Policy, contract: Contract) -> Space:
    """The situations of a space in which a step may be admitted, and perhaps more; every sensor reports."""
    vehicle, reach = policy.vehicle, reach_of(policy.vehicle)
    arguments, slots = list(space.arguments), list(space.slots)
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            _within(arguments, parameter.cell, reach)
    if vehicle.position >= 0:
        _within(slots, vehicle.position, reach)
    for signal in policy.signals:
        # two ways to read one quantity: where one of them is the length of a vector, the other is no less than nothing
        if signal.kind == NUMBER and any(len(source.fields) > 1 for source in signal.sources):
            _clip(slots, signal.slot, 0, MAX_VALUE)
    if vehicle.height >= 0:
        _clip(slots, vehicle.height, reach.down, reach.up)
    if vehicle.battery >= 0:
        _clip(slots, vehicle.battery, max(1, vehicle.reserve), MAX_VALUE)
    slots = [present(value) if value[2] == MAYBE else value for value in slots]
    utc = tuple(_days(space.utc, space.tables.local)) or space.utc
    return space._replace(arguments=tuple(arguments), slots=tuple(slots), utc=utc)


def _within(values: list[Value], at: int, reach: Reach) -> None:
    _clip(values, at, -reach.across, reach.across)
    _clip(values, at + 1, -reach.across, reach.across)


def _clip(values: list[Value], at: int, low: int, high: int) -> None:
    values[at] = clipped(values[at], low, high) or values[at]


def _days(utc: Sequence[Between], local: LocalTime) -> Iterator[Between]:
    """Moments without the last minute of each local day, where the local time is known."""
    stretches = ((low, after - 1, offset) for span in utc for low, after, offset in local.stretches(*span))
    for low, high, offset in stretches:
        for day in range((low + offset) // DAY, (high + offset) // DAY + 1):
            first, last = max(low, day * DAY - offset), min(high, (day + 1) * DAY - offset - _MINUTE - 1)
            if first <= last:
                yield first, last


class Vacuous:
    """Which rules of a program, as they are written, make no difference, in every policy that has them."""

    def __init__(self, grounds: Sequence[ProofContext]) -> None:
        self._every = [Deciding(ground) for ground in grounds]

    def __call__(self, rule: Rule, skill: str) -> bool:
        """Whether the condition of a rule makes no difference to a skill; False where it cannot be told."""
        answers = (each.is_vacuous(rule, skill) for each in self._every)
        told = [answer for answer in answers if answer is not None]
        return bool(told) and all(told)
