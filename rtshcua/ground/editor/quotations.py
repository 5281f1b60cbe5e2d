"""Where tests quote clauses in which a name is changed: the places within the quotations that mean the same.

A quotation is a text, so nothing in it is looked up by name. It is held against the clause that it quotes, character
by character but for the blanks, and what changes in the clause changes in it. So a name that means something else in
another clause keeps standing there.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence

from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.desk import View
from rtshcua.ground.testing.case import PolicyCase
from rtshcua.ground.testing.clause_quotes import REST
from rtshcua.model.flat.policy import Rule
from rtshcua.model.ir.scenarios import Decides
from rtshcua.model.ir.tests import Expectation, Quoted, TestDecl

#: where the characters of a text stand, blanks left out; None: the text has one there that no source has
Characters = list[tuple[str, Span | None]]


def quoted(view: View, cases: Iterable[PolicyCase], places: Collection[Span]) -> tuple[Span, ...]:
    """The parts of a program's quotations that stand for `places`; `cases` are those of its tests."""
    by_file: dict[str, list[Span]] = {}
    for place in places:
        by_file.setdefault(place.file, []).append(place)
    found = (span for case in cases if case.expected.clause is not None
             for span in _within(view, case, case.expected.clause, by_file))  # fmt: skip
    return tuple(dict.fromkeys(found))


def unread(view: View, cases: Iterable[PolicyCase], name: str) -> Span | None:
    """A quotation with `name` in it whose test has an error, so that nobody knows what it quotes; None if none."""
    word = _word(name)
    known = {case.expected.span for case in cases}
    for test in view.symbols.tests:
        for expectation in _expectations(test):
            clause = expectation.clause
            if clause is not None and word.search(clause.text) and expectation.span not in known:
                return clause.span
    return None


def flown_quotation(view: View, name: str) -> Span | None:
    """A quotation with `name` in it in a scenario, of which no case tells what it quotes; None if none."""
    for scenario in view.symbols.scenarios:
        for demand in scenario.demands:
            clause = demand.decision.clause if isinstance(demand, Decides) else None
            if clause is not None and _word(name).search(clause.text):
                return clause.span
    return None


def _word(name: str) -> re.Pattern[str]:
    return re.compile(rf"(?<![A-Za-z0-9_.]){re.escape(name)}(?![A-Za-z0-9_])")


def _expectations(test: TestDecl) -> Sequence[Expectation]:
    rows = () if test.table is None else test.table.rows
    own = () if test.expectation is None else (test.expectation,)
    return (*own, *(row.expectation for row in rows))


def _within(view: View, case: PolicyCase, clause: Quoted, places: dict[str, list[Span]]) -> Iterator[Span]:
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


def _characters(view: View, spans: Iterable[Span]) -> Characters:
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
