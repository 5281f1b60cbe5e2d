"""Ending the log of a flight that broke off: `rtshcua.evidence.recovery` on the disk, safe to be broken off itself.

    log.jsonl         the log; what is not kept of it is cut off its end, and `recover` and `close` are appended
    log.discarded     what was cut off, as it was; `log.discarded.2` and so on where there is one already
    log.recovering    the two lines, before anything is cut: whoever comes next finishes what was begun

In this order, each on the disk before the next: the copy of what is discarded, the two lines, the cut, the end. Nothing
is deleted but `log.recovering`, at last.
"""

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.files.port import SYSTEM, Disk
from rtshcua.adapters.files.recovering import digest, end, forget, keep, places, plan_of, write
from rtshcua.adapters.files.secret import disclosure_of
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, Recover
from rtshcua.evidence.recovery import RECOVERABLE, Examination, Examined, State, ending
from rtshcua.model.flat.situation import Now

_LONGEST_PLAN = 1 << 16


class InUse(Exception):
    """The log is still being written, or recovered, by another process."""


class Signer(NamedTuple):
    """Who ends logs: signs with the log key `public`, at a moment; `draw` gives 32 secret random bytes.

    So that records of a log with more than `most_disclosed` records can be shown in part, it must be asked for more:
    working that out takes longer than all the rest.
    """

    public: bytes
    certify: Callable[[bytes], bytes]
    draw: Callable[[], bytes]
    now: Callable[[], Now]
    most_disclosed: int = 20_000


class Recovered(NamedTuple):
    """What came of it: how the log was found, where what was discarded is now, the hash of the log's last line.

    `done` False: the log is as it was. `last` is then that of the last line that verifies, hexadecimal.
    """

    found: Examined
    done: bool
    discarded: Path | None
    last: str


def examine(path: Path, public: bytes | None) -> Examined:
    """The log as it is, for the log key `public` or any. Raises OSError."""
    examination = Examination(public)
    with open_regular(path) as file:
        for line in lines(file):
            examination.take(line)
    return examination.examined()


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Holds the log, as long as its writer lives; the system lets go of it when the process dies. Raises `InUse`."""
    with open_regular(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InUse(f"`{path}` is still being written") from None
        except OSError:
            pass  # a file system without locks
        yield


def recover(path: Path, signer: Signer, *, disk: Disk = SYSTEM) -> Recovered:
    """Ends a log that has no close, unless it was tampered with. Raises `InUse` and OSError; it can be called again."""
    with alone(path):
        begun = _begun(path, signer.public)
        if begun is not None:
            return _finish(path, begun, disk)
        found = examine(path, signer.public)
        if found.state not in RECOVERABLE:
            return Recovered(found, False, None, found.head.prev)
        discarded = keep(path, found.kept, disk) if found.discarded else None
        tail = ending(
            found, signer.now(), signer.certify, signer.public, signer.draw, partial(_disclosed, path, found, signer)
        )
        write(plan_of(path), tail, disk)
        end(path, found.kept, tail, disk)
        return Recovered(found, True, discarded, leaf_hash(tail.partition(b"\n")[2]).hex())


def _disclosed(path: Path, found: Examined, signer: Signer, recover: bytes) -> bytes | None:
    if found.records > signer.most_disclosed:
        return None
    with open_regular(path) as file:
        return disclosure_of(path, found.records + 1, chain(islice(lines(file), found.records), [recover]))


# ------------------------------------------------------------------------------------------ what was begun


class _Begun(NamedTuple):
    """What an earlier recovery meant to do, if it got far enough: what it found, what it keeps, and the two lines."""

    found: Examined
    tail: bytes


def _begun(path: Path, public: bytes) -> _Begun | None:
    if not plan_of(path).is_file():
        return None
    tail = read_regular(plan_of(path), _LONGEST_PLAN, path.parent)
    first, newline, second = tail.partition(b"\n")
    recover, close = read(first + newline), read(second)
    if not isinstance(recover, Recover) or not isinstance(close, Close):
        return None  # torn itself: then nothing was cut yet
    examination = Examination(public)
    with open_regular(path) as file:
        for line in islice(lines(file), recover.seq):
            if not examination.take(line):
                return None
    found = examination.examined()
    if found.state is not State.WHOLE or not examination.take(first + newline) or not examination.take(second):
        return None
    if recover.discarded_bytes:
        discarded = bytes.fromhex(recover.discarded_digest)
        found = found._replace(state=State.TORN, discarded=recover.discarded_bytes, discarded_digest=discarded)
    return _Begun(found, tail)


def _finish(path: Path, begun: _Begun, disk: Disk) -> Recovered:
    found, tail = begun
    discarded = _kept_before(path, found) if found.discarded else None
    with open_regular(path) as file:
        file.seek(found.kept)
        behind = file.read(len(tail) + 1)
    if behind == tail:
        forget(path, disk)
    else:
        if not tail.startswith(behind) and not _same(path, found.kept, found):
            keep(path, found.kept, disk, besides=discarded)  # what the power left of the two lines
        end(path, found.kept, tail, disk)
    return Recovered(found, True, discarded, leaf_hash(tail.partition(b"\n")[2]).hex())


def _kept_before(path: Path, found: Examined) -> Path | None:
    for place in places(path):
        if not place.exists():
            return None
        if _same(place, 0, found):
            return place
    return None


def _same(path: Path, start: int, found: Examined) -> bool:
    """Whether the file, from there on, is what is discarded."""
    size = path.stat().st_size - start
    return size == found.discarded and digest(path, start, size) == found.discarded_digest
