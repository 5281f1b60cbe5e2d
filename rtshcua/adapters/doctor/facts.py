"""Everything that was heard on the link while the doctor listened, whoever sent it."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from rtshcua.codec.frames import Received
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT

_MOST_TEXTS: Final = 20
_MOST_TALKERS: Final = 64
_LONG_AGO: Final = 64  # a sequence that goes back by less than this came out of order, and nothing is missing


@dataclass(slots=True)
class Talker:
    """One component of one system: its frames, how many are missing in between, and how many carried a signature."""

    frames: int = 0
    missing: int = 0
    signed: int = 0
    kind: int | None = None  # MAV_TYPE of its heartbeat,
    autopilot: int | None = None  # and MAV_AUTOPILOT
    sequence: int | None = None

    def hear(self, frame: Received) -> None:
        """Count one frame."""
        if self.sequence is not None:
            gap = (frame.sequence - self.sequence - 1) % 256
            self.missing += gap if gap < 256 - _LONG_AGO else 0
        self.sequence = frame.sequence
        self.frames += 1
        self.signed += frame.signed
        if frame.name == "HEARTBEAT":
            self.kind, self.autopilot = frame.message.type, frame.message.autopilot


@dataclass(slots=True)
class Stream:
    """One kind of message of the vehicle: how often it came, when first and last (us), and the last one."""

    count: int
    first_us: int
    last_us: int
    latest: Any

    @property
    def interval_us(self) -> int | None:
        """The mean time from one to the next; None for a single one."""
        return (self.last_us - self.first_us) // (self.count - 1) if self.count > 1 else None


@dataclass(slots=True)
class Facts:
    """`talkers` by (system, component); `streams` of `system`'s own components by name. Times are monotonic, in us."""

    system: int = 0
    talkers: dict[tuple[int, int], Talker] = field(default_factory=dict)
    streams: dict[str, Stream] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    round_trip_us: int | None = None  # of TIMESYNC, the median
    clock_error_us: int | None = None  # by how much, at the most, its stamps are taken for older than they are
    ahead_us: int | None = None  # how far the vehicle's UTC is ahead of ours
    answered: bool = False  # it answered something that we asked
    values: dict[int, int | None] = field(default_factory=dict)  # of the policy's signals, by state slot

    def meet(self, frame: Received) -> None:
        """Count one good frame, of anybody, believed or not."""
        key = (frame.system, frame.component)
        if key in self.talkers or len(self.talkers) < _MOST_TALKERS:
            self.talkers.setdefault(key, Talker()).hear(frame)

    def hear(self, frame: Received, now_us: int, utc_us: int) -> None:
        """Take in what one frame says."""
        if frame.system != self.system:
            return
        stream = self.streams.get(frame.name)
        if stream is None:
            self.streams[frame.name] = Stream(1, now_us, now_us, frame.message)
        else:
            stream.count, stream.last_us, stream.latest = stream.count + 1, now_us, frame.message
        if frame.component != AUTOPILOT:
            return
        match frame.name:
            case "COMMAND_ACK" | "PARAM_VALUE" | "AUTOPILOT_VERSION":
                self.answered = True
            case "SYSTEM_TIME" if frame.message.time_unix_usec:
                self.ahead_us = frame.message.time_unix_usec - utc_us

    def say(self, text: str) -> None:
        """Keep what the vehicle said, the first few texts once each."""
        if text not in self.texts and len(self.texts) < _MOST_TEXTS:
            self.texts.append(text)

    def latest(self, name: str) -> Any:
        """The last message of a name; None if there was none."""
        stream = self.streams.get(name)
        return None if stream is None else stream.latest

    def others(self) -> Iterator[tuple[tuple[int, int], Talker]]:
        """Whoever else was heard but the autopilot."""
        return ((key, talker) for key, talker in self.talkers.items() if key != (self.system, AUTOPILOT))
