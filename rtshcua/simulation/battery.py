"""The battery: drained by the power that flight takes. Four cells in series; its level never rises by itself."""

from dataclasses import dataclass

CAPACITY_MAH = 5000
_FULL_MV, _EMPTY_MV = 16_800, 14_000
_SAG_MV = 300
"""What hovering takes off the voltage."""

REST = 0.002
"""The load while disarmed, as a part of what hovering takes."""
IDLE = 0.05
"""The load while the motors turn on the ground."""


def flight_load(airspeed: float, climb: float) -> float:
    """What flying takes, hovering being 1: more with air speed (m/s), more when climbing, a little less going down."""
    return 1.0 + 0.3 * (airspeed / 12) ** 2 + (0.15 * climb if climb > 0 else 0.05 * max(climb, -3.0))


@dataclass(slots=True)
class Battery:
    """A battery that lasts `hover_s` seconds of hovering when full."""

    level: float
    """0 to 1."""
    hover_s: float
    load: float = REST
    used_mah: float = 0.0

    def drain(self, dt: float, load: float) -> None:
        """Takes out what `load` needs for `dt` seconds."""
        taken = min(self.level, load * dt / self.hover_s)
        self.level -= taken
        self.load = load
        self.used_mah += taken * CAPACITY_MAH

    def cap(self, level: float) -> None:
        """Finds that no more than `level` is left."""
        self.level = min(self.level, level)

    @property
    def percent(self) -> int:
        """`battery_remaining` of BATTERY_STATUS: rounded down, so that it never promises what is not there."""
        return int(self.level * 100 + 1e-9)

    @property
    def millivolts(self) -> int:
        """The voltage under the present load."""
        return round(_EMPTY_MV + (_FULL_MV - _EMPTY_MV) * self.level - _SAG_MV * self.load)

    @property
    def centiamperes(self) -> int:
        """The current; hovering empties `CAPACITY_MAH` in `hover_s`."""
        return round(self.load * CAPACITY_MAH / self.hover_s * 360)
