"""Whether a condition or a zone of a policy restricts anything, over every situation in which a step can be decided.

In such a situation the vehicle is within its reach, the battery is at or above the reserve, and each argument and
reading is in its range. A condition that fails in no such situation restricts nothing. Missing readings are not
considered: a condition that is unknown refuses a step by the rules of the language, not by the policy.

The reach is the distance that the vehicle flies from home at its highest speed on a full battery, and the height that
it climbs in that time, plus the position error of home (`within`) and one per cent. A zone that contains the reach
restricts nothing, and neither does a zone that the reach does not touch. Every estimate errs towards a longer reach,
and so towards "restricted". Lengths are in mm.
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
#: a hundredth: the error of the local plane is 1 part in 1,000 within 5 km, and below 1 % within any vehicle's reach
_MARGIN = 100


class VehicleReach(NamedTuple):
    """All places less than `across` from home, and from `down` to `up` above it."""

    across: int
    up: int
    down: int

    def belongs_to(self, zone: Zone) -> bool:
        """Whether it is proved that a zone contains the whole reach at all times."""
        if timed(zone) or zone.floor > self.down or zone.ceiling < self.up:
            return False
        if zone.shape == CIRCLE:
            x, y, squared = zone.data
            return isqrt(squared) - isqrt(x * x + y * y) - 1 > self.across
        plan = Region(polygonal(rings_of(zone)), LOWEST, HIGHEST)
        return lies_within(Region(RoundArea((0, 0), self.across), LOWEST, HIGHEST), plan)

    def misses(self, zone: Zone) -> bool:
        """Whether it is proved that a zone contains no part of the reach."""
        return zone.floor > self.up or zone.ceiling < self.down or _distance(zone) > self.across


def reach_of(vehicle: VehicleLimits) -> VehicleReach:
    """Return the reach of a vehicle. It may descend faster than it climbs, but not farther than it flies."""

    def flown(speed: int) -> int:
        way = -(-speed * vehicle.endurance_us // _SECOND) + vehicle.home_within + vehicle.position_error
        return way + way // _MARGIN

    return VehicleReach(flown(vehicle.speed), flown(vehicle.climb), -flown(max(vehicle.speed, vehicle.climb)))


def is_open(policy: Policy) -> bool:
    """Whether a policy has no airspace, or one that does not restrict where its vehicle can fly."""
    reach = reach_of(policy.vehicle)
    without = () if policy.airspace is None else policy.airspace.outside
    return is_unbounded(policy) and all(reach.misses(policy.zones[number]) for number in without)


def is_unbounded(policy: Policy) -> bool:
    """Whether a policy has no `airspace inside` zone that restricts where its vehicle can fly."""
    reach = reach_of(policy.vehicle)
    within = () if policy.airspace is None else policy.airspace.inside
    return all(reach.belongs_to(policy.zones[number]) for number in within)


def region_of(zone: Zone) -> Region:
    """Return a zone as a region, without its times. The radius of a circle is rounded up."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return Region(RoundArea((x, y), isqrt(squared) + 1), zone.floor, zone.ceiling)
    return Region(polygonal(rings_of(zone)), zone.floor, zone.ceiling)


def _distance(zone: Zone) -> int:
    """Return a lower bound of the distance from home to a zone; 0 if home may lie in the zone."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return max(0, isqrt(x * x + y * y) - isqrt(squared) - 1)
    corners = [corner for ring in rings_of(zone) for corner in ring]
    xs, ys = [x for x, _ in corners], [y for _, y in corners]
    # the bounding box is never farther than the zone
    dx, dy = max(min(xs), -max(xs), 0), max(min(ys), -max(ys), 0)
    return isqrt(dx * dx + dy * dy)


_MINUTE = 60_000_000  # us


class ConditionEffects:
    """Analysis of which rules of a lowered policy ever affect a skill."""

    def __init__(self, ground: ProofContext) -> None:
        self.rules = Ruleset(ground)
        self._ground = ground
        self._spaces: dict[int, SituationSpace] = {}

    def always_permit(self, numbers: Sequence[int], skill: int) -> bool:
        """Whether it is proved that in each step of a skill the condition of one of these permits holds."""
        return self._never([(number, FALSE | UNKNOWN) for number in numbers], skill)

    def acts(self, number: int, skill: int) -> bool:
        """Whether a rule other than a permit may act. A `degrade` is monitored in flight, so any state counts."""
        if self.rules.rule(number).kind == RuleKind.DEGRADE:
            return not isinstance(self.rules.ask([(number, TRUE)], skill), No)
        return not self._never([(number, TRUE | UNKNOWN)], skill)

    def is_vacuous(self, rule: RuleDecl, skill: str) -> bool | None:
        """Whether the condition of a rule as written has no effect on a skill; None if the policy lacks the rule.

        The condition of a permit has no effect if it never fails, that of any other rule if it never holds.
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
        """Whether a flat rule about a skill was written in the policy, and not derived by a delegation."""
        origin = self._ground.lowered.rules[number].origin
        return skill in self.rules.skills(number) and not any(isinstance(each, Delegation) for each in origin)

    def _never(self, wanted: Sequence[tuple[int, Truth]], skill: int) -> bool:
        """Whether it is proved that no step of a skill gives the conditions of flat rules these truth values."""

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
    """Return a superset of the situations in which a step may be admitted and every sensor reports."""
    vehicle, reach = policy.vehicle, reach_of(policy.vehicle)
    arguments, slots = list(space.arguments), list(space.slots)
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            _within_reach(arguments, parameter.cell, reach)
    if vehicle.position >= 0:
        _within_reach(slots, vehicle.position, reach)
    for signal in policy.signals:
        # all sources of a signal measure one quantity: if one is the length of a vector, no value is negative
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
    """Yield the times, without the last minute of each local day, for which the local time is known."""
    stretches = ((low, after - 1, offset) for span in utc for low, after, offset in local.stretches(*span))
    for low, high, offset in stretches:
        for day in range((low + offset) // DAY, (high + offset) // DAY + 1):
            first, last = max(low, day * DAY - offset), min(high, (day + 1) * DAY - offset - _MINUTE - 1)
            if first <= last:
                yield first, last


class VacuousRules:
    """Find the rules, as written in a program, that have no effect in any policy that has them."""

    def __init__(self, grounds: Sequence[ProofContext]) -> None:
        self._every = [ConditionEffects(ground) for ground in grounds]

    def __call__(self, rule: RuleDecl, skill: str) -> bool:
        """Whether it is proved that the condition of a rule has no effect on a skill."""
        results = [each.is_vacuous(rule, skill) for each in self._every]
        known = [result for result in results if result is not None]
        return bool(known) and all(known)
