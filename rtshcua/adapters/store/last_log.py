"""Which log a vehicle wrote last: the next one names it, and the log of a flight that broke off is given its end.

    <state folder>/logs/vehicle-<identity>     JSON: {"before", "last", "log"}

`log` is where the last log lies, `before` what its genesis names, and `last` the hash of its last line (hexadecimal),
null until it was closed. It is written when the log was made and is empty yet, and again when it was closed.
"""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final, NamedTuple
from urllib.parse import quote

import msgspec

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.recovery import InUse, Recovered
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace
from rtshcua.evidence.recovery import RECOVERABLE, LogState

#: the folder, in the state folder, of what simulated vehicles that a run starts itself leave behind: nothing of them
#: hangs in the air, or has parameters to be put back, when the real one of that identity is connected
SIMULATED: Final = "simulated"

_LARGEST = 1 << 16  # octets of the file

_Hash = Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]


class _Kept(msgspec.Struct):
    """The file."""

    log: str
    before: _Hash | None = None
    last: _Hash | None = None


class PreviousLog(NamedTuple):
    """The log before the next one: the hash of its last line, None where there is none or it is not known; what there
    is to tell of it, empty where all is as it should be; where it lies, if its flight is not known to have ended it;
    where it lies, if it may be believed; and whether it is gone, so that nobody knows.
    """

    last: str | None
    note: str = ""
    broken_off: Path | None = None
    log: Path | None = None
    gone: bool = False


class LastLog:
    """Remembers the last log of the vehicle called `vehicle` (its identity). One process at a time writes. What a
    simulation of our own leaves lies in a state folder of its own (`SIMULATED` below the other).
    """

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "logs" / f"vehicle-{quote(vehicle, safe='')}"

    def settle(self, recover: Callable[[Path], Recovered]) -> PreviousLog:
        """The last log; `recover` ends it where it has no end, if it can. Never raises: no flight waits for a log."""
        try:
            known = _remembered(self.path)
        except (OSError, ValueError) as error:
            return PreviousLog(None, f"it is not known which log came before: `{self.path}`: {_words(error)}")
        if known is None:
            return PreviousLog(None)
        log = Path(known.log)
        if known.last is not None:
            return PreviousLog(known.last, log=log)
        try:
            return _told(log, known.before, recover(log))._replace(broken_off=log)
        except FileNotFoundError:
            text = f"the log before, `{log}`, is no longer there: whether its flight ended is not known"
            return PreviousLog(None, text, log, gone=True)
        except (OSError, InUse) as error:
            living = isinstance(error, InUse)  # its run flies on, and broke off nowhere
            text = f"the log before, `{log}`, was not closed, nor can it be: {_words(error)}"
            return PreviousLog(None, text, None if living else log)

    def begin(self, log: Path, before: str | None) -> None:
        """A log was made that will name `before`. Raises OSError."""
        self._write(log, before, None)

    def end(self, log: Path, before: str | None, last: str) -> None:
        """It was closed; `last` is the hash of its last line. Raises OSError."""
        self._write(log, before, last)

    def _write(self, log: Path, before: str | None, last: str | None) -> None:
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        told = {"before": before, "last": last, "log": str(log.resolve())}
        replace(self.path, json.dumps(told).encode() + b"\n", mode=PRIVATE_FILE)


def known_end(state: Path, log: Path) -> str | None:
    """The hash of the last line of a log that a vehicle here wrote last, if it was closed; None where nobody knows."""
    where = str(log.resolve())
    for path in sorted(each for of in (state, state / SIMULATED) for each in (of / "logs").glob("vehicle-*")):
        with suppress(OSError, ValueError):
            known = _remembered(path)
            if known is not None and known.log == where and known.last is not None:
                return known.last
    return None


def _remembered(path: Path) -> _Kept | None:
    """What is kept of the last log. Raises OSError, and ValueError for what was not written by this."""
    data = read_if_there(path, _LARGEST)
    try:
        return None if data is None else msgspec.json.decode(data, type=_Kept)
    except msgspec.DecodeError:
        raise ValueError("it is damaged") from None


def _told(log: Path, before: str | None, done: Recovered) -> PreviousLog:
    found = done.found
    if done.done:
        text = f"the log before, `{log}`, was not closed: it is recovered, {found.records} records of it are kept"
        note = text if not found.discarded else f"{text}, {found.discarded} octets discarded"
        return PreviousLog(done.last, note, log=log)
    if found.state is LogState.CLOSED:
        return PreviousLog(done.last, log=log)
    if found.state in RECOVERABLE:
        text = f"the log before, `{log}`, was not closed: `rtshcua recover` ends it, where the log's key is"
        return PreviousLog(done.last, text, log=log)
    if found.state is LogState.UNBEGUN:
        return PreviousLog(before)
    reason = "" if found.reason is None else f" (record {found.reason.record}: {found.reason.text})"
    what = "was tampered with" if found.state is LogState.TAMPERED else "is of another log key"
    return PreviousLog(done.last, f"the log before, `{log}`, {what} and is left as it is{reason}")


def _words(error: Exception) -> str:
    if isinstance(error, OSError):
        return (error.strerror or str(error)).lower()
    return "it is damaged" if isinstance(error, ValueError) else str(error)
