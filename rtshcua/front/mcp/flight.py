"""Follow a vehicle through its agent socket, in a thread."""

import json
import socket
import threading
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from rtshcua.evidence.records import DecisionRecord
from rtshcua.ground.language.size_limits import values_of, without_texts

_Count = Annotated[int, msgspec.Meta(ge=0, lt=1 << 53)]
_Step = Annotated[int, msgspec.Meta(ge=-1, lt=1 << 31)]
_Octets = Annotated[str, msgspec.Meta(pattern=r"^(?:[0-9a-f]{2})*\Z")]


class _Hello(msgspec.Struct):
    flight: _Octets
    vehicle: str = ""
    mode: str = ""


class _Waiting(msgspec.Struct):
    policy: str = ""


class _Vehicle(msgspec.Struct):
    ready: bool = False
    unready: str | None = None
    armed: bool | None = None
    airborne: bool | None = None
    signals: Any = None


class _MissionStep(msgspec.Struct):
    phase: str = ""
    text: str = ""


class _Mission(msgspec.Struct):
    digest: _Octets
    mission: str = ""
    policy_digest: _Octets = ""
    steps: list[_MissionStep] = []


class _Decided(msgspec.Struct):
    """Requirements on a decision beyond the types of its record."""

    binding: _Octets
    invocation: _Octets
    step: _Step


class _Effect(msgspec.Struct):
    seq: _Count
    event: str
    step: _Step = -1
    detail: str = ""


class _Sealing(msgspec.Struct):
    seq: _Count


class _Close(msgspec.Struct):
    seq: _Count
    ending: str


_TYPES: Final[Mapping[str, type[msgspec.Struct]]] = {
    "hello": _Hello,
    "waiting": _Waiting,
    "vehicle": _Vehicle,
    "mission": _Mission,
    "decision": DecisionRecord,
    "effect": _Effect,
    "seal": _Sealing,
    "recover": _Sealing,
    "close": _Close,
}


def understood(told: Any) -> dict[str, Any]:
    """Return a line of a known type, or an empty dictionary. Raises msgspec.ValidationError for invalid fields."""
    found: dict[str, Any] = told if isinstance(told, dict) else {}
    kind = found.get("type")
    fields = _TYPES.get(kind) if isinstance(kind, str) else None
    if fields is None:
        return {}
    msgspec.convert(found, fields)
    if fields is DecisionRecord:
        msgspec.convert(found, _Decided)
    return found


#: delay before reconnecting, s
AGAIN_S: Final = 0.3
#: how long the first answer waits for the connection, s
FIRST_S: Final = 1.0
#: limits of the kept lines: their number, and their size in bytes plus `VALUE` for each value; the oldest are dropped
MOST_LINES: Final = 5_000
MOST_KEPT: Final = 16 << 20
VALUE: Final = 128
#: limits of one line in bytes and values; the longest line of a flight, a replacement's, has 350 KB
LONGEST: Final = 2 << 20
MOST_VALUES: Final = 1 << 16


class Following:
    """The lines received on the current or last connection. Fields are replaced, never modified in place.

    `turn` is notified for each line.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.turn = threading.Condition()
        self.heard = 0
        self.connected = False
        self._attempts = 0  # connections that ended or failed
        self.hello: dict[str, Any] = {}
        self.waiting: dict[str, Any] = {}
        self.vehicle: dict[str, Any] = {}
        self.mission: dict[str, Any] = {}
        self.close: dict[str, Any] = {}
        self.records: deque[dict[str, Any]] = deque(maxlen=MOST_LINES)
        self._weights: deque[int] = deque()  # the sizes of the records
        self._kept = 0  # the sum of the sizes
        self._ended = threading.Event()
        self._link: socket.socket | None = None
        threading.Thread(target=self._follow, daemon=True).start()

    @property
    def stage(self) -> str:
        """The stage of the vehicle."""
        if self.close:
            return "ended"
        if not self.connected:
            return "unreachable"
        return "flying" if self.mission else "waiting"

    def await_first(self) -> None:
        """Wait for a short time until the vehicle has told its state or cannot be reached."""
        with self.turn:
            self.turn.wait_for(lambda: bool(self.vehicle) or self._attempts > 0, FIRST_S)

    def await_told(self) -> None:
        """Wait for a short time until the vehicle has said whether it flies, or cannot be reached."""
        with self.turn:
            self.turn.wait_for(
                lambda: bool(self.mission or self.waiting) or self._attempts > 0 or self._ended.is_set(), FIRST_S
            )

    def await_flying(self) -> None:
        """Wait for a short time until the vehicle flies: another host may have proposed a mission just before."""
        with self.turn:
            self.turn.wait_for(lambda: self.stage == "flying" or self._ended.is_set(), FIRST_S)

    def await_current(self) -> None:
        """Wait for a short time until the fields describe the present flight.

        A new flight is connected to after up to `AGAIN_S`; until then the fields are those of the flight before.
        """
        with self.turn:
            before = self._attempts
            self.turn.wait_for(
                lambda: self._attempts > before or (self.connected and not self.close) or self._ended.is_set(), FIRST_S
            )

    def end(self) -> None:
        """Stop following."""
        self._ended.set()
        with self.turn:
            self.turn.notify_all()
        if self._link is not None:
            self._link.close()

    def _follow(self) -> None:
        while not self._ended.is_set():
            try:
                with socket.socket(socket.AF_UNIX) as link:
                    link.connect(str(self._path))
                    self._link = link
                    self._read(link)
            except (OSError, ValueError, RecursionError):
                pass  # the flight is gone, or the peer is not a flight
            with self.turn:
                self.connected = False
                self._attempts += 1
                self.turn.notify_all()
            self._ended.wait(AGAIN_S)

    def _read(self, link: socket.socket) -> None:
        with link.makefile("rb") as lines:
            while line := lines.readline(LONGEST):
                bare = without_texts(line, MOST_VALUES)
                if bare is None:
                    raise ValueError("not a line of a flight")
                told = understood(json.loads(line))
                with self.turn:
                    self._take(told, len(line) + VALUE * values_of(bare))
                    self.turn.notify_all()

    def _take(self, told: dict[str, Any], weight: int) -> None:
        self.heard += 1
        match told.get("type"):
            case "hello":
                if told.get("flight") != self.hello.get("flight"):
                    self.mission, self.close, self.vehicle = {}, {}, {}
                    self.records = deque(maxlen=MOST_LINES)
                    self._weights, self._kept = deque(), 0
                self.hello, self.connected = told, True
            case "waiting":
                self.waiting = told
            case "vehicle":
                self.vehicle = told
            case "mission":
                self.mission = told
            case "close":
                self.close = told
                self._keep(told, weight)
            case "decision" | "effect" | "seal" | "recover":
                self._keep(told, weight)

    def _keep(self, told: dict[str, Any], weight: int) -> None:
        self._weights.append(weight)
        self._kept += weight
        while len(self._weights) > MOST_LINES or self._kept > MOST_KEPT:
            self._kept -= self._weights.popleft()
            if self.records:
                self.records.popleft()
        self.records.append(told)
