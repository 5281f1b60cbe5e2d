"""Upload the policy's airspace as a geofence of the autopilot: a second line of defence that is never narrower than the
policy.

A fence has neither heights nor times, an excluded area has no holes, and autopilots differ in the meaning of several
inclusions. What a fence cannot represent exactly is left out and reported, so that the autopilot never takes over where
the policy permits the vehicle to be. How little a fence protects: docs/adr/0019-what-a-vehicle-says.md.
"""

from collections.abc import Iterator, Sequence
from enum import Enum, auto
from math import isclose, isqrt
from typing import Any, Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, FenceHabits
from rtshcua.adapters.vehicle.messages import FENCE, FenceItem, Message
from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.decision.times import timed
from rtshcua.mavlink import enums
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, Projection, Zone, unproject

INCLUDE_VERTEX: Final = enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
EXCLUDE_VERTEX: Final = enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
INCLUDE_CIRCLE: Final = enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
EXCLUDE_CIRCLE: Final = enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION

Ring = tuple[int, ...]


class Fence(NamedTuple):
    """The items to upload, and the parts of the airspace that they leave out, in words."""

    items: tuple[FenceItem, ...]
    left_out: tuple[str, ...]


def fence_of(policy: Policy, habits: FenceHabits) -> Fence:
    """The fence of a policy's airspace; without items where a fence cannot represent it."""
    airspace = policy.airspace
    if airspace is None:
        return Fence((), ("the policy has no airspace",))
    left_out: list[str] = []
    inside = [policy.zones[number] for number in airspace.inside]
    kept = [zone for zone in inside if _can_include(zone, habits, left_out)]
    if not habits.all_inclusions and len(kept) > 1:
        kept.sort(key=_size)
        left_out += [
            f"`{zone.name}`, because this autopilot joins inclusion zones instead of intersecting them"
            for zone in kept[1:]
        ]
        del kept[1:]
    items = [item for zone in kept for item in _items(zone, policy.projection, inside=True)]
    for zone in (policy.zones[number] for number in airspace.outside):
        if _can_exclude(zone, left_out):
            items += _items(zone, policy.projection, inside=False)
    return Fence(tuple(items), tuple(left_out))


def _can_include(zone: Zone, habits: FenceHabits, left_out: list[str]) -> bool:
    if zone.floor > 0 or zone.ceiling < HIGHEST:
        left_out.append(f"the heights of `{zone.name}`")
    if timed(zone):
        left_out.append(f"the times of `{zone.name}`")
    parts = sum(_is_outer(ring) for ring in _rings(zone))
    if parts > 1 and habits.all_inclusions:
        left_out.append(f"`{zone.name}`, because this autopilot would require all of its {parts} parts at once")
        return False
    return True


def _can_exclude(zone: Zone, left_out: list[str]) -> bool:
    for there, what in (
        (zone.floor > 0 or zone.ceiling < HIGHEST, "it may be flown over or under"),
        (timed(zone), "it applies at times only"),
        (not all(map(_is_outer, _rings(zone))), "it has holes"),
    ):
        if there:
            left_out.append(f"`{zone.name}`: {what}")
            return False
    return True


def _items(zone: Zone, projection: Projection, *, inside: bool) -> Iterator[FenceItem]:
    """The items that include a zone (its holes become exclusions) or exclude it; outer rings first."""
    if zone.shape == CIRCLE:
        x, y, square = zone.data
        # whole centimetres, which a 32-bit float holds exactly, rounded away from the airspace
        centimetres = isqrt(square) // 10 + inside
        command = INCLUDE_CIRCLE if inside else EXCLUDE_CIRCLE
        yield FenceItem(command, *unproject(projection, x, y), centimetres / 100)
    for ring in sorted(_rings(zone), key=_is_outer, reverse=True):
        command = INCLUDE_VERTEX if inside and _is_outer(ring) else EXCLUDE_VERTEX
        for x, y in zip(ring[::2], ring[1::2], strict=True):
            yield FenceItem(command, *unproject(projection, x, y), float(len(ring) // 2))


def _rings(zone: Zone) -> Iterator[Ring]:
    """The rings of a zone that is not a circle, outer ones counter-clockwise."""
    if zone.shape == AREA:
        count = zone.data[0]
        at = 1 + count
        for corners in zone.data[1 : 1 + count]:
            yield zone.data[at : at + 2 * corners]
            at += 2 * corners
    elif zone.shape != CIRCLE:
        yield zone.data


def _twice_area(ring: Sequence[int]) -> int:
    points = list(zip(ring[::2], ring[1::2], strict=True))
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True))


