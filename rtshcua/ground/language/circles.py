"""Files that import each other in a circle. That is harmless, for each is read once; but none is complete by itself."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.codes import IMPORT_CYCLE
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.model.ir.program import Import

NAMED = 12  # files of one circle; more are counted, so that many long circles cannot swamp a person


class Edge(NamedTuple):
    """A file has `by`, which imports the file `to`."""

    by: Import
    to: str


def circles(files: Iterable[str], imports: Mapping[str, Sequence[Edge]]) -> list[Diagnostic]:
    """A finding for each import that leads back to where a walk came from; the walk follows `imports` depth first, in
    the order in which they are written, and begins with each of `files` that it has not met.
    """
    found: list[Diagnostic] = []
    done: set[str] = set()
    for file in files:
        if file not in done:
            _walk(file, imports, done, found)
    return found


def _walk(first: str, imports: Mapping[str, Sequence[Edge]], done: set[str], found: list[Diagnostic]) -> None:
    path = [first]
    places = {first: 0}  # in `path`
    taken: list[Edge] = []  # from each file of `path` to the next
    waiting = [iter(imports.get(first, ()))]
    while waiting:
        edge = next(waiting[-1], None)
        if edge is None:
            waiting.pop()
            done.add(path[-1])
            del places[path.pop()], taken[-1:]
        elif edge.to in places:
            start = places[edge.to]
            found.append(_circle(path[start:], taken[start:], edge))
        elif edge.to not in done:
            places[edge.to] = len(path)
            path.append(edge.to)
            taken.append(edge)
            waiting.append(iter(imports.get(edge.to, ())))


def _circle(files: list[str], taken: list[Edge], last: Edge) -> Diagnostic:
    names = [*files, last.to]
    if len(names) > NAMED:
        half = NAMED // 2
        names[half:-half] = [f"({len(names) - NAMED} more)"]
    return Diagnostic(
        IMPORT_CYCLE,
        f"this import closes a circle: `{' -> '.join(names)}`",
        last.by.span,
        "move what the files need of each other into one that imports none of them"
        if len(files) > 1
        else "a file sees its own declarations, so leave the import out",
        labels=tuple(Label(edge.by.span, "and this one leads there") for edge in taken[:NAMED]),
    )
