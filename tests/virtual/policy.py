"""A policy by hand with the signals and the vehicle that a driver needs, without rules."""

from math import cos, radians

from rtshcua.model.flat.policy import Policy, VehicleLimits
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, POSITION, Signal, SignalSource
from rtshcua.model.flat.zone import SHIFT, Projection, unproject
from rtshcua.simulation.config import HOME

_EAST = cos(radians(HOME.latitude / 1e7))
PROJECTION = Projection(
    HOME.latitude, HOME.longitude, round(11.1319 * _EAST * (1 << SHIFT)), round(11.1319 * (1 << SHIFT))
)

BATTERY, HEIGHT, FIX, POSITION_X, WIND, LINK = 0, 1, 2, 3, 5, 6

SIGNALS = (
    Signal("battery", BATTERY, NUMBER, "ratio", 5_000_000, (), (
        SignalSource("BATTERY_STATUS", ("battery_remaining",), 100, 1, (-1,)),
    )),
    Signal("height", HEIGHT, NUMBER, "altitude", 500_000, (), (
        SignalSource("GLOBAL_POSITION_INT", ("relative_alt",), 1, 1, ()),
    )),
    Signal("gps.fix", FIX, ENUMERATION, "GPS_FIX_TYPE", 2_000_000, ((3, "fix_3d"),), (
        SignalSource("GPS_RAW_INT", ("fix_type",), 1, 1, ()),
    )),
    Signal("position", POSITION_X, POSITION, "position", 500_000, (), (
        SignalSource("GLOBAL_POSITION_INT", ("lat", "lon"), 1, 1, ()),
    )),
    Signal("wind.speed", WIND, NUMBER, "speed", 10_000_000, (), (
        SignalSource("WIND_COV", ("wind_x", "wind_y"), 1_000, 1, ()),
        SignalSource("WIND", ("speed",), 1_000, 1, ()),
    )),
    Signal("link.quality", LINK, NUMBER, "ratio", 5_000_000, (), (
        SignalSource("RADIO_STATUS", ("txbuf",), 100, 1, (255,)),
    )),
)  # fmt: skip

VEHICLE = VehicleLimits(
    "quad", "quad-07", 50_000, 12_000, 3_000, 3_000, 18 * 60_000_000, 2_000, 0, POSITION_X, HEIGHT, BATTERY
)

POLICY = Policy(
    name="driver", version=1, vehicle=VEHICLE, projection=PROJECTION, roles=("operator",), signals=SIGNALS, slots=7,
    zones=(), declared=0, tables=(), sets=(), contracts=(), rules=(), airspace=None, contingency=(), sources=(),
    source_digests=(),
)  # fmt: skip


def geo(*points: tuple[int, int]) -> tuple[int, ...]:
    """Local mm (east, north) as latitude, longitude, ..."""
    return tuple(part for x, y in points for part in unproject(PROJECTION, x, y))
