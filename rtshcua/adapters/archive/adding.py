"""Taking logs into an archive, and verifying those that are there."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import duckdb
from msgspec.structs import replace

from rtshcua.adapters.archive.entry import AUDIT, FAILED, ArchiveEntry, VerifiedLog
from rtshcua.adapters.archive.examine import LogVerifiers, Task, missing
from rtshcua.adapters.archive.folder import ArchiveFolder, LogSource
from rtshcua.adapters.archive.index import forget_unfinished, ingest, lay_out, read_catalogue, write_catalogue
from rtshcua.wire.keys import PUBLIC_BYTES, Duty, key_id
from rtshcua.wire.untrusted import Untrusted

#: octets of logs that are taken in at once: what a crash has to be done again
_BATCH = 256 << 20
#: rows of the index are written for so many logs at once at most
_MOST = 512
_DIGEST = re.compile("[0-9a-f]{64}")


class VerificationOptions(NamedTuple):
    """What logs are verified with: the pinned root key, how deep, the time (UTC, us), and by whom."""

    pinned: bytes
    depth: str
    now_us: int
    workers: LogVerifiers

    @property
    def root(self) -> str:
        """The name of the pinned key, in hexadecimal, whichever way it was given."""
        return (key_id(Duty.ROOT, self.pinned) if len(self.pinned) == PUBLIC_BYTES else self.pinned).hex()


class Done(NamedTuple):
    """What became of one log: `known` where the archive had it already, verified no less."""

    path: Path
    entry: ArchiveEntry
    known: bool


def add(folder: ArchiveFolder, sources: Iterable[LogSource], check: VerificationOptions) -> Iterator[Done]:
    """Takes logs in, verifies them and indexes those that are to be believed.

    What was given is done when the iterator says so: a crash before leaves the archive as it was then. Raises OSError
    where a file cannot be read, with all before it done.
    """
    with folder.writing():
        entries = read_catalogue(folder)
        forget_unfinished(folder, entries)
        lay_out(folder)
        batch = _Batch(folder, entries, check)
        for source in sources:
            try:
                digest, size, new = folder.take_in(source)
            except OSError:
                yield from batch.settle()
                raise
            held = entries.get(digest)
            if digest in batch.logs:
                batch.copies.append((source.path, digest))
                continue
            if held is not None and not new and _no_less(held, check):
                yield Done(source.path, held, known=True)
                continue
            yield from batch.put(source.path, _asked(held, digest, size, str(source.path), check))
        yield from batch.settle()


def verify(folder: ArchiveFolder, check: VerificationOptions) -> Iterator[Done]:
    """Verifies the logs of an archive once more, where they lie: those that were verified under this root."""
    with folder.writing():
        entries = read_catalogue(folder)
        forget_unfinished(folder, entries)
        batch = _Batch(folder, entries, check)
        for each in [entry for entry in entries.values() if entry.pinned == check.root]:
            yield from batch.put(folder.log(each.log), _asked(each, each.log, each.bytes, each.name, check))
        yield from batch.settle()


def reindex(folder: ArchiveFolder, check: VerificationOptions) -> Iterator[Done]:
    """Verifies every log of an archive, and makes the whole index anew from them; an old one is not believed, but for
    which logs there were: one that is gone is told.

    Broken off, it is to be done again.
    """
    with folder.writing():
        try:
            old = read_catalogue(folder)
        except (duckdb.Error, Untrusted):
            old = {}
        for part in folder.parts():
            part.unlink()
        lay_out(folder)
        write_catalogue(folder, ())
        batch = _Batch(folder, {}, check)
        here = {path.parent.name: path for path in folder.logs()}
        gone = {log: folder.log(log) for log in sorted(old.keys() - here.keys()) if _DIGEST.fullmatch(log)}
        for log, path in (here | gone).items():
            size = path.stat().st_size if log in here else old[log].bytes
            yield from batch.put(path, replace(_asked(old.get(log), log, size, str(path), check), part=""))
        yield from batch.settle()


def _no_less(held: ArchiveEntry, check: VerificationOptions) -> bool:
    """Whether an entry already says what this check would."""
    return held.pinned == check.root and held.status != FAILED and (held.checked == AUDIT or check.depth != AUDIT)


def _asked(held: ArchiveEntry | None, digest: str, size: int, name: str, check: VerificationOptions) -> ArchiveEntry:
    """The row of a log before its verification; of one that is known, what stays."""
    return ArchiveEntry(
        log=digest,
        bytes=size,
        name=name if held is None else held.name,
        added_us=check.now_us if held is None else held.added_us,
        checked_us=check.now_us,
        checked=check.depth,
        pinned=check.root,
        status=FAILED,
        part="" if held is None else held.part,
    )


class _Batch:
    """Logs that are verified and indexed together. `entries`, the rows by log, follow what came of them; of `copies` of
    them the same came.
    """

    def __init__(self, folder: ArchiveFolder, entries: dict[str, ArchiveEntry], check: VerificationOptions) -> None:
        self.logs: dict[str, tuple[Path, ArchiveEntry]] = {}
        self.copies: list[tuple[Path, str]] = []
        self._folder = folder
        self._entries = entries
        self._check = check

    def put(self, path: Path, entry: ArchiveEntry) -> Iterator[Done]:
        """One more log; what came of all, where they are enough to be done before more are taken in."""
        self.logs[entry.log] = path, entry
        if len(self.logs) >= _MOST or sum(entry.bytes for _, entry in self.logs.values()) >= _BATCH:
            yield from self.settle()

    def settle(self) -> Iterator[Done]:
        """What came of those that wait: verified, indexed, and in the catalogue."""
        if not self.logs:
            return
        folder, entries = self._folder, self._entries
        asked = [entry for _, entry in sorted(self.logs.values(), key=lambda each: -each[1].bytes)]
        gone = {entry.log for entry in asked if not folder.log(entry.log).exists()}  # here: others may see no file
        tasks = [Task(folder.log(entry.log), entry, self._check.pinned) for entry in asked if entry.log not in gone]
        examined = list(self._check.workers.examine(tasks)) if tasks else []
        examined += [missing(entry) for entry in asked if entry.log in gone]
        fresh: list[VerifiedLog] = []
        for each in examined:
            if each.entry.part:
                entries[each.entry.log] = each.entry  # its records are indexed already, and cannot have changed
            else:
                fresh.append(each)
        entries.update((entry.log, entry) for entry in ingest(folder, fresh))
        write_catalogue(folder, entries.values())
        for digest, (path, _) in self.logs.items():
            yield Done(path, entries[digest], known=False)
        for path, digest in self.copies:
            yield Done(path, entries[digest], known=True)
        self.logs.clear()
        self.copies.clear()
