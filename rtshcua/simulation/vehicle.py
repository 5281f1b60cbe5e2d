"""The vehicle's state machine: armed or not, on the ground or in the air, and what it is flying to. Metres, seconds.

It is the same for both flavours; `Handling` and the mode table hold what differs.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from math import copysign, hypot

from rtshcua.simulation import battery
from rtshcua.simulation.kinematics import Body, approach_speed, stopping_distance
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_ARRIVED_M, _ARRIVED_M_S = 0.5, 0.4


class Landed(IntEnum):
    """EXTENDED_SYS_STATE.landed_state (MAV_LANDED_STATE)."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Event(Enum):
    """What happened that the autopilot has a text for."""

    ARMED = auto()
    DISARMED = auto()
    TAKEOFF = auto()
    RETURN = auto()
    LANDED = auto()
    AUTO_DISARMED = auto()


class _Activity(Enum):
    REST = auto()
    CLIMB = auto()
    TRACK = auto()
    RETURN_CLIMB = auto()
    RETURN_CROSS = auto()
    DESCEND = auto()
    FALL = auto()


@dataclass(slots=True)
class Handling:
    """How it flies; parameters may change it. Speeds in m/s, heights in metres above home, times in seconds."""

    cruise: float
    max_speed: float
    climb: float
    descent: float
    land_speed: float
    """The rate of descent below `land_below`."""
    land_below: float
    return_up: float
    """The height of the way home."""
    takeoff_up: float
    """The height of a takeoff that names none."""
    idle_disarm_s: float = 10.0
    landed_disarm_s: float = 2.0
    after_takeoff: Mode | None = None
    after_landing: Mode | None = None


