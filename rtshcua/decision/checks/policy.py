"""Checks of a whole policy: its vehicle and signals, monitors, rules and airspace."""

from collections.abc import Iterator
from itertools import pairwise

from rtshcua.decision.checks.contracts import chain, clause, contract, link
from rtshcua.decision.checks.emission_numbers import servos
from rtshcua.decision.checks.indexes import ascending, at, index, within
from rtshcua.decision.checks.zones import zones
from rtshcua.decision.tree import CodeScope, scope_of
from rtshcua.model.flat import limits
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import (
    AfterSilence,
    Airspace,
    Monitor,
    MonitorKind,
    Policy,
    Rule,
    RuleKind,
    Speeds,
    VehicleLimits,
    WithoutEvidence,
)
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, POSITION, SignalSource
from rtshcua.model.flat.zone import HIGHEST, MAX_COORDINATE

MAX_POSITION_ERROR = 1 << 20  # mm, about 1 km
MAX_REACTION = 60_000_000  # us


def signals(policy: Policy) -> Iterator[str]:
    """Yield the problems of a policy's signals: every slot must have exactly one owner."""
    yield from within("number of slots", policy.slots, 0, limits.MAX_SLOTS)
    owned: set[int] = set()
    for signal in policy.signals:
        where = f"signal `{signal.name}`"
        yield from at(where, within("kind", signal.kind, NUMBER, POSITION))
        yield from at(where, within("staleness", signal.stale_us, 1, limits.MAX_STALE))
        for source in signal.sources:
            yield from at(where, _source(source, signal.kind))
        for slot in (signal.slot, signal.slot + 1) if signal.kind == POSITION else (signal.slot,):
            if not 0 <= slot < policy.slots or slot in owned:
                yield f"{where}: slot {slot} does not exist or is owned twice"
            owned.add(slot)
    if len(owned) != policy.slots:
        yield "a slot has no signal"


def _source(source: SignalSource, kind: int) -> Iterator[str]:
    fields = {NUMBER: (1, 2), ENUMERATION: (1, 1), POSITION: (2, 2)}[kind]
    yield from within("number of fields", len(source.fields), *fields)
    yield from within("numerator", source.numerator, 1, limits.MAX_VALUE)
    yield from within("denominator", source.denominator, 1, limits.MAX_VALUE)


def vehicle(policy: Policy) -> Iterator[str]:
    """Yield the problems of a policy's vehicle."""
    yield from at("vehicle", _numbers(policy.vehicle))
    yield from at("vehicle", _without(policy))
    kinds = {signal.slot: signal.kind for signal in policy.signals}
    for name, slot, kind in (
        ("position", policy.vehicle.position, POSITION),
        ("height", policy.vehicle.height, NUMBER),
        ("battery", policy.vehicle.battery, NUMBER),
        ("velocity north", policy.vehicle.north, NUMBER),
        ("velocity east", policy.vehicle.east, NUMBER),
        ("velocity down", policy.vehicle.down, NUMBER),
    ):
        if slot != -1 and kinds.get(slot) != kind:
            yield f"vehicle: slot {slot} is not a {name}"


def _without(policy: Policy) -> Iterator[str]:
    """Yield the problems of `without`: its signals are in order, nothing reads them, and clauses are left out only
    because of them.
    """
    names = policy.vehicle.without
    if any(one >= other for one, other in pairwise(names)):
        yield "the signals in `without` are not ascending"
    for signal in policy.signals:
        if signal.name in names:
            yield f"the policy reads `{signal.name}`, which the vehicle is without"
    for left_out in policy.left_out:
        if not names:
            yield f"`{left_out.text}` is left out, but the vehicle is without no signal"
        if left_out.part in ("require", "assume", "maintain"):
            yield from index("skill", left_out.skill, len(policy.contracts))
        elif left_out.part not in ("forbid", "confirm", "degrade") or left_out.skill != -1:
            yield f"`{left_out.text}` is left out of `{left_out.part}`, which is not a part of a contract"


def _numbers(vehicle: VehicleLimits) -> Iterator[str]:
    yield from within("home distance", vehicle.home_within, 0, MAX_COORDINATE)
    yield from within("speed", vehicle.speed, 1, limits.MAX_SPEED)
    yield from within("climb", vehicle.climb, 1, limits.MAX_SPEED)
    yield from within("position error", vehicle.position_error, 0, MAX_POSITION_ERROR)
    yield from within("endurance", vehicle.endurance_us, 1, limits.MAX_DURATION)
    yield from within("reserve", vehicle.reserve, 0, limits.FULL)
    yield from within("return altitude", vehicle.return_altitude, 0, HIGHEST)
    yield from within("offset from UTC", vehicle.utc_offset_us, -limits.DAY, limits.DAY)
    yield from within("braking", vehicle.braking, 0, limits.MAX_SPEED)
    yield from within("reaction", vehicle.reaction_us, 0, MAX_REACTION)
    yield from _offsets(vehicle)
    yield from servos(vehicle)
    if vehicle.braking and -1 in (vehicle.north, vehicle.east, vehicle.down):
        yield "braking is declared without a velocity signal"
    if vehicle.speeds is not None:
        yield from _speeds(vehicle.speeds)


def _speeds(speeds: Speeds) -> Iterator[str]:
    for name in ("cruise", "climb", "descent", "landing", "homeward", "acceleration", "air"):
        yield from within(f"{name} of its speeds", getattr(speeds, name), 1, limits.MAX_SPEED)
    yield from within("wind of its speeds", speeds.wind, 0, limits.MAX_SPEED)
    yield from within("height of its landing speed", speeds.landing_below, 0, HIGHEST)
    yield from within("time of flight", speeds.flight_us, 1, limits.MAX_DURATION)


