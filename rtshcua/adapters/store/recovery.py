"""Ending the log of a flight that broke off: `rtshcua.evidence.recovery` on the disk, safe to be broken off itself.

    log.jsonl         the log; what is not kept of it is cut off its end, and `recover` and `close` are appended
    log.discarded     what was cut off, as it was; `log.discarded.2` and so on where there is one already
    log.recovering    the two lines, before anything is cut: whoever comes next finishes what was begun

In this order, each on the disk before the next: the copy of what is discarded, the two lines, the cut, the end. Nothing
is deleted but `log.recovering`, at last. A log of which a witness saw more, or another, was
cut or rewritten by no crash: it is left as it is.
"""

import errno
import fcntl
import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from itertools import count, islice
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.evidence_file import SYSTEM, Disk, LogFile, write_all
from rtshcua.adapters.store.logs import lines, read_anchors
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.note import octets
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, Recover
from rtshcua.evidence.recovery import RECOVERABLE, Examination, FoundLog, LogState, ending
from rtshcua.evidence.witnessing.anchors import Anchors
from rtshcua.evidence.witnessing.submission import note_of
from rtshcua.model.flat.situation import Now
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT, open_root
from rtshcua.wire.untrusted import Untrusted

_LONGEST_PLAN = 1 << 16
_CHUNK = 1 << 20


class InUse(Exception):
    """Another process is writing or recovering the log."""


class LogEnder(NamedTuple):
    """Ends logs: signs with the log key `public`, at a given time; `draw` returns 32 secret random bytes."""

    public: bytes
    certify: Callable[[bytes], bytes]
    draw: Callable[[], bytes]
    now: Callable[[], Now]


class Recovered(NamedTuple):
    """The result: how the log was found, where the discarded part is now, and the hash of the log's last line. `done`
    False: the log is unchanged. `last` is then the hash of the last line that verifies, in hexadecimal.
    """

    found: FoundLog
    done: bool
    discarded: Path | None
    last: str


def examine(path: Path, public: bytes | None) -> FoundLog:
    """The state of a log, for the log key `public` or any, and for the notes of witnesses beside it. Raises OSError."""
    anchors = read_anchors(path)  # before the log: see `read_anchors`
    examination, checkpoints = Examination(public), list[str]()
    with open_regular(path) as file:
        for line in lines(file):
            kept = examination.take(line)
            note = note_of(line) if kept and anchors else None
            checkpoints += [] if note is None else [note]
    found = examination.examined()
    return found if not anchors else _witnessed(found, checkpoints, anchors)


