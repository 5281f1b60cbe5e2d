"""The vehicle's state machine: armed or disarmed, on the ground or in the air, and its commands. Metres, seconds.

Both flavours share it; `Handling` and the mode table hold the differences.
"""

from dataclasses import replace
from enum import Enum, IntEnum, auto
from math import copysign, hypot, inf

from rtshcua.mavlink import enums
from rtshcua.model.faults import FlightMode
from rtshcua.simulation import battery, guidance
from rtshcua.simulation.handling import Handling
from rtshcua.simulation.kinematics import Body, heading, within
from rtshcua.simulation.place import Point


class Landed(IntEnum):
    """EXTENDED_SYS_STATE.landed_state (MAV_LANDED_STATE)."""

    ON_GROUND = enums.MAV_LANDED_STATE_ON_GROUND
    IN_AIR = enums.MAV_LANDED_STATE_IN_AIR
    TAKEOFF = enums.MAV_LANDED_STATE_TAKEOFF
    LANDING = enums.MAV_LANDED_STATE_LANDING


class VehicleEvent(Enum):
    """An event for which the autopilot has a text."""

    ARMED = auto()
    DISARMED = auto()
    TAKEOFF = auto()
    RETURN = auto()
    RETURN_CLIMB = auto()
    HOME = auto()
    TOUCHED = auto()
    LANDED = auto()
    AUTO_DISARMED = auto()
    TIPPED = auto()
    CRASHED = auto()


class Activity(Enum):
    """The current activity. `REST`: on the ground; `TOUCHED`: on the ground, landing not yet detected; `WRECK`: crashed
    on the ground; `CRUISE`: flying at a commanded velocity.
    """

    REST = auto()
    CLIMB = auto()
    TRACK = auto()
    RETURN_CLIMB = auto()
    RETURN_CROSS = auto()
    RETURN_WAIT = auto()
    CIRCLE = auto()
    DESCEND = auto()
    TOUCHED = auto()
    FALL = auto()
    WRECK = auto()
    CRUISE = auto()


_FACING_M_S = 1.0  # above this speed the nose turns towards the direction of flight

_DOWN = (Activity.REST, Activity.TOUCHED, Activity.WRECK)
_STEADY = (Activity.TRACK, Activity.DESCEND, Activity.CIRCLE, Activity.CRUISE)
"""Activities that continue until another command, or touchdown."""
_VELOCITY_S = 3.0
"""How long a commanded velocity holds without renewal (GUID_TIMEOUT); then the vehicle stops."""
_HARD_M_S = 4.0
"""A faster touchdown is a crash."""


