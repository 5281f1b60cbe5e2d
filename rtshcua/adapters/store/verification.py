"""Verify a log file: quickly and in several processes if it is valid, otherwise line by line (`rtshcua.evidence`)."""

import gc
import os
from array import array
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from hashlib import sha256
from itertools import repeat
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.quick_verification import LONGEST_SEGMENT, LogOutline, Octets, SegmentPart, outline, quick, scan
from rtshcua.evidence.records import AnyRecord
from rtshcua.ground.audit.audit import Audit, Auditor, anchors_of, trusted
from rtshcua.ground.audit.frames import FrameAudit
from rtshcua.ground.audit.trust import establish

#: octets of a log from which on several processes are used
LONG: Final = 32 << 20

_GROUP: Final = 16  # segments that a process takes at a time
_PIECE: Final = 1 << 18  # octets that are read at a time for hashing


class VerificationInputs(NamedTuple):
    """The inputs of a verification: the pinned root key, the expected bundle, and the notes of anchors."""

    pinned: bytes
    bundle: bytes | None = None
    anchors: tuple[str, ...] = ()


#: gets the number of octets that are done
Progress = Callable[[int], None]


def verify_carefully(
    path: Path,
    asked: VerificationInputs,
    *,
    derive: bool,
    frames: FrameAudit | None = None,
    each: Callable[[AnyRecord], None] | None = None,
    progress: Progress = lambda _: None,
) -> Audit:
    """The audit of a log line by line, in constant memory. `frames` are compared with it if it derives; `each` gets its
    valid records.
    """
    auditor = Auditor(asked.pinned, bundle=asked.bundle, derive=derive, anchors=asked.anchors, frames=frames)
    with open_regular(path) as file:
        return follow(file, auditor, None if each is None else lambda _, record: each(record), progress)


def follow(
    file: BinaryIO,
    auditor: Auditor,
    each: Callable[[bytes, AnyRecord], None] | None = None,
    progress: Progress = lambda _: None,
) -> Audit:
    """The audit of the lines of an open log. `each` gets its valid records with their lines."""
    collecting = gc.isenabled()
    gc.disable()  # nothing here makes reference cycles, and searching for them costs a tenth of the time
    try:
        for number, line in enumerate(lines(file)):
            if not number & 0xFFF:
                progress(file.tell())
            if not auditor.take(line):
                break
            if each is not None and auditor.record is not None:
                each(line, auditor.record)
    finally:
        if collecting:
            gc.enable()
    return auditor.audit()


def verify_quickly(
    path: Path, asked: VerificationInputs, *, fast: bool = False, jobs: int = 0, progress: Progress = lambda _: None
) -> Audit:
    """The audit of a log by its signatures; line by line where that fails. `fast` only checks the octets of the
    segments. `jobs` is the number of processes (threads, if `fast`); 0 is one for each core if the log is long.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        log = outline(_reader(file.fileno()), size)
        found = None if log is None else _quick(path, log, asked, fast=fast, jobs=jobs or _jobs(size), told=progress)
    return found or verify_carefully(path, asked, derive=False, progress=progress)


def _quick(
    path: Path, log: LogOutline, asked: VerificationInputs, *, fast: bool, jobs: int, told: Progress
) -> Audit | None:
    basis = establish(log.genesis, asked.pinned, bundle=asked.bundle)
    if isinstance(basis, Flaw):
        return None
    anchors = anchors_of(basis, log.genesis)
    if any(anchors.anchor(note) for note in asked.anchors):
        return None
    parts = _digests(log, jobs) if fast else _scanned(path, log, jobs)
    report = quick(log, _counted(parts, log.offsets, told), anchors)
    return None if report is None else Audit(trusted(report, basis), basis, 0, 0)


def _counted(
    parts: Iterable[SegmentPart | None], offsets: "array[int]", told: Progress
) -> Iterator[SegmentPart | None]:
    for offset, part in zip(offsets, parts, strict=False):
        told(offset)
        yield part


def _jobs(size: int) -> int:
    return len(os.sched_getaffinity(0)) if size >= LONG and hasattr(os, "sched_getaffinity") else 1


def _reader(handle: int) -> Octets:
    """A function that reads an open file at any offset, in any thread."""

    def read(offset: int, length: int) -> bytes:
        pieces = []
        while length > 0 and (piece := os.pread(handle, length, offset)):
            pieces.append(piece)
            offset, length = offset + len(piece), length - len(piece)
        return b"".join(pieces)

    return read


def _digests(log: LogOutline, jobs: int) -> Iterator[SegmentPart | None]:
    """The parts of a log by their octets alone. Hashing releases the interpreter lock, so signatures are verified
    meanwhile.
    """
    threads = ThreadPoolExecutor(jobs)
    try:
        yield from threads.map(lambda start, end: _digest(log.octets, start, end), log.offsets, log.offsets[1:])
    finally:
        threads.shutdown(cancel_futures=True)


def _digest(octets: Octets, start: int, end: int) -> SegmentPart | None:
    if end - start > LONGEST_SEGMENT:
        return None
    hasher = sha256()
    for offset in range(start, end, _PIECE):
        hasher.update(octets(offset, min(_PIECE, end - offset)))
    return SegmentPart(hasher.hexdigest(), None)


def _scanned(path: Path, log: LogOutline, jobs: int) -> Iterator[SegmentPart | None]:
    """The parts of a log with their leaves."""
    spans = list(zip(log.offsets, log.offsets[1:], strict=False))
    groups = [spans[number : number + _GROUP] for number in range(0, len(spans), _GROUP)]
    if jobs == 1 or len(groups) == 1:
        for group in groups:
            yield from _scan(path, group)
        return
    with ProcessPoolExecutor(min(jobs, len(groups))) as processes:
        try:
            for parts in processes.map(_scan, repeat(path), groups):
                yield from parts
        finally:
            processes.shutdown(cancel_futures=True)


def _scan(path: Path, spans: list[tuple[int, int]]) -> list[SegmentPart | None]:
    """The parts of some segments, up to the first one out of place."""
    parts: list[SegmentPart | None] = []
    with open_regular(path) as file:
        read = _reader(file.fileno())
        for start, end in spans:
            parts.append(None if end - start > LONGEST_SEGMENT else scan(read(start, end - start)))
            if parts[-1] is None:
                break
    return parts
