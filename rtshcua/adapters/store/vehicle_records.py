"""What is kept of each vehicle from flight to flight, one file a vehicle and subject:

    <state folder>/trust/vehicle-<identity>        the signed trust root that it accepted last
    <state folder>/logs/vehicle-<identity>         its last log; JSON: {"before", "last", "log"}
    <state folder>/parameters/vehicle-<identity>   parameters to put back; JSON: {name: [before, set]}, as text
    <state folder>/boundary/vehicle-<identity>     "<session> <digest, hexadecimal>", and a line feed
    <data folder>/qualifications/vehicle-<identity>.cbor   its last qualification record

- The trust root is there from the first flight under a root that is not for development, or from `rtshcua keys
  accept`. An older root, or one that does not follow from it, is refused.
- `log` is the path of the last log, `before` what its genesis names, `last` the hash of its last line (hexadecimal),
  null until it is closed. It is written when the log is created, and again when it is closed; the next log names it.
- The parameters are on the disk before anything is set. A run that may set or put back some holds `lock-<identity>`
  beside it: what a living run owes, no other run puts back.
- The boundary's digest of its own evidence is written when a session begins, and again when it ends in order: so a
  session names the one before, and whether that ended.

Nothing here detects that a whole folder was removed, or restored to an earlier state: a witness outside does.
"""

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final, NamedTuple
from urllib.parse import quote

import msgspec

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.recovery import InUse, Recovered
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, lock, make_folder, replace
from rtshcua.evidence.recovery import RECOVERABLE, LogState
from rtshcua.mavlink.parameters import bits_of, shown
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed
from rtshcua.wire import cose
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.qualification import MAX_QUALIFICATION
from rtshcua.wire.trust import MAX_ROOT, RootError, TrustRoot, follow, open_root
from rtshcua.wire.untrusted import Untrusted


class RootStore:
    """The trust root of the vehicle with the identity `vehicle`."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "trust" / f"vehicle-{quote(vehicle, safe='')}"

    def kept(self) -> bytes | None:
        """The last accepted signed root, if any. Raises `RootError` (`damaged`) and OSError."""
        data = read_if_there(self.path, MAX_ROOT)
        try:
            if data is not None:
                opened_root(data)
        except Untrusted as error:
            raise RootError("damaged", f"the last accepted trust root, `{self.path}`, is damaged: {error}") from None
        return data

    def keep(self, signed: bytes) -> None:
        """Store a root, synced. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        replace(self.path, signed, mode=PRIVATE_FILE)


def opened_root(signed: bytes) -> TrustRoot:
    """A root that is trusted because of its place, expired or not. Raises `Untrusted`."""
    return open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=0)


def root_in_force(kept: bytes | None, chain: Sequence[bytes], *, named: bool, now_us: int) -> bytes:
    """The root that counts, from the last one that a vehicle accepted and roots from the oldest to the newest. `named`
    roots must lead from the accepted one to a newer one, or be it; without an accepted one, the first is trusted
    because it was named. Those of a key store, which were not named, may be older. Raises `Untrusted`.
    """
    if kept is None:
        first, *newer = chain if named else chain[-1:]
        opened_root(first)
        return follow(newer, current=first, now_us=now_us)
    if not named and (not chain or opened_root(chain[-1]).version < opened_root(kept).version):
        chain = ()
    return follow(chain, current=kept, now_us=now_us)


#: the subfolder of the state folder for simulated vehicles that a run starts itself: the real vehicle with the same
#: identity must not inherit their flights or owed parameters
SIMULATED_FOLDER: Final = "simulated"

_LARGEST_LAST_LOG = 1 << 16  # octets of the file

_Hash = Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]


class _Kept(msgspec.Struct):
    """The content of the file."""

    log: str
    before: _Hash | None = None
    last: _Hash | None = None


class PreviousLog(NamedTuple):
    """The log before the next one: the hash of its last line, None if unknown or without one; a note, empty if all is
    well; its path, if its flight may not have ended; its path, if it can be trusted; and whether it is missing.
    """

    last: str | None
    note: str = ""
    broken_off: Path | None = None
    log: Path | None = None
    gone: bool = False


