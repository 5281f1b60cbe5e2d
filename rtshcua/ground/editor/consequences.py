"""What changes of a program with the names in it: nothing may, but for the names.

A program under the new name must parse to the same declarations, each place must mean what it meant, nothing new may
be found in it (no proof is made: these depend on meanings alone), and its tests must come to the same decisions.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.moved import parts
from rtshcua.ground.editor.targets import Occurrence, Sort, Target
from rtshcua.ground.pipeline.program import Compilation
from rtshcua.ground.testing.case import PolicyCase
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.tests import Quoted

_OWNED = (Sort.PARAMETER, Sort.MEMBER, Sort.CHOICE)
"""The names that belong to a declaration, whose name they are told apart by."""


class Judged(NamedTuple):
    """What is found in a program without proofs, and the cases of its tests; none where it has errors."""

    found: tuple[Diagnostic, ...]
    cases: tuple[PolicyCase, ...]


class Renamed(NamedTuple):
    """Which name becomes which, and where, by file."""

    target: Target
    name: str
    places: Mapping[str, tuple[Span, ...]]


def judged(view: View, dialect: Dialect) -> Judged:
    """Checks the declarations of a program, lowers it, and makes the cases of its tests."""
    run = Compilation(view.program, dialect, 0)
    run.check()
    run.unproved()
    cases = run.cases()
    return Judged(run.diagnostics(), cases)


def consequence(old: View, before: Judged, new: View, dialect: Dialect, made: Renamed, *, declared: bool) -> str | None:
    """What else than the name changes, for a person; None where nothing does. `declared`: whether it is declared in
    the program at all, or there alone where other files are imported too.
    """
    other = f"`{made.name}` would mean something else in the program of `{old.name}`"
    if new.units.keys() != old.units.keys() or has_errors(new.program.diagnostics):
        return other
    edited = {file: tuple(sorted(spans)) for file, spans in made.places.items()}
    if not all(_alike(unit, new.units[file], edited) for file, unit in old.units.items()):
        return other
    after = judged(new, dialect)
    more = _new(before.found, after.found, made)
    if more is not None:
        return f"in the program of `{old.name}` the name would not do: {more.message} ({more.code.id})"
    for file in old.units if declared else ():
        now = [(each.target, each.declares) for each in new.occurrences(file)]
        if now != [_expected(each, made) for each in old.occurrences(file)]:
            return other
    if _decisions(before.cases) != _decisions(after.cases):
        return f"the tests of `{old.name}` would come to other decisions"
    return None


def _expected(each: Occurrence, made: Renamed) -> tuple[Target, bool]:
    """What a place of the old text must mean in the new one."""
    meant, target = each.target, made.target
    if meant == target:
        return meant._replace(name=made.name), each.declares
    first, dot, rest = meant.owner.partition(".")
    if target.sort is Sort.DECLARED and meant.sort in _OWNED and first == target.name:
        return meant._replace(owner=made.name + dot + rest), each.declares
    if target.sort is Sort.PARAMETER and meant.sort is Sort.CHOICE and meant.owner == f"{target.owner}.{target.name}":
        return meant._replace(owner=f"{target.owner}.{made.name}"), each.declares
    return meant, each.declares


def _alike(old: Any, new: Any, edited: Mapping[str, Sequence[Span]]) -> bool:
    """Whether two nodes, or tuples of them, say the same but for the names at the places that were edited."""
    if type(old) is not type(new):
        return False
    if isinstance(old, Node):
        file, start, end = old.span
        free = isinstance(old, Name | Reference | Quoted) and any(
            start <= place.start and place.end <= end for place in edited.get(file, ())
        )
        return all(
            type(mine) is Span or (free and type(mine) is str) or _alike(mine, its, edited)
            for mine, its in zip(parts(old), parts(new), strict=True)
        )
    if type(old) is tuple:
        return len(old) == len(new) and all(_alike(mine, its, edited) for mine, its in zip(old, new, strict=True))
    return bool(old == new)


def _new(before: Iterable[Diagnostic], after: Iterable[Diagnostic], made: Renamed) -> Diagnostic | None:
    """The first finding that was not there before."""
    known = Counter((each.code, None if each.span is None else _moved(each.span, made)) for each in before)
    for each in after:
        key = (each.code, each.span)
        if not known[key]:
            return each
        known[key] -= 1
    return None


def _moved(span: Span, made: Renamed) -> Span:
    """Where a place of the old text is in the new one."""
    by_start = by_end = 0
    for place in made.places.get(span.file, ()):
        longer = len(made.name) - (place.end - place.start)
        by_start += longer if place.end <= span.start else 0
        by_end += longer if place.end <= span.end else 0
    return Span(span.file, span.start + by_start, span.end + by_end)


def _decisions(cases: Iterable[PolicyCase]) -> list[tuple[object, ...]]:
    """What the cases come to, in order."""
    ran = [run_case(case) for case in cases]
    return [(each.case.row, each.met, each.trace.decision.outcome, each.trace.decision.reason) for each in ran]
