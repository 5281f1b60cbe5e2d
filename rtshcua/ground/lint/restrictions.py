"""Whether a condition or a zone of a policy restricts anything, over every situation in which a step can be decided.

A step is decided while the vehicle is within its reach, has at least its battery reserve, and each argument and reading
is in its range. A condition that fails in no such situation restricts nothing. A missing reading makes a condition
unknown, and so refuses even here: that is the language's rule, not the policy's.

The reach is how far the vehicle flies from home at its highest speed on a full battery, and how high it climbs in that
time, plus the distance by which home may be off (`within`) and one per cent. A zone that contains all of the reach
restricts nothing, nor does a zone that has nothing in common with it. Every estimate here errs towards a longer reach,
so towards "restricted". Lengths are in mm.
"""

from collections.abc import Iterator, Sequence
from math import isqrt
from typing import NamedTuple

from rtshcua.decision.times import LocalTime, timed
from rtshcua.decision.values import FALSE, MAYBE, TRUE, UNKNOWN, Truth, Value
from rtshcua.decision.values import Span as Between
from rtshcua.ground.analysis.box import clipped, present
from rtshcua.ground.analysis.plane import rings_of
from rtshcua.ground.analysis.solve import Goal, No
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.geometry.shapes import Region, RoundArea, lies_within, polygonal
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.contract import PLACE, Contract
from rtshcua.model.flat.limits import DAY, MAX_VALUE
from rtshcua.model.flat.policy import Policy, RuleKind, VehicleLimits
from rtshcua.model.flat.signal import NUMBER
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.ir.policies import Delegation, RuleDecl

_SECOND = 1_000_000
#: the local plane is true to 1 part in 1,000 within 5 km; a per cent is more than it errs by within what flies
_MARGIN = 100


class VehicleReach(NamedTuple):
    """All places less than `across` from home, and from `down` to `up` above it."""

    across: int
    up: int
    down: int

    def belongs_to(self, zone: Zone) -> bool:
        """Whether it is proved that a zone holds all of it, at all times."""
        if timed(zone) or zone.floor > self.down or zone.ceiling < self.up:
            return False
        if zone.shape == CIRCLE:
            x, y, squared = zone.data
            return isqrt(squared) - isqrt(x * x + y * y) - 1 > self.across
        plan = Region(polygonal(rings_of(zone)), LOWEST, HIGHEST)
        return lies_within(Region(RoundArea((0, 0), self.across), LOWEST, HIGHEST), plan)

    def misses(self, zone: Zone) -> bool:
        """Whether it is proved that a zone has nothing of it."""
        return zone.floor > self.up or zone.ceiling < self.down or _distance(zone) > self.across


