"""A recorded session with a real autopilot: requests and answers, by the autopilot's own clock.

The autopilot's clock is `time_boot_ms` of GLOBAL_POSITION_INT. One session ran faster than real time, another a little
slower; by that clock they can be repeated in virtual time.
"""

import lzma
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.mavlink import tlog

TRACES = Path(__file__).resolve().parents[1] / "traces"
SECOND = 1_000_000
CLIENT = 191
_UPLOADED = "MISSION_ITEM_INT"


@dataclass(frozen=True)
class Heard:
    """A valid frame, and its time: microseconds since the autopilot's start."""

    at_us: int
    received: ReceivedFrame

    @property
    def name(self) -> str:
        return self.received.name

    @property
    def message(self) -> Any:
        return self.received.message


def mode(heard: Heard) -> object:
    """`custom_mode`, and whether it is armed; None of other messages."""
    m = heard.message
    return (m.custom_mode, bool(m.base_mode & 128)) if heard.name == "HEARTBEAT" else None


def landed(heard: Heard) -> object:
    """`landed_state`; None of other messages."""
    return heard.message.landed_state if heard.name == "EXTENDED_SYS_STATE" else None


@dataclass(frozen=True)
class Question:
    """A request of the client; `items` are those of an upload, sent on request."""

    number: int
    heard: Heard
    items: tuple[Heard, ...] = ()

    @property
    def at_us(self) -> int:
        return self.heard.at_us

    @property
    def key(self) -> str:
        """Return a short description with its position in the session."""
        m = self.heard.message
        what = self.heard.name
        if what in ("COMMAND_LONG", "COMMAND_INT"):
            what = f"command {m.command}"
        elif what == "PARAM_SET":
            what = f"PARAM_SET {m.param_id}"
        return f"{self.number} {what}"


class Trace:
    """Read the session of one file in `tests/traces`.

    `wall`: by the recorder's clock, from the first frame; for an autopilot whose own clock stopped.
    """

    def __init__(self, name: str, wall: bool = False) -> None:
        self._wall = wall
        data = lzma.decompress((TRACES / f"{name}.tlog.xz").read_bytes())
        self._frames = [
            (entry.at_us, received) for entry in tlog.read(data) for received in Codec(0, 0).parse(entry.frame)
        ]

    @cached_property
    def _clock(self) -> tuple[list[int], list[int]]:
        pairs = [(at, r.message.time_boot_ms * 1000) for at, r in self._frames if r.name == "GLOBAL_POSITION_INT"]
        return [at for at, _ in pairs], [boot for _, boot in pairs]

    def _boot_us(self, at_us: int) -> int:
        if self._wall:
            return at_us - self._frames[0][0]
        wall, boot = self._clock
        after = min(max(bisect_right(wall, at_us), 1), len(wall) - 1)
        left = after - 1
        slope = (boot[after] - boot[left]) / (wall[after] - wall[left]) if wall[left] <= at_us <= wall[after] else 1.0
        return round(boot[left] + (at_us - wall[left]) * slope)

    @cached_property
    def heard(self) -> list[Heard]:
        """Return every frame of both ends, in order."""
        return [Heard(self._boot_us(at), received) for at, received in self._frames]

    @cached_property
    def of_vehicle(self) -> list[Heard]:
        return [h for h in self.heard if h.received.component != CLIENT]

    @cached_property
    def heartbeats(self) -> list[Heard]:
        """Return the client's frames."""
        return [h for h in self.heard if h.received.component == CLIENT and h.name == "HEARTBEAT"]

    @cached_property
    def questions(self) -> list[Question]:
        asked = [h for h in self.heard if h.received.component == CLIENT and h.name != "HEARTBEAT"]
        starts = [i for i, h in enumerate(asked) if h.name != _UPLOADED]
        ends = [*starts[1:], len(asked)]
        return [
            Question(number, asked[start], tuple(asked[start + 1 : end]))
            for number, (start, end) in enumerate(zip(starts, ends, strict=True))
        ]
