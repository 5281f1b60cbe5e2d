"""The files of a policy: its own file and everything that this file imports.

A mission may have declarations of its own, but they do not change the policy: the policy is signed separately and is
the same for every mission under it.
"""

import posixpath
from collections.abc import Iterator, Mapping, Sequence

from rtshcua.ground.language.paths import imported, pack_of, shown
from rtshcua.model.ir.program import Import, Unit


class Imports:
    """The import graph of a program's files."""

    def __init__(self, units: Sequence[Unit], stable: Mapping[str, str]) -> None:
        self._units = {unit.file: unit for unit in units}
        self._by_stable = {stable.get(unit.file, unit.file): unit.file for unit in units}

    def closure(self, file: str) -> frozenset[str]:
        """A file and everything that it imports, directly or indirectly."""
        seen = {file}
        waiting = [file]
        while waiting:
            for found in self._imported(waiting.pop()):
                if found not in seen:
                    seen.add(found)
                    waiting.append(found)
        return frozenset(seen)

    def target(self, file: str, each: Import) -> str | None:
        """Return the file of the program to which an import of `file` refers; None if there is none."""
        pack = pack_of(each.path)
        if pack is not None:
            inside = posixpath.normpath(each.path.removeprefix(f"{pack}:").lstrip("/"))
            name = self._by_stable.get(f"{pack}:{inside}")
        else:
            path = imported(each.path, file, lambda _: None)
            name = None if path is None else shown(path)
        return name if name in self._units else None

    def _imported(self, file: str) -> Iterator[str]:
        unit = self._units.get(file)
        for each in () if unit is None else unit.imports:
            name = self.target(file, each)
            if name is not None:
                yield name


def beside(name: str, other: str) -> str:
    """The stable name of a file relative to the folder of another, so that it does not depend on the importing file."""
    if pack_of(name) is not None or pack_of(other) is not None:
        return name
    parts, folder = name.split("/"), other.split("/")[:-1]
    common = 0
    while common < min(len(parts) - 1, len(folder)) and parts[common] == folder[common]:
        common += 1
    if ".." in folder[common:]:
        return name
    return "/".join([".."] * (len(folder) - common) + parts[common:])
