"""How ArduCopter takes missions, fences and rally points, and what it flies of a mission.

It asks for items with the legacy MISSION_REQUEST and takes either form. Slot 0 of a mission is home, whatever was
uploaded there. Whether a waypoint is outside the fence it asks neither at upload nor at the start.
"""

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation import fence
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.mission_items import (
    FLOWN,
    LAND,
    LOITER,
    LOITER_TIME,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    WAYPOINTS,
    MissionRules,
)
from rtshcua.simulation.place import Home, Point
from rtshcua.simulation.plan import AMSL_FRAMES, FENCE, MISSION, PLACELESS_FRAME, RALLY, RELATIVE_FRAMES, Item
from rtshcua.simulation.transfer import ACCEPTED, ERROR, UNSUPPORTED, UNSUPPORTED_FRAME, TransferRules
from rtshcua.simulation.vehicle import Vehicle

_NAMES = {WAYPOINT: "WP", TAKEOFF: "Takeoff", LAND: "Land", RETURN: "RTL", LOITER: "LoitUnlim", LOITER_TIME: "LoitTime"}


def home_item(home: Home) -> Item:
    """Slot 0 of every mission."""
    return Item(WAYPOINT, mavlink.MAV_FRAME_GLOBAL, x=home.latitude, y=home.longitude, z=home.amsl_mm / 1000)


def _check(kind: int, number: int, item: Item) -> int:
    if item.frame not in AMSL_FRAMES | RELATIVE_FRAMES | {PLACELESS_FRAME}:
        return UNSUPPORTED_FRAME
    if kind == MISSION and number == 0:
        return ACCEPTED  # home: it is not looked at
    known = {MISSION: FLOWN, FENCE: fence.COMMANDS, RALLY: {mavlink.MAV_CMD_NAV_RALLY_POINT}}
    if item.command not in known[kind] or (item.frame == PLACELESS_FRAME and item.command in WAYPOINTS):
        return UNSUPPORTED
    return ACCEPTED


def _check_all(kind: int, items: tuple[Item, ...]) -> int:
    return ERROR if kind == FENCE and fence.problem(items) else ACCEPTED


def _judge(items: tuple[Item, ...], _vehicle: Vehicle, _home: Home, _allows: Callable[[Point], bool]) -> bool:
    return len(items) > 1


def _may_enter(items: tuple[Item, ...], vehicle: Vehicle) -> bool:
    """Armed and on the ground, only a mission whose first item that takes time is a takeoff."""
    on_ground = vehicle.armed and not vehicle.in_air
    return not on_ground or next((item.command for item in items[1:] if item.command in _NAMES), None) == TAKEOFF


def on_plan(a: Autopilot, kind: int) -> None:
    """Tells that a plan was stored, and how many items it has."""
    if kind == MISSION:
        a.say(mavlink.MAV_SEVERITY_INFO, "Flight plan received")
    elif kind == FENCE:
        a.say(mavlink.MAV_SEVERITY_DEBUG, "Fence Indexed OK")
    name = {MISSION: "MIS_TOTAL", FENCE: "FENCE_TOTAL", RALLY: "RALLY_TOTAL"}[kind]
    a.send(a.parameters.assign(name, len(a.plans.items(kind))))


TRANSFER = TransferRules(
    learns_int=False,
    retry_us=1_000_000,
    abort_us=8_000_000,
    on_abort=mavlink.MAV_MISSION_OPERATION_CANCELLED,
    out_of_order=mavlink.MAV_MISSION_INVALID_SEQUENCE,
    busy=mavlink.MAV_MISSION_DENIED,
    opens_downloads=False,
    capacity={MISSION: 724, FENCE: 84, RALLY: 10},
    check=_check,
    check_all=_check_all,
)
MISSIONS = MissionRules(
    first=1,
    judge=_judge,
    may_enter=_may_enter,
    judged_us=0,
    waits_for_start=True,
    return_is_mode=False,
    after=None,
    accept_m=2.0,
    tells_all=False,
    text=lambda number, item: f"Mission: {number} {_NAMES.get(item.command, 'Delay')}",
)
