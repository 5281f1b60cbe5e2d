"""How PX4 takes missions, fences and rally points, and what it flies of a mission.

An upload is acknowledged before the mission is judged, so the ACK says nothing about whether it will fly; until the
judgement is there the one before stands, and MISSION_START right behind an upload is denied, as recorded.
"""

from collections.abc import Callable
from math import hypot, isfinite

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation import fence
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.mission_items import FLOWN, NAVIGATION, WAYPOINTS, MissionRules
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Home, Point
from rtshcua.simulation.plan import AMSL_FRAMES, FENCE, MISSION, PLACELESS_FRAME, RALLY, RELATIVE_FRAMES, Item
from rtshcua.simulation.transfer import ACCEPTED, ERROR, UNSUPPORTED, UNSUPPORTED_FRAME, TransferRules
from rtshcua.simulation.vehicle import Vehicle

FARTHEST_FIRST_M = 10_000.0
"""MIS_DIST_1WP: farther than this from home the first waypoint may not be."""


def _check(kind: int, _number: int, item: Item) -> int:
    if item.frame not in AMSL_FRAMES | RELATIVE_FRAMES | {PLACELESS_FRAME}:
        return UNSUPPORTED_FRAME
    known = {MISSION: FLOWN, FENCE: fence.COMMANDS - {fence.RETURN_POINT}, RALLY: {mavlink.MAV_CMD_NAV_RALLY_POINT}}
    if item.command not in known[kind] or (item.frame == PLACELESS_FRAME and item.command in WAYPOINTS):
        return UNSUPPORTED
    return ACCEPTED


def _check_all(kind: int, items: tuple[Item, ...]) -> int:
    return ERROR if kind == FENCE and fence.problem(items) else ACCEPTED


def _judge(items: tuple[Item, ...], _vehicle: Vehicle, home: Home, allows: Callable[[Point], bool]) -> bool:
    """The feasibility check: every place inside the fence, the first one not too far; else the mission is not flown."""
    first = True
    for item in items:
        if item.command not in NAVIGATION or not item.has_place:
            continue
        north, east = home.local(item.x, item.y)
        up = item.z - home.amsl_mm / 1000 if item.frame in AMSL_FRAMES else item.z
        if not allows(Point(north, east, up if isfinite(up) else 0.0)):
            return False
        if first and hypot(north, east) > FARTHEST_FIRST_M:
            return False
        first = False
    return bool(items)


def on_plan(_a: Autopilot, _kind: int) -> None:
    """PX4 says nothing but the ACK."""


TRANSFER = TransferRules(
    learns_int=True,
    retry_us=250_000,
    abort_us=5_000_000,
    on_abort=None,
    out_of_order=None,
    busy=ERROR,
    opens_downloads=True,
    capacity={MISSION: 500, FENCE: 64, RALLY: 32},
    check=_check,
    check_all=_check_all,
)
MISSIONS = MissionRules(
    first=0,
    judge=_judge,
    may_enter=lambda _items, _vehicle: True,
    judged_us=150_000,
    waits_for_start=False,
    return_is_mode=True,
    after=Mode.LOITER,
    accept_m=2.0,
    tells_all=True,
    text=lambda _number, _item: None,
)
