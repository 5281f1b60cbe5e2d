"""The autopilot's own cylinder around home, from its parameters, and whether a mission stays inside.

On ArduCopter FENCE_ENABLE arms every type in FENCE_TYPE, so switching on the fence with the airspace arms a circle
(FENCE_RADIUS) and a ceiling (FENCE_ALT_MAX) too. A target beyond them is silently ignored
(`AC_Fence::check_destination_within_fence`), and a return stays under FENCE_ALT_MAX - FENCE_MARGIN
(`ModeRTL::compute_return_target`). PX4 has GF_MAX_HOR_DIST and GF_MAX_VER_DIST, which are off at 0.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Final, NamedTuple

from rtshcua.mavlink.quantise import hypot_mm
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, Zone

_METRE: Final = 1_000
#: bits of FENCE_TYPE
CEILING_BIT, CIRCLE_BIT, FLOOR_BIT = 1, 2, 8


class OwnFence(NamedTuple):
    """The names of an autopilot's parameters. `types` is the set of bits of the armed kinds, `switches` say whether the
    fence is on; without them a bound of 0 is off. `margin` is its own margin.
    """

    circle: str
    ceiling: str
    floor: str | None = None
    margin: str | None = None
    types: str | None = None
    switches: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters that have to be read."""
        extra = (self.floor, self.margin, self.types, *self.switches)
        return (self.circle, self.ceiling, *(name for name in extra if name is not None))


class FlightReach(NamedTuple):
    """The greatest distance from home, the greatest and the least height of a flight, in mm; None where unknown."""

    farthest: int = 0
    highest: int = 0
    lowest: int | None = None


class Narrow(NamedTuple):
    """A bound that is too narrow: its parameter, its value and the required value in its unit."""

    parameter: str
    value: float
    needed: int
    about: str
    bit: int


def reach_of(steps: Sequence[Invocation], policy: Policy, home: tuple[int, int]) -> FlightReach:
    """The reach of a mission's targets, including its returns; `home` is the vehicle's position in local mm."""
    targets = [each.plan for each in steps]
    far = [
        hypot_mm(x - home[0], y - home[1])
        for plan in targets
        for x, y in zip(plan.path[::2], plan.path[1::2], strict=True)
    ]
    aloft = [plan for plan in targets if plan.kind in (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)]
    high, low = [plan.altitude for plan in aloft], [plan.lowest for plan in aloft]
    returns = [policy.vehicle.return_altitude] if steps else []
    return FlightReach(max(far, default=0), max((*high, *returns), default=0), min(low, default=None))


def airspace_reach(policy: Policy) -> FlightReach:
    """The reach of an airspace: that of the narrowest zone to stay in."""
    inside = [] if policy.airspace is None else [policy.zones[number] for number in policy.airspace.inside]
    far = min((_extent(zone) for zone in inside), default=0)
    high = min((zone.ceiling for zone in inside if zone.ceiling < HIGHEST), default=0)
    return FlightReach(far, high)


def _extent(zone: Zone) -> int:
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        return hypot_mm(x, y) + int(square**0.5)
    data = zone.data[1 + zone.data[0] :] if zone.shape == AREA else zone.data
    return max((hypot_mm(x, y) for x, y in zip(data[::2], data[1::2], strict=True)), default=0)


def unknown(own: OwnFence, values: Mapping[str, float], *, armed: bool) -> str | None:
    """The first parameter that must be known and is not; `armed`: a flight of ours switches the fence on."""
    if own.types is not None and own.types not in values:
        return own.types
    return next((name for name, _, _ in _bounds(own, values, armed=armed) if name not in values), None)


def narrower(
    own: OwnFence, values: Mapping[str, float], reach: FlightReach, room: int, *, armed: bool
) -> Iterator[Narrow]:
    """The armed bounds that leave less than `room` (mm) around the reach."""
    room = max(room, _mm(values.get(own.margin, 0.0)) if own.margin is not None else 0)
    for name, about, bit in _bounds(own, values, armed=armed):
        if name not in values:
            continue
        value = values[name]
        if bit == FLOOR_BIT:
            if reach.lowest is not None and _mm(value) > reach.lowest - room:
                yield Narrow(name, value, (reach.lowest - room) // _METRE, about, bit)
            continue
        needed = reach.farthest if bit == CIRCLE_BIT else reach.highest
        if needed and _mm(value) < needed + room:
            yield Narrow(name, value, -(-(needed + room) // _METRE), about, bit)


def _bounds(own: OwnFence, values: Mapping[str, float], *, armed: bool) -> Iterator[tuple[str, str, int]]:
    """The bounds in force, as parameter, value and bit."""
    if own.switches and not armed and not any(values.get(name, 0.0) >= 1 for name in own.switches):
        return
    types = None if own.types is None else _bits(values.get(own.types, 0.0))
    every = ((own.circle, "from home", CIRCLE_BIT), (own.ceiling, "above home", CEILING_BIT))
    floor = () if own.floor is None else ((own.floor, "above home", FLOOR_BIT),)
    for name, about, bit in (*every, *floor):
        if types is None:
            if values.get(name, 0.0) > 0:
                yield name, about, bit
        elif types & bit:
            yield name, about, bit


def _bits(value: float) -> int:
    return int(value) if isfinite(value) else 0


def _mm(metres: float) -> int:
    return round(metres * _METRE) if isfinite(metres) else 0
