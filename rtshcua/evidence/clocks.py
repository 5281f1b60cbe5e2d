"""Checks the clocks of a log: the times of each record against those of the records before (docs/log-format.md,
section 5).
"""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.gaps import seconds
from rtshcua.evidence.records import AnyRecord, Genesis, Recover


class Clocks:
    """Processes the times of the records in order. All in microseconds; `at_us` is the last monotonic time.

    Monotonic time restarts at a `recover` record, because the machine may have been restarted before it.
    """

    __slots__ = ("_apart_error_us", "_apart_us", "_utc_low_us", "at_us")

    def __init__(self) -> None:
        self.at_us = self._utc_low_us = 0
        self._apart_us = self._apart_error_us = (
            0  # UTC minus monotonic time since the restart of the latter, and its error
        )

    def check(self, record: AnyRecord) -> Flaw | None:
        """The flaw in the times of the next record, or None."""
        at_us, utc_us, error_us = record.at_us, record.utc_us, record.utc_error_us
        apart_us = utc_us - at_us
        if isinstance(record, Genesis) and record.received_us > at_us:
            text = "the bundle was received after the beginning of the log that contains it"
            return Flaw("clock/received", text, f"{record.received_us} us", f"{at_us} us or earlier")
        if isinstance(record, Genesis | Recover):
            self._apart_us, self._apart_error_us = apart_us, error_us
        elif at_us < self.at_us:
            text = "the monotonic time is before that of the previous record"
            return Flaw("clock/backwards", text, f"{at_us} us", f"{self.at_us} us or later")
        if utc_us + error_us < self._utc_low_us:
            text = "the time of day is before that of an earlier record, by more than the stated errors of both"
            latest, least = f"{utc_us + error_us} us at most", f"{self._utc_low_us} us at least"
            return Flaw("clock/utc-backwards", text, latest, least)
        if abs(apart_us - self._apart_us) > error_us + self._apart_error_us:
            text = "time of day and monotonic time advanced by different amounts, beyond the stated errors of both"
            found, most = (
                f"{seconds(apart_us - self._apart_us)} difference",
                f"{seconds(error_us + self._apart_error_us)} at most",
            )
            return Flaw("clock/utc-jump", text, found, most)
        self.at_us = at_us
        if utc_us - error_us > self._utc_low_us:
            self._utc_low_us = utc_us - error_us
        return None
