"""Taking logs into an archive, and verifying those that are there."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import duckdb
from msgspec.structs import replace

from rtshcua.adapters.archive import catalogue
from rtshcua.adapters.archive.entry import AUDIT, FAILED, Entry, Examined
from rtshcua.adapters.archive.examine import Task, missing
from rtshcua.adapters.archive.folder import Folder
from rtshcua.adapters.archive.parts import ingest, lay_out
from rtshcua.adapters.archive.workers import Workers
from rtshcua.wire.keys import PUBLIC_BYTES, Duty, key_id

#: octets of logs that are taken in at once: what a crash has to be done again
_BATCH = 256 << 20
#: rows of the index are written for so many logs at once at most
_MOST = 512
_DIGEST = re.compile("[0-9a-f]{64}")


class Check(NamedTuple):
    """What logs are verified with: the pinned root key, how deep, the time (UTC, us), and by whom."""

    pinned: bytes
    depth: str
    now_us: int
    workers: Workers

    @property
    def root(self) -> str:
        """The name of the pinned key, in hexadecimal, whichever way it was given."""
        return (key_id(Duty.ROOT, self.pinned) if len(self.pinned) == PUBLIC_BYTES else self.pinned).hex()


class Done(NamedTuple):
    """What became of one log: `known` where the archive had it already, verified no less."""

    path: Path
    entry: Entry
    known: bool


def add(folder: Folder, sources: Iterable[Path], check: Check) -> Iterator[Done]:
    """Takes logs in, verifies them and indexes those that are to be believed.

    What was given is done when the iterator says so: a crash before leaves the archive as it was then. Raises OSError
    where a file cannot be read, with all before it done.
    """
    with folder.writing():
        entries = catalogue.read(folder)
        catalogue.forget_unfinished(folder, entries)
        lay_out(folder)
        batch: dict[str, tuple[Path, Entry]] = {}
        for source in sources:
            try:
                digest, size, new = folder.take_in(source)
            except OSError:
                yield from _settle(folder, entries, batch, check)
                raise
            held = entries.get(digest)
            if digest in batch or (held is not None and not new and _no_less(held, check)):
                yield Done(source, held or batch[digest][1], known=True)
                continue
            batch[digest] = source, _asked(held, digest, size, str(source), check)
            if _enough(batch):
                yield from _settle(folder, entries, batch, check)
                batch.clear()
        yield from _settle(folder, entries, batch, check)


def verify(folder: Folder, check: Check) -> Iterator[Done]:
    """Verifies the logs of an archive once more, where they lie: those that were verified under this root."""
    with folder.writing():
        entries = catalogue.read(folder)
        catalogue.forget_unfinished(folder, entries)
        chosen = [entry for entry in entries.values() if entry.pinned == check.root]
        for first in range(0, len(chosen), _MOST):
            some = chosen[first : first + _MOST]
            batch = {
                each.log: (folder.log(each.log), _asked(each, each.log, each.bytes, each.name, check)) for each in some
            }
            yield from _settle(folder, entries, batch, check)


def reindex(folder: Folder, check: Check) -> Iterator[Done]:
    """Verifies every log of an archive, and makes the whole index anew from them; an old one is not believed, but for
    which logs there were: one that is gone is told.

    Broken off, it is to be done again.
    """
    with folder.writing():
        try:
            old = catalogue.read(folder)
        except duckdb.Error:
            old = {}
        for part in folder.parts():
            part.unlink()
        lay_out(folder)
        entries: dict[str, Entry] = {}
        catalogue.write(folder, ())
        batch: dict[str, tuple[Path, Entry]] = {}
        here = {path.parent.name: path for path in folder.logs()}
        gone = {log: folder.log(log) for log in sorted(old.keys() - here.keys()) if _DIGEST.fullmatch(log)}
        for log, path in (here | gone).items():
            size = path.stat().st_size if log in here else old[log].bytes
            batch[log] = path, replace(_asked(old.get(log), log, size, str(path), check), part="")
            if _enough(batch):
                yield from _settle(folder, entries, batch, check)
                batch.clear()
        yield from _settle(folder, entries, batch, check)


def _enough(batch: dict[str, tuple[Path, Entry]]) -> bool:
    """Whether these are to be done before more are taken in."""
    return len(batch) >= _MOST or sum(entry.bytes for _, entry in batch.values()) >= _BATCH


def _no_less(held: Entry, check: Check) -> bool:
    """Whether an entry already says what this check would."""
    return held.pinned == check.root and held.status != FAILED and (held.checked == AUDIT or check.depth != AUDIT)


def _asked(held: Entry | None, digest: str, size: int, name: str, check: Check) -> Entry:
    """The row of a log before its verification; of one that is known, what stays."""
    return Entry(
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


def _settle(
    folder: Folder, entries: dict[str, Entry], batch: dict[str, tuple[Path, Entry]], check: Check
) -> Iterator[Done]:
    if not batch:
        return
    asked = [entry for _, entry in sorted(batch.values(), key=lambda each: -each[1].bytes)]
    gone = {entry.log for entry in asked if not folder.log(entry.log).exists()}  # asked here: others may see no file
    tasks = [Task(folder.log(entry.log), entry, check.pinned) for entry in asked if entry.log not in gone]
    examined = list(check.workers.examine(tasks)) if tasks else []
    examined += [missing(entry) for entry in asked if entry.log in gone]
    fresh: list[Examined] = []
    for each in examined:
        if each.entry.part:
            entries[each.entry.log] = each.entry  # its records are indexed already, and cannot have changed
        else:
            fresh.append(each)
    entries.update((entry.log, entry) for entry in ingest(folder, fresh))
    catalogue.write(folder, entries.values())
    for digest, (path, _) in batch.items():
        yield Done(path, entries[digest], known=False)
