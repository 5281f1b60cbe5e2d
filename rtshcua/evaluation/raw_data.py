"""The raw data of an evaluation: a folder with one file of JSON lines for each experiment, only ever appended to.

- The first line describes the computer, the program and the design: a run continues a file only if program and design
  are the same.
- Each further line holds one result, with the key of its unit of work, its place among the unit's results, and the
  load of the computer.

A unit is done when all its results are there. Lines that a crash cut off, and results that are not of their unit or not
of the design, are skipped, and their unit runs again; a failed attempt is kept, and its unit runs again. All results of
a unit that is there twice count: nothing replaces a measurement. One process at a time writes to a folder.
"""

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, BinaryIO, Final, NamedTuple

import msgspec

from rtshcua.adapters.store.reading import open_regular, read_regular, walk
from rtshcua.adapters.store.writing import UNFINISHED, append, create_whole, lock, make_folder
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation.computer import Computer
from rtshcua.evaluation.design import MODES, POINTS, EvaluationPoint, WorkUnit
from rtshcua.evaluation.published import CASES
from rtshcua.evaluation.results import (
    CaseFlight,
    EnforceCheck,
    FailedAttempt,
    FallbackReaction,
    FallbackTiming,
    Natural,
    PointFlight,
    Result,
)

FORMAT: Final = 1
#: octets of the longest line: a whole log's append times
_LONGEST: Final = 1 << 24
_ANOTHER: Final = "name another folder with `-o`, or remove this one"
_ANOTHER_FILE: Final = "name another folder with `-o`, or remove this file"
_LOCK: Final = ".lock"
_CASES: Final = frozenset(each.name for each in CASES)
#: the beginning of the name of a folder for the files of a run, which a killed process leaves behind
_SCRATCH: Final = f"{UNFINISHED}work-"
#: what must be the same to continue a file
_DIFFERS: Final = {
    "program": "version of this program",
    "commit": "commit of this program",
    "design": "design of the measurements",
    "quick": "extent (`--quick`)",
}
#: what must be the same of the computer
_COMPUTER: Final = ("processor", "cores", "python", "versions")
#: seconds of UTC since 1970, until the year 6325
_Seconds = Annotated[int, msgspec.Meta(ge=0, le=1 << 37)]


class RawHeader(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The first line of a file. `design` is SHA-256 of what measures and is measured (`design_digest`); `quick`: fewer
    and smaller measurements. `began` is the start in seconds of UTC since 1970.
    """

    format: int
    experiment: str
    program: str
    commit: str
    design: str
    quick: bool
    began: _Seconds
    computer: Computer


class KeptResult(msgspec.Struct, frozen=True, kw_only=True):
    """One result: `part` of `parts` of the unit `key` (no result: the unit gave none). `load` is the load average of
    one minute then, `jobs` how many processes measured.
    """

    key: tuple[str | int, ...]
    part: Natural
    parts: Natural
    at: _Seconds
    load: Annotated[float, msgspec.Meta(ge=0, le=1e6)]
    jobs: Natural
    result: Result | None


class RawExperiment(NamedTuple):
    """The content of a file: its header, the results of the units that are done, how many lines were skipped because
    they are cut off, malformed or not of the design, and the attempts that failed.
    """

    header: RawHeader
    units: Mapping[WorkUnit, tuple[KeptResult, ...]]
    skipped: int
    failed: Sequence[tuple[WorkUnit, FailedAttempt]] = ()

    @property
    def results(self) -> tuple[Result, ...]:
        """All results, in the order of their units' completion."""
        return tuple(each.result for kept in self.units.values() for each in kept if each.result is not None)


_HEADER: Final = msgspec.json.Decoder(RawHeader)
_KEPT: Final = msgspec.json.Decoder(KeptResult)
#: what decoders raise for lines of others
MALFORMED: Final = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError)