def reach_of(vehicle: VehicleLimits) -> VehicleReach:
    """Where a vehicle may come. Down it may come faster than it climbs, but not further than it flies."""

    def flown(speed: int) -> int:
        way = -(-speed * vehicle.endurance_us // _SECOND) + vehicle.home_within + vehicle.position_error
        return way + way // _MARGIN

    return VehicleReach(flown(vehicle.speed), flown(vehicle.climb), -flown(max(vehicle.speed, vehicle.climb)))


def is_open(policy: Policy) -> bool:
    """Whether nothing in a policy's airspace restricts where its vehicle comes, or it has none."""
    reach = reach_of(policy.vehicle)
    without = () if policy.airspace is None else policy.airspace.outside
    return is_unbounded(policy) and all(reach.misses(policy.zones[number]) for number in without)


def is_unbounded(policy: Policy) -> bool:
    """Whether a policy has no zone to stay inside of that restricts where its vehicle comes."""
    reach = reach_of(policy.vehicle)
    within = () if policy.airspace is None else policy.airspace.inside
    return all(reach.belongs_to(policy.zones[number]) for number in within)


def region_of(zone: Zone) -> Region:
    """A zone as a region of the plane, without its times; a circle is no smaller than it is."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return Region(RoundArea((x, y), isqrt(squared) + 1), zone.floor, zone.ceiling)
    return Region(polygonal(rings_of(zone)), zone.floor, zone.ceiling)


def _distance(zone: Zone) -> int:
    """A distance from home that a zone keeps at least; 0 where home may lie in it."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return max(0, isqrt(x * x + y * y) - isqrt(squared) - 1)
    corners = [corner for ring in rings_of(zone) for corner in ring]
    xs, ys = [x for x, _ in corners], [y for _, y in corners]
    # the box around it is nearer than the zone is, never further
    dx, dy = max(min(xs), -max(xs), 0), max(min(ys), -max(ys), 0)
    return isqrt(dx * dx + dy * dy)


_MINUTE = 60_000_000  # us


class ConditionEffects:
    """The rules of a lowered policy, each with whether it ever makes a difference to a skill."""

    def __init__(self, ground: ProofContext) -> None:
        self.rules = Ruleset(ground)
        self._ground = ground
        self._spaces: dict[int, SituationSpace] = {}

    def always_permit(self, numbers: Sequence[int], skill: int) -> bool:
        """Whether it is proved that in each step of a skill one of some permits has its condition met."""
        return self._never([(number, FALSE | UNKNOWN) for number in numbers], skill)

    def acts(self, number: int, skill: int) -> bool:
        """Whether a rule that is no permit may act. A `degrade` is watched in flight, so there any state counts."""
        if self.rules.rule(number).kind == RuleKind.DEGRADE:
            return not isinstance(self.rules.ask([(number, TRUE)], skill), No)
        return not self._never([(number, TRUE | UNKNOWN)], skill)

    def is_vacuous(self, rule: RuleDecl, skill: str) -> bool | None:
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

    def _space(self, skill: int) -> SituationSpace:
        found = self._spaces.get(skill)
        if found is None:
            policy = self._ground.prepared.policy
            found = self._spaces[skill] = _when_admitted(self.rules.space(skill), policy, policy.contracts[skill])
        return found


def _when_admitted(space: SituationSpace, policy: Policy, contract: Contract) -> SituationSpace:
    """The situations of a space in which a step may be admitted, and perhaps more; every sensor reports."""
    vehicle, reach = policy.vehicle, reach_of(policy.vehicle)
    arguments, slots = list(space.arguments), list(space.slots)
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            _within_reach(arguments, parameter.cell, reach)
    if vehicle.position >= 0:
        _within_reach(slots, vehicle.position, reach)
    for signal in policy.signals:
        # two ways to read one quantity: where one of them is the length of a vector, the other is no less than nothing
        if signal.kind == NUMBER and any(len(source.fields) > 1 for source in signal.sources):
            _clip(slots, signal.slot, 0, MAX_VALUE)
    if vehicle.height >= 0:
        _clip(slots, vehicle.height, reach.down, reach.up)
    if vehicle.battery >= 0:
        _clip(slots, vehicle.battery, max(1, vehicle.reserve), MAX_VALUE)
    slots = [present(value) if value[2] == MAYBE else value for value in slots]
    utc = tuple(_without_last_minute(space.utc, space.tables.local)) or space.utc
    return space._replace(arguments=tuple(arguments), slots=tuple(slots), utc=utc)


def _within_reach(values: list[Value], at: int, reach: VehicleReach) -> None:
    _clip(values, at, -reach.across, reach.across)
    _clip(values, at + 1, -reach.across, reach.across)


def _clip(values: list[Value], at: int, low: int, high: int) -> None:
    values[at] = clipped(values[at], low, high) or values[at]


def _without_last_minute(utc: Sequence[Between], local: LocalTime) -> Iterator[Between]:
    """Moments without the last minute of each local day, where the local time is known."""
    stretches = ((low, after - 1, offset) for span in utc for low, after, offset in local.stretches(*span))
    for low, high, offset in stretches:
        for day in range((low + offset) // DAY, (high + offset) // DAY + 1):
            first, last = max(low, day * DAY - offset), min(high, (day + 1) * DAY - offset - _MINUTE - 1)
            if first <= last:
                yield first, last


class VacuousRules:
    """Which rules of a program, as they are written, make no difference, in every policy that has them."""

    def __init__(self, grounds: Sequence[ProofContext]) -> None:
        self._every = [ConditionEffects(ground) for ground in grounds]

    def __call__(self, rule: RuleDecl, skill: str) -> bool:
        """Whether the condition of a rule makes no difference to a skill; False where it cannot be told."""
        answers = (each.is_vacuous(rule, skill) for each in self._every)
        told = [answer for answer in answers if answer is not None]
        return bool(told) and all(told)