def _witnessed(found: FoundLog, checkpoints: Iterable[str], anchors: Iterable[str]) -> FoundLog:
    """The state of a log, unless a witness of its own trust root saw another log. That root is not verified: whoever
    ends the log has the key that signed it, and verifiers decide whether to trust it.
    """
    genesis = found.genesis
    data = None if genesis is None else octets(genesis.root)
    if genesis is None or data is None or found.state not in (*RECOVERABLE, LogState.CLOSED):
        return found
    try:
        root = open_root(data, pinned=cose.unverified(data, limit=MAX_ROOT).kid, now_us=genesis.utc_us)
    except Untrusted:
        return found
    witnesses = root.witnesses(genesis.vehicle, genesis.utc_us)
    seen = Anchors(origin_of(genesis.vehicle, genesis.boot), witnesses, root.witness_threshold)
    flaws = [*map(seen.checkpoint, checkpoints), *map(seen.anchor, anchors), seen.finish(found.records)]
    flaw = next((each for each in flaws if isinstance(each, Flaw)), None)
    if flaw is None:
        return found
    return found._replace(state=LogState.TAMPERED, reason=flaw.at(found.records, found.kept))


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock the log for as long as it is written; the system unlocks it when the process dies. Raises `InUse`."""
    with open_regular(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InUse(f"`{path}` is still being written") from None
        except OSError:
            pass  # a file system without locks
        yield


def look(path: Path) -> Recovered:
    """The state of a log where nobody has the key that ends it. Raises `InUse` and OSError."""
    with alone(path):
        found = examine(path, None)
        return Recovered(found, False, None, found.head.prev)


def recover(path: Path, signer: LogEnder, *, disk: Disk = SYSTEM) -> Recovered:
    """End a log without a close record, unless it was tampered with. Raises `InUse` and OSError; it may be called
    again.
    """
    with alone(path):
        begun = _begun(path, signer.public)
        if begun is not None:
            return _finish(path, *begun, disk)
        found = examine(path, signer.public)
        if found.state not in RECOVERABLE:
            return Recovered(found, False, None, found.head.prev)
        discarded = _keep(path, found.kept, disk) if found.discarded else None
        tail = ending(found, signer.now(), signer.certify, signer.public, signer.draw)
        _write_plan(_plan_of(path), tail, disk)
        _end(path, found.kept, tail, disk)
        return Recovered(found, True, discarded, _last(tail))


# ------------------------------------------------------------------------------------------ interrupted recoveries


def _begun(path: Path, public: bytes) -> tuple[FoundLog, bytes] | None:
    """The state found by an interrupted recovery and the two lines that it meant to append, if it got that far."""
    if not _plan_of(path).is_file():
        return None
    tail = read_regular(_plan_of(path), _LONGEST_PLAN, path.parent)
    first, newline, second = tail.partition(b"\n")
    recover, close = read(first + newline), read(second)
    if not isinstance(recover, Recover) or not isinstance(close, Close):
        return None  # torn itself: nothing was cut yet then
    examination = Examination(public)
    with open_regular(path) as file:
        for line in islice(lines(file), recover.seq):
            if not examination.take(line):
                return None
    found = examination.examined()
    if found.state is not LogState.WHOLE or not examination.take(first + newline) or not examination.take(second):
        return None
    if recover.discarded_bytes:
        discarded = bytes.fromhex(recover.discarded_digest)
        found = found._replace(state=LogState.TORN, discarded=recover.discarded_bytes, discarded_digest=discarded)
    return found, tail


def _finish(path: Path, found: FoundLog, tail: bytes, disk: Disk) -> Recovered:
    discarded = _kept_before(path, found) if found.discarded else None
    with open_regular(path) as file:
        file.seek(found.kept)
        behind = file.read(len(tail) + 1)
    if behind == tail:
        _forget(path, disk)
    else:
        if not tail.startswith(behind) and not _same(path, found.kept, found):
            _keep(path, found.kept, disk, besides=discarded)  # what a power failure left of the two lines
        _end(path, found.kept, tail, disk)
    return Recovered(found, True, discarded, _last(tail))


def _last(tail: bytes) -> str:
    """The hash of the second of the two lines."""
    return leaf_hash(tail.partition(b"\n")[2]).hex()


def _kept_before(path: Path, found: FoundLog) -> Path | None:
    for place in _places(path):
        if not place.exists():
            return None
        if _same(place, 0, found):
            return place
    return None


def _same(path: Path, start: int, found: FoundLog) -> bool:
    """Whether the file, from there on, is the discarded part."""
    size = path.stat().st_size - start
    return size == found.discarded and _digest(path, start, size) == found.discarded_digest


# --------------------------- the steps; each is on the disk when it returns, and can be repeated


def _plan_of(path: Path) -> Path:
    """The file that holds the end of a log until it is appended."""
    return path.with_suffix(".recovering")


def _places(path: Path) -> Iterator[Path]:
    """The possible files of the discarded part of a log, the first one first."""
    first = path.with_suffix(".discarded")
    yield first
    for number in count(2):
        yield first.with_name(f"{first.name}.{number}")


def _keep(path: Path, kept: int, disk: Disk, *, besides: Path | None = None) -> Path:
    """Copy the part after the first `kept` octets, and return where it is. An interrupted copy is written anew, but no
    other file is changed, nor that in `besides`.
    """
    size = path.stat().st_size - kept
    for place in _places(path):
        if place == besides:
            continue
        try:
            found = place.lstat()
        except FileNotFoundError:
            file = disk.create(place)
            break
        there = found.st_size
        if _own(found) and there <= size and _digest(place, 0, there) == _digest(path, kept, there):
            file = disk.reopen(place)  # ours, complete or torn
            break
    _write(file, _chunks(path, kept, size))
    return place


def _write_plan(path: Path, data: bytes, disk: Disk) -> None:
    """Write the file, synced when this returns; until then it may hold anything."""
    if path.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    there = path.exists()
    if there and not _own(path.lstat()):
        raise OSError(errno.EEXIST, "something else is there", str(path))
    _write(disk.reopen(path) if there else disk.create(path), [data])


def _end(path: Path, kept: int, tail: bytes, disk: Disk) -> None:
    """Cut the log off after so many octets, and append its end."""
    _write(disk.reopen(path), [tail], kept)
    _forget(path, disk)


def _write(file: LogFile, chunks: Iterable[bytes], kept: int = 0) -> None:
    """Replace everything after the first `kept` octets of a file by these chunks, and close it."""
    try:
        file.truncate(kept)
        if kept:
            file.sync()  # otherwise a power failure could leave the cut part after the appended one
        for chunk in chunks:
            write_all(file, chunk)
        file.sync()
    finally:
        file.close()


def _forget(path: Path, disk: Disk) -> None:
    """Remove the plan. If this fails, the next call finds the log closed, and tries again."""
    with suppress(OSError):
        _plan_of(path).unlink()
        disk.sync_folder(path.parent)


def _own(found: os.stat_result) -> bool:
    """Whether a file has no other name: another's content is not overwritten."""
    return stat.S_ISREG(found.st_mode) and found.st_nlink == 1


def _digest(path: Path, start: int, size: int) -> bytes:
    """SHA-256 of so many octets of a file, or as many as there are."""
    hasher = sha256()
    for chunk in _chunks(path, start, size):
        hasher.update(chunk)
    return hasher.digest()


def _chunks(path: Path, start: int, size: int) -> Iterator[bytes]:
    with open_regular(path) as file:
        file.seek(start)
        while size > 0 and (chunk := file.read(min(size, _CHUNK))):
            size -= len(chunk)
            yield chunk
