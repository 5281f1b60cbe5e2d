"""The clocks of a log: what the times of one record say about those of the next (docs/log-format.md, section 5)."""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.gaps import seconds
from rtshcua.evidence.records import AnyRecord, Genesis, Recover


class Clocks:
    """Takes the times of the records in their order. All in microseconds; `at_us` is the last monotonic time.

    Monotonic time begins anew at a recover, for the machine may have been restarted before it.
    """

    __slots__ = ("_apart_error_us", "_apart_us", "_utc_low_us", "at_us")

    def __init__(self) -> None:
        self.at_us = self._utc_low_us = 0
        self._apart_us = self._apart_error_us = 0  # UTC less monotonic time where the latter began, and its error

    def check(self, record: AnyRecord) -> Flaw | None:
        """What is wrong with the times of the next record, or None."""
        at_us, utc_us, error_us = record.at_us, record.utc_us, record.utc_error_us
        apart_us = utc_us - at_us
        if isinstance(record, Genesis) and record.received_us > at_us:
            text = "its bundle was received after the log that holds it began"
            return Flaw("clock/received", text, f"{record.received_us} us", f"{at_us} us or before")
        if isinstance(record, Genesis | Recover):
            self._apart_us, self._apart_error_us = apart_us, error_us
        elif at_us < self.at_us:
            text = "its monotonic time lies before that of the record before it"
            return Flaw("clock/backwards", text, f"{at_us} us", f"{self.at_us} us or later")
        if utc_us + error_us < self._utc_low_us:
            text = "its time of day lies before that of an earlier record, by more than the errors stated for both"
            latest, least = f"{utc_us + error_us} us at most", f"{self._utc_low_us} us at least"
            return Flaw("clock/utc-backwards", text, latest, least)
        if abs(apart_us - self._apart_us) > error_us + self._apart_error_us:
            text = "its time of day went on by more or less than its monotonic time, beyond the errors stated for both"
            found, most = (
                f"{seconds(apart_us - self._apart_us)} apart",
                f"{seconds(error_us + self._apart_error_us)} at most",
            )
            return Flaw("clock/utc-jump", text, found, most)
        self.at_us = at_us
        if utc_us - error_us > self._utc_low_us:
            self._utc_low_us = utc_us - error_us
        return None
