"""What was before a flight: the vehicle's last log, ended if it was not, and named by the next one."""

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

#: the effect that says, in the signed log, what there was to tell of the one before
LOG_BEFORE = "log-before"

_UNKEPT = "the next log will not know of this one, for that cannot be kept"


class LogBefore:
    """The last log of a vehicle; `hash` and `note` are for the next one."""

    def __init__(self, last: LastLog, earlier: PreviousLog) -> None:
        self._last = last
        self._earlier = earlier
        self._log: Path | None = None
        self._held = ExitStack()

    @classmethod
    def settle(cls, state: Path, vehicle: str, log_key: SigningKey | None) -> Self:
        """Ends it, where it must be ended; without the log's key it stays without an end."""
        last = LastLog(state, vehicle)
        signer = None if log_key is None else signer_of(log_key)
        return cls(last, last.settle(look if signer is None else lambda path: recover(path, signer)))

    @property
    def hash(self) -> str | None:
        """The hash of the last line of the log before, None where there is none, or it is not known."""
        return self._earlier.last

    @property
    def note(self) -> str:
        """What there is to tell of it; empty where all is as it should be."""
        return self._earlier.note

    @property
    def broken_off(self) -> Path | None:
        """The run folder of the flight before, if that is not known to have ended its log."""
        log = self._earlier.broken_off
        return None if log is None else log.parent

    @property
    def gone(self) -> bool:
        """Whether the log before is not there any more: nobody knows how its flight ended."""
        return self._earlier.gone

    def left(self, bundle: bytes, loaded: Loaded) -> Left | None:
        """What a run of this bundle left the vehicle doing, if the log before is of one; None: nobody knows."""
        log = self._earlier.log
        if log is None:
            return None
        try:
            with open_regular(log) as file:
                return left_by(lines(file), bundle, loaded.bundle.policy, loaded.bundle.mission)
        except OSError:
            return None

    def begin(self, log: Path, *, aloft: bool = False) -> None:
        """The next log was made, and nothing is in it yet; nobody recovers it before `end`. Raises OSError where that
        cannot be kept; not for a vehicle that is `aloft`, which comes down whatever the state folder says.
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
        """It is closed; `last` is the hash of its last line. Where that cannot be kept, the log is asked again."""
        assert self._log is not None
        with suppress(OSError):
            self._last.end(self._log, self.hash, last)
        self._held.close()


def signer_of(log_key: SigningKey) -> LogEnder:
    """Who ends logs with this key, by this machine's clock, in no more time than a flight can wait."""

    def certify(text: bytes) -> bytes:
        return log_key.sign(text, duty=Duty.LOG)

    clock = SystemClock()
    UtcWatch(clock)  # the kernel may vouch for it; nobody else is there
    return LogEnder(log_key.public, certify, lambda: secrets.token_bytes(SEED_BYTES), clock.now)
