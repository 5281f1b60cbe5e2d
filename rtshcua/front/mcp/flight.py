"""The vehicle as its agent socket tells of it, followed in a thread: only its first word is waited for."""

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


class _Mission(msgspec.Struct):
    digest: _Octets


class _Decided(msgspec.Struct):
    """What is asked of a decision beyond its record's types."""

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
    """A line that has a type which is read here, else an empty one. Raises msgspec.ValidationError for one whose fields
    are not those of its type.
    """
    found: dict[str, Any] = told if isinstance(told, dict) else {}
    kind = found.get("type")
    fields = _TYPES.get(kind) if isinstance(kind, str) else None
    if fields is None:
        return {}
    msgspec.convert(found, fields)
    if fields is DecisionRecord:
        msgspec.convert(found, _Decided)
    return found


#: how long until it is tried again to follow, in seconds
AGAIN_S: Final = 0.3
#: how long the first answer about it waits for its first word, in seconds
FIRST_S: Final = 1.0
#: how many lines are kept, and how much they may weigh, in octets and for each value some more; the oldest let go first
MOST_LINES: Final = 5_000
MOST_KEPT: Final = 16 << 20
VALUE: Final = 128
#: a line that is longer, in octets, or has more values, is none of a flight's: a replacement's has 350 KB
LONGEST: Final = 2 << 20
MOST_VALUES: Final = 1 << 16


class Following:
    """What was told since the connection that stands, or the last one that did. Every field is replaced, never changed.

    `turn` counts the lines, and wakes whoever waits.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.turn = threading.Condition()
        self.heard = 0
        self.connected = False
        self._attempts = 0  # that ended, or that connected
        self.hello: dict[str, Any] = {}
        self.waiting: dict[str, Any] = {}
        self.vehicle: dict[str, Any] = {}
        self.mission: dict[str, Any] = {}
        self.close: dict[str, Any] = {}
        self.records: deque[dict[str, Any]] = deque(maxlen=MOST_LINES)
        self._weights: deque[int] = deque()  # of these
        self._kept = 0  # and their sum
        self._ended = threading.Event()
        self._link: socket.socket | None = None
        threading.Thread(target=self._follow, daemon=True).start()

    @property
    def stage(self) -> str:
        """Where it stands, in a word."""
        if self.close:
            return "ended"
        if not self.connected:
            return "unreachable"
        return "flying" if self.mission else "waiting"

    def await_first(self) -> None:
        """Wait until it told who it is, or cannot be reached, for a short time."""
        with self.turn:
            self.turn.wait_for(lambda: self.connected or self._attempts > 0, FIRST_S)

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
        """Follow no more."""
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
                pass  # it is gone, or says what no flight says
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
                    raise ValueError("no line of a flight")
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
