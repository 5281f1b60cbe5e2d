"""A vehicle with its own clock behind a bad link, as an oracle: it knows when each frame was made."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from heapq import heappop, heappush
from random import Random
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import ReceivedFrame

SECOND = 1_000_000


@dataclass(frozen=True)
class LinkKind:
    """Delays in us: the minimum each way, and the largest addition; loss in percent; `ordered`: no overtaking."""

    up_us: int = 2_000
    down_us: int = 2_000
    jitter_us: int = 3_000
    loss: int = 0
    ordered: bool = False


@dataclass
class Arrival:
    """A frame with its times of arrival, sending and measurement, on our clock."""

    frame: ReceivedFrame
    came_us: int
    sent_us: int
    measured_us: int
    stamped: bool


@dataclass
class StampedVehicle:
    """`ppm` is how much faster its clock runs than ours. Frames come from component 1."""

    seed: int
    link: LinkKind
    ppm: int = 0
    start_us: int = 7 * SECOND
    uptime_us: int = 3 * SECOND
    _random: Random = field(init=False)
    _queue: list[tuple[int, int, Any]] = field(default_factory=list, init=False)
    _count: int = field(default=0, init=False)
    _number: int = field(default=0, init=False)
    _last_came_us: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._random = Random(self.seed)

    def boot_us(self, our_us: int) -> int:
        """Its clock at a time of ours."""
        passed = our_us - self.start_us
        return self.uptime_us + passed + passed * self.ppm // 1_000_000

    def run(self, source: Any, seconds: int) -> Iterator[Arrival]:
        """Let time pass; TIMESYNC goes through `source`, and each other frame is yielded on arrival."""
        now_us, end_us = self.start_us, self.start_us + seconds * SECOND
        self._schedule(now_us, ("emit",))
        self._schedule(now_us, ("tick",))
        while self._queue and self._queue[0][0] < end_us:
            now_us, _, what = heappop(self._queue)
            if what[0] == "tick":
                ts1 = source.clock.due(now_us)
                if ts1 is not None and not self._lost():
                    self._schedule(now_us + self._way(self.link.up_us), ("asked", ts1))
                self._schedule(now_us + 50_000, ("tick",))
            elif what[0] == "asked":
                answer = mavlink.MAVLink_timesync_message(self.boot_us(now_us) * 1_000, what[1])
                self._send(now_us, now_us, answer, stamped=True)
            elif what[0] == "emit":
                self._emit(now_us)
                self._schedule(now_us + self._random.randrange(5_000, 40_000), ("emit",))
            else:
                yield what[1]

    def _emit(self, now_us: int) -> None:
        kind = self._random.randrange(5)
        if kind == 0:
            self._send(now_us, now_us, mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3), stamped=False)
        elif kind == 1:
            old_us = now_us - self._random.randrange(300_000)
            fix = mavlink.MAVLink_gps_raw_int_message(self.boot_us(old_us), 3, 0, 0, 0, 0, 0, 0, 0, 0)
            self._send(now_us, old_us, fix, stamped=True)
        else:
            place = mavlink.MAVLink_global_position_int_message(
                self.boot_us(now_us) // 1_000 % (1 << 32), 0, 0, 0, 0, 0, 0, 0, 0
            )
            self._send(now_us, now_us, place, stamped=True)

    def _send(self, now_us: int, measured_us: int, message: Any, *, stamped: bool) -> None:
        number, self._number = self._number, (self._number + 1) % 256
        if self._lost():
            return
        came_us = now_us + self._way(self.link.down_us)
        if self.link.ordered:
            came_us = self._last_came_us = max(came_us, self._last_came_us)
        frame = ReceivedFrame(message, message.get_type(), 1, 1, number, False, b"")
        self._schedule(came_us, ("came", Arrival(frame, came_us, now_us, measured_us, stamped)))

    def _schedule(self, at_us: int, what: Any) -> None:
        self._count += 1
        heappush(self._queue, (at_us, self._count, what))

    def _way(self, least_us: int) -> int:
        return least_us + self._random.randrange(self.link.jitter_us + 1)

    def _lost(self) -> bool:
        return self._random.randrange(100) < self.link.loss
