"""How an autopilot stops: where it says that it will stop, where it does, and how it slows down. Metres, seconds."""

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

from rtshcua.simulation.kinematics import Approach, Body


@dataclass(frozen=True, slots=True)
class Stop:
    """How it stops, from any ground speed (m/s)."""

    approach: Approach
    hardest: float
    """The most that it accelerates meanwhile, in m/s^2."""
    ahead: Callable[[float], float]
    """How far ahead it comes to stand."""
    told: Callable[[float], float]
    """How far ahead it says that it will."""

    def place(self, body: Body) -> tuple[float, float]:
        """Where it comes to stand, in metres north and east of home."""
        return _in_front(body, self.ahead)

    def told_place(self, body: Body) -> tuple[float, float]:
        """The target that it reports."""
        return _in_front(body, self.told)


def _in_front(body: Body, distance: Callable[[float], float]) -> tuple[float, float]:
    speed = hypot(body.v_north, body.v_east)
    if speed == 0:
        return body.north, body.east
    time = distance(speed) / speed
    return body.north + body.v_north * time, body.east + body.v_east * time
