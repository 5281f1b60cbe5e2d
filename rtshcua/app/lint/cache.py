"""Cache entries of lint: the findings of one program, with the digests of everything that they depend on."""

import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from rtshcua import __version__
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.lint.cached_findings import findings_as_lists, findings_from_lists, spans_of


class ProgramFindings(NamedTuple):
    """The findings of `check` (`found`) and of the lint rules (`habits`)."""

    found: tuple[Diagnostic, ...]
    habits: tuple[Diagnostic, ...]


@dataclass(frozen=True, slots=True)
class LintedProgram:
    """The program of one file, as far as lint needs it.

    `members` are its sources. `reads` has the digest of each file that was read for it (None if it could not be read),
    `packs` the folder of each skill pack that it imports (None if there is none). `asked` are those of its files that
    are linted, each with its line width if its layout is checked. `result` is None if the program was not checked
    because it is part of another program.
    """

    members: tuple[str, ...]
    reads: Mapping[str, str | None]
    packs: Mapping[str, str | None]
    asked: Mapping[str, int | None]
    result: ProgramFindings | None

    @property
    def lasting(self) -> bool:
        """Whether it may be cached. A missing file or pack may exist at the next run, so it prevents caching."""
        return None not in self.reads.values() and None not in self.packs.values()


def encoded(examined: LintedProgram, mark: str) -> bytes:
    """Encode a program; `mark` stands for everything else that findings depend on, such as the lint rules."""
    result = examined.result
    return json.dumps(
        {
            "mark": mark,
            "members": examined.members,
            "reads": dict(examined.reads),
            "packs": dict(examined.packs),
            "asked": dict(examined.asked),
            "result": None if result is None else [findings_as_lists(result.found), findings_as_lists(result.habits)],
        }
    ).encode()


def decoded(
    data: bytes,
    mark: str,
    asked: Mapping[str, int | None],
    digest: Callable[[str], str | None],
    folder: Callable[[str], str | None],
    length: Callable[[str], int | None],
) -> LintedProgram | None:
    """Decode a program; None if the entry is malformed or out of date.

    An entry is up to date if the mark is the same and every file and every pack is unchanged, by `digest` and `folder`.
    It has a result only if the same files are linted. Every span of a finding must lie within a file that was read,
    whose `length` is in characters.
    """
    try:
        tree: Any = json.loads(data)
        if tree["mark"] != mark:
            return None
        members, reads, packs = _texts(tree["members"]), tree["reads"], tree["packs"]
        _texts([*reads, *reads.values(), *packs, *packs.values()])
        if any(digest(name) != known for name, known in reads.items()):
            return None
        if any(folder(name) != known for name, known in packs.items()):
            return None
        mine = {name: asked[name] for name in members if name in asked}
        result = tree["result"] if tree["asked"] == mine else None
        return LintedProgram(members, reads, packs, mine, None if result is None else _result(result, reads, length))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _texts(found: Any) -> tuple[str, ...]:
    """Return a list of strings as a tuple. Raises TypeError for anything else."""
    if type(found) is not list or not all(type(each) is str for each in found):
        raise TypeError("expected a list of strings")
    return tuple(found)


def _result(lists: Any, reads: Mapping[str, str | None], length: Callable[[str], int | None]) -> ProgramFindings:
    """Decode a result. Raises ValueError for a span outside the files that were read, else as `findings_from_lists`."""
    found, habits = lists
    result = ProgramFindings(findings_from_lists(found), findings_from_lists(habits))
    for place in spans_of((*result.found, *result.habits)):
        whole = length(place.file) if place.file in reads else None
        if whole is None or place.end > whole:
            raise ValueError("a span lies outside the files that were read")
    return result


#: the parts of the package on which findings depend
_PARTS = ("app/lint", "decision", "diagnostics", "ground", "mavlink", "model", "wire")


@cache
def mark() -> str:
    """A digest of the version and of the code on which findings depend, computed once a process."""
    package = Path(__file__).resolve().parents[2]
    whole = sha256(f"{__version__} {sys.version_info[:3]}".encode())
    for part in _PARTS:
        for file in sorted(_files(str(package / part))):
            with open(file, "rb") as opened:  # noqa: PTH123  a Path costs more than the file
                whole.update(f"{file.removeprefix(str(package))}\0".encode())
                whole.update(sha256(opened.read()).digest())
    return whole.hexdigest()


def _files(folder: str) -> list[str]:
    found: list[str] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir():
                found += _files(entry.path) if entry.name != "__pycache__" else []
            elif entry.name.endswith((".py", ".json")):
                found.append(entry.path)
    return found
