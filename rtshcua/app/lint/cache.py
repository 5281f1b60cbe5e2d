"""What was found in one program, as it is remembered from run to run, with the digest of all that it depends on."""

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
    """The findings of `check`, and those of the rules."""

    found: tuple[Diagnostic, ...]
    habits: tuple[Diagnostic, ...]


@dataclass(frozen=True, slots=True)
class LintedProgram:
    """The program of one file. `members` are its sources; `reads` the digest of each file that was read for it, None of
    one that could not be had; `packs` the folders of the packs that it asked for. `asked` are its files that were asked
    for, of which alone the rules speak, each with the width of its lines, if its layout was looked at. `result` is None
    where it was not examined, being part of another program.
    """

    members: tuple[str, ...]
    reads: Mapping[str, str | None]
    packs: Mapping[str, str | None]
    asked: Mapping[str, int | None]
    result: ProgramFindings | None

    @property
    def lasting(self) -> bool:
        """Whether it may be remembered: what could not be read may be there the next time, or something nearby."""
        return None not in self.reads.values() and None not in self.packs.values()


def encoded(examined: LintedProgram, mark: str) -> bytes:
    """As bytes; `mark` is of all that findings depend on besides, such as the rules themselves."""
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
    """From bytes, if it still holds: the same mark, the same files asked for, and every file and every pack as it was,
    which `digest` and `folder` say. It speaks of nothing but places in the texts of these files, whose `length` counts
    characters.
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
    """A list of texts, as a tuple. Raises TypeError for any other."""
    if type(found) is not list or not all(type(each) is str for each in found):
        raise TypeError("no texts")
    return tuple(found)


def _result(lists: Any, reads: Mapping[str, str | None], length: Callable[[str], int | None]) -> ProgramFindings:
    """A result, if it speaks of nothing but what was read for it. Raises as `findings_from_lists` does."""
    found, habits = lists
    result = ProgramFindings(findings_from_lists(found), findings_from_lists(habits))
    for place in spans_of((*result.found, *result.habits)):
        whole = length(place.file) if place.file in reads else None
        if whole is None or place.end > whole:
            raise ValueError("it speaks of what was not read")
    return result


#: the parts of the package that findings come from
_PARTS = ("app/lint", "decision", "diagnostics", "ground", "mavlink", "model", "wire")


@cache
def mark() -> str:
    """The mark: a digest. What runs is what was there when it was first asked for."""
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
