"""What is uploaded before a flight: missions, fences and rally points, as items of the MAVLink mission protocol.

What the items mean to this vehicle, too. https://mavlink.io/en/services/mission.html
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message

MISSION = mavlink.MAV_MISSION_TYPE_MISSION
FENCE = mavlink.MAV_MISSION_TYPE_FENCE
RALLY = mavlink.MAV_MISSION_TYPE_RALLY
ALL = mavlink.MAV_MISSION_TYPE_ALL
KINDS = (MISSION, FENCE, RALLY)

AMSL_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
RELATIVE_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})
PLACELESS_FRAME = mavlink.MAV_FRAME_MISSION
_LARGEST_E7 = 1_800_000_000

WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
LOITER = mavlink.MAV_CMD_NAV_LOITER_UNLIM
LOITER_TIME = mavlink.MAV_CMD_NAV_LOITER_TIME
RETURN = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
LAND = mavlink.MAV_CMD_NAV_LAND
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
DELAY = mavlink.MAV_CMD_NAV_DELAY
SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
JUMP = mavlink.MAV_CMD_DO_JUMP
WAYPOINTS = frozenset({WAYPOINT, LOITER, LOITER_TIME})
"""Items that fly to a place."""
NAVIGATION = WAYPOINTS | frozenset({RETURN, LAND, TAKEOFF, DELAY})
"""Items that take time."""
PASSED_BY = frozenset(
    {
        mavlink.MAV_CMD_CONDITION_YAW,
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_SET_CAMERA_MODE,
        mavlink.MAV_CMD_SET_CAMERA_ZOOM,
        mavlink.MAV_CMD_SET_CAMERA_FOCUS,
    }
)
"""Items for cameras and gimbals, of which this vehicle has none: they are done at once."""
FLOWN = NAVIGATION | PASSED_BY | {SPEED, JUMP}

INCLUDED = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
EXCLUDED = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
ROUND_INCLUDED = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
ROUND_EXCLUDED = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
POLYGONS = (INCLUDED, EXCLUDED)
CIRCLES = (ROUND_INCLUDED, ROUND_EXCLUDED)
FENCE_ITEMS = frozenset({*POLYGONS, *CIRCLES, RETURN_POINT})
_FEWEST_VERTICES = 3


@dataclass(frozen=True, slots=True)
class PlanItem:
    """One item; the place in 1e-7 degree, the altitude `z` in metres above what `frame` (MAV_FRAME) says."""

    command: int
    frame: int
    p1: float = 0.0
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: int = 1

    @property
    def has_place(self) -> bool:
        """Whether it names a place: latitude and longitude of nothing mean none."""
        return self.frame != PLACELESS_FRAME and (self.x, self.y) != (0, 0)


def from_message(message: Message) -> PlanItem | None:
    """The item in a MISSION_ITEM_INT, or in a MISSION_ITEM with its degrees; None if its place is no place."""
    m = message
    if m.get_type() == "MISSION_ITEM":
        scale = 1.0 if m.frame == PLACELESS_FRAME else 1e7
        if not isfinite(m.x) or not isfinite(m.y):
            return None
        x, y = round(m.x * scale), round(m.y * scale)
    else:
        x, y = m.x, m.y
    if m.frame != PLACELESS_FRAME and (abs(x) > _LARGEST_E7 // 2 or abs(y) > _LARGEST_E7):
        return None
    if not -(2**31) <= x < 2**31 or not -(2**31) <= y < 2**31:
        return None
    return PlanItem(m.command, m.frame, m.param1, m.param2, m.param3, m.param4, x, y, m.z, m.autocontinue)


def to_message(item: PlanItem, sequence: int, kind: int, to: tuple[int, int], whole: bool) -> Message:
    """The item as MISSION_ITEM_INT if `whole`, else as the older MISSION_ITEM; `to` is (system, component)."""
    parts = (item.p1, item.p2, item.p3, item.p4)
    head = (*to, sequence, item.frame, item.command, 0, item.autocontinue, *parts)
    if whole:
        return mavlink.MAVLink_mission_item_int_message(*head, item.x, item.y, item.z, kind)
    scale = 1.0 if item.frame == PLACELESS_FRAME else 1e-7
    return mavlink.MAVLink_mission_item_message(*head, item.x * scale, item.y * scale, item.z, kind)


def draws_no_fence(items: Sequence[PlanItem]) -> bool:
    """Whether the items draw no fence: vertices too few or of mixed count, a circle without a radius."""
    at = 0
    while at < len(items):
        item = items[at]
        if item.command in CIRCLES:
            if not 0 < item.p1 < inf:
                return True
            at += 1
        elif item.command in POLYGONS:
            if not _FEWEST_VERTICES <= item.p1 < inf:
                return True
            vertices = items[at : at + int(item.p1)]
            if len(vertices) < int(item.p1) or any((v.command, v.p1) != (item.command, item.p1) for v in vertices):
                return True
            at += len(vertices)
        elif item.command == RETURN_POINT:
            at += 1
        else:
            return True
    return False


class Plans:
    """What is stored of each kind. Whoever wants to know of changes adds itself to `listeners`."""

    def __init__(self) -> None:
        self._items: dict[int, tuple[PlanItem, ...]] = dict.fromkeys(KINDS, ())
        self.listeners: list[Callable[[int], None]] = []
        """Called with the kind after each change."""

    def items(self, kind: int) -> tuple[PlanItem, ...]:
        """The items of a kind, in order."""
        return self._items[kind]

    def replace(self, kind: int, items: Sequence[PlanItem]) -> None:
        """Stores other items in place of all of that kind."""
        self._items[kind] = tuple(items)
        self._tell(kind)

    def read_again(self) -> None:
        """Tells of each kind that is stored, as after a start."""
        for kind, items in self._items.items():
            if items:
                self._tell(kind)

    def _tell(self, kind: int) -> None:
        for listener in self.listeners:
            listener(kind)