class Vehicle:
    """A multirotor on the ground at home, disarmed."""

    def __init__(self, handling: Handling, mode: Mode) -> None:
        self.handling = handling
        self.body = Body()
        self.mode = mode
        self.armed = False
        self.landed = Landed.ON_GROUND
        self.target = Point(0.0, 0.0, 0.0)
        self.takeoff_up: float | None = None
        """The height that the next takeoff climbs to; kept while disarmed, for arming in TAKEOFF starts it."""
        self.events: list[Event] = []
        self._activity = _Activity.REST
        self._speed: float | None = None
        self._has_flown = False
        self._standing_s = 0.0

    # ------------------------------------------------------------------------------------------- commands

    @property
    def in_air(self) -> bool:
        """Whether it has left the ground."""
        return self._activity is not _Activity.REST

    @property
    def speed(self) -> float:
        """The ground speed that it flies to a target with."""
        wanted = self.handling.cruise if self._speed is None else self._speed
        return min(wanted, self.handling.max_speed)

    @speed.setter
    def speed(self, value: float) -> None:
        self._speed = max(value, 0.1)

    def arm(self) -> None:
        """Starts the motors; in TAKEOFF mode the climb follows."""
        if self.armed:
            return
        self.armed = True
        self._has_flown = False
        self._standing_s = 0.0
        self.events.append(Event.ARMED)
        if self.mode is Mode.TAKEOFF:
            self.climb()

    def disarm(self, event: Event = Event.DISARMED) -> None:
        """Stops the motors, wherever it is: in the air it falls."""
        if not self.armed:
            return
        self.armed = False
        self._speed = None
        self.takeoff_up = None
        self._activity = _Activity.FALL if self.in_air else _Activity.REST
        self.events.append(event)
        if self.handling.after_landing is not None and not self.in_air:
            self.mode = self.handling.after_landing

    def set_mode(self, mode: Mode) -> None:
        """Enters a mode and begins what it does; every mode but TAKEOFF, RETURN and LAND holds the place."""
        if mode is self.mode and mode in (Mode.RETURN, Mode.LAND):
            return
        self.mode = mode
        if mode is Mode.TAKEOFF:
            self.climb()
        if not self.in_air or self._activity is _Activity.FALL:
            return
        if mode is Mode.LAND:
            self._descend()
        elif mode is Mode.RETURN:
            self._hold(max(self.body.up, self.handling.return_up), _Activity.RETURN_CLIMB)
            self.events.append(Event.RETURN)
        elif mode is not Mode.TAKEOFF:
            self.hold()

    def climb(self) -> None:
        """Takes off to `takeoff_up` if armed, and if that is above where it is."""
        up = self.takeoff_up
        if not self.armed or up is None or up <= self.body.up or self._activity is _Activity.FALL:
            return
        if not self.in_air:
            self.events.append(Event.TAKEOFF)
            self._has_flown = True
        self._hold(up, _Activity.CLIMB)
        self.landed = Landed.TAKEOFF

    def hold(self) -> None:
        """Stops as soon as it can and stays there."""
        if self.in_air and self._activity is not _Activity.FALL:
            self._hold(self.body.up + copysign(stopping_distance(abs(self.body.v_up)), self.body.v_up))

    def go_to(self, target: Point) -> None:
        """Flies straight to `target`; does nothing on the ground."""
        if self.in_air and self._activity is not _Activity.FALL:
            self.target = target
            self._activity = _Activity.TRACK
            self.landed = Landed.IN_AIR

    def _hold(self, up: float, activity: _Activity = _Activity.TRACK) -> None:
        body = self.body
        speed = hypot(body.v_north, body.v_east)
        ahead = stopping_distance(speed) / speed if speed > 0 else 0.0
        self.target = Point(body.north + body.v_north * ahead, body.east + body.v_east * ahead, up)
        self._activity = activity
        self.landed = Landed.IN_AIR

    def _descend(self) -> None:
        self._hold(self.body.up, _Activity.DESCEND)
        self.landed = Landed.LANDING

    # ----------------------------------------------------------------------------------------------- time

    def step(self, dt: float, wind: tuple[float, float], error: tuple[float, float], powered: bool) -> float:
        """Lets `dt` seconds pass, in this wind, steering by a position that is off by `error`.

        Returns the load on the battery, hovering being 1.
        """
        if self._activity is _Activity.REST:
            self._stand(dt)
            return battery.IDLE if self.armed else battery.REST
        body = self.body
        if not powered:
            self._activity = _Activity.FALL
        if self._activity is _Activity.FALL:
            body.fall(dt)
        else:
            self._advance(error)
            target = (self.target.north - error[0], self.target.east - error[1])
            body.track(dt, target, self.speed, self._climb_rate(), wind)
        if body.up <= 0 and body.v_up < 0:
            self._touch_down()
        airspeed = hypot(body.v_north - wind[0], body.v_east - wind[1])
        return battery.flight_load(airspeed, body.v_up) if self.armed else battery.REST

    def _stand(self, dt: float) -> None:
        if not self.armed:
            return
        self._standing_s += dt
        handling = self.handling
        done = self._has_flown or self.mode in (Mode.RETURN, Mode.LAND)
        if self._standing_s >= (handling.landed_disarm_s if done else handling.idle_disarm_s):
            self.disarm(Event.AUTO_DISARMED)

    def _advance(self, error: tuple[float, float]) -> None:
        """Goes on to the next part of a takeoff or a return when the present one is done."""
        if self._activity in (_Activity.TRACK, _Activity.DESCEND):
            return
        up_reached = abs(self.target.up - self.body.up) < _ARRIVED_M and abs(self.body.v_up) < _ARRIVED_M_S
        if self._activity is _Activity.CLIMB:
            if up_reached:
                self._activity = _Activity.TRACK
                self.landed = Landed.IN_AIR
                self.takeoff_up = None
                if self.mode is Mode.TAKEOFF and self.handling.after_takeoff is not None:
                    self.mode = self.handling.after_takeoff
        elif self._activity is _Activity.RETURN_CLIMB:
            if up_reached:
                self.target = Point(0.0, 0.0, self.target.up)
                self._activity = _Activity.RETURN_CROSS
        elif self._is_above(self.target, error):
            self._activity = _Activity.DESCEND
            self.landed = Landed.LANDING

    def _is_above(self, point: Point, error: tuple[float, float]) -> bool:
        body = self.body
        away = hypot(point.north - error[0] - body.north, point.east - error[1] - body.east)
        return away < _ARRIVED_M and hypot(body.v_north, body.v_east) < _ARRIVED_M_S

    def _climb_rate(self) -> float:
        up, handling = self.body.up, self.handling
        if self._activity is _Activity.DESCEND:
            # Slows down so that it is slow enough where the last part begins.
            above = max(0.0, up - handling.land_below)
            return -min(handling.descent, handling.land_speed + approach_speed(above))
        away = self.target.up - up
        return copysign(min(handling.climb if away > 0 else handling.descent, approach_speed(abs(away))), away)

    def _touch_down(self) -> None:
        self.body.stop()
        self._activity = _Activity.REST
        self.landed = Landed.ON_GROUND
        self._standing_s = 0.0
        self.events.append(Event.LANDED)
