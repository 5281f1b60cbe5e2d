"""The folder of an archive.

    archive.json                        what this folder is, and its version
    logs/ab/<digest>/log.jsonl          a log, octet for octet, under the SHA-256 of its octets; never changed
    logs/ab/<digest>/*.anchors          what witnesses cosigned of it, under the SHA-256 of theirs
    index/logs.parquet                  a row a log: all that is known, replaced as a whole by each change
    index/<table>/<part>.parquet        rows of records; what counts are those of the logs that logs.parquet names

The logs are what is kept; the index is worked out from them and can be thrown away.
"""

import errno
import json
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import file_digest, sha256
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from rtshcua.adapters.store.logs import ANCHORS, START, anchors_path
from rtshcua.adapters.store.reading import NotRegular, open_regular, read_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.adapters.store.writing import (
    PUBLIC_FILE,
    UNFINISHED,
    lock,
    make_folder,
    naming,
    open_new,
    publish,
    replace,
    write_new,
)
from rtshcua.evidence.witnessing.anchors import notes
from rtshcua.wire.untrusted import Untrusted

FORMAT, VERSION = "rtshcua/archive", 1
#: the tables of records, one folder each
TABLES: Final = ("decisions", "effects", "seals")
#: the part of each table without rows
NOTHING: Final = "nothing"

_MARK: Final = "archive.json"
_BLOCK: Final = 1 << 20
_MOST_ANCHORS: Final = 16 << 20  # octets of a file of anchors
_PATTERN: Final = frozenset("*?[]{}")  # the query engine would take a path with these for a pattern


class LogSource(NamedTuple):
    """A log to add. Below `root`, the folder that the user named, no link is followed."""

    path: Path
    root: Path | None = None


class ArchiveFolder:
    """An archive's folder. Raises `Untrusted` (`no-archive`, `archive-version`, `archive-path`) for other folders."""

    def __init__(self, path: Path, *, make: bool = False) -> None:
        self.path = path.resolve()
        if _PATTERN & set(str(self.path)):
            raise Untrusted(
                "archive-path", f"`{path}`: the path of an archive must not contain {' '.join(sorted(_PATTERN))}"
            )
        if make and not (self.path / _MARK).exists():
            self._make()
        self._check(path)
        self._expect_plain()
        if make:
            for folder in (self.path / "logs", self.scratch, *map(self.table, TABLES)):
                make_folder(folder, root=self.path)

    def _make(self) -> None:
        if self.path.exists() and not all(path.name.startswith(UNFINISHED) for path in self.path.iterdir()):
            raise Untrusted("no-archive", f"`{self.path}` is not an archive: it holds other files")
        make_folder(self.path)
        replace(self.path / _MARK, json.dumps({"format": FORMAT, "version": VERSION}).encode() + b"\n")

    def _check(self, given: Path) -> None:
        try:
            said = json.loads(read_regular(self.path / _MARK, _BLOCK, self.path))
        except (OSError, ValueError):
            raise Untrusted("no-archive", f"`{given}` is not an archive") from None
        if said != {"format": FORMAT, "version": VERSION}:
            raise Untrusted("archive-version", f"`{given}` is an archive of another version than {VERSION}")

    def _expect_plain(self) -> None:
        """Check that nothing in the archive's folders leads out of it or could block: an archive may come from a
        stranger. The folders of logs are not checked here, because no link to a log is followed.
        """
        index = self.catalogue.parent
        for folder in (self.path, self.scratch, index, *map(self.table, TABLES)):
            with suppress(FileNotFoundError), os.scandir(folder) as found:
                for each in found:
                    if not (each.is_dir(follow_symlinks=False) or each.is_file(follow_symlinks=False)):
                        name = Path(each.path).relative_to(self.path)
                        text = f"`{name}` in the archive `{self.path}` is neither a file nor a folder"
                        raise Untrusted("archive-path", text)

    @property
    def catalogue(self) -> Path:
        """The table of logs."""
        return self.path / "index" / "logs.parquet"

    @property
    def scratch(self) -> Path:
        """The folder for unfinished files."""
        return self.path / "tmp"

    def table(self, name: str) -> Path:
        """The folder with the parts of a table."""
        return self.path / "index" / name

    def log(self, digest: str) -> Path:
        """The log with this SHA-256."""
        return self.path / "logs" / digest[:2] / digest / LOG

    def logs(self) -> list[Path]:
        """All logs in the archive."""
        return sorted((self.path / "logs").glob(f"*/*/{LOG}"))

    def parts(self) -> list[Path]:
        """All files with rows of records."""
        return [path for name in TABLES for path in self.table(name).glob("*.parquet")]

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Lock the archive for changes. Raises BlockingIOError if another process has it."""
        with os.fdopen(lock(self.path / "lock", mode=PUBLIC_FILE), "rb"):
            for left in self.scratch.iterdir():
                if left.is_dir() and not left.is_symlink():
                    shutil.rmtree(left)
                else:
                    left.unlink()
            yield

    def take_in(self, source: LogSource) -> tuple[str, int, bool]:
        """Copy a log in, with its anchors, unless it is there. Returns its SHA-256, its size, and whether anything is
        new.
        """
        scratch = self.scratch / f"{os.getpid()}.taken"
        try:
            with open_regular(*source) as reader:
                if not reader.peek(len(START)).startswith(START):
                    raise NotRegular(errno.ENXIO, "it is not a log of this program", str(source.path))
                mode = _mode(reader, 0o444)
                with naming(self.path), os.fdopen(open_new(scratch, mode=mode), "wb") as writer:
                    digest, size = _copy(reader, writer)
            place = self.log(digest)
            new = not _holds(place, digest, size, self.path)  # a copy that was damaged later is replaced
            if new:
                make_folder(place.parent, root=self.path)
                publish(scratch, place, self.path)
        finally:
            scratch.unlink(missing_ok=True)
        return digest, size, self._take_anchors(source, digest) or new

    def _take_anchors(self, source: LogSource, digest: str) -> bool:
        """Copy the anchors: all of those beside a log named as in a run's folder, otherwise those with its name."""
        log, root = source
        found = log.parent.glob(f"*{ANCHORS}") if log.name == LOG else [anchors_path(log)]
        new = False
        for path in found:
            try:
                with open_regular(path, root or path.parent) as file:
                    data, mode = file.read(_MOST_ANCHORS + 1), _mode(file, PUBLIC_FILE)
            except (FileNotFoundError, NotRegular):
                continue
            if len(data) > _MOST_ANCHORS or not any(notes(data.decode("utf-8", "replace"))):
                continue  # only notes of witnesses are copied
            with suppress(FileExistsError):
                copy = self.log(digest).with_name(sha256(data).hexdigest() + ANCHORS)
                write_new(copy, data, mode=mode, root=self.path)
                new = True
        return new


def _mode(file: BinaryIO, most: int) -> int:
    """The permissions of a copy: nobody who may not read the file itself may read it."""
    return stat.S_IMODE(os.fstat(file.fileno()).st_mode) & most | stat.S_IRUSR


def _holds(place: Path, digest: str, size: int, root: Path) -> bool:
    """Whether the file there is a log with these octets, not only with this name."""
    try:
        with open_regular(place, root) as file:
            return os.fstat(file.fileno()).st_size == size and file_digest(file, "sha256").hexdigest() == digest
    except OSError:
        return False


def _copy(reader: BinaryIO, writer: BinaryIO) -> tuple[str, int]:
    hasher, size = sha256(), 0
    while block := reader.read(_BLOCK):
        hasher.update(block)
        writer.write(block)
        size += len(block)
    writer.flush()
    return hasher.hexdigest(), size
