"""The times of a log's records since its first one. Monotonic time restarts at a `recover` record, because the machine
may have been restarted before it; from there on UTC tells how much later it was, as far as UTC was known.
"""

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.evidence.records import AnyRecord, Close, Recover, Seal


class LogSegment(NamedTuple):
    """Records between which monotonic time did not restart: the number of the first one, and the monotonic time of the
    log's first record as it would be in this segment, us.
    """

    first: int
    begun_us: int


class LogTimes:
    """Finds the segments of a log from its records, which it takes in order. Before the first one, all times are 0."""

    def __init__(self) -> None:
        self._segments: list[LogSegment] = []
        self._begun_utc_us = self._latest_us = self._lasted_us = 0
        self._recovered = False

    @property
    def segments(self) -> tuple[LogSegment, ...]:
        """The segments so far."""
        return tuple(self._segments)

    @property
    def lasted_us(self) -> int:
        """The time of the last record that the flight itself wrote: not of those that ended the log after a crash."""
        return self._lasted_us

    def take(self, record: AnyRecord) -> int:
        """Take the next record; return its time since the first one."""
        if not self._segments:
            self._segments.append(LogSegment(record.seq, record.at_us))
            self._begun_utc_us = record.utc_us
        elif isinstance(record, Recover):
            # nothing is earlier than the records before it, even if the clock was set back
            t_us = max(record.utc_us - self._begun_utc_us, self._latest_us)
            self._segments.append(LogSegment(record.seq, record.at_us - t_us))
            self._recovered = True
        t_us = since_begun(self._segments[-1:], record)
        self._latest_us = max(self._latest_us, t_us)
        if not self._recovered or not isinstance(record, Recover | Seal | Close):
            self._lasted_us, self._recovered = t_us, False
        return t_us


def since_begun(segments: Sequence[LogSegment], record: AnyRecord) -> int:
    """The time of a record since the log's first one, us."""
    at = bisect_right(segments, record.seq, key=lambda each: each.first) - 1
    return record.at_us - segments[max(at, 0)].begun_us if segments else 0