class Multirotor:
    """A multirotor, initially disarmed on the ground at home, with its commands and their execution."""

    def __init__(self, handling: Handling, mode: FlightMode) -> None:
        self.handling = handling
        self.return_under = inf
        """The greatest height above home of a return, limited by the fence."""
        self.body = Body()
        self.mode = mode
        self.armed = False
        self.landed = Landed.ON_GROUND
        self.target = Point(0.0, 0.0, 0.0)
        self.destination: Point | None = None
        """The target that it reports: the commanded place, or its own stopping point."""
        self.sent = False
        """Whether the destination was commanded, not a stopping point or a takeoff."""
        self.takeoff_up: float | None = None
        """The height of the takeoff. Kept while disarmed, because arming in TAKEOFF starts it, until that mode is left
        (PX4: `Takeoff::set_takeoff_position` takes what NAV_TAKEOFF named once).
        """
        self.events: list[VehicleEvent] = []
        self.blind = False  # flies level because it has no position to hold
        self.crashed = False
        self.touched_m_s = 0.0  # the speed of the last touchdown
        self.paused = False
        """Whether it is paused on its way to a target (ArduCopter)."""
        self.ceiling = inf
        """The greatest height that it can reach, in m."""
        self._stood_s = 0.0  # since arming or touchdown
        self._lifting_s: float | None = None  # until lift-off, if one is commanded
        self._has_flown = False  # since arming
        self._activity = Activity.REST
        self._error = (0.0, 0.0)  # the error of its position estimate
        self._speed: float | None = None
        self._waiting_s = 0.0
        self._nose: float | None = None
        self._radius = 0.0
        self._velocity = (0.0, 0.0, 0.0)
        self._past: guidance.Overshoot | None = None
        self._comes_back = False  # from an overshoot
        self._steer_to_target()

    @property
    def in_air(self) -> bool:
        """Whether it has left the ground and no landing is detected."""
        return self._activity is not Activity.REST

    @property
    def flies(self) -> bool:
        """Whether it is in the air and controllable."""
        return self._activity not in (Activity.REST, Activity.FALL, Activity.WRECK)

    @property
    def lies(self) -> bool:
        """Whether it lies crashed on the ground."""
        return self._activity is Activity.WRECK

    @property
    def descends(self) -> bool:
        """Whether it descends to land, or has touched down."""
        return self._activity in (Activity.DESCEND, Activity.TOUCHED)

    @property
    def orders(self) -> tuple[object, ...]:
        """The commanded state; it changes when the vehicle obeys a command."""
        return self.mode, self.armed, self._activity, self.target, self.destination, self.paused

    @property
    def speed(self) -> float:
        """The ground speed towards a target."""
        handling, speed = self.handling, self._speed
        if self.mode is FlightMode.RETURN and handling.return_speed > 0:
            speed = handling.return_speed
        elif speed is None:
            speed = handling.cruise
        return within(speed, handling.max_speed)

    @speed.setter
    def speed(self, value: float) -> None:
        self._speed = max(value, 0.1)

    # ------------------------------------------------------------------------------------------- what it is told

    def arm(self) -> None:
        """Start the motors; in TAKEOFF mode, begin the climb."""
        if self.armed:
            return
        self.armed = True
        self._stood_s, self._lifting_s, self._has_flown = 0.0, None, False
        self.events.append(VehicleEvent.ARMED)
        if self.mode is FlightMode.TAKEOFF:
            self.climb()

    def disarm(self, event: VehicleEvent = VehicleEvent.DISARMED) -> None:
        """Stop the motors; in the air the vehicle falls."""
        if not self.armed:
            return
        self.armed = False
        self._speed = None
        self.takeoff_up = None
        self.destination, self.sent, self.paused = None, False, False
        self._lifting_s = None
        if self._activity in (Activity.REST, Activity.TOUCHED, Activity.WRECK):
            self._activity, self.landed = Activity.REST, Landed.ON_GROUND
        else:
            self._activity = Activity.FALL
            self.landed = Landed.ON_GROUND  # autopilots report a disarmed vehicle as landed, even in the air
        self.events.append(event)
        if self.handling.after_landing is not None and not self.in_air:
            self.mode = self.handling.after_landing

    def restart(self, mode: FlightMode) -> None:
        """Restart in this mode: the motors stop, and all commands are lost."""
        self.disarm()
        self.events.clear()
        self.mode = mode
        self.takeoff_up = self.destination = self._speed = self._nose = None
        self.blind = self.sent = self.paused = False

    def crash(self) -> None:
        """Hit an obstacle and fall. The autopilot does not notice: the motors stay on."""
        if not self.crashed:
            self.crashed = True
            self._activity = Activity.FALL
            self.body.crash()

    def set_mode(self, mode: FlightMode) -> None:
        """Enter a mode and begin its activity; every mode but TAKEOFF, RETURN and LAND holds the place.

        Selecting the current mode has no effect: neither autopilot enters it again, and PX4 in Hold flies on to the
        target of a DO_REPOSITION (recorded). PX4: `UserModeIntention::change`; ArduCopter: `Copter::set_mode`
        returns at once.
        """
        if mode is self.mode:
            return
        if self.handling.forgets_speed:
            self._speed = None
        if self.mode is FlightMode.TAKEOFF:
            self.takeoff_up = None
        self.mode = mode
        self._nose = None
        self.blind = self.sent = self.paused = False
        self.destination = None
        if mode is FlightMode.TAKEOFF:
            self.climb()
        else:
            self._lifting_s = None
        if not self.flies:
            return
        if mode is FlightMode.LAND:
            self.land_here()
        elif mode is FlightMode.RETURN:
            self.return_home()
            self.events += [VehicleEvent.RETURN, VehicleEvent.RETURN_CLIMB]
        elif mode is not FlightMode.TAKEOFF:
            self.hold()

    def climb(self) -> None:
        """Take off to `takeoff_up` if armed and below that height."""
        up = self.takeoff_up
        if not self.armed or up is None or up <= self.body.up or self._activity is Activity.FALL:
            return
        if self.in_air:
            self._hold(Activity.CLIMB, up)
            self.landed = Landed.TAKEOFF
        else:
            self._lift(self._believed(self.body.north, self.body.east, up))
        self.sent = False

    def _lift(self, target: Point) -> None:
        """Spool up the motors, then fly to `target`, straight up first for a takeoff."""
        if not self.crashed:
            self.target = self.destination = target
            if self._lifting_s is None:  # motors that spool up already continue
                agility = self.handling.agility
                self._lifting_s = max(agility.spool_s - self._stood_s, 0.0) + agility.ramp_s

    def hold(self, up: float | None = None) -> None:
        """Stop as soon as possible and hold, optionally at another height."""
        if self.flies:
            self._hold(up=up)

    def pause(self) -> None:
        """Stop on the way to a target. The target, or a later one, is kept until `go_on`."""
        if self.flies and not self.paused:
            self._cruise(0.0, 0.0, 0.0)
            self.paused = True

    def go_on(self) -> None:
        """Continue to the target after a pause."""
        if self.paused:
            self.paused = False
            if self.sent and self.destination is not None:
                self.go_to(self.destination)

    def turn_to(self, nose: float) -> None:
        """Point the nose in a direction, radians from north, until the mode or the target changes."""
        self._nose = nose

    def land_here(self) -> None:
        """Descend and land, in any mode."""
        if self.flies:
            self._hold(Activity.DESCEND, self.body.up)
            self._waiting_s = 0.0
            self.landed = Landed.LANDING

    def return_home(self) -> None:
        """Climb to the return height, fly home and land, in any mode. Both autopilots compute that height once, where
        they begin to climb.
        """
        if self.flies:
            body = self.body
            self._hold(Activity.RETURN_CLIMB, body.up)
            if self.handling.comes_back:
                self.target = self.destination = self._believed(body.north, body.east, body.up)
                self._steer_to_target()
            height = self.handling.return_height(self.handling, hypot(self.target.north, self.target.east), body.up)
            up = max(body.up, min(height, self.return_under))
            self.target = replace(self.target, up=up)
            if self.destination is not None:
                self.destination = replace(self.destination, up=up)

    def wait(self, seconds: float) -> None:
        """Hold the height for so long before the landing continues."""
        self._waiting_s = seconds

    def go_to(self, target: Point, *, past: bool = True) -> None:
        """Fly straight to `target`; on the ground, do nothing, or lift off if armed, depending on the flavour.

        `past`: whether it may overshoot the target and come back.
        """
        if self.flies:
            if self.handling.forgets_at_first_target and self.mode is FlightMode.GUIDED and not self.sent:
                self._speed = None
            self.destination, self.sent = target, True
            if self.paused:
                return
            if target != self.target or self._activity is not Activity.TRACK:
                self._past, self._comes_back = None, False
                if past:
                    self._fly_past(target)
            self.target = target
            self._nose = None
            self._steer_to_target()
            self._activity = Activity.TRACK
            self.landed = Landed.IN_AIR
        elif self.armed and not self.in_air and self.handling.lifts_to_targets and target.up > self.body.up:
            self._lift(target)

    def fly_at(self, north: float, east: float, up: float) -> None:
        """Fly at a velocity for a limited time, then stop; no target is reported."""
        if self.flies:
            self.destination, self.sent, self._nose = None, False, None
            if self.paused:
                return
            self._cruise(north, east, up)

    def _cruise(self, north: float, east: float, up: float) -> None:
        self._past, self._comes_back = None, False
        self._hardest = self.handling.acceleration
        self._activity, self._velocity, self._waiting_s = Activity.CRUISE, (north, east, up), _VELOCITY_S
        self.landed = Landed.IN_AIR

    def shift_east(self, metres: float) -> None:
        """Move the place that it holds or lands at."""
        if self.flies:
            self.target = Point(self.target.north, self.target.east + metres, self.target.up)

    def circle(self, centre: Point, radius: float) -> None:
        """Circle a place until the next command, clockwise seen from above if the radius is positive."""
        if self.flies:
            self.target, self._radius = centre, radius
            self._past = None
            self._activity = Activity.CIRCLE
            self.landed = Landed.IN_AIR

    # ------------------------------------------------------------------------------------------------- in time

    def step(
        self, dt: float, wind: tuple[float, float], error: tuple[float, float], powered: bool, sees: bool = True
    ) -> float:
        """Advance by `dt` seconds in this wind, steering by a position with `error`, or without one (`sees`).

        Return the load on the battery relative to hovering.
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
        return battery.flight_load(airspeed, body.v_up, body.thrust())

    def _believed(self, north: float, east: float, up: float) -> Point:
        """Return a true place as the vehicle estimates it."""
        return Point(north + self._error[0], east + self._error[1], up)

    def _hold(self, activity: Activity = Activity.TRACK, up: float | None = None) -> None:
        """Stop as soon as possible, at the height `up`, or where the climb ends."""
        body, agility = self.body, self.handling.agility
        stop = agility.brake if self.mode is FlightMode.BRAKE else agility.stop
        if self.mode is FlightMode.LAND:
            stop = agility.land
        self._approach, self._hardest = stop.approach, stop.hardest
        if up is None:
            # PX4 returns to the height where hold was commanded (recorded); ArduCopter stops beyond it.
            ahead = 0.0 if self.handling.comes_back else body.v_up**2 / (2 * agility.climb_acceleration)
            up = body.up + copysign(ahead, body.v_up)
        self.target = self._believed(*stop.place(body), up)
        self.destination = self._believed(*stop.told_place(body), up)
        self.sent = False
        self._past, self._comes_back = None, False
        self._activity = activity
        self.landed = Landed.IN_AIR

    def _fly_past(self, target: Point) -> None:
        """Plan the overshoot past a target."""
        here = self._believed(self.body.north, self.body.east, self.body.up)
        self._past = guidance.past(here, target, self.speed, self.handling.agility)
        self._comes_back = False

    def _steer_to_target(self) -> None:
        agility, most = self.handling.agility, self.handling.acceleration
        self._approach, self._hardest = agility.approach, min(guidance.hardest(agility), most)
        if most < agility.approach.braking * guidance.SPARE:
            self._approach = replace(agility.approach, braking=most / guidance.SPARE)

    def _fly(self, dt: float, wind: tuple[float, float], error: tuple[float, float], sees: bool) -> None:
        body, agility = self.body, self.handling.agility
        if self._activity is not Activity.TRACK:
            self._waiting_s -= dt
            if self._activity not in _STEADY:
                self._advance(error)
        activity, target, past = self._activity, self.target, self._past
        most = agility.takeoff_acceleration if activity is Activity.CLIMB else agility.climb_acceleration
        north, east = target.north - error[0], target.east - error[1]
        if self.blind or not sees:
            self.blind = True
            body.drift(dt, self._climb_rate(north, east), most, wind)
            return
        if past is not None:
            if past.is_over(body, north, east):
                self._past = None
                self._comes_back = True
            else:
                north, east = north + past.north, east + past.east
        speed = self.speed
        if activity is Activity.CRUISE:
            want = self._velocity[:2] if self._waiting_s > 0 else (0.0, 0.0)
        elif activity is Activity.CIRCLE:
            want = guidance.around(body, north, east, self._radius, speed)
        else:
            if self._comes_back:
                speed = min(guidance.speed_back(body, north, east), speed)
            want = guidance.towards(body, north, east, speed, self._approach)
        climb = self._climb_rate(north, east)
        body.track(dt, want, self._hardest, climb, most, wind)
        if self._nose is not None:
            body.turn(dt, self._nose)
        elif abs(want[0]) + abs(want[1]) > _FACING_M_S:
            body.turn(dt, heading(body.v_north, body.v_east))

    def _advance(self, error: tuple[float, float]) -> None:
        """Begin the next part of a takeoff or a return when the current one is done."""
        activity, body = self._activity, self.body
        away = abs(self.target.up - body.up)
        if activity is Activity.CLIMB:
            if away < self.handling.agility.takeoff_within:
                self._activity = Activity.TRACK
                self.landed = Landed.IN_AIR
                self.takeoff_up = None
                if self.mode is FlightMode.TAKEOFF and self.handling.after_takeoff is not None:
                    self.mode = self.handling.after_takeoff
        elif activity is Activity.RETURN_CLIMB:
            if away < guidance.ARRIVED_M and abs(body.v_up) < guidance.ARRIVED_M_S:
                self.target = self.destination = Point(0.0, 0.0, self.target.up)
                self._fly_past(self.target)
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
            self.events.append(VehicleEvent.HOME)

    def _climb_rate(self, north: float, east: float) -> float:
        """Return the climb rate, limited by the ceiling; (north, east) is the target that it steers to."""
        return min(self._wanted_climb(north, east), max(self.ceiling - self.body.up, 0.0))

    def _wanted_climb(self, north: float, east: float) -> float:
        activity, body = self._activity, self.body
        if activity is Activity.CRUISE:
            return self._velocity[2] if self._waiting_s > 0 else 0.0
        if activity is Activity.DESCEND:
            return 0.0 if self._waiting_s > 0 else guidance.landing_rate(body, self.handling)
        up = self.target.up
        rate = guidance.climb_rate(body.up, up, self.handling, activity is Activity.CLIMB)
        return within(rate, guidance.steepest(body, north, east, up)) if activity is Activity.TRACK else rate

    # ---------------------------------------------------------------------------------------------- on the ground

    def _stand(self, dt: float) -> None:
        handling = self.handling
        self._stood_s += dt
        if self._activity is Activity.TOUCHED:
            if self._stood_s >= handling.agility.land_detect_s:
                self._stood_s = 0.0
                self._activity = Activity.REST
                self.landed = Landed.ON_GROUND
                self.events.append(VehicleEvent.LANDED)
        elif self._activity is Activity.WRECK:
            if self.armed and handling.crash_disarm_s is not None and self._stood_s >= handling.crash_disarm_s:
                self.disarm(VehicleEvent.CRASHED)
        elif self._lifting_s is not None:
            self._lifting_s -= dt
            if self._lifting_s <= 0:
                self._lift_off()
        elif self.armed:
            landed = self._has_flown or self.mode in (FlightMode.RETURN, FlightMode.LAND)
            if self._stood_s >= (handling.landed_disarm_s if landed else handling.idle_disarm_s):
                self.disarm(VehicleEvent.AUTO_DISARMED)

    def _lift_off(self) -> None:
        self._lifting_s, self._has_flown = None, True
        self.events.append(VehicleEvent.TAKEOFF)
        self._steer_to_target()
        climbs = self.takeoff_up is not None
        self._activity = Activity.CLIMB if climbs else Activity.TRACK
        self.landed = Landed.TAKEOFF if climbs else Landed.IN_AIR

    def _touch_down(self) -> None:
        self.touched_m_s = -self.body.v_up
        self._past = None
        self.crashed = self.crashed or self.touched_m_s > _HARD_M_S
        self.body.stop(upright=not self.crashed)
        self.events += (
            [VehicleEvent.TOUCHED, VehicleEvent.TIPPED] if self.crashed and self.armed else [VehicleEvent.TOUCHED]
        )
        if not self.armed:
            self._activity = Activity.REST
        else:
            self._activity = Activity.WRECK if self.crashed else Activity.TOUCHED
        self.landed = self.landed if self.armed else Landed.ON_GROUND
        self._stood_s = 0.0
        self.blind = False
