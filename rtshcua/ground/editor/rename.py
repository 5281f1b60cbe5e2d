"""Renames a declaration in every file that means it; refused where that would change what anything means.

A program under the new name must parse to the same declarations, each place must mean what it meant, nothing new may be
found in it (proofs are not run, they depend on meanings alone), and its tests must come to the same decisions. Tests
quote clauses as text: a quotation is compared with the clause that it quotes, and what changes in the clause changes in
it.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import WORDS
from rtshcua.ground.checker.well_known import MEASURED, PER_CELL, VELOCITY, WELL_KNOWN
from rtshcua.ground.editor.incremental_parse import same
from rtshcua.ground.editor.navigation import declared_at, references, targets
from rtshcua.ground.editor.occurrences import NameKind, NameTarget, Occurrence, at
from rtshcua.ground.editor.workspace import ProgramView, Workspace
from rtshcua.ground.language.table import table
from rtshcua.ground.pipeline.program import Compilation
from rtshcua.ground.testing.case import PolicyCase
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.testing.clause_quotes import REST
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.policy import Rule
from rtshcua.model.ir.scenarios import DecidesDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.ir.tests import Expectation, Quoted, TestDecl

_OWNED = (NameKind.PARAMETER, NameKind.MEMBER, NameKind.CHOICE)
"""The names that belong to a declaration, whose name they are told apart by."""


class ProgramVerdict(NamedTuple):
    """What is found in a program without proofs, and the cases of its tests; none where it has errors."""

    found: tuple[Diagnostic, ...]
    cases: tuple[PolicyCase, ...]


class NameChange(NamedTuple):
    """Which name becomes which, and where, by file."""

    target: NameTarget
    name: str
    places: Mapping[str, tuple[Span, ...]]


def verdict_of(view: ProgramView, dialect: Dialect) -> ProgramVerdict:
    """Checks the declarations of a program, lowers it, and makes the cases of its tests."""
    run = Compilation(view.program, dialect, 0)
    run.check()
    run.unproved()
    cases = run.cases()
    return ProgramVerdict(run.diagnostics(), cases)


def consequence(
    old: ProgramView, before: ProgramVerdict, new: ProgramView, dialect: Dialect, made: NameChange, *, declared: bool
) -> str | None:
    """What else than the name changes, for a person; None where nothing does. `declared`: whether it is declared in
    the program at all, or there alone where other files are imported too.
    """
    other = f"`{made.name}` would mean something else in the program of `{old.name}`"
    if new.units.keys() != old.units.keys() or has_errors(new.program.diagnostics):
        return other
    edited = {file: tuple(sorted(spans)) for file, spans in made.places.items()}
    if not all(same(unit, new.units[file], edited) for file, unit in old.units.items()):
        return other
    after = verdict_of(new, dialect)
    more = _new_finding(before.found, after.found, made)
    if more is not None:
        return f"in the program of `{old.name}` the name would not do: {more.message} ({more.code.id})"
    for file in old.units if declared else ():
        now = [(each.target, each.declares) for each in new.occurrences(file)]
        if now != [_expected(each, made) for each in old.occurrences(file)]:
            return other
    if _decisions(before.cases) != _decisions(after.cases):
        return f"the tests of `{old.name}` would come to other decisions"
    return None


def _expected(each: Occurrence, made: NameChange) -> tuple[NameTarget, bool]:
    """What a place of the old text must mean in the new one."""
    meant, target = each.target, made.target
    if meant == target:
        return meant._replace(name=made.name), each.declares
    first, dot, rest = meant.owner.partition(".")
    if target.sort is NameKind.DECLARED and meant.sort in _OWNED and first == target.name:
        return meant._replace(owner=made.name + dot + rest), each.declares
    if (
        target.sort is NameKind.PARAMETER
        and meant.sort is NameKind.CHOICE
        and meant.owner == f"{target.owner}.{target.name}"
    ):
        return meant._replace(owner=f"{target.owner}.{made.name}"), each.declares
    return meant, each.declares


def _new_finding(before: Iterable[Diagnostic], after: Iterable[Diagnostic], made: NameChange) -> Diagnostic | None:
    """The first finding that was not there before."""
    known = Counter((each.code, None if each.span is None else _moved_span(each.span, made)) for each in before)
    for each in after:
        key = (each.code, each.span)
        if not known[key]:
            return each
        known[key] -= 1
    return None


def _moved_span(span: Span, made: NameChange) -> Span:
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


#: where the characters of a text stand, blanks left out; None: the text has one there that no source has
Characters = list[tuple[str, Span | None]]


def quotations_of(view: ProgramView, cases: Iterable[PolicyCase], places: Collection[Span]) -> tuple[Span, ...]:
    """The parts of a program's quotations that stand for `places`; `cases` are those of its tests."""
    by_file: dict[str, list[Span]] = {}
    for place in places:
        by_file.setdefault(place.file, []).append(place)
    found = (span for case in cases if case.expected.clause is not None
             for span in _quotations_in(view, case, case.expected.clause, by_file))  # fmt: skip
    return tuple(dict.fromkeys(found))