class RawFolder:
    """A folder of raw data. Use it within `held` to write."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def held(self) -> Iterator[str]:
        """Make the folder and hold it; yields the path of an empty folder on the same disk, which is removed at the
        end. Raises BlockingIOError if another process holds it, and OSError.
        """
        make_folder(self.path)
        handle = lock(self.path / _LOCK)
        try:
            for left in self.path.glob(f"{_SCRATCH}*"):
                shutil.rmtree(left, ignore_errors=True)
            with TemporaryDirectory(prefix=_SCRATCH, dir=self.path, ignore_cleanup_errors=True) as scratch:
                yield scratch
        finally:
            os.close(handle)

    def foreign_report(self, names: Sequence[str]) -> Refusal | None:
        """Why a report in the folder must not be replaced: one of these names, without raw data beside it."""
        reports = [self.path / name for name in names if (self.path / name).exists()]
        if not reports or any(self.path.glob("X*.jsonl")):
            return None
        return Refusal("usage", f"`{reports[0]}` is there, but no raw data of an evaluation", _ANOTHER_FILE)

    def read(self, experiment: str) -> RawExperiment | Refusal | None:
        """Read a file; None if it is not there. Raises OSError."""
        path = self._file(experiment)
        try:
            with open_regular(path, self.path) as file:
                header = _HEADER.decode(file.readline(_LONGEST))
                if header.format == FORMAT:
                    return _whole(header, _lines(file))
        except FileNotFoundError:
            return None
        except MALFORMED:
            return Refusal("malformed", f"`{path}` does not begin as raw data of an evaluation", _ANOTHER)
        return Refusal("malformed", f"`{path}` has format {header.format}; accepted: {FORMAT}", _ANOTHER)

    def differs(self, header: RawHeader) -> Refusal | None:
        """Why a file cannot be continued; None where it can, or is not there. Raises OSError."""
        found = self.read(header.experiment)
        if not isinstance(found, RawExperiment):
            return found
        differ = [text for name, text in _DIFFERS.items() if getattr(found.header, name) != getattr(header, name)]
        mine, other = header.computer, found.header.computer
        if any(getattr(mine, name) != getattr(other, name) for name in _COMPUTER):
            differ.append("computer (processor, cores, Python or libraries)")
        text = f"`{self._file(header.experiment)}` was measured with another {' and another '.join(differ)}"
        return Refusal("usage", text, _ANOTHER) if differ else None

    def begin(self, header: RawHeader) -> Refusal | None:
        """Begin a file, or continue one of the same program and design. Raises OSError."""
        refused, path = self.differs(header), self._file(header.experiment)
        if refused is not None:
            return refused
        create_whole(path, msgspec.json.encode(header) + b"\n")
        with open_regular(path, self.path) as file:
            file.seek(-1, os.SEEK_END)
            whole = file.read() == b"\n"
        if not whole:  # the last line was cut off: the next one has its own
            append(path, b"\n", self.path)
        return None

    def keep(self, unit: WorkUnit, results: Sequence[Result], *, at: int, load: float, jobs: int) -> None:
        """Store the results of a unit on the disk. Raises OSError."""
        parts: Sequence[Result | None] = results or (None,)
        lines = (
            KeptResult(key=unit.key, part=number, parts=len(parts), at=at, load=load, jobs=jobs, result=each)
            for number, each in enumerate(parts)
        )
        append(self._file(unit.experiment), b"".join(msgspec.json.encode(each) + b"\n" for each in lines), self.path)

    def _file(self, experiment: str) -> Path:
        return self.path / f"{experiment}.jsonl"


def _lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a file; in place of one that is too long, one that is malformed."""
    while line := file.readline(_LONGEST):
        if len(line) < _LONGEST or line.endswith(b"\n"):
            yield line
            continue
        while len(line) == _LONGEST and not line.endswith(b"\n"):
            line = file.readline(_LONGEST)
        yield b"too long"


def _belongs(key: tuple[str | int, ...], result: Result | None) -> bool:
    """Whether a flight, check or timing is one of the design, and of the unit in whose line it stands."""
    match result:
        case PointFlight():
            point = EvaluationPoint(result.mission, result.deadline_us)
            return point in POINTS and result.mode in MODES and key == (*point, result.seed, result.mode)
        case EnforceCheck():
            point = EvaluationPoint(result.mission, result.deadline_us)
            return point in POINTS and result.case in _CASES and key[:4] == ("check", *point, result.mode)
        case CaseFlight():
            place = "aloft" if result.aloft else "ground"
            struck = (result.case, result.mission, result.deadline_us, result.flavour, place)
            return result.case in _CASES and key == ("flight", *struck)
        case FallbackTiming():
            return result.case in _CASES and key[:1] == (result.mode,)
        case FallbackReaction():
            return result.case in _CASES and key[1:3] == (result.case, result.mode)
    return True


def _whole(header: RawHeader, lines: Iterable[bytes]) -> RawExperiment:
    """The units of which each part is there, in a row."""
    kept, skipped = list[KeptResult](), 0
    for line in lines:
        try:
            each = _KEPT.decode(line)
        except MALFORMED:
            skipped += line != b"\n"
            continue
        if _belongs(each.key, each.result):
            kept.append(each)
        else:
            skipped += 1
    units: dict[WorkUnit, tuple[KeptResult, ...]] = {}
    failed: list[tuple[WorkUnit, FailedAttempt]] = []
    attempts = list[list[KeptResult]]()
    for each in kept:
        if each.part == 0 or not attempts or attempts[-1][0].key != each.key:
            attempts.append([])
        attempts[-1].append(each)
    for parts in attempts:
        unit = WorkUnit(header.experiment, parts[0].key)
        if any((each.part, each.parts) != (number, len(parts)) for number, each in enumerate(parts)):
            skipped += len(parts)
        elif isinstance(parts[0].result, FailedAttempt):
            failed.append((unit, parts[0].result))
        else:
            units[unit] = (*units.get(unit, ()), *parts)
    return RawExperiment(header, units, skipped, failed)


def design_digest(folders: Sequence[Path]) -> str:
    """SHA-256 over the names and contents of the files in folders that say what is measured, in hexadecimal."""
    found = sha256()
    for folder in folders:
        for above, _, names in sorted(walk(folder)):
            for name in sorted(names):
                if not name.endswith((".py", ".rts")):
                    continue
                octets = read_regular(Path(above) / name, _LONGEST)
                found.update(f"{Path(above).relative_to(folder)}/{name} {len(octets)}\n".encode() + octets)
    return found.hexdigest()
