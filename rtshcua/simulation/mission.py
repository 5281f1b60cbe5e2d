"""Fly an uploaded mission item by item while the mode is MISSION, and the mission rules of a flavour."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from math import hypot, isfinite

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message, maker
from rtshcua.model.faults import FlightMode
from rtshcua.simulation import mission_protocol
from rtshcua.simulation.mission_protocol import AMSL_FRAMES, FENCE, MISSION, PlanItem, Plans
from rtshcua.simulation.place import HomePosition, Point
from rtshcua.simulation.vehicle import Landed, Multirotor

_MISSION_CURRENT = maker(mavlink.MAVLink_mission_current_message)

_ARRIVED_UP_M = 1.0
_IN_MISSION, _SUSPENDED = 1, 2


class MissionState(IntEnum):
    """MISSION_CURRENT.mission_state (MISSION_STATE)."""

    UNKNOWN = 0
    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class MissionRules:
    """The mission behaviour that depends on the flavour."""

    judge: Callable[[tuple[PlanItem, ...], Multirotor, HomePosition, Callable[[Point], bool]], bool]
    """Returns whether a mission can be flown; the last argument checks points against the fence."""
    first: int = 0
    """The slot of the first item that is flown."""
    may_enter: Callable[[tuple[PlanItem, ...], Multirotor], bool] = lambda _items, _vehicle: True
    """Returns whether the mode may be entered with a valid mission."""
    judged_us: int = 0
    """The delay from an upload to its check; until then the previous result holds."""
    waits_for_start: bool = False
    """Whether on the ground only MISSION_START begins the mission, not the mode alone."""
    return_is_mode: bool = False
    """Whether a return item changes the mode."""
    after: FlightMode | None = None
    """The mode after the last item, in the air; None keeps the mode and holds."""
    accept_m: float = 2.0
    """The acceptance radius of a waypoint that does not name one."""
    tells_all: bool = False
    """Whether MISSION_ITEM_REACHED is also sent for items that take no time."""
    text: Callable[[int, PlanItem], str | None] = lambda _number, _item: None
    """Returns the text that is sent when a navigation item begins."""


class MissionProgress:
    """The mission of one vehicle and its progress. `where` returns the estimated position."""

    def __init__(
        self,
        rules: MissionRules,
        stored: Plans,
        vehicle: Multirotor,
        home: HomePosition,
        allows: Callable[[Point], bool],
        where: Callable[[], Point],
        send: Callable[[Message], None],
        say: Callable[[int, str], None],
    ) -> None:
        self._rules = rules
        self._stored = stored
        self._vehicle = vehicle
        self._home = home
        self._allows = allows
        self._where = where
        self._send = send
        self._say = say
        self._judge_at_us: int | None = None
        self._now_us = 0
        self._begun = False
        self._arrived_us: int | None = None
        self._started = False
        self._entered = False
        self._jumps: dict[int, int] = {}
        self.current = 0
        """The current item."""
        self.valid = False
        """Whether the mission passed the vehicle's check."""
        self.state = MissionState.NO_MISSION
        stored.listeners.append(self._plan_changed)

    # -------------------------------------------------------------------------------------------- from outside

    @property
    def items(self) -> tuple[PlanItem, ...]:
        """All items, including home in slot 0 if the flavour has it."""
        return self._stored.items(MISSION)

    @property
    def running(self) -> bool:
        """Whether the mission is being flown."""
        return self._vehicle.mode is FlightMode.MISSION and self.state is MissionState.ACTIVE

    def may_enter(self) -> bool:
        """Return whether MISSION may be entered now."""
        return self.valid and self._rules.may_enter(self.items, self._vehicle)

    def start(self, first: int | None = None) -> bool:
        """Handle MISSION_START, from item `first` if given. Return False if there is nothing to start."""
        if not self.valid or (first is not None and not self.select(first)):
            return False
        if self.state is MissionState.COMPLETE:
            self._rewind()
        self._started = True
        return True

    def select(self, number: int) -> bool:
        """Handle MISSION_SET_CURRENT: make another item the current one. Return False if there is no such item."""
        if not 0 <= number < len(self.items):
            return False
        self.current = max(number, self._rules.first)
        self._begun, self._arrived_us = False, None
        if self.state is MissionState.COMPLETE:
            self.state = MissionState.NOT_STARTED
        self._send(self.message())
        return True

    def message(self) -> Message:
        """Return MISSION_CURRENT. `total` counts the items without home; PX4 sends no `mission_mode`."""
        first = self._rules.first
        mode = (_IN_MISSION if self._vehicle.mode is FlightMode.MISSION else _SUSPENDED) if first else 0
        total = max(0, len(self.items) - first)
        return _MISSION_CURRENT(self.current, total, self.state, mode)

    def tell_current(self) -> None:
        """Send a text for the current item if it is a navigation item and the flavour has a text."""
        item = self.items[self.current]
        text = self._rules.text(self.current, item) if item.command in mission_protocol.NAVIGATION else None
        if text is not None:
            self._say(mavlink.MAV_SEVERITY_INFO, text)

    def _plan_changed(self, kind: int) -> None:
        if kind == MISSION:
            self._rewind()
            self._judge_at_us = self._now_us + self._rules.judged_us
            if not self._rules.judged_us:
                self._judge()
        elif kind == FENCE and self._rules.judged_us and self.state in (MissionState.UNKNOWN, MissionState.NOT_STARTED):
            self._judge_at_us = self._now_us + self._rules.judged_us

    def _judge(self) -> None:
        self._judge_at_us = None
        self.valid = self._rules.judge(self.items, self._vehicle, self._home, self._allows)
        if len(self.items) <= self._rules.first:
            self.state = MissionState.NO_MISSION
        else:
            self.state = MissionState.NOT_STARTED if self.valid else MissionState.UNKNOWN
        if not self.valid and self._vehicle.mode is FlightMode.MISSION:
            self._vehicle.set_mode(FlightMode.LOITER)
        self._send(self.message())

    def _rewind(self) -> None:
        self.current = min(self._rules.first, max(0, len(self.items) - 1))
        self._begun, self._arrived_us, self._started = False, None, False
        self._jumps.clear()
        if self.state is MissionState.COMPLETE:
            self.state = MissionState.NOT_STARTED

    # ------------------------------------------------------------------------------------------------- in time

    def step(self, now_us: int) -> None:
        """Continue the mission if the mode is MISSION."""
        self._now_us = now_us
        if self._judge_at_us is not None and now_us >= self._judge_at_us:
            self._judge()
        if self._vehicle.mode is not FlightMode.MISSION:
            self._entered = False
            if self.state is MissionState.ACTIVE:
                self._begun, self._arrived_us = False, None
                self._report(MissionState.PAUSED)
            return
        if not self._entered:
            self._entered = True
            if self.state is MissionState.COMPLETE:
                self._rewind()
        if not self._may_fly():
            return
        if self.state is not MissionState.ACTIVE:
            self._report(MissionState.ACTIVE)
        here = self._where()
        for _ in range(len(self.items)):
            if not self._step_item(self.items[self.current], here):
                return

    def _may_fly(self) -> bool:
        vehicle = self._vehicle
        if not vehicle.armed or not self.valid or self.state is MissionState.COMPLETE:
            return False
        return vehicle.in_air or self._begun or self._started or not self._rules.waits_for_start

    def _report(self, state: MissionState) -> None:
        self.state = state
        self._send(self.message())

    def _step_item(self, item: PlanItem, here: Point) -> bool:
        """Begin the current item or check whether it is done; return whether the next item may begin now."""
        if not self._begun:
            self._begun, self._arrived_us = True, None
            self.tell_current()
            self._begin(item, here)
        if not self._is_done(item, here):
            return False
        if item.command in mission_protocol.NAVIGATION or self._rules.tells_all:
            self._send(mavlink.MAVLink_mission_item_reached_message(self.current))
        return self._advance(item)

    def _advance(self, item: PlanItem) -> bool:
        self._begun = False
        following = self.current + 1
        if item.command == mission_protocol.JUMP:
            done = self._jumps.get(self.current, 0)
            if (item.p2 < 0 or done < item.p2) and self._rules.first <= item.p1 < len(self.items):
                self._jumps[self.current] = done + 1
                following = int(item.p1)
        if following < len(self.items) and (item.command != mission_protocol.RETURN or not self._rules.return_is_mode):
            self.current = following
            self._send(self.message())
            return True
        self.state = MissionState.COMPLETE
        self._started = False
        if self._vehicle.in_air and self._vehicle.mode is FlightMode.MISSION:
            if self._rules.after is not None:
                self._vehicle.set_mode(self._rules.after)
            else:
                self._vehicle.hold()
        self._send(self.message())
        return False

    def _begin(self, item: PlanItem, here: Point) -> None:
        vehicle, command = self._vehicle, item.command
        if command == mission_protocol.TAKEOFF or (command in mission_protocol.WAYPOINTS and not vehicle.in_air):
            self._climb(self._up(item, here))
        elif command in mission_protocol.WAYPOINTS:
            vehicle.go_to(self._place(item, here))
        elif command == mission_protocol.LAND and item.has_place:
            vehicle.go_to(Point(*self._home.local(item.x, item.y), here.up))
        elif command == mission_protocol.LAND:
            vehicle.land_here()
        elif command == mission_protocol.RETURN and self._rules.return_is_mode:
            vehicle.set_mode(FlightMode.RETURN)
        elif command == mission_protocol.RETURN:
            vehicle.return_home()
        elif command == mission_protocol.SPEED and item.p2 > 0:
            vehicle.speed = item.p2

    def _climb(self, up: float) -> None:
        vehicle = self._vehicle
        if not vehicle.in_air or up > vehicle.body.up:
            vehicle.takeoff_up = up if up > 0 else vehicle.handling.takeoff_up
            vehicle.climb()

    def _is_done(self, item: PlanItem, here: Point) -> bool:
        vehicle, command = self._vehicle, item.command
        climbing = not vehicle.in_air or vehicle.landed is Landed.TAKEOFF
        if command == mission_protocol.TAKEOFF:
            return not climbing
        if command in mission_protocol.WAYPOINTS:
            if climbing:
                return False
            place = self._place(item, here)
            if vehicle.target != place:  # from the ground it climbs first
                vehicle.go_to(place)
            return (
                self._has_arrived(item, place, here)
                and command != mission_protocol.LOITER
                and self._has_waited(item.p1)
            )
        if command == mission_protocol.DELAY:
            return self._has_waited(item.p1)
        if command == mission_protocol.LAND:
            if item.has_place and vehicle.landed is Landed.IN_AIR and self._is_near(vehicle.target, here):
                vehicle.land_here()
            return not vehicle.in_air
        return command != mission_protocol.RETURN or self._rules.return_is_mode or not vehicle.in_air

    def _has_arrived(self, item: PlanItem, place: Point, here: Point) -> bool:
        """Return whether it has arrived, now or earlier: gusts may carry it away while it waits."""
        if self._arrived_us is not None:
            return True
        accept = item.p2 if item.command == mission_protocol.WAYPOINT and item.p2 > 0 else self._rules.accept_m
        return self._is_near(place, here, accept) and abs(place.up - here.up) < _ARRIVED_UP_M

    def _is_near(self, place: Point, here: Point, accept_m: float | None = None) -> bool:
        away = hypot(place.north - here.north, place.east - here.east)
        return away < (self._rules.accept_m if accept_m is None else accept_m)

    def _has_waited(self, seconds: float) -> bool:
        if self._arrived_us is None:
            self._arrived_us = self._now_us
        return not seconds > 0 or self._now_us - self._arrived_us >= seconds * 1_000_000

    def _place(self, item: PlanItem, here: Point) -> Point:
        """Return the place of an item; an item without a place is at the current target."""
        up = self._up(item, here)
        if not item.has_place:
            return Point(self._vehicle.target.north, self._vehicle.target.east, up)
        return Point(*self._home.local(item.x, item.y), up)

    def _up(self, item: PlanItem, here: Point) -> float:
        if not isfinite(item.z):
            return here.up
        return item.z - self._home.amsl_mm / 1000 if item.frame in AMSL_FRAMES else item.z
