"""The battery model: four cells in series, drained by the power of flight."""

from dataclasses import dataclass
from itertools import pairwise
from math import sqrt

CAPACITY_MAH = 5000
_CELLS = 4
_CELL_MV = ((0.0, 3200), (0.1, 3500), (0.5, 3800), (1.0, 4200))
"""A cell at rest: level and voltage, linear between."""
_SAG_MV = 300
"""Voltage drop of all cells while hovering, from internal resistance."""

REST = 0.002
"""The load while disarmed, relative to hovering."""
IDLE = 0.05
"""The load while the motors turn on the ground."""

FAILED_CELL_SAG = 3.0
"""Factor on the voltage drop of a failed cell under load: its resistance has risen."""

_INDUCED = 0.7
"""The part of hover power that accelerates air downwards; the rest overcomes blade drag."""
_HOVER_AIR = 7.0
"""Airspeed, m/s, at which induced power has fallen by about a third."""
_DRAG_POWER = 1.75e-4
"""Power of the body's drag per cubed airspeed, relative to a hover power of 120 W/kg."""
_CLIMB_POWER = 9.80665 / 120
"""Power of lifting the weight, per m/s of climb."""
_LEAST = 0.3
"""The least load in flight: the blades turn however fast the vehicle descends."""


def flight_load(airspeed: float, climb: float, thrust: float = 1.0) -> float:
    """Return the power of flight relative to hovering.

    Induced power falls with `airspeed` (m/s, momentum theory) and drag rises with it; `climb` in m/s, down negative;
    `thrust` relative to the weight, more than 1 when leaning or accelerating.
    """
    slip = airspeed / _HOVER_AIR
    carried = _INDUCED * thrust * sqrt(thrust) / sqrt(1.0 + slip * slip)
    load = carried + 1.0 - _INDUCED + _DRAG_POWER * airspeed**3 + _CLIMB_POWER * thrust * climb
    return max(_LEAST, load)


@dataclass(slots=True)
class Battery:
    """A battery that lasts `hover_s` seconds of hovering when full."""

    level: float
    """0 to 1."""
    hover_s: float
    load: float = REST
    used_mah: float = 0.0
    forced_mv: int | None = None
    """The measured voltage if a fault overrides it."""
    lost_mv: int = 0
    """The voltage that failed cells no longer give."""
    failed: int = 0
    """The number of failed cells."""

    def drain(self, dt: float, load: float) -> None:
        """Remove the energy that `load` needs for `dt` seconds."""
        level, taken = self.level, load * dt / self.hover_s
        if taken > level:
            taken = level
        self.level = level - taken
        self.load = load
        self.used_mah += taken * CAPACITY_MAH

    def cap(self, level: float) -> None:
        """Lower the level to at most `level`."""
        self.level = min(self.level, level)

    def fail_cell(self, drop_mv: int) -> None:
        """Let a cell fail: the voltage falls, more so under load. The level does not change."""
        self.lost_mv += drop_mv
        self.failed = min(_CELLS, self.failed + 1)

    @property
    def percent(self) -> int:
        """`battery_remaining` of BATTERY_STATUS, rounded down so that it never overstates the charge."""
        return int(self.level * 100 + 1e-9)

    @property
    def millivolts(self) -> int:
        """The voltage under the current load."""
        if self.forced_mv is not None:
            return self.forced_mv
        below, above = next(pair for pair in pairwise(_CELL_MV) if self.level <= pair[1][0])
        part = (self.level - below[0]) / (above[0] - below[0])
        rest = _CELLS * (below[1] + part * (above[1] - below[1])) - self.lost_mv
        sag = _SAG_MV * (1.0 + self.failed * (FAILED_CELL_SAG - 1.0) / _CELLS)
        return max(0, round(rest - sag * self.load))

    @property
    def centiamperes(self) -> int:
        """The current; hovering empties `CAPACITY_MAH` in `hover_s`."""
        return round(self.load * CAPACITY_MAH / self.hover_s * 360)
