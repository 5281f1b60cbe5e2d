"""The battery: drained by the power that flight takes. Four cells in series; its level never rises by itself."""

from dataclasses import dataclass
from itertools import pairwise
from math import sqrt

CAPACITY_MAH = 5000
_CELLS = 4
_CELL_MV = ((0.0, 3200), (0.1, 3500), (0.5, 3800), (1.0, 4200))
"""A cell at rest: level and voltage, linear between."""
_SAG_MV = 300
"""What hovering takes off the voltage: internal resistance, all cells together."""

REST = 0.002
"""The load while disarmed, as a part of what hovering takes."""
IDLE = 0.05
"""The load while the motors turn on the ground."""

FAILED_CELL_SAG = 3.0
"""How many times as much a cell that failed gives way under load: its resistance has risen."""

_INDUCED = 0.7
"""The part of hovering that moves air down; the rest turns the blades."""
_HOVER_AIR = 7.0
"""m/s: about the speed through the air at which moving it down has become cheaper by a third."""
_DRAG_POWER = 1.75e-4
"""What still air takes, by the cube of the speed: the body's drag over the power of hovering, 120 W/kg."""
_CLIMB_POWER = 9.80665 / 120
"""Lifting the weight, for each m/s."""
_LEAST = 0.3
"""However fast it goes down, the blades turn."""


def flight_load(airspeed: float, climb: float, thrust: float = 1.0) -> float:
    """The power of flight, that of hovering being 1.

    By the speed through the air (m/s): momentum theory for what carries it, which gets cheaper, and drag, which gets
    dear; by climbing (m/s, down is negative); and by `thrust`, the weight being 1: leaning and accelerating.
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
    """What is measured instead of the voltage, if a fault says so."""
    lost_mv: int = 0
    """What failed cells do not give any more."""
    failed: int = 0
    """How many cells have failed."""

    def drain(self, dt: float, load: float) -> None:
        """Takes out what `load` needs for `dt` seconds."""
        level, taken = self.level, load * dt / self.hover_s
        if taken > level:
            taken = level
        self.level = level - taken
        self.load = load
        self.used_mah += taken * CAPACITY_MAH

    def cap(self, level: float) -> None:
        """Finds that no more than `level` is left."""
        self.level = min(self.level, level)

    def fail_cell(self, drop_mv: int) -> None:
        """A cell fails: less voltage from now on, and less again under load. The level says nothing of it."""
        self.lost_mv += drop_mv
        self.failed = min(_CELLS, self.failed + 1)

    @property
    def percent(self) -> int:
        """`battery_remaining` of BATTERY_STATUS: rounded down, so that it never promises what is not there."""
        return int(self.level * 100 + 1e-9)

    @property
    def millivolts(self) -> int:
        """The voltage under the present load."""
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
