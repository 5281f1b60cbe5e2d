"""The vehicle's state machine: armed or not, on the ground or in the air, and what it may be told. Metres, seconds.

It is the same for both flavours; `Handling` and the mode table hold what differs.
"""

from rtshcua.simulation.activity import Activity, Event, Landed
from rtshcua.simulation.flight import Flight
from rtshcua.simulation.ground import Ground
from rtshcua.simulation.handling import Handling
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_HARD_M_S = 4.0
"""Who comes down faster than this breaks."""


class Vehicle(Flight):
    """A multirotor on the ground at home, disarmed."""

    def __init__(self, handling: Handling, mode: Mode) -> None:
        super().__init__(handling, mode)
        self._ground = Ground(handling)
        self.paused = False
        """Whether it stands still on its way to a target, until told to go on (ArduCopter)."""

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
        self.destination, self.sent, self.paused = None, False, False
        self._ground.stay()
        if self._activity in (Activity.REST, Activity.TOUCHED, Activity.WRECK):
            self._activity, self.landed = Activity.REST, Landed.ON_GROUND
        else:
            self._activity = Activity.FALL
            self.landed = Landed.ON_GROUND  # autopilots call a vehicle landed that is disarmed, wherever it is
        self.events.append(event)
        if self.handling.after_landing is not None and not self.in_air:
            self.mode = self.handling.after_landing

    def crash(self) -> None:
        """Has flown into something: it falls. The motors are on, for all that the autopilot knows."""
        if not self.crashed:
            self.crashed = True
            self._activity = Activity.FALL
            self.body.crash()

    def set_mode(self, mode: Mode) -> None:
        """Enters a mode and begins what it does; every mode but TAKEOFF, RETURN and LAND holds the place.

        The mode that it is in already changes nothing: neither autopilot enters it again, and PX4 in Hold flies on to
        the target of a DO_REPOSITION (recorded). PX4: `UserModeIntention::change`; ArduCopter: `Copter::set_mode`
        returns at once.
        """
        if mode is self.mode:
            return
        if self.handling.forgets_speed:
            self._speed = None
        self.mode = mode
        self._nose = None
        self.blind = self.sent = self.paused = False
        self.destination = None
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
            self._hold(Activity.CLIMB, up)
            self.landed = Landed.TAKEOFF
        else:
            self._lift(self._believed(self.body.north, self.body.east, up))
        self.sent = False

    def _lift(self, target: Point) -> None:
        """Runs up the motors; when they carry, it flies to `target`, straight up first if that is a takeoff."""
        if not self.crashed:
            self.target = self.destination = target
            self._ground.run_up()

    def hold(self, up: float | None = None) -> None:
        """Stops as soon as it can and stays there, or goes to another height."""
        if self.flies:
            self._hold(up=up)

    def pause(self) -> None:
        """Stops on its way; the target stays what it is, and so does one that comes meanwhile, until `go_on`."""
        if self.flies and not self.paused:
            destination, sent = self.destination, self.sent
            self._hold()
            self.destination, self.sent, self.paused = destination, sent, True

    def go_on(self) -> None:
        """Goes on to the target after a pause."""
        if self.paused:
            self.paused = False
            if self.sent and self.destination is not None:
                self.go_to(self.destination)

    def turn_to(self, nose: float) -> None:
        """Points the nose there, in radians from north, until the mode or the target changes."""
        self._nose = nose

    def land_here(self) -> None:
        """Descends and lands, whatever the mode."""
        if self.flies:
            self._hold(Activity.DESCEND, self.body.up)
            self._waiting_s = 0.0
            self.landed = Landed.LANDING

    def return_home(self) -> None:
        """Climbs to the height of the way home, flies home and lands, whatever the mode."""
        if self.flies:
            body = self.body
            self._hold(Activity.RETURN_CLIMB, max(body.up, self.handling.return_up))
            if self.handling.comes_back:
                self.target = self.destination = self._believed(body.north, body.east, self.target.up)
                self._steer_to_target()

    def wait(self, seconds: float) -> None:
        """Keeps its height for so long before it goes on landing."""
        self._waiting_s = seconds

    def go_to(self, target: Point) -> None:
        """Flies straight to `target`; on the ground it does nothing, or lifts off if armed, as the flavour does."""
        if self.flies:
            if self.handling.forgets_at_first_target and self.mode is Mode.GUIDED and not self.sent:
                self._speed = None
            self.destination, self.sent = target, True
            if self.paused:
                return
            self.target = target
            self._nose = None
            self._steer_to_target()
            self._activity = Activity.TRACK
            self.landed = Landed.IN_AIR
        elif self.armed and not self.in_air and self.handling.lifts_to_targets and target.up > self.body.up:
            self._lift(target)

    def shift_east(self, metres: float) -> None:
        """Moves the place that it holds, or lands at."""
        if self.flies:
            self.target = Point(self.target.north, self.target.east + metres, self.target.up)

    def circle(self, centre: Point, radius: float) -> None:
        """Flies around a place, clockwise seen from above if the radius is positive, until told otherwise."""
        if self.flies:
            self.target, self._radius = centre, radius
            self._activity = Activity.CIRCLE
            self.landed = Landed.IN_AIR

    # ---------------------------------------------------------------------------------------------- on the ground

    def _stand(self, dt: float) -> None:
        if self._activity is Activity.TOUCHED:
            if self._ground.has_landed(dt):
                self._activity = Activity.REST
                self.landed = Landed.ON_GROUND
                self.events.append(Event.LANDED)
        elif self._activity is Activity.WRECK:
            after_s = self.handling.crash_disarm_s
            if self.armed and after_s is not None and self._ground.has_lain(dt, after_s):
                self.disarm(Event.CRASHED)
        elif self._ground.lifting:
            if self._ground.lifts_off(dt):
                self._lift_off()
        elif self.armed and self._ground.has_done(dt, self.mode in (Mode.RETURN, Mode.LAND)):
            self.disarm(Event.AUTO_DISARMED)

    def _lift_off(self) -> None:
        self.events.append(Event.TAKEOFF)
        self._steer_to_target()
        climbs = self.takeoff_up is not None
        self._activity = Activity.CLIMB if climbs else Activity.TRACK
        self.landed = Landed.TAKEOFF if climbs else Landed.IN_AIR

    def _touch_down(self) -> None:
        self.touched_m_s = -self.body.v_up
        self.crashed = self.crashed or self.touched_m_s > _HARD_M_S
        self.body.stop(upright=not self.crashed)
        self.events += [Event.TOUCHED, Event.TIPPED] if self.crashed and self.armed else [Event.TOUCHED]
        if not self.armed:
            self._activity = Activity.REST
        else:
            self._activity = Activity.WRECK if self.crashed else Activity.TOUCHED
        self.landed = self.landed if self.armed else Landed.ON_GROUND
        self._ground.touch()
        self.blind = False
