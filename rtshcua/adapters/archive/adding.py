"""Add logs to an archive, and verify the ones in it."""

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

#: octets of logs that are added together: the most that a crash undoes
_BATCH = 256 << 20
#: the most logs whose index rows are written together
_MOST = 512
_DIGEST = re.compile("[0-9a-f]{64}")


class VerificationOptions(NamedTuple):
    """How to verify logs: the pinned root key, the depth, the time (UTC, us), and the processes."""

    pinned: bytes
    depth: str
    now_us: int
    workers: LogVerifiers

    @property
    def root(self) -> str:
        """The name of the pinned key, in hexadecimal."""
        return (key_id(Duty.ROOT, self.pinned) if len(self.pinned) == PUBLIC_BYTES else self.pinned).hex()


class Done(NamedTuple):
    """The result for one log. `known`: the archive had it already, verified at least as deeply."""

    path: Path
    entry: ArchiveEntry
    known: bool


def add(folder: ArchiveFolder, sources: Iterable[LogSource], check: VerificationOptions) -> Iterator[Done]:
    """Copy logs in, verify them and index the valid ones. A returned log is done: a crash before leaves the archive as
    it was. Raises OSError where a file cannot be read, after all logs before it.
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
    """Verify the logs in an archive again: those that were verified under this root."""
    with folder.writing():
        entries = read_catalogue(folder)
        forget_unfinished(folder, entries)
        batch = _Batch(folder, entries, check)
        for each in [entry for entry in entries.values() if entry.pinned == check.root]:
            yield from batch.put(folder.log(each.log), _asked(each, each.log, each.bytes, each.name, check))
        yield from batch.settle()


def reindex(folder: ArchiveFolder, check: VerificationOptions) -> Iterator[Done]:
    """Verify every log in an archive and rebuild the index from them. The old index is only used to report missing
    logs. If interrupted, repeat it.
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
    """Whether an entry already holds the result of this check."""
    return held.pinned == check.root and held.status != FAILED and (held.checked == AUDIT or check.depth != AUDIT)


def _asked(held: ArchiveEntry | None, digest: str, size: int, name: str, check: VerificationOptions) -> ArchiveEntry:
    """The row of a log before its verification; for a known log, with the values that stay."""
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
    """Logs that are verified and indexed together. `entries`, the rows by log, are updated with the results; `copies`
    counts further sources of the same log.
    """

    def __init__(self, folder: ArchiveFolder, entries: dict[str, ArchiveEntry], check: VerificationOptions) -> None:
        self.logs: dict[str, tuple[Path, ArchiveEntry]] = {}
        self.copies: list[tuple[Path, str]] = []
        self._folder = folder
        self._entries = entries
        self._check = check

    def put(self, path: Path, entry: ArchiveEntry) -> Iterator[Done]:
        """Add a log; return results once there are enough logs to process."""
        self.logs[entry.log] = path, entry
        if len(self.logs) >= _MOST or sum(entry.bytes for _, entry in self.logs.values()) >= _BATCH:
            yield from self.settle()

    def settle(self) -> Iterator[Done]:
        """The results of the waiting logs: verified, indexed, and in the catalogue."""
        if not self.logs:
            return
        folder, entries = self._folder, self._entries
        asked = [entry for _, entry in sorted(self.logs.values(), key=lambda each: -each[1].bytes)]
        # here: other processes may see no file
        gone = {entry.log for entry in asked if not folder.log(entry.log).exists()}
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
