"""The vehicle's side of the MAVLink mission protocol: items of missions, fences and rally points, and their transfer.

One upload, download or clearing at a time. `TransferRules` holds the differences of PX4 and ArduCopter. An upload takes
effect as a whole when its last item has arrived.
https://mavlink.io/en/services/mission.html
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
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
"""The items that fly to a place."""
NAVIGATION = WAYPOINTS | frozenset({RETURN, LAND, TAKEOFF, DELAY})
"""The items that take time."""
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
"""Items for cameras and gimbals, which this vehicle lacks: they complete at once."""
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
    """One item: the place in 1e-7 degree, the altitude `z` in metres above the datum of `frame` (MAV_FRAME)."""

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
        """Whether it names a place: latitude and longitude 0 mean none."""
        return self.frame != PLACELESS_FRAME and (self.x, self.y) != (0, 0)


def from_message(message: Message) -> PlanItem | None:
    """Return the item of a MISSION_ITEM_INT or MISSION_ITEM; None if its place is invalid."""
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
    """Return the item as MISSION_ITEM_INT if `whole`, otherwise as MISSION_ITEM; `to` is (system, component)."""
    parts = (item.p1, item.p2, item.p3, item.p4)
    head = (*to, sequence, item.frame, item.command, 0, item.autocontinue, *parts)
    if whole:
        return mavlink.MAVLink_mission_item_int_message(*head, item.x, item.y, item.z, kind)
    scale = 1.0 if item.frame == PLACELESS_FRAME else 1e-7
    return mavlink.MAVLink_mission_item_message(*head, item.x * scale, item.y * scale, item.z, kind)


def draws_no_fence(items: Sequence[PlanItem]) -> bool:
    """Return whether the items are no valid fence: too few vertices, mixed counts, or a circle without a radius."""
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
    """The stored plan of each kind. `listeners` are notified of changes."""

    def __init__(self) -> None:
        self._items: dict[int, tuple[PlanItem, ...]] = dict.fromkeys(KINDS, ())
        self.listeners: list[Callable[[int], None]] = []
        """Called with the kind after each change."""

    def items(self, kind: int) -> tuple[PlanItem, ...]:
        """Return the items of a kind, in order."""
        return self._items[kind]

    def replace(self, kind: int, items: Sequence[PlanItem]) -> None:
        """Replace all items of a kind."""
        self._items[kind] = tuple(items)
        self._tell(kind)

    def read_again(self) -> None:
        """Notify the listeners of each stored kind, as after a restart."""
        for kind, items in self._items.items():
            if items:
                self._tell(kind)

    def _tell(self, kind: int) -> None:
        for listener in self.listeners:
            listener(kind)


ACCEPTED: int = mavlink.MAV_MISSION_ACCEPTED
ERROR: int = mavlink.MAV_MISSION_ERROR
UNSUPPORTED: int = mavlink.MAV_MISSION_UNSUPPORTED
UNSUPPORTED_FRAME: int = mavlink.MAV_MISSION_UNSUPPORTED_FRAME
_FRAMES = AMSL_FRAMES | RELATIVE_FRAMES | {PLACELESS_FRAME}

Peer = tuple[int, int]
"""(system, component) of the other end."""


@dataclass(frozen=True, slots=True)
class TransferRules:
    """The behaviour of a flavour in the protocol."""

    retry_us: int
    abort_us: int
    busy: int
    """The result for an upload by another sender during an upload."""
    capacity: tuple[int, int, int]
    """The greatest number of items: missions, fences, rally points."""
    fence_items: frozenset[int]
    """The allowed commands of fence items."""
    on_abort: int | None = None
    """The result when it abandons an upload; None: no message."""
    out_of_order: int | None = None
    """The result for an unexpected item; None: no message."""
    learns_int: bool = False
    """Whether it requests with MISSION_REQUEST_INT after the first item of that form; else with MISSION_REQUEST."""
    opens_downloads: bool = False
    """Whether items can be requested only after MISSION_REQUEST_LIST; it then repeats unacknowledged items."""
    keeps_home: bool = False
    """Whether slot 0 of a mission is home and is not checked."""

    def check(self, kind: int, number: int, item: PlanItem) -> int:
        """Return the MAV_MISSION_RESULT of an item."""
        if item.frame not in _FRAMES:
            return UNSUPPORTED_FRAME
        if self.keeps_home and kind == MISSION and number == 0:
            return ACCEPTED
        known = {MISSION: FLOWN, FENCE: self.fence_items, RALLY: {mavlink.MAV_CMD_NAV_RALLY_POINT}}[kind]
        if item.command not in known or (item.frame == PLACELESS_FRAME and item.command in WAYPOINTS):
            return UNSUPPORTED
        return ACCEPTED


@dataclass(slots=True)
class _Upload:
    peer: Peer
    kind: int
    count: int
    heard_us: int
    asked_us: int
    items: list[PlanItem] = field(default_factory=list)


@dataclass(slots=True)
class _Download:
    peer: Peer
    kind: int
    heard_us: int
    sent_us: int
    whole: bool = True
    next: int = 0


class Transfer:
    """The vehicle's side. `stored` returns the items of a download, `may_clear` whether a kind may be cleared."""

    def __init__(
        self,
        rules: TransferRules,
        kept: Plans,
        send: Callable[[Message], None],
        stored: Callable[[int], tuple[PlanItem, ...]],
        may_clear: Callable[[int], bool],
    ) -> None:
        self._rules = rules
        self._plans = kept
        self._send = send
        self._stored = stored
        self._may_clear = may_clear
        self._upload: _Upload | None = None
        self._download: _Download | None = None
        self._asks_int = False

    # --------------------------------------------------------------------------------------------- upload

    def count(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_COUNT: begin an upload."""
        upload, rules, kind, count = self._upload, self._rules, message.mission_type, message.count
        if kind not in KINDS:
            return self._ack(peer, UNSUPPORTED, kind)
        if upload is not None and upload.peer != peer:
            return self._ack(peer, rules.busy, kind)
        if count > rules.capacity[kind]:
            return self._ack(peer, mavlink.MAV_MISSION_NO_SPACE, kind)
        self._download = None
        if count == 0:
            self._upload = None
            return self._clear(peer, (kind,), kind)
        self._upload = _Upload(peer, kind, count, now_us, now_us)
        return self._ask(self._upload, now_us)

    def item(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_ITEM or MISSION_ITEM_INT: keep the requested item and request the next."""
        upload, rules, kind = self._upload, self._rules, message.mission_type
        expected = upload is not None and (upload.peer, upload.kind) == (peer, kind)
        if upload is None or not expected or message.seq != len(upload.items):
            if rules.out_of_order is not None:
                self._ack(peer, rules.out_of_order, kind)
            return
        self._asks_int = rules.learns_int and message.get_type() == "MISSION_ITEM_INT"
        item = from_message(message)
        result = mavlink.MAV_MISSION_INVALID_PARAM5_X if item is None else rules.check(kind, message.seq, item)
        if item is None or result != ACCEPTED:
            self._upload = None
            self._ack(peer, result, kind)
            return
        upload.items.append(item)
        upload.heard_us = now_us
        if len(upload.items) < upload.count:
            self._ask(upload, now_us)
        else:
            self._upload = None
            self._store(peer, kind, tuple(upload.items))

    def _store(self, peer: Peer, kind: int, items: tuple[PlanItem, ...]) -> None:
        result = ERROR if kind == FENCE and draws_no_fence(items) else ACCEPTED
        self._ack(peer, result, kind)
        if result == ACCEPTED:
            self._plans.replace(kind, items)

    def clear_all(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_CLEAR_ALL."""
        kind = message.mission_type
        if kind != ALL and kind not in KINDS:
            return self._ack(peer, UNSUPPORTED, kind)
        if self._upload is not None:
            return self._ack(peer, self._rules.busy, kind)
        return self._clear(peer, KINDS if kind == ALL else (kind,), kind)

    def _clear(self, peer: Peer, kinds: tuple[int, ...], named: int) -> None:
        allowed = all(self._may_clear(kind) for kind in kinds)
        self._ack(peer, ACCEPTED if allowed else ERROR, named)
        for kind in kinds if allowed else ():
            self._plans.replace(kind, ())

    def _ask(self, upload: _Upload, now_us: int) -> None:
        upload.asked_us = now_us
        kind = mavlink.MAVLink_mission_request_message
        if self._asks_int:
            kind = mavlink.MAVLink_mission_request_int_message
        self._send(kind(*upload.peer, len(upload.items), upload.kind))

    # ------------------------------------------------------------------------------------------- download

    def request_list(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_REQUEST_LIST: send the number of items."""
        kind = message.mission_type
        if self._upload is not None:
            return self._ack(peer, self._rules.busy, kind)
        if kind not in KINDS:
            return self._ack(peer, UNSUPPORTED, kind)
        if self._rules.opens_downloads and self._stored(kind):
            self._download = _Download(peer, kind, now_us, now_us)
        return self._send(mavlink.MAVLink_mission_count_message(*peer, len(self._stored(kind)), kind))

    def request(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_REQUEST or MISSION_REQUEST_INT: send one item in the requested form."""
        kind, number = message.mission_type, message.seq
        whole = message.get_type() == "MISSION_REQUEST_INT"
        items = self._stored(kind) if kind in KINDS else ()
        if number >= len(items):
            return self._ack(peer, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)
        download = self._download
        if self._rules.opens_downloads:
            if download is None or (download.peer, download.kind) != (peer, kind):
                return self._ack(peer, ERROR, kind)
            download.heard_us, download.sent_us, download.next, download.whole = now_us, now_us, number + 1, whole
        return self._send_item(peer, kind, number, whole)

    def acknowledged(self, peer: Peer, message: Message, now_us: int) -> None:
        """Handle MISSION_ACK: the peer is done, gives up, or requires the other form of request."""
        result = message.type
        if self._download is not None and self._download.peer == peer:
            self._download = None
        upload = self._upload
        if upload is None or upload.peer != peer or result == ACCEPTED:
            return
        if result == UNSUPPORTED and self._rules.learns_int:
            self._asks_int = not self._asks_int
            self._ask(upload, now_us)
        else:
            self._upload = None

    def _send_item(self, peer: Peer, kind: int, number: int, whole: bool) -> None:
        self._send(to_message(self._stored(kind)[number], number, kind, peer, whole))

    # ----------------------------------------------------------------------------------------------- time

    def step(self, now_us: int) -> None:
        """Repeat overdue requests and abandon transfers that timed out."""
        rules, upload, download = self._rules, self._upload, self._download
        if upload is not None:
            if now_us - upload.heard_us > rules.abort_us:
                self._upload = None
                if rules.on_abort is not None:
                    self._ack(upload.peer, rules.on_abort, upload.kind)
            elif now_us - upload.asked_us > rules.retry_us:
                self._ask(upload, now_us)
        if download is not None:
            if now_us - download.heard_us > rules.abort_us:
                self._download = None
            elif now_us - download.sent_us > rules.retry_us:
                self._send_again(download, now_us)

    def _send_again(self, download: _Download, now_us: int) -> None:
        download.sent_us = now_us
        count = len(self._stored(download.kind))
        if download.next == 0:
            self._send(mavlink.MAVLink_mission_count_message(*download.peer, count, download.kind))
        elif download.next <= count:
            self._send_item(download.peer, download.kind, download.next - 1, download.whole)

    def _ack(self, peer: Peer, result: int, kind: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(*peer, result, kind))