class LastLog:
    """Stores the last log of the vehicle with the identity `vehicle`. One process at a time writes. Simulations of a
    run have their own state folder (`SIMULATED_FOLDER` below the other).
    """

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "logs" / f"vehicle-{quote(vehicle, safe='')}"

    def settle(self, recover: Callable[[Path], Recovered]) -> PreviousLog:
        """The last log; `recover` ends it if it has no end. Never raises: no flight waits for a log."""
        try:
            known = _remembered(self.path)
        except (OSError, ValueError) as error:
            return PreviousLog(None, f"the previous log is not known: `{self.path}`: {_words(error)}")
        if known is None:
            return PreviousLog(None)
        log = Path(known.log)
        if known.last is not None:
            return PreviousLog(known.last, log=log)
        try:
            return _told(log, known.before, recover(log))._replace(broken_off=log)
        except FileNotFoundError:
            text = f"the previous log, `{log}`, is missing, so it is not known whether its flight ended"
            return PreviousLog(None, text, log, gone=True)
        except (OSError, InUse) as error:
            living = isinstance(error, InUse)  # its run still flies
            text = f"the previous log, `{log}`, was not closed and cannot be: {_words(error)}"
            return PreviousLog(None, text, None if living else log)

    def begin(self, log: Path, before: str | None) -> None:
        """Store a new log, whose genesis names `before`. Raises OSError."""
        self._write(log, before, None)

    def end(self, log: Path, before: str | None, last: str) -> None:
        """Store that it was closed; `last` is the hash of its last line. Raises OSError."""
        self._write(log, before, last)

    def _write(self, log: Path, before: str | None, last: str | None) -> None:
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        told = {"before": before, "last": last, "log": str(log.resolve())}
        replace(self.path, json.dumps(told).encode() + b"\n", mode=PRIVATE_FILE)


def known_end(state: Path, log: Path) -> str | None:
    """The hash of the last line of a log, if it is the last one of a vehicle here and was closed; None if unknown."""
    where = str(log.resolve())
    for path in sorted(each for of in (state, state / SIMULATED_FOLDER) for each in (of / "logs").glob("vehicle-*")):
        with suppress(OSError, ValueError):
            known = _remembered(path)
            if known is not None and known.log == where and known.last is not None:
                return known.last
    return None


def _remembered(path: Path) -> _Kept | None:
    """The stored last log. Raises OSError, and ValueError for an invalid file."""
    data = read_if_there(path, _LARGEST_LAST_LOG)
    try:
        return None if data is None else msgspec.json.decode(data, type=_Kept)
    except msgspec.DecodeError:
        raise ValueError("it is damaged") from None


def _told(log: Path, before: str | None, done: Recovered) -> PreviousLog:
    found = done.found
    if done.done:
        text = f"the previous log, `{log}`, was not closed: it was recovered with {found.records} records"
        note = text if not found.discarded else f"{text}, {found.discarded} octets discarded"
        return PreviousLog(done.last, note, log=log)
    if found.state is LogState.CLOSED:
        return PreviousLog(done.last, log=log)
    if found.state in RECOVERABLE:
        text = f"the previous log, `{log}`, was not closed: run `rtshcua recover` where the log's key is"
        return PreviousLog(done.last, text, log=log)
    if found.state is LogState.UNBEGUN:
        return PreviousLog(before)
    reason = "" if found.reason is None else f" (record {found.reason.record}: {found.reason.text})"
    what = "was tampered with" if found.state is LogState.TAMPERED else "belongs to another log key"
    return PreviousLog(done.last, f"the previous log, `{log}`, {what} and is left unchanged{reason}")


def _words(error: Exception) -> str:
    if isinstance(error, OSError):
        return (error.strerror or str(error)).lower()
    return "it is damaged" if isinstance(error, ValueError) else str(error)


def qualification_path(data: Path, vehicle: str) -> Path:
    """The file of the record of a vehicle."""
    return data / "qualifications" / f"vehicle-{quote(vehicle, safe='')}.cbor"


