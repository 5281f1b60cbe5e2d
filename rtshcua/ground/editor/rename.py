"""Renames a declaration in every file that refers to it. A renaming that changes any meaning is refused.

With the new name, a program must parse to the same declarations, each name must have the same target, there must be no
new findings, and the tests must give the same decisions. Proofs are not repeated, because they do not depend on names.
Tests quote clauses as text: a renaming in a clause is applied to its quotations too.
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
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.ir.scenarios import DecidesDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.ir.tests import Expectation, Quoted, TestDecl

_OWNED = (NameKind.PARAMETER, NameKind.MEMBER, NameKind.CHOICE)
"""The kinds of names whose target includes the name of their declaration."""


class ProgramVerdict(NamedTuple):
    """The findings on a program without proofs, and the cases of its tests, if there are no errors."""

    found: tuple[Diagnostic, ...]
    cases: tuple[PolicyCase, ...]


class NameChange(NamedTuple):
    """A target, its new name, and the changed places by file."""

    target: NameTarget
    name: str
    places: Mapping[str, tuple[Span, ...]]


def verdict_of(view: ProgramView, dialect: Dialect) -> ProgramVerdict:
    """Check the declarations of a program, lower it, and make the cases of its tests."""
    run = Compilation(view.program, dialect, 0)
    run.check()
    run.unproved()
    cases = run.cases()
    return ProgramVerdict(run.diagnostics(), cases)


def consequence(
    old: ProgramView, before: ProgramVerdict, new: ProgramView, dialect: Dialect, made: NameChange, *, declared: bool
) -> str | None:
    """Return a description of a change other than the name, or None. `declared` says whether the program declares the
    target.
    """
    other = f"`{made.name}` would have another meaning in the program of `{old.name}`"
    if new.units.keys() != old.units.keys() or has_errors(new.program.diagnostics):
        return other
    edited = {file: tuple(sorted(spans)) for file, spans in made.places.items()}
    if not all(same(unit, new.units[file], edited) for file, unit in old.units.items()):
        return other
    after = verdict_of(new, dialect)
    more = _new_finding(before.found, after.found, made)
    if more is not None:
        return f"the name would cause a finding in the program of `{old.name}`: {more.message} ({more.code.id})"
    for file in old.units if declared else ():
        now = [(each.target, each.declares) for each in new.occurrences(file)]
        if now != [_expected(each, made) for each in old.occurrences(file)]:
            return other
    if _decisions(before.cases) != _decisions(after.cases):
        return f"the tests of `{old.name}` would give other decisions"
    return None


def _expected(each: Occurrence, made: NameChange) -> tuple[NameTarget, bool]:
    """The expected target of an old occurrence in the new text, and whether it declares it."""
    meant, target = each.target, made.target
    if meant == target:
        return meant._replace(name=made.name), each.declares
    first, dot, rest = meant.owner.partition(".")
    if target.kind is NameKind.DECLARED and meant.kind in _OWNED and first == target.name:
        return meant._replace(owner=made.name + dot + rest), each.declares
    if (
        target.kind is NameKind.PARAMETER
        and meant.kind is NameKind.CHOICE
        and meant.owner == f"{target.owner}.{target.name}"
    ):
        return meant._replace(owner=f"{target.owner}.{made.name}"), each.declares
    return meant, each.declares


def _new_finding(before: Iterable[Diagnostic], after: Iterable[Diagnostic], made: NameChange) -> Diagnostic | None:
    """The first new finding, or None."""
    known = Counter((each.code, None if each.span is None else _moved_span(each.span, made)) for each in before)
    for each in after:
        key = (each.code, each.span)
        if not known[key]:
            return each
        known[key] -= 1
    return None


def _moved_span(span: Span, made: NameChange) -> Span:
    """The place in the new text of a span of the old text."""
    by_start = by_end = 0
    for place in made.places.get(span.file, ()):
        longer = len(made.name) - (place.end - place.start)
        by_start += longer if place.end <= span.start else 0
        by_end += longer if place.end <= span.end else 0
    return Span(span.file, span.start + by_start, span.end + by_end)


def _decisions(cases: Iterable[PolicyCase]) -> list[tuple[object, ...]]:
    """The decisions of the cases, in order."""
    ran = [run_case(case) for case in cases]
    return [(each.case.row, each.met, each.trace.decision.outcome, each.trace.decision.reason) for each in ran]


#: the characters of a text without white space, with their places; None for a character that is not in the source
Characters = list[tuple[str, Span | None]]


def quotations_of(view: ProgramView, cases: Iterable[PolicyCase], places: Collection[Span]) -> tuple[Span, ...]:
    """The parts of a program's quotations that quote `places`; `cases` are those of its tests."""
    by_file: dict[str, list[Span]] = {}
    for place in places:
        by_file.setdefault(place.file, []).append(place)
    found = (span for case in cases if case.expected.clause is not None
             for span in _quotations_in(view, case, case.expected.clause, by_file))  # fmt: skip
    return tuple(dict.fromkeys(found))


