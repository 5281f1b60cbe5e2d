"""The vehicle's previous log: it is recovered if it has no end, and the next log names its hash."""

import secrets
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.recovery import LogEnder, alone, look, recover
from rtshcua.adapters.store.vehicle_records import LastLog, PreviousLog
from rtshcua.adapters.utc import UtcWatch
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.left import Left, left_by
from rtshcua.wire.keys import SEED_BYTES, Duty, SigningKey

#: the event of the effect with the note about the previous log
LOG_BEFORE = "log-before"

_UNKEPT = "the next log cannot name this one, because its name could not be stored"


class LogBefore:
    """The previous log of a vehicle; `hash` and `note` go into the next log."""

    def __init__(self, last: LastLog, earlier: PreviousLog) -> None:
        self._last = last
        self._earlier = earlier
        self._log: Path | None = None
        self._held = ExitStack()

    @classmethod
    def settle(cls, state: Path, vehicle: str, log_key: SigningKey | None) -> Self:
        """Recover the previous log if it has no end; without the log's key it is only read."""
        last = LastLog(state, vehicle)
        signer = None if log_key is None else signer_of(log_key)
        return cls(last, last.settle(look if signer is None else lambda path: recover(path, signer)))

    @property
    def hash(self) -> str | None:
        """The hash of the last line of the previous log; None if there is none, or it is unknown."""
        return self._earlier.last

    @property
    def note(self) -> str:
        """A note about a problem with the previous log; empty if there is none."""
        return self._earlier.note

    @property
    def broken_off(self) -> Path | None:
        """The run folder of the previous flight, if its log is not known to have ended."""
        log = self._earlier.broken_off
        return None if log is None else log.parent

    @property
    def gone(self) -> bool:
        """Whether the previous log is missing, so that the end of its flight is unknown."""
        return self._earlier.gone

    def left(self, bundle: bytes, loaded: Loaded) -> Left | None:
        """What a run of this bundle left the vehicle doing, by the previous log; None if unknown."""
        log = self._earlier.log
        if log is None:
            return None
        try:
            with open_regular(log) as file:
                return left_by(lines(file), bundle, loaded.bundle.policy, loaded.bundle.mission)
        except OSError:
            return None

    def begin(self, log: Path, *, aloft: bool = False) -> None:
        """Store the path of the new, empty log, and lock it against recovery until `end`. Raises OSError if that fails,
        but not for a vehicle that is `aloft`, which must come down.
        """
        self._held.enter_context(alone(log))
        try:
            self._last.begin(log, self.hash)
        except OSError as error:
            if not aloft:
                raise
            self._earlier = self._earlier._replace(note=f"{self.note}; {_UNKEPT}: {error}".removeprefix("; "))
        self._log = log

    def end(self, last: str) -> None:
        """Store the hash of the last line of the closed log. If that fails, the next run reads the log again."""
        assert self._log is not None
        with suppress(OSError):
            self._last.end(self._log, self.hash, last)
        self._held.close()


def signer_of(log_key: SigningKey) -> LogEnder:
    """A `LogEnder` that ends logs with this key, by this machine's clock."""

    def certify(text: bytes) -> bytes:
        return log_key.sign(text, duty=Duty.LOG)

    clock = SystemClock()
    UtcWatch(clock)  # takes the kernel's bound, if the clock is synchronised
    return LogEnder(log_key.public, certify, lambda: secrets.token_bytes(SEED_BYTES), clock.now)