def _is_outer(ring: Ring) -> bool:
    return _twice_area(ring) > 0


def _size(zone: Zone) -> int:
    """Twice the area in mm^2, approximately, to find the smallest zone."""
    return 6 * zone.data[2] if zone.shape == CIRCLE else sum(map(_twice_area, _rings(zone)))


# ---------------------------------------------------------------- the mission protocol

RETRY_US: Final = 1_000_000
RETRIES: Final = 8
#: The longest pause between two requests of the vehicle; ArduCopter itself gives up after 8 s.
SILENCE_US: Final = 8_000_000

_RESULTS: Final = {
    1: "error", 2: "unsupported frame", 4: "no space", 5: "invalid", 14: "denied", 15: "cancelled",
}  # fmt: skip
_ACCEPTED, _UNSUPPORTED, _OUT_OF_ORDER = 0, 3, 13


class UploadState(Enum):
    """The state of an upload."""

    IDLE = auto()
    SENDING = auto()
    COUNTING = auto()
    READING = auto()
    DONE = auto()
    UNSUPPORTED = auto()
    FAILED = auto()


class Upload:
    """One fence for one vehicle: uploaded, then downloaded and compared. An acknowledged upload proves little
    (docs/adr/0019-what-a-vehicle-says.md). `problem` says why it FAILED.

    Source: https://mavlink.io/en/services/mission.html. PX4 requests items by MISSION_REQUEST_INT, at times by both
    messages; ArduCopter requests them by the older MISSION_REQUEST and accepts MISSION_ITEM_INT (recorded). It rejects
    an item that it has not requested as out of sequence, and continues (MissionItemProtocol.cpp,
    `handle_mission_item`).
    """

    def __init__(self, items: tuple[FenceItem, ...], frame: int, slack: int = 1) -> None:
        self._slack = slack
        self._items = items
        self._frame = frame
        self.state = UploadState.IDLE
        self.problem = ""
        self._request: Message = None  # the last request, repeated until it is answered
        self._tries = 0
        self._sent_us = 0
        self._asked = False  # it is the vehicle's turn to request
        self._read = 0  # how many of the items were read back unchanged

    def due(self, system: int, now_us: int) -> list[Message]:
        """The messages to send now: the first one, or the unanswered one again."""
        if self.state is UploadState.IDLE:
            return self._ask(UploadState.SENDING, messages.fence_count(system, len(self._items)), now_us)
        if self.state not in (UploadState.SENDING, UploadState.COUNTING, UploadState.READING):
            return []
        if now_us - self._sent_us < (SILENCE_US if self._asked else RETRY_US) * self._slack:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            return self._fail("does not answer")
        self._sent_us, self._asked = now_us, False
        return [self._request]

    def take(self, name: str, message: Any, system: int, now_us: int) -> list[Message]:
        """Take in a mission message about fences that is addressed to us; return the answer."""
        match name, self.state:
            case (("MISSION_REQUEST" | "MISSION_REQUEST_INT"), UploadState.SENDING):
                if message.seq >= len(self._items):
                    return self._fail(f"asks for item {message.seq} of {len(self._items)}")
                self._sent_us, self._asked, self._tries = now_us, True, 0
                return [messages.fence_item(system, message.seq, self._frame, self._items[message.seq])]
            case "MISSION_ACK", UploadState.SENDING:
                if message.type == _ACCEPTED:
                    return self._ask(UploadState.COUNTING, messages.fence_list(system), now_us)
                if message.type == _UNSUPPORTED:
                    self.state = UploadState.UNSUPPORTED
                    return []
                if message.type == _OUT_OF_ORDER:  # an item came twice, because a delayed one is requested twice
                    return []
                return self._fail(f"refuses it ({_RESULTS.get(message.type, f'result {message.type}')})")
            case "MISSION_COUNT", UploadState.COUNTING:
                if message.count != len(self._items):
                    return self._fail(f"holds {message.count} items instead of {len(self._items)}")
                return self._ask(UploadState.READING, messages.fence_request(system, 0), now_us)
            case "MISSION_ITEM_INT", UploadState.READING:
                return self._compare(message, system, now_us)
        return []

    def _compare(self, message: Any, system: int, now_us: int) -> list[Message]:
        if message.seq != self._read:
            return []  # an answer to an earlier request
        item = self._items[self._read]
        same = (message.command, message.x, message.y) == (item.command, item.latitude, item.longitude)
        if not (same and isclose(message.param1, item.parameter, abs_tol=0.01)):
            return self._fail(f"holds an item {self._read} that differs from the one it was sent")
        self._read += 1
        if self._read < len(self._items):
            return self._ask(UploadState.READING, messages.fence_request(system, self._read), now_us)
        self.state = UploadState.DONE
        return [messages.fence_received(system)]

    def _ask(self, state: UploadState, request: Message, now_us: int) -> list[Message]:
        self.state, self._request, self._sent_us, self._tries, self._asked = state, request, now_us, 0, False
        return [request]

    def _fail(self, problem: str) -> list[Message]:
        self.state, self.problem = UploadState.FAILED, problem
        return []