def kept_qualification(data: Path, vehicle: str) -> bytes | None:
    """The signed record, unverified; None without one. Raises OSError."""
    return read_if_there(qualification_path(data, vehicle), MAX_QUALIFICATION)


def keep_qualification(data: Path, vehicle: str, signed: bytes) -> Path:
    """Replace the stored record, and return its file. Raises OSError."""
    path = qualification_path(data, vehicle)
    make_folder(path.parent, mode=PRIVATE_FOLDER)
    replace(path, signed)
    return path


_LARGEST_OWED = 1 << 16  # octets of the file


class OwedParameters:
    """The owed parameters of the vehicle with the identity `vehicle`, when this was made. `left` holds the ones to
    restore; if they are unknown, it is empty and `trouble` says why: nothing is set then.

    `sets` says whether a run sets parameters; None for a reader. A run that does, or that owes some, locks the file
    until it is closed or its process dies; while another run has it, nothing is left to this one.
    """

    def __init__(self, state: Path, vehicle: str, *, sets: bool | None = None) -> None:
        name = quote(vehicle, safe="")
        self.path = state / "parameters" / f"vehicle-{name}"
        self.left: Mapping[str, Owed] = {}
        self.trouble: str | None = None
        self._lock: int | None = None
        try:
            left = self._read()
            if sets or (sets is not None and left):
                make_folder(self.path.parent, mode=PRIVATE_FOLDER)
                self._lock = lock(self.path.with_name(f"lock-{name}"))
                left = self._read()  # its former owner may have restored some since
            self.left = left
        except BlockingIOError:
            self.trouble = f"another run of `{vehicle}` has changed its parameters and will restore them"
        except (OSError, ValueError) as error:
            why = str(error) if isinstance(error, ValueError) else (error.strerror or str(error)).lower()
            self.trouble = f"the parameters to restore are not known: {why}"

    def close(self) -> None:
        """Release the file for another run."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _read(self) -> dict[str, Owed]:
        data = read_if_there(self.path, _LARGEST_OWED)
        if data is None:
            return {}
        try:
            told = json.loads(data)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            raise ValueError(f"`{self.path}` is damaged")
        return {name: self._owed(name, values) for name, values in told.items()}

    def keep(self, owed: Mapping[str, Owed]) -> None:
        """Store what is owed now, synced. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        told = {name: [shown(each.before), shown(each.value)] for name, each in owed.items()}
        replace(self.path, json.dumps(told, sort_keys=True).encode() + b"\n", mode=PRIVATE_FILE)

    def _owed(self, name: str, values: object) -> Owed:
        if name in SETTABLE and isinstance(values, list) and len(values) == 2:
            found = [_bits(each) for each in values]
            if found[0] is not None and found[1] is not None:
                return Owed(found[0], found[1])
        raise ValueError(f"`{self.path}` is damaged")


def _bits(text: object) -> int | None:
    try:
        return bits_of(float(text)) if isinstance(text, str) else None
    except ValueError:
        return None


_KEPT = re.compile(rb"([0-9]{1,18}) ([0-9a-f]{64})\n")
_LARGEST_KEPT = 1 << 10  # octets of the file


class BoundarySession(NamedTuple):
    """The number of a session, from 1 on, and a digest; 0 and zero octets before the first."""

    session: int
    digest: bytes


class DamagedState(Exception):
    """An existing file with invalid content."""


class BoundaryStore:
    """The sessions of the boundary on the vehicle with the identity `vehicle`."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "boundary" / f"vehicle-{quote(vehicle, safe='')}"

    def kept(self) -> BoundarySession:
        """The last stored session. Raises DamagedState, and OSError."""
        data = read_if_there(self.path, _LARGEST_KEPT)
        if data is None:
            return BoundarySession(0, START)
        said = _KEPT.fullmatch(data)
        if said is None:
            raise DamagedState(f"`{self.path}` is damaged, so the previous session of the boundary is not known")
        return BoundarySession(int(said[1]), bytes.fromhex(said[2].decode()))

    def keep(self, session: int, digest: bytes) -> None:
        """Store the digest of a session, synced. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        replace(self.path, b"%d %s\n" % (session, digest.hex().encode()), mode=PRIVATE_FILE)