def _offsets(vehicle: VehicleLimits) -> Iterator[str]:
    """Yield the problems of a time zone's offsets. Local time is known from the first transition to the last."""
    if len({bool(vehicle.time_zone), bool(vehicle.time_zone_data), bool(vehicle.offsets)}) > 1:
        yield "a time zone needs a name, a data version, and offsets"
    moments, offsets = vehicle.offsets[::2], vehicle.offsets[1::2]
    if vehicle.offsets and (vehicle.utc_offset_us or len(moments) != len(offsets) + 1 or not offsets):
        yield "local-time offsets must alternate with the moments between them"
    yield from within("number of offsets", len(offsets), 0, limits.MAX_OFFSETS)
    for one in offsets:
        yield from within("offset from UTC", one, -limits.DAY, limits.DAY)
    for moment in moments:
        yield from within("moment", moment, 0, limits.MAX_VALUE)
    if any(one >= other for one, other in pairwise(moments)):
        yield "the moments of the local-time changes are not ascending"


def monitors(policy: Policy, scope: CodeScope) -> Iterator[str]:
    """Yield the problems of a policy's monitors. Each reads only earlier ones, so that one pass evaluates all of
    them.
    """
    yield from within("number of monitors", len(policy.monitors), 0, limits.MAX_MONITORS)
    for number, one in enumerate(policy.monitors):
        yield from at(f"monitor {number}", _monitor(one, scope.inside_monitor(number)))


def _monitor(monitor: Monitor, scope: CodeScope) -> Iterator[str]:
    yield from within("kind", monitor.kind, MonitorKind.FOR_LAST, MonitorKind.FALLING)
    low, high = (1, limits.MAX_WINDOW) if monitor.kind in (MonitorKind.FOR_LAST, MonitorKind.WITHIN_LAST) else (0, 0)
    yield from within("window", monitor.window_us, low, high)
    yield from clause(monitor.when, scope)


def phases(policy: Policy) -> Iterator[str]:
    """Yield the problems of the names of mission phases."""
    yield from within("number of phase names", len(policy.phases), 0, limits.MAX_PHASE_NAMES)
    if len(set(policy.phases)) != len(policy.phases):
        yield "two phases have the same name"


def rules(policy: Policy, scope: CodeScope) -> Iterator[str]:
    """Yield the problems of a policy's rules. The contracts must be well-formed."""
    yield from within("number of rules", len(policy.rules), 0, limits.MAX_RULES)
    keys = sum((len(rule.skills) or 1) * (len(rule.roles) or 1) for rule in policy.rules)
    yield from within("number of skills times roles in the rules", keys, 0, limits.MAX_RULE_KEYS)
    for number, one in enumerate(policy.rules):
        yield from at(f"rule {number}", rule(one, policy, scope))


def rule(rule: Rule, policy: Policy, scope: CodeScope) -> Iterator[str]:
    """Yield the problems of a rule."""
    yield from within("kind", rule.kind, RuleKind.FORBID, RuleKind.DEGRADE)
    yield from ascending("skill", rule.skills, len(policy.contracts))
    yield from ascending("role", rule.roles, len(policy.roles))
    yield from ascending("source", rule.sources, len(SourceKind))
    if rule.when is not None:
        yield from at("when", clause(rule.when, scope.about(*(policy.contracts[skill] for skill in rule.skills))))
    if rule.second != -1 and rule.kind != RuleKind.CONFIRM:
        yield "only a `confirm` rule can require a second person"
    if rule.kind == RuleKind.CONFIRM:
        yield from index("role", rule.approver, len(policy.roles))
        yield from within("role of the second person", rule.second, -1, len(policy.roles) - 1)
        yield from within("within", rule.within_us, 1, limits.MAX_DURATION)
    if rule.kind == RuleKind.DEGRADE:
        if rule.target is None:
            yield "a `degrade` rule needs a target"
        else:
            yield from at("target", link(rule.target, policy))


def airspace(airspace: Airspace | None, policy: Policy) -> Iterator[str]:
    """Yield the problems of the airspace."""
    if airspace is not None:
        for zone in (*airspace.inside, *airspace.outside):
            yield from index("zone", zone, len(policy.zones))


def problems(policy: Policy) -> Iterator[str]:
    """Yield the problems of a policy. Later checks rely on earlier ones, so the caller must stop at the first
    problem.
    """
    yield from signals(policy)
    yield from vehicle(policy)
    yield from zones(policy)
    yield from within("number of roles", len(policy.roles), 0, limits.MAX_ROLES)
    yield from within("number of sets", len(policy.sets), 0, limits.MAX_SETS)
    for number, members in enumerate(policy.sets):
        yield from at(f"set {number}", within("number of members", len(members), 0, limits.MAX_MEMBERS))
    yield from within("number of contracts", len(policy.contracts), 0, limits.MAX_CONTRACTS)
    yield from phases(policy)
    scope = scope_of(policy)
    yield from monitors(policy, scope)
    for one in policy.contracts:
        yield from at(f"skill `{one.name}`", contract(one, policy, scope))
    for one in policy.contracts:
        yield from at(f"skill `{one.name}`: fallback", chain(one.fallback, policy))
    yield from at("contingency", chain(policy.contingency, policy))
    yield from rules(policy, scope)
    yield from at("airspace", airspace(policy.airspace, policy))
    yield from within("without evidence", policy.without_evidence, WithoutEvidence.LAND, WithoutEvidence.REFUSE)
    yield from within("silence", policy.silence_us, 1, limits.MAX_SILENCE)
    yield from within("after silence", policy.after_silence, AfterSilence.CONTINUE, AfterSilence.CONTINGENCY)
