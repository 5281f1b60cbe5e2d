"""How a flight goes on by itself, from what it was told last: tick by tick, part by part. Metres, seconds."""

from abc import ABC, abstractmethod
from math import copysign, hypot

from rtshcua.simulation import battery, guidance
from rtshcua.simulation.activity import Activity, Event, Landed
from rtshcua.simulation.handling import Handling
from rtshcua.simulation.kinematics import Body, heading
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_FACING_M_S = 1.0  # from this speed on the nose turns to where it goes

_DOWN = frozenset({Activity.REST, Activity.TOUCHED, Activity.WRECK})
_STEADY = frozenset({Activity.TRACK, Activity.DESCEND, Activity.CIRCLE})
"""Activities that go on until something else is asked for, or the ground comes."""


class Flight(ABC):
    """A multirotor, and what it is flying to. `Vehicle` adds what it may be told."""

    def __init__(self, handling: Handling, mode: Mode) -> None:
        self.handling = handling
        self.body = Body()
        self.mode = mode
        self.armed = False
        self.landed = Landed.ON_GROUND
        self.target = Point(0.0, 0.0, 0.0)
        self.destination: Point | None = None
        """What it was told to fly to, or chose as the place to stop at: the target that it reports."""
        self.sent = False
        """Whether somebody named that place: no stopping point, no takeoff."""
        self.takeoff_up: float | None = None
        """The height that the next takeoff climbs to; kept while disarmed, for arming in TAKEOFF starts it."""
        self.events: list[Event] = []
        self.blind = False  # flies level, for it has no position to hold
        self.crashed = False
        self.touched_m_s = 0.0  # how fast it last came down on the ground
        self._activity = Activity.REST
        self._error = (0.0, 0.0)  # how far its estimate is off
        self._speed: float | None = None
        self._waiting_s = 0.0
        self._nose: float | None = None
        self._radius = 0.0
        self._steer_to_target()

    @property
    def in_air(self) -> bool:
        """Whether it has left the ground, and does not know that it came down."""
        return self._activity is not Activity.REST

    @property
    def flies(self) -> bool:
        """Whether it is in the air and obeys."""
        return self._activity not in (Activity.REST, Activity.FALL, Activity.WRECK)

    @property
    def lies(self) -> bool:
        """Whether it lies on the ground as it came down."""
        return self._activity is Activity.WRECK

    @property
    def descends(self) -> bool:
        """Whether it is on its way down to land, or has come down."""
        return self._activity in (Activity.DESCEND, Activity.TOUCHED)

    @property
    def speed(self) -> float:
        """The ground speed that it flies to a target with."""
        wanted = self.handling.cruise if self._speed is None else self._speed
        return min(wanted, self.handling.max_speed)

    @speed.setter
    def speed(self, value: float) -> None:
        self._speed = max(value, 0.1)

    # ------------------------------------------------------------------------------------------------- in time

    def step(
        self, dt: float, wind: tuple[float, float], error: tuple[float, float], powered: bool, sees: bool = True
    ) -> float:
        """Lets `dt` seconds pass, in this wind, steering by a position that is off by `error`, or by none (`sees`).

        Returns the load on the battery, hovering being 1.
        """
        activity, body = self._activity, self.body
        self._error = error
        if activity in _DOWN:
            self._stand(dt)
            return battery.IDLE if self.armed else battery.REST
        if not powered:
            self._activity = activity = Activity.FALL
        if activity is Activity.FALL:
            body.fall(dt)
        else:
            self._fly(dt, wind, error, sees)
        if body.up <= 0 and body.v_up < 0:
            self._touch_down()
        if not self.armed:
            return battery.REST
        airspeed = hypot(body.v_north - wind[0], body.v_east - wind[1])
        return battery.flight_load(airspeed, body.v_up, body.thrust)

    @abstractmethod
    def _stand(self, dt: float) -> None:
        """Lets time pass on the ground."""

    @abstractmethod
    def _touch_down(self) -> None:
        """The ground has come."""

    def _believed(self, north: float, east: float, up: float) -> Point:
        """A place as it takes it to be: it steers by its estimate, which may be off."""
        return Point(north + self._error[0], east + self._error[1], up)

    def _hold(self, activity: Activity = Activity.TRACK, up: float | None = None) -> None:
        """Stops where it can, at the height `up`, or where it can stop climbing as well."""
        body, agility = self.body, self.handling.agility
        stop = agility.brake if self.mode is Mode.BRAKE else agility.stop
        if self.mode is Mode.LAND:
            stop = agility.land
        self._approach, self._hardest = stop.approach, stop.hardest
        if up is None:
            # PX4 comes back to the height where it was told to hold (recorded); ArduCopter stops ahead of it.
            ahead = 0.0 if self.handling.comes_back else body.v_up**2 / (2 * agility.climb_acceleration)
            up = body.up + copysign(ahead, body.v_up)
        self.target = self._believed(*stop.place(body), up)
        self.destination = self._believed(*stop.told_place(body), up)
        self.sent = False
        self._activity = activity
        self.landed = Landed.IN_AIR

    def _steer_to_target(self) -> None:
        agility = self.handling.agility
        self._approach, self._hardest = agility.approach, guidance.hardest(agility)

    def _fly(self, dt: float, wind: tuple[float, float], error: tuple[float, float], sees: bool) -> None:
        body, agility = self.body, self.handling.agility
        self._waiting_s -= dt
        self._advance(error)
        most = agility.takeoff_acceleration if self._activity is Activity.CLIMB else agility.climb_acceleration
        self.blind = self.blind or not sees
        north, east = self.target.north - error[0], self.target.east - error[1]
        if self.blind:
            body.drift(dt, self._climb_rate(north, east), most, wind)
            return
        if self._activity is Activity.CIRCLE:
            want = guidance.around(body, north, east, self._radius, self.speed)
        else:
            want = guidance.towards(body, north, east, self.speed, self._approach)
        climb = self._climb_rate(north, east)
        body.track(dt, want, self._hardest, climb, most, wind)
        if self._nose is not None:
            body.turn(dt, self._nose)
        elif abs(want[0]) + abs(want[1]) > _FACING_M_S:
            body.turn(dt, heading(body.v_north, body.v_east))

    def _advance(self, error: tuple[float, float]) -> None:
        """Goes on to the next part of a takeoff or a return when the present one is done."""
        activity, body = self._activity, self.body
        if activity in _STEADY:
            return
        away = abs(self.target.up - body.up)
        if activity is Activity.CLIMB:
            if away < self.handling.agility.takeoff_within:
                self._activity = Activity.TRACK
                self.landed = Landed.IN_AIR
                self.takeoff_up = None
                if self.mode is Mode.TAKEOFF and self.handling.after_takeoff is not None:
                    self.mode = self.handling.after_takeoff
        elif activity is Activity.RETURN_CLIMB:
            if away < guidance.ARRIVED_M and abs(body.v_up) < guidance.ARRIVED_M_S:
                self.target = self.destination = Point(0.0, 0.0, self.target.up)
                self._steer_to_target()
                self._activity = Activity.RETURN_CROSS
        elif activity is Activity.RETURN_CROSS:
            within = self.handling.agility.home_within
            if guidance.is_above(body, self.target.north - error[0], self.target.east - error[1], within):
                self._activity = Activity.RETURN_WAIT
                self._waiting_s = self.handling.agility.return_wait_s
        elif self._waiting_s <= 0:
            self._activity = Activity.DESCEND
            self.destination = Point(self.target.north, self.target.east, 0.0)
            self.landed = Landed.LANDING
            self.events.append(Event.HOME)

    def _climb_rate(self, north: float, east: float) -> float:
        """Upwards; (north, east) is the target as it is steered to."""
        if self._activity is Activity.DESCEND:
            if self._waiting_s > 0:
                return 0.0
            return guidance.landing_rate(self.body, self.handling)
        climbs = self._activity is Activity.CLIMB
        rate = guidance.climb_rate(self.body.up, self.target.up, self.handling, climbs)
        if self._activity is Activity.TRACK:
            most = guidance.steepest(self.body, north, east, self.target.up)
            rate = max(-most, min(most, rate))
        return rate