def unresolved_quotation(view: ProgramView, cases: Iterable[PolicyCase], name: str) -> Span | None:
    """A quotation with `name` in it whose test has an error, so that nobody knows what it quotes; None if none."""
    word = _word(name)
    known = {case.expected.span for case in cases}
    for test in view.symbols.tests:
        for expectation in _expectations(test):
            clause = expectation.clause
            if clause is not None and word.search(clause.text) and expectation.span not in known:
                return clause.span
    return None


def scenario_quotation(view: ProgramView, name: str) -> Span | None:
    """A quotation with `name` in it in a scenario, of which no case tells what it quotes; None if none."""
    for scenario in view.symbols.scenarios:
        for demand in scenario.demands:
            clause = demand.decision.clause if isinstance(demand, DecidesDecl) else None
            if clause is not None and _word(name).search(clause.text):
                return clause.span
    return None


def _word(name: str) -> re.Pattern[str]:
    return re.compile(rf"(?<![A-Za-z0-9_.]){re.escape(name)}(?![A-Za-z0-9_])")


def _expectations(test: TestDecl) -> Sequence[Expectation]:
    rows = () if test.table is None else test.table.rows
    own = () if test.expectation is None else (test.expectation,)
    return (*own, *(row.expectation for row in rows))


def _quotations_in(
    view: ProgramView, case: PolicyCase, clause: Quoted, places: dict[str, list[Span]]
) -> Iterator[Span]:
    file, start, end = clause.span
    if view.slice(Span(file, start + 1, end - 1)) != clause.text:
        return  # characters are escaped in it
    written = clause.text.rstrip()
    length = len(written.removesuffix(REST))
    own = [start + 1 + at for at, letter in enumerate(written[:length]) if not letter.isspace()]
    if not case.quoted or case.quoted[0] is None:
        return
    meant = case.quoted[0]  # all have one text
    spans = [case.policy.span(meant)]
    declared = case.policy.lowered.written.get(meant) if isinstance(meant, Rule) else None
    if declared is not None:
        spans = [*(node.span for node in declared.origin), declared.span]
    characters = _characters(view, spans)
    text = view.text(file)
    if len(own) > len(characters) or any(text[at] != letter for at, (letter, _) in zip(own, characters, strict=False)):
        return  # the clause is put together in another way
    numbers = {at: number for number, (_, at) in enumerate(characters) if at is not None}
    for each in (place for span in spans for place in places.get(span.file, ())):
        first = numbers.get(Span(each.file, each.start, each.start + 1))
        last = numbers.get(Span(each.file, each.end - 1, each.end))
        if first is not None and last is not None and last < len(own):
            yield Span(file, own[first], own[last] + 1)


def _characters(view: ProgramView, spans: Iterable[Span]) -> Characters:
    """What stands under spans, as a clause's text has it: one after the other, with a colon between."""
    found: Characters = []
    for span in spans:
        found += [(":", None)] if found else []
        found += [
            (letter, Span(span.file, span.start + at, span.start + at + 1))
            for at, letter in enumerate(view.slice(span))
            if not letter.isspace()
        ]
    return found


#: gives programs one after the other; between them a question may be taken back
Steps = Callable[[Sequence[ProgramView]], Iterable[ProgramView]]
RENAMED = (NameKind.DECLARED, NameKind.PARAMETER, NameKind.MEMBER, NameKind.CHOICE)
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


def renamable(workspace: Workspace, view: ProgramView, file: str, offset: int) -> Span | Refusal:
    """The name at a place, if it may be changed."""
    found = _target(workspace, view, file, offset)
    return found if isinstance(found, Refusal) else at(view.occurrences(file), offset)[0].span