def unresolved_quotation(view: ProgramView, cases: Iterable[PolicyCase], name: str) -> Span | None:
    """A quotation with `name` in a test with errors, so that its clause is unknown; None if there is none."""
    word = _word(name)
    known = {case.expected.span for case in cases}
    for test in view.symbols.tests:
        for expectation in _expectations(test):
            clause = expectation.clause
            if clause is not None and word.search(clause.text) and expectation.span not in known:
                return clause.span
    return None


def scenario_quotation(view: ProgramView, name: str) -> Span | None:
    """A quotation with `name` in a scenario, whose clause is unknown; None if there is none."""
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
    quoted = case.quoted[0] if case.quoted else None  # all have one text
    if quoted is None or view.slice(Span(file, start + 1, end - 1)) != clause.text:
        return  # no clause, or escaped characters
    written = clause.text.rstrip().removesuffix(REST)
    own = [start + 1 + at for at, letter in enumerate(written) if not letter.isspace()]
    spans = _clause_spans(case, quoted)
    characters = _characters(view, spans)
    if not "".join(letter for letter, _ in characters).startswith("".join(written.split())):
        return  # the text of the clause is not that of its spans
    offsets = {place: at for at, (_, place) in zip(own, characters, strict=False) if place is not None}
    for span in spans:
        for each in places.get(span.file, ()):
            first = offsets.get(Span(each.file, each.start, each.start + 1))
            last = offsets.get(Span(each.file, each.end - 1, each.end))
            if first is not None and last is not None:
                yield Span(file, first, last + 1)


def _clause_spans(case: PolicyCase, clause: Clause | Rule | Airspace) -> list[Span]:
    """The spans whose texts form the text of a clause."""
    declared = case.policy.lowered.written.get(clause) if isinstance(clause, Rule) else None
    return [case.policy.span(clause)] if declared is None else [*(node.span for node in declared.origin), declared.span]


def _characters(view: ProgramView, spans: Iterable[Span]) -> Characters:
    """The characters under spans, with a colon between spans, as in a clause's text."""
    found: Characters = []
    for span in spans:
        found += [(":", None)] if found else []
        found += [
            (letter, Span(span.file, span.start + at, span.start + at + 1))
            for at, letter in enumerate(view.slice(span))
            if not letter.isspace()
        ]
    return found


#: yields programs one after the other; between them the request may be cancelled
Steps = Callable[[Sequence[ProgramView]], Iterable[ProgramView]]
RENAMED = (NameKind.DECLARED, NameKind.PARAMETER, NameKind.MEMBER, NameKind.CHOICE)
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_TAKEN = ("phase", "local")
"""Names that are keywords where values are expected."""
_READ = (
    dict.fromkeys(WELL_KNOWN, "every decision needs it")
    | dict.fromkeys(VELOCITY, "the supervision of a vehicle that brakes needs it")
    | dict.fromkeys((*MEASURED, *PER_CELL), "the name determines how its value is computed")
)
"""Signals with a fixed name, and the reason."""


@dataclass(frozen=True, slots=True)
class Renaming:
    """The places that change, by file, and the new name."""

    places: Mapping[str, tuple[Span, ...]]
    name: str

    def applied(self, file: str, text: str) -> str:
        """The text of a file with the new name."""
        for span in sorted(self.places.get(file, ()), reverse=True):
            text = text[: span.start] + self.name + text[span.end :]
        return text


