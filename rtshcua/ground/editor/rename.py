"""Giving a thing another name, in every file that means it; refused where that would change what anything means."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import WORDS
from rtshcua.ground.checker.well_known import MEASURED, PER_CELL, VELOCITY, WELL_KNOWN
from rtshcua.ground.editor.consequences import Judged, Renamed, consequence, judged
from rtshcua.ground.editor.desk import Desk, View
from rtshcua.ground.editor.navigation import declared_at, references, targets
from rtshcua.ground.editor.occurrences import at
from rtshcua.ground.editor.quotations import flown_quotation, quoted, unread
from rtshcua.ground.editor.targets import Occurrence, Sort, Target
from rtshcua.ground.language.table import table
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.ir.signals import SignalDecl

#: gives programs one after the other; between them a question may be taken back
Steps = Callable[[Sequence[View]], Iterable[View]]
RENAMED = (Sort.DECLARED, Sort.PARAMETER, Sort.MEMBER, Sort.CHOICE)
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_TAKEN = ("phase", "local")
"""Names that would be read as words where values stand."""
_READ = (
    dict.fromkeys(WELL_KNOWN, "every decision needs it")
    | dict.fromkeys(VELOCITY, "what watches a vehicle that brakes needs it")
    | dict.fromkeys((*MEASURED, *PER_CELL), "what it tells is worked out by its name")
)
"""Signals that are found by their names, and by nothing that a source says."""


@dataclass(frozen=True, slots=True)
class Renaming:
    """The places that change, by file, and what is written there."""

    places: Mapping[str, tuple[Span, ...]]
    name: str

    def applied(self, file: str, text: str) -> str:
        """The text of a file with the new name."""
        for span in sorted(self.places.get(file, ()), reverse=True):
            text = text[: span.start] + self.name + text[span.end :]
        return text


def renamable(desk: Desk, view: View, file: str, offset: int) -> Span | Refusal:
    """The name at a place, if it may be changed."""
    found = _target(desk, view, file, offset)
    return found if isinstance(found, Refusal) else at(view.occurrences(file), offset)[0].span


def rename(
    desk: Desk,
    files: Iterable[str],
    view: View,
    file: str,
    offset: int,
    name: str,
    dialect: Dialect,
    steps: Steps = iter,
) -> Renaming | Refusal:
    """Renames what stands at a place in the programs of `files`, and of all that are open.

    Every program that has a file which changes is checked under the new name before this answers, `steps` giving one
    after the other.
    """
    target = _target(desk, view, file, offset)
    if isinstance(target, Refusal):
        return target
    if name == target.name:
        return Renaming({}, name)
    views = list({each.name: each for each in (view, *desk.views(files))}.values())
    home = declared_at(view, target)
    concerned = [each for each in views if declared_at(each, target) == home]
    why = _unfit(view, target, name) or _clash(concerned, target, name)
    if why is not None:
        return Refusal("rename", why)
    places = tuple(references(views, view, target))
    views = list({each.name: each for each in (*views, *_tested(desk, concerned, target))}.values())
    changed = {span.file for span in places}
    affected = [each for each in views if not changed.isdisjoint(each.units)]
    why = _faulty(affected)
    if why is not None:
        return Refusal("rename", why)
    before = {each.name: judged(each, dialect) for each in steps(affected)}
    for each in affected:
        span = unread(each, before[each.name].cases, target.name)
        if span is not None:
            why = f"a test of `{span.file}` has errors, so nobody knows what it quotes: correct these first"
            return Refusal("rename", why)
        span = flown_quotation(each, target.name)
        if span is not None:
            why = f"a scenario of `{span.file}` quotes a clause with `{target.name}` in it: quote less of it first"
            return Refusal("rename", why)
        places = (*places, *quoted(each, before[each.name].cases, places))
    return _checked(desk, affected, before, Renamed(target, name, _by_file(places)), dialect, steps)


def _checked(
    desk: Desk,
    affected: Sequence[View],
    before: Mapping[str, Judged],
    made: Renamed,
    dialect: Dialect,
    steps: Steps,
) -> Renaming | Refusal:
    """The renaming, if it changes nothing but the name."""
    shipped = next((each for each in made.places if desk.is_shipped(each)), None)
    if shipped is not None:
        return Refusal("rename", f"`{made.target.name}` is used in `{shipped}`, which ships with the library")
    renaming = Renaming(made.places, made.name)
    texts = {file: renaming.applied(file, view.text(file)) for view in affected for file in made.places
             if file in view.units}  # fmt: skip
    changed = desk.with_texts(texts)
    for old in steps(affected):
        declared = bool(declared_at(old, made.target))
        why = consequence(old, before[old.name], changed.view(old.name), dialect, made, declared=declared)
        if why is not None:
            return Refusal("rename", why)
    return renaming


def _by_file(places: Iterable[Span]) -> dict[str, tuple[Span, ...]]:
    by_file: dict[str, tuple[Span, ...]] = {}
    for span in dict.fromkeys(places):
        by_file[span.file] = (*by_file.get(span.file, ()), span)
    return by_file


def _tested(desk: Desk, concerned: Iterable[View], target: Target) -> Iterator[View]:
    """The programs of files whose tests may quote the name: tests are run where their file itself is asked for."""
    files = {file for each in concerned for file, unit in each.units.items()
             if (unit.tests or unit.scenarios) and target.name in each.text(file)}  # fmt: skip
    return (desk.view(file) for file in sorted(files))


def _target(desk: Desk, view: View, file: str, offset: int) -> Target | Refusal:
    if not at(view.occurrences(file), offset):
        return Refusal("rename", "there is no name here, or what it stands in has a syntax error")
    found = targets(view, file, offset)
    if len(found) > 1:
        owners = " and ".join(f"`{each.owner}`" for each in found)
        return Refusal("rename", f"this means a parameter of {owners} at once: rename each where it is declared")
    target = found[0]
    if target.sort not in RENAMED:
        return Refusal("rename", f"a {target.sort.value} is declared nowhere, so it has no other name")
    home = declared_at(view, target)
    if not home:
        return Refusal("rename", f"nothing declares `{target.name}`")
    if len(home) > 1 or any(target.name == each.name.text for _, each in view.symbols.duplicates):
        return Refusal("rename", f"`{target.name}` is declared twice")
    if target.sort is Sort.DECLARED and target.name in _READ and target.name in view.symbols.signals:
        return Refusal("rename", f"the signal `{target.name}` is read by this very name: {_READ[target.name]}")
    if desk.is_shipped(home[0].file):
        return Refusal("rename", f"`{target.name}` belongs to the library")
    enum = view.symbols.enums.get(target.owner) if target.sort is Sort.MEMBER else None
    if enum is not None and enum.dialect is not None and target.name in _sentinels(view, target):
        return Refusal("rename", f"`{target.name}` is a value that the dialect names")
    return target


def _sentinels(view: View, target: Target) -> set[str]:
    """The values that signals are unknown at, of an enumeration: these may be those of the dialect."""
    of_type = [each for each in view.symbols.signals.values() if each.type.text == target.owner]
    enum = view.symbols.enums[target.owner]
    own = {member.name.text for member in enum.members}
    return {name.text for each in of_type for name in each.unknown_at} - own


def _unfit(view: View, target: Target, name: str) -> str | None:
    declared = view.symbols.declared.get(target.name) if target.sort is Sort.DECLARED else None
    dotted = isinstance(declared, SignalDecl)
    if not all(map(_PLAIN.fullmatch, name.split(".") if dotted else [name])):
        return f"`{name}` is no name: names are of letters, digits and `_`" + (", those of signals with dots" * dotted)
    if dotted and name in _READ:
        return f"a signal `{name}` is read by this very name: {_READ[name]}"
    if table().words.get(name) is False or name in _TAKEN:
        return f"`{name}` is a reserved word"
    return None


def _faulty(views: Iterable[View]) -> str | None:
    for view in views:
        if has_errors(view.program.diagnostics) or view.symbols.broken or not view.program.whole:
            return f"the program of `{view.name}` has errors: correct these first"
    return None


def _clash(views: Iterable[View], target: Target, name: str) -> str | None:
    views = list(views)
    why = _faulty(views)
    if why is not None:
        return why
    for view in views:
        other = view.symbols.declared.get(name)
        if other is not None:
            return f"`{name}` is already {WORDS[type(other)]}"
        for file in (file for file in view.units if name in view.text(file)):
            taken = next((each for each in view.occurrences(file) if _is_taken(each, target, name)), None)
            if taken is not None:
                return f"`{name}` is already a {taken.target.sort.value} of `{taken.target.owner}`"
    return None


def _is_taken(each: Occurrence, target: Target, name: str) -> bool:
    """Whether a name that something else gives stands in the way of `target`."""
    if not each.declares or each.target.name != name:
        return False
    if target.sort is Sort.DECLARED:
        return each.target.sort in RENAMED
    return each.target.owner == target.owner or (
        {each.target.sort, target.sort} == {Sort.MEMBER, Sort.PARAMETER} or each.target.sort is Sort.DECLARED
    )
