"""The vehicle and its signals."""

from collections.abc import Iterator
from itertools import pairwise

from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.model.flat.limits import DAY, FULL, MAX_DURATION, MAX_SLOTS, MAX_SPEED, MAX_STALE, MAX_VALUE
from rtshcua.model.flat.policy import Policy, Vehicle
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, POSITION, SignalSource
from rtshcua.model.flat.zone import HIGHEST, MAX_COORDINATE

MAX_POSITION_ERROR = 1 << 20  # mm, about 1 km
MAX_REACTION = 60_000_000  # us


def signals(policy: Policy) -> Iterator[str]:
    """What is wrong with a policy's signals: every slot has exactly one owner."""
    yield from within("number of slots", policy.slots, 0, MAX_SLOTS)
    owned: set[int] = set()
    for signal in policy.signals:
        where = f"signal `{signal.name}`"
        yield from at(where, within("kind", signal.kind, NUMBER, POSITION))
        yield from at(where, within("staleness", signal.stale_us, 1, MAX_STALE))
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
    yield from within("numerator", source.numerator, 1, MAX_VALUE)
    yield from within("denominator", source.denominator, 1, MAX_VALUE)


def vehicle(policy: Policy) -> Iterator[str]:
    """What is wrong with a policy's vehicle."""
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
            yield f"vehicle: slot {slot} is no {name}"


def _without(policy: Policy) -> Iterator[str]:
    """The sensors that it lacks are named in order, and nothing reads them; without any, no clause is left out."""
    names = policy.vehicle.without
    if any(one >= other for one, other in pairwise(names)):
        yield "the signals that it is without are not ascending"
    for signal in policy.signals:
        if signal.name in names:
            yield f"it is without the signal `{signal.name}`, which the policy reads"
    for clause in policy.left_out:
        if not names:
            yield f"`{clause.text}` is left out, and it is without no signal"
        yield from index("skill", clause.skill, len(policy.contracts))
        if clause.part not in ("require", "assume", "maintain"):
            yield f"`{clause.text}` is left out of `{clause.part}`, which no contract has"


def _numbers(vehicle: Vehicle) -> Iterator[str]:
    yield from within("home distance", vehicle.home_within, 0, MAX_COORDINATE)
    yield from within("speed", vehicle.speed, 1, MAX_SPEED)
    yield from within("climb", vehicle.climb, 1, MAX_SPEED)
    yield from within("position error", vehicle.position_error, 0, MAX_POSITION_ERROR)
    yield from within("endurance", vehicle.endurance_us, 1, MAX_DURATION)
    yield from within("reserve", vehicle.reserve, 0, FULL)
    yield from within("return altitude", vehicle.return_altitude, 0, HIGHEST)
    yield from within("offset from UTC", vehicle.utc_offset_us, -DAY, DAY)
    yield from within("braking", vehicle.braking, 0, MAX_SPEED)
    yield from within("reaction", vehicle.reaction_us, 0, MAX_REACTION)
    if vehicle.braking and -1 in (vehicle.north, vehicle.east, vehicle.down):
        yield "brakes, and has no signal of its velocity"