# ---------------------------------------------------------------- the whole procedure

#: How long it waits after a failure before it begins again.
AGAIN_US: Final = 10_000_000

#: The mission messages that `take` uses.
HEEDED: Final = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT")


class Fencing:
    """Makes the airspace the vehicle's fence: uploads, reads back, switches on, and starts again after a failure.
    `unready` says what is not settled; `note` is the result for the operator.
    """

    def __init__(
        self, policy: Policy, flavour: AutopilotFlavour, parameters: VehicleParameters, *, wanted: bool, slack: int
    ) -> None:
        self._fence = fence_of(policy, flavour.fence) if wanted else None
        self._habits = flavour.fence
        self._parameters = parameters
        self._slack = slack
        self._upload = self._begin()
        self._failed_us: int | None = None
        self._problem: str | None = None

    def due(self, system: int, now_us: int) -> list[Message]:
        """The messages to send now."""
        if self._upload is None:
            return []
        problem = self._failure()
        if problem is None:
            self._failed_us = None
        elif self._failed_us is None:
            self._failed_us, self._problem = now_us, problem
        elif now_us - self._failed_us >= AGAIN_US * self._slack:
            self._failed_us, self._upload = None, self._begin()
            for name, _ in self._habits.switches:
                self._parameters.forget(name)
        out = [] if self._upload is None else self._upload.due(system, now_us)
        if self._state is UploadState.DONE:
            for name, bits in self._habits.switches:
                self._parameters.ensure(name, bits)
        return out

    def take(self, name: str, message: Any, system: int, now_us: int) -> list[Message]:
        """Take in a mission message; return the answer."""
        if self._upload is None or name not in HEEDED or message.mission_type != FENCE:
            return []
        return self._upload.take(name, message, system, now_us)

    @property
    def unready(self) -> str | None:
        """Why the fence is not set yet; None where none is wanted or possible."""
        if self._state in (None, UploadState.UNSUPPORTED):
            return None
        if self._state is UploadState.DONE and all(self._parameters.has(*each) for each in self._habits.switches):
            return None
        return self._failure() or self._problem or "the vehicle's fence is being set"

    @property
    def read_back(self) -> bool:
        """Whether the vehicle holds the fence, item by item."""
        return self._state is UploadState.DONE

    @property
    def note(self) -> str:
        """The result, in words, once everything is settled."""
        fence = self._fence
        if fence is None:
            return "the vehicle's own fence was left unchanged"
        if self._state is UploadState.UNSUPPORTED:
            return "the vehicle accepts no fence: only this program watches the policy's airspace"
        left_out = "; ".join(fence.left_out)
        if not fence.items:
            return f"no fence was set, because this autopilot cannot represent the airspace: {left_out}"
        many = f"{len(fence.items)} item{'' if len(fence.items) == 1 else 's'}"
        changes = [
            f"`{name}` from {before:g} to {after:g}"
            for name, (before, after) in self._parameters.changed.items()
            if name in dict(self._habits.switches)
        ]
        text = f"its fence was set to the policy's airspace ({many}), and read back"
        if changes:
            text = f"{text}; switched on with {' and '.join(changes)}, which stays so"
        return f"{text}; the fence leaves out: {left_out}" if left_out else text

    @property
    def _state(self) -> UploadState | None:
        return None if self._upload is None else self._upload.state

    def _begin(self) -> Upload | None:
        if self._fence is None or not self._fence.items:
            return None
        return Upload(self._fence.items, self._habits.frame, self._slack)

    def _failure(self) -> str | None:
        if self._upload is not None and self._upload.state is UploadState.FAILED:
            return f"the vehicle's fence could not be set: it {self._upload.problem} (`--no-fence` flies without)"
        for name, _ in self._habits.switches if self._state is UploadState.DONE else ():
            if self._parameters.is_absent(name):
                return f"the vehicle's fence could not be switched on: no answer about `{name}` (see `--no-fence`)"
        return None
