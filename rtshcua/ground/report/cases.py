"""The tests of the sources, as they were decided when the page was made."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.report.model import CaseTold, Start
from rtshcua.ground.report.subject import place_of
from rtshcua.ground.report.words.cases import (
    told_decision,
    told_expectation,
    told_given,
    told_nominal,
    told_premises,
    told_request,
)
from rtshcua.ground.report.words.vocabulary import Vocabulary
from rtshcua.ground.testing.boundaries.draft import GENERATED
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.model.ir.tests import TestDecl


@dataclass(frozen=True, slots=True)
class Tried:
    """The cases of one file that was asked for, decided; `program` is that file with what it imports."""

    program: Program
    ran: tuple[CaseResult, ...]


def starts_and_cases(tried: Sequence[Tried]) -> tuple[tuple[Start, ...], tuple[CaseTold, ...]]:
    """What cases start from, and the cases. All are of one policy; a nominal that shares its name with another says
    where it is written.
    """
    told = []
    for one in tried:
        symbols = collect(one.program.units, one.program.broken)
        vocabulary = Vocabulary(frozenset(symbols.signals), frozenset(symbols.zones))
        told += [
            (each, _start(one.program, each, vocabulary), vocabulary, _generated(one.program, each)) for each in one.ran
        ]
    starts = tuple(dict.fromkeys(start for _, start, *_ in told))
    names = [start.name for start in starts]
    return starts, tuple(
        replace(
            _case(ran, f"`{start.name}`" + (f" ({start.place})" if names.count(start.name) > 1 else ""), vocabulary),
            generated=generated,
        )
        for ran, start, vocabulary, generated in told
    )


def told_test(test: TestDecl, start: str, names: Vocabulary) -> Iterator[CaseTold]:
    """The cases of a test, not decided yet; `start` is the nominal that it starts from, empty for none."""
    given = tuple(told_premises(test.premises, names))
    if start:
        given = (f"as in {start}", *given)
    asked = told_request(test.request, names)
    if test.expectation is not None:
        yield CaseTold(test.name.text, given, asked, told_expectation(test.expectation), "", met=False)
    if test.table is None:
        return
    for row in test.table.rows:
        more = tuple(
            told_given(column, cell, names) for column, cell in zip(test.table.columns, row.cells, strict=False)
        )
        yield CaseTold(test.name.text, (*given, *more), asked, told_expectation(row.expectation), "", met=False)


def _case(ran: CaseResult, start: str, names: Vocabulary) -> CaseTold:
    told = list(told_test(ran.case.test, start, names))
    contracts = ran.case.policy.lowered.policy.contracts
    decided = told_decision(ran.trace.decision, [contract.name for contract in contracts])
    return replace(told[ran.case.row or 0], decided=decided, met=ran.met)


def _generated(program: Program, ran: CaseResult) -> bool:
    """Whether a case stands in a file that `rtshcua test --generate` wrote."""
    source = program.sources.get(ran.case.test.span.file)
    return source is not None and source.text.lstrip().startswith(GENERATED)


def _start(program: Program, ran: CaseResult, names: Vocabulary) -> Start:
    nominal = ran.case.nominal
    return Start(nominal.name.text, place_of(program, nominal.span), tuple(told_nominal(nominal, names)))