def rename(
    workspace: Workspace,
    files: Iterable[str],
    view: ProgramView,
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
    target = _target(workspace, view, file, offset)
    if isinstance(target, Refusal):
        return target
    if name == target.name:
        return Renaming({}, name)
    views = list({each.name: each for each in (view, *workspace.views(files))}.values())
    home = declared_at(view, target)
    concerned = [each for each in views if declared_at(each, target) == home]
    why = _unfit(view, target, name) or _clash(concerned, target, name)
    if why is not None:
        return Refusal("rename", why)
    places = tuple(references(views, view, target))
    views = list({each.name: each for each in (*views, *_tested(workspace, concerned, target))}.values())
    changed = {span.file for span in places}
    affected = [each for each in views if not changed.isdisjoint(each.units)]
    why = _faulty(affected)
    if why is not None:
        return Refusal("rename", why)
    before = {each.name: verdict_of(each, dialect) for each in steps(affected)}
    for each in affected:
        span = unresolved_quotation(each, before[each.name].cases, target.name)
        if span is not None:
            why = f"a test of `{span.file}` has errors, so nobody knows what it quotes: correct these first"
            return Refusal("rename", why)
        span = scenario_quotation(each, target.name)
        if span is not None:
            why = f"a scenario of `{span.file}` quotes a clause with `{target.name}` in it: quote less of it first"
            return Refusal("rename", why)
        places = (*places, *quotations_of(each, before[each.name].cases, places))
    return _checked(workspace, affected, before, NameChange(target, name, _by_file(places)), dialect, steps)


def _checked(
    workspace: Workspace,
    affected: Sequence[ProgramView],
    before: Mapping[str, ProgramVerdict],
    made: NameChange,
    dialect: Dialect,
    steps: Steps,
) -> Renaming | Refusal:
    """The renaming, if it changes nothing but the name."""
    shipped = next((each for each in made.places if workspace.is_shipped(each)), None)
    if shipped is not None:
        return Refusal("rename", f"`{made.target.name}` is used in `{shipped}`, which ships with the library")
    renaming = Renaming(made.places, made.name)
    texts = {file: renaming.applied(file, view.text(file)) for view in affected for file in made.places
             if file in view.units}  # fmt: skip
    changed = workspace.with_texts(texts)
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


def _tested(workspace: Workspace, concerned: Iterable[ProgramView], target: NameTarget) -> Iterator[ProgramView]:
    """The programs of files whose tests may quote the name: tests are run where their file itself is asked for."""
    files = {file for each in concerned for file, unit in each.units.items()
             if (unit.tests or unit.scenarios) and target.name in each.text(file)}  # fmt: skip
    return (workspace.view(file) for file in sorted(files))


def _target(workspace: Workspace, view: ProgramView, file: str, offset: int) -> NameTarget | Refusal:
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
    if target.sort is NameKind.DECLARED and target.name in _READ and target.name in view.symbols.signals:
        return Refusal("rename", f"the signal `{target.name}` is read by this very name: {_READ[target.name]}")
    if workspace.is_shipped(home[0].file):
        return Refusal("rename", f"`{target.name}` belongs to the library")
    enum = view.symbols.enums.get(target.owner) if target.sort is NameKind.MEMBER else None
    if enum is not None and enum.dialect is not None and target.name in _sentinels(view, target):
        return Refusal("rename", f"`{target.name}` is a value that the dialect names")
    return target


def _sentinels(view: ProgramView, target: NameTarget) -> set[str]:
    """The values that signals are unknown at, of an enumeration: these may be those of the dialect."""
    of_type = [each for each in view.symbols.signals.values() if each.type.text == target.owner]
    enum = view.symbols.enums[target.owner]
    own = {member.name.text for member in enum.members}
    return {name.text for each in of_type for name in each.unknown_at} - own


def _unfit(view: ProgramView, target: NameTarget, name: str) -> str | None:
    declared = view.symbols.declared.get(target.name) if target.sort is NameKind.DECLARED else None
    dotted = isinstance(declared, SignalDecl)
    if not all(map(_PLAIN.fullmatch, name.split(".") if dotted else [name])):
        return f"`{name}` is no name: names are of letters, digits and `_`" + (", those of signals with dots" * dotted)
    if dotted and name in _READ:
        return f"a signal `{name}` is read by this very name: {_READ[name]}"
    if table().words.get(name) is False or name in _TAKEN:
        return f"`{name}` is a reserved word"
    return None


def _faulty(views: Iterable[ProgramView]) -> str | None:
    for view in views:
        if has_errors(view.program.diagnostics) or view.symbols.broken or not view.program.whole:
            return f"the program of `{view.name}` has errors: correct these first"
    return None


def _clash(views: Iterable[ProgramView], target: NameTarget, name: str) -> str | None:
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


def _is_taken(each: Occurrence, target: NameTarget, name: str) -> bool:
    """Whether a name that something else gives stands in the way of `target`."""
    if not each.declares or each.target.name != name:
        return False
    if target.sort is NameKind.DECLARED:
        return each.target.sort in RENAMED
    return each.target.owner == target.owner or (
        {each.target.sort, target.sort} == {NameKind.MEMBER, NameKind.PARAMETER}
        or each.target.sort is NameKind.DECLARED
    )