def renamable(workspace: Workspace, view: ProgramView, file: str, offset: int) -> Span | Refusal:
    """Return the span of the name at an offset, if it may be renamed."""
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
    """Rename the name at an offset in the programs of `files` and of all open texts.

    Every program with a changed file is checked with the new name, in the order of `steps`.
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
        why = _unclear_quotation(each, before[each.name].cases, target.name)
        if why is not None:
            return Refusal("rename", why)
        places = (*places, *quotations_of(each, before[each.name].cases, places))
    return _checked(workspace, affected, before, NameChange(target, name, _by_file(places)), dialect, steps)


def _unclear_quotation(view: ProgramView, cases: Iterable[PolicyCase], name: str) -> str | None:
    span = unresolved_quotation(view, cases, name)
    if span is not None:
        return f"a test of `{span.file}` with errors quotes a clause with `{name}`: correct the errors first"
    span = scenario_quotation(view, name)
    if span is not None:
        return f"a scenario of `{span.file}` quotes a clause with `{name}`: shorten the quotation first"
    return None


def _checked(
    workspace: Workspace,
    affected: Sequence[ProgramView],
    before: Mapping[str, ProgramVerdict],
    made: NameChange,
    dialect: Dialect,
    steps: Steps,
) -> Renaming | Refusal:
    """Return the renaming if it changes nothing but the name."""
    shipped = next((each for each in made.places if workspace.is_shipped(each)), None)
    if shipped is not None:
        return Refusal("rename", f"`{made.target.name}` is used in `{shipped}`, which belongs to the library")
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
    """The programs of files whose tests may quote the name. Tests run only in the program of their own file."""
    files = {file for each in concerned for file, unit in each.units.items()
             if (unit.tests or unit.scenarios) and target.name in each.text(file)}  # fmt: skip
    return (workspace.view(file) for file in sorted(files))


def _target(workspace: Workspace, view: ProgramView, file: str, offset: int) -> NameTarget | Refusal:
    if not at(view.occurrences(file), offset):
        return Refusal("rename", "no name here, or its declaration has a syntax error")
    found = targets(view, file, offset)
    if len(found) > 1:
        owners = " and ".join(f"`{each.owner}`" for each in found)
        return Refusal("rename", f"this is a parameter of {owners}: rename each at its declaration")
    why = _fixed(workspace, view, found[0])
    return found[0] if why is None else Refusal("rename", why)


def _fixed(workspace: Workspace, view: ProgramView, target: NameTarget) -> str | None:
    """The reason why a target may not be renamed, or None."""
    if target.kind not in RENAMED:
        return f"a {target.kind.value} is not declared in a source, so it cannot be renamed"
    home = declared_at(view, target)
    if not home:
        return f"`{target.name}` is not declared"
    if len(home) > 1 or any(target.name == each.name.text for _, each in view.symbols.duplicates):
        return f"`{target.name}` is declared twice"
    if target.kind is NameKind.DECLARED and target.name in _READ and target.name in view.symbols.signals:
        return f"the name of the signal `{target.name}` is fixed: {_READ[target.name]}"
    if workspace.is_shipped(home[0].file):
        return f"`{target.name}` belongs to the library"
    enum = view.symbols.enums.get(target.owner) if target.kind is NameKind.MEMBER else None
    if enum is not None and enum.dialect is not None and target.name in _sentinels(view, target):
        return f"`{target.name}` is a value of the dialect"
    return None


def _sentinels(view: ProgramView, target: NameTarget) -> set[str]:
    """The values of an enumeration at which signals are unknown; they may be those of the dialect."""
    of_type = [each for each in view.symbols.signals.values() if each.type.text == target.owner]
    enum = view.symbols.enums[target.owner]
    own = {member.name.text for member in enum.members}
    return {name.text for each in of_type for name in each.unknown_at} - own


def _unfit(view: ProgramView, target: NameTarget, name: str) -> str | None:
    declared = view.symbols.declared.get(target.name) if target.kind is NameKind.DECLARED else None
    dotted = isinstance(declared, SignalDecl)
    if not all(map(_PLAIN.fullmatch, name.split(".") if dotted else [name])):
        return f"`{name}` is not a valid name: use letters, digits and `_`" + (", and dots in a signal" * dotted)
    if dotted and name in _READ:
        return f"the name of the signal `{name}` is fixed: {_READ[name]}"
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
                return f"`{name}` is already a {taken.target.kind.value} of `{taken.target.owner}`"
    return None


def _is_taken(each: Occurrence, target: NameTarget, name: str) -> bool:
    """Whether an occurrence declares `name` such that `target` cannot have it."""
    if not each.declares or each.target.name != name:
        return False
    if target.kind is NameKind.DECLARED:
        return each.target.kind in RENAMED
    return each.target.owner == target.owner or (
        {each.target.kind, target.kind} == {NameKind.MEMBER, NameKind.PARAMETER}
        or each.target.kind is NameKind.DECLARED
    )
