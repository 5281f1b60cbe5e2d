"""The vehicle's state machine: armed or not, on the ground or in the air, and what it is flying to. Metres, seconds.

It is the same for both flavours; `Handling` and the mode table hold what differs.
"""

from math import copysign, hypot

from rtshcua.simulation import battery, guidance
from rtshcua.simulation.activity import Activity, Event, Landed
from rtshcua.simulation.ground import Ground
from rtshcua.simulation.handling import Handling
from rtshcua.simulation.kinematics import Body, heading
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_FACING_M_S = 1.0  # from this speed on the nose turns to where it goes


_STEADY = frozenset({Activity.TRACK, Activity.DESCEND, Activity.CIRCLE})
"""Activities that go on until something else is asked for, or the ground comes."""


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
        self._activity = Activity.REST
        self._speed: float | None = None
        self._ground = Ground(handling)
        self._waiting_s = 0.0
        self._nose: float | None = None
        self._radius = 0.0
        self.blind = False  # flies level, for it has no position to hold
        self._approach = handling.agility.approach
        self.crashed = False
        self.touched_m_s = 0.0  # how fast it last came down on the ground

    # ------------------------------------------------------------------------------------------- commands

    @property
    def in_air(self) -> bool:
        """Whether it has left the ground."""
        return self._activity is not Activity.REST

    @property
    def flies(self) -> bool:
        """Whether it is in the air and obeys."""
        return self._activity is not Activity.REST and self._activity is not Activity.FALL

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
        self._ground.arm()
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
        self._ground.stay()
        if self._activity in (Activity.REST, Activity.TOUCHED):
            self._activity, self.landed = Activity.REST, Landed.ON_GROUND
        else:
            self._activity = Activity.FALL
        self.events.append(event)
        if self.handling.after_landing is not None and not self.in_air:
            self.mode = self.handling.after_landing

    def crash(self) -> None:
        """Has flown into something: it falls, and the motors are off."""
        if self.armed:
            self.crashed = True
            self.disarm(Event.CRASHED)
            self.body.crash()

    def set_mode(self, mode: Mode) -> None:
        """Enters a mode and begins what it does; every mode but TAKEOFF, RETURN and LAND holds the place."""
        if mode is self.mode and mode in (Mode.RETURN, Mode.LAND, Mode.MISSION):
            return
        if self.handling.forgets_speed and mode is not self.mode:
            self._speed = None
        self.mode = mode
        self._nose = None
        self.blind = False
        if mode is Mode.TAKEOFF:
            self.climb()
        else:
            self._ground.stay()
        if not self.flies:
            return
        if mode is Mode.LAND:
            self.land_here()
        elif mode is Mode.RETURN:
            self.return_home()
            self.events += [Event.RETURN, Event.RETURN_CLIMB]
        elif mode is not Mode.TAKEOFF:
            self.hold()

    def climb(self) -> None:
        """Takes off to `takeoff_up` if armed, and if that is above where it is."""
        up = self.takeoff_up
        if not self.armed or up is None or up <= self.body.up or self._activity is Activity.FALL:
            return
        if self.in_air:
            self._hold(up, Activity.CLIMB)
            self.landed = Landed.TAKEOFF
        else:
            self._lift(Point(self.body.north, self.body.east, up))

    def _lift(self, target: Point) -> None:
        """Runs up the motors; when they carry, it flies to `target`, straight up first if that is a takeoff."""
        self.target = target
        self._ground.run_up()

    def hold(self) -> None:
        """Stops as soon as it can and stays there."""
        if self.flies:
            ahead = self.body.v_up**2 / (2 * self.handling.agility.climb_acceleration)
            self._hold(self.body.up + copysign(ahead, self.body.v_up))

    def turn_to(self, nose: float) -> None:
        """Points the nose there, in radians from north, until the mode or the target changes."""
        self._nose = nose

    def land_here(self) -> None:
        """Descends and lands, whatever the mode."""
        if self.flies:
            self._hold(self.body.up, Activity.DESCEND)
            self._waiting_s = 0.0
            self.landed = Landed.LANDING

    def return_home(self) -> None:
        """Climbs to the height of the way home, flies home and lands, whatever the mode."""
        if self.flies:
            self._hold(max(self.body.up, self.handling.return_up), Activity.RETURN_CLIMB)

    def wait(self, seconds: float) -> None:
        """Keeps its height for so long before it goes on landing."""
        self._waiting_s = seconds

    def go_to(self, target: Point) -> None:
        """Flies straight to `target`; on the ground it does nothing, or lifts off if armed, as the flavour does."""
        if self.flies:
            self.target = target
            self._nose = None
            self._approach = self.handling.agility.approach
            self._activity = Activity.TRACK
            self.landed = Landed.IN_AIR
        elif self.armed and not self.in_air and self.handling.lifts_to_targets and target.up > self.body.up:
            self._lift(target)

    def circle(self, centre: Point, radius: float) -> None:
        """Flies around a place, clockwise seen from above if the radius is positive, until told otherwise."""
        if self.flies:
            self.target, self._radius = centre, radius
            self._activity = Activity.CIRCLE
            self.landed = Landed.IN_AIR

    def _hold(self, up: float, activity: Activity = Activity.TRACK) -> None:
        body = self.body
        self._approach = self.handling.agility.stop
        speed = hypot(body.v_north, body.v_east)
        ahead = self._approach.distance(speed) / speed if speed > 0 else 0.0
        self.target = Point(body.north + body.v_north * ahead, body.east + body.v_east * ahead, up)
        self._activity = activity
        self.landed = Landed.IN_AIR

    def step(
        self, dt: float, wind: tuple[float, float], error: tuple[float, float], powered: bool, sees: bool = True
    ) -> float:
        """Lets `dt` seconds pass, in this wind, steering by a position that is off by `error`, or by none (`sees`).

        Returns the load on the battery, hovering being 1.
        """
        activity, body = self._activity, self.body
        if activity is Activity.REST or activity is Activity.TOUCHED:
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

    def _fly(self, dt: float, wind: tuple[float, float], error: tuple[float, float], sees: bool) -> None:
        body, agility = self.body, self.handling.agility
        self._waiting_s -= dt
        self._advance(error)
        most = agility.takeoff_acceleration if self._activity is Activity.CLIMB else agility.climb_acceleration
        self.blind = self.blind or not sees
        if self.blind:
            body.drift(dt, self._climb_rate(), most, wind)
            return
        north, east = self.target.north - error[0], self.target.east - error[1]
        if self._activity is Activity.CIRCLE:
            want = guidance.around(body, north, east, self._radius, self.speed)
        else:
            want = guidance.towards(body, north, east, self.speed, self._approach)
        body.track(dt, want, guidance.hardest(agility, self._approach), self._climb_rate(), most, wind)
        if self._nose is not None:
            body.turn(dt, self._nose)
        elif abs(want[0]) + abs(want[1]) > _FACING_M_S:
            body.turn(dt, heading(body.v_north, body.v_east))

    def _stand(self, dt: float) -> None:
        if self._activity is Activity.TOUCHED:
            if self._ground.has_landed(dt):
                self._activity = Activity.REST
                self.landed = Landed.ON_GROUND
                self.events.append(Event.LANDED)
        elif self._ground.lifting:
            if self._ground.lifts_off(dt):
                self._lift_off()
        elif self.armed and self._ground.has_done(dt, self.mode in (Mode.RETURN, Mode.LAND)):
            self.disarm(Event.AUTO_DISARMED)

    def _lift_off(self) -> None:
        self.events.append(Event.TAKEOFF)
        self._approach = self.handling.agility.approach
        climbs = self.takeoff_up is not None
        self._activity = Activity.CLIMB if climbs else Activity.TRACK
        self.landed = Landed.TAKEOFF if climbs else Landed.IN_AIR

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
                self.target = Point(0.0, 0.0, self.target.up)
                self._approach = self.handling.agility.approach
                self._activity = Activity.RETURN_CROSS
        elif activity is Activity.RETURN_CROSS:
            within = self.handling.agility.home_within
            if guidance.is_above(body, self.target.north - error[0], self.target.east - error[1], within):
                self._activity = Activity.RETURN_WAIT
                self._waiting_s = self.handling.agility.return_wait_s
        elif self._waiting_s <= 0:
            self._activity = Activity.DESCEND
            self.landed = Landed.LANDING
            self.events.append(Event.HOME)

    def _climb_rate(self) -> float:
        if self._activity is Activity.DESCEND:
            if self._waiting_s > 0:
                return 0.0
            return guidance.landing_rate(self.body, self.handling)
        return guidance.climb_rate(self.body.up, self.target.up, self.handling, self._activity is Activity.CLIMB)

    def _touch_down(self) -> None:
        self.touched_m_s = -self.body.v_up
        self.body.stop()
        self.events.append(Event.TOUCHED)
        self._activity = Activity.TOUCHED if self.armed else Activity.REST
        self.landed = self.landed if self.armed else Landed.ON_GROUND
        self._ground.touch()
        self.blind = False
