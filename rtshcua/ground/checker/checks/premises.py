"""Check the premises of nominals and tests: each is well typed and given once."""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.fields import on_globe, one_of, quantity, size
from rtshcua.ground.checker.lookup import find_nominal, find_policy, find_vehicle
from rtshcua.ground.checker.name_scope import Argument, signal_type
from rtshcua.ground.checker.ranges import beyond
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import MAX_PHASES
from rtshcua.model.ir.expression import Coordinates, Edge, ForLast, Reference, Value, WithinLast
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.ir.skills import ParameterDecl
from rtshcua.model.ir.tests import (
    Asker,
    InPhase,
    Instant,
    Named,
    NominalDecl,
    OverTime,
    Premises,
    Subject,
    TableCell,
    TestDecl,
)
from rtshcua.model.quantity import Dimension

#: the values of a temporal condition, as written; `unknown` is a keyword
TRUTHS = ("true", "false")
SOURCES = tuple(kind.name.lower() for kind in SourceKind)


def check_premises(context: CheckContext, premises: Premises) -> None:
    """Report invalid premises of a nominal or a test."""
    for assignment in premises.given:
        check_subject(context, assignment.subject)
        check_cell(context, assignment.subject, assignment.cell)
    once(context, ((each.subject, each.span) for each in premises.given))
    instant, phase, issued = premises.instant, premises.phase, premises.issued
    quantity(context, None if instant is None else instant.within, Dimension.DURATION, positive=False)
    quantity(context, premises.released, Dimension.DURATION, positive=False)
    quantity(context, None if issued is None else issued.distance, Dimension.DURATION, positive=False)
    for answer in premises.answers:
        quantity(context, answer.ago, Dimension.DURATION, positive=False)
    if phase is not None:
        _order(context, phase.order)


def check_asker(context: CheckContext, asker: Asker | None) -> None:
    """Report an unknown source. Roles are those of the policy, and are checked when the test is lowered."""
    if asker is not None and asker.source is not None:
        one_of(context, codes.UNKNOWN_SOURCE, asker.source, SOURCES, "source of requests")


def check_subject(context: CheckContext, subject: Subject) -> None:
    """Report a subject that is neither a signal nor a temporal condition."""
    scope = context.scope()
    if isinstance(subject, Named):
        if signal_of(context, subject) is None:
            scope.unknown(subject.span, subject.name.text)
        return
    before = len(context.report.found)
    check_condition(scope, subject.condition)
    if len(context.report.found) == before and not isinstance(subject.condition, ForLast | WithinLast | Edge):
        written = context.report.text(subject.condition.span)
        context.report.add(
            codes.WRONG_TYPE,
            subject.condition.span,
            f"expected a temporal condition; `{written}` reads current values only",
            help="set the signals that it reads; only conditions with `for the last`, `within the "
            "last`, `rising` or `falling` can be set",
        )


def check_cell(context: CheckContext, subject: Subject, cell: TableCell) -> None:
    """Report an invalid value of a subject; keep a valid one in `CheckContext.given`."""
    quantity(context, cell.measured, Dimension.DURATION, positive=False)
    if isinstance(subject, OverTime):
        _truth(context, cell)
        return
    signal = signal_of(context, subject)
    if signal is None or cell.value is None:
        return
    type = signal_type(context.symbols, signal)
    if type is None:  # reported where the signal is declared
        return
    seen = ParameterDecl(
        span=signal.name.span, name=signal.name, type=signal.type, range=None, choices=(), default=None
    )
    bound = bind_value(context.scope(), Argument(seen, type), cell.value)
    if bound is not None and check_size(context, cell.value, bound, type.dimension):
        extent = context.symbols.ranges.get(signal.name.text)
        if extent is not None and type.dimension is not None and isinstance(bound, int) and not extent.has(bound):
            beyond(context.scope(), cell.value, signal.name.text, extent, type.dimension, bound)
        else:
            context.given[signal.name.text, cell.value] = bound


def check_size(context: CheckContext, value: Value, bound: Bound, dimension: Dimension | None) -> bool:
    """Whether coordinates are supported, or a number fits on board; reports it if not."""
    if isinstance(bound, Coordinates):
        return on_globe(context, bound)
    return not isinstance(bound, int) or dimension is None or size(context, value, dimension, bound)


def signal_of(context: CheckContext, subject: Named) -> SignalDecl | None:
    """The signal of that name, if any."""
    return context.symbols.signals.get(subject.name.text)


def once(
    context: CheckContext, subjects: Iterable[tuple[Subject, Span]], first_words: str = "first given here"
) -> None:
    """Report premises that are given twice."""
    seen: dict[str, Span] = {}
    for subject, span in subjects:
        words = context.report.text(subject.span)
        first = seen.setdefault(words, span)
        if first is not span:
            context.report.add(
                codes.GIVEN_TWICE,
                subject.span,
                f"`{words}` is given twice",
                help="keep one of them",
                labels=[(first, first_words)],
            )


def _truth(context: CheckContext, cell: TableCell) -> None:
    if cell.value is not None and not (isinstance(cell.value, Reference) and cell.value.name in TRUTHS):
        near = suggestion(cell.value.name, TRUTHS) if isinstance(cell.value, Reference) else None
        context.report.add(
            codes.WRONG_TYPE,
            cell.value.span,
            f"`{context.report.text(cell.value.span)}` is not a truth value",
            help=near or "write `true`, `false` or `unknown`",
            fix=correction(context.report, cell.value.span, context.report.raw(cell.value.span), TRUTHS),
        )
    elif cell.measured is not None:
        context.report.add(
            codes.WITHOUT_EFFECT,
            cell.measured.span,
            "the value of a temporal condition has no age",
            help="leave `measured ... ago` out",
        )


def _order(context: CheckContext, order: tuple[Name, ...]) -> None:
    if len(order) > MAX_PHASES:
        context.report.add(
            codes.TOO_MANY,
            order[0].span.to(order[-1].span),
            f"the test names {len(order)} phases; the limit is {MAX_PHASES}",
        )
    seen: dict[str, Name] = {}
    for name in order:
        first = seen.setdefault(name.text, name)
        if first is not name:
            context.report.add_twice(codes.DUPLICATE_NAME, name.span, f"the phase `{name.text}`", "named", first.span)


def check_nominals(context: CheckContext) -> None:
    """Report every nominal with unknown or invalid parts."""
    for nominal in context.symbols.nominals.values():
        find_policy(context, nominal.policy)
        find_vehicle(context, nominal.vehicle)
        check_asker(context, nominal.asker)
        check_premises(context, nominal.premises)


class TestStart(NamedTuple):
    """The start of a test: its own premises, else those of its nominal, else None."""

    nominal: NominalDecl
    role: Name | None
    source: Name | None
    instant: Instant | None
    phase: InPhase | None
    order: tuple[Name, ...]  # of the phases; never empty where there is a phase


def nominal_of(context: CheckContext, test: TestDecl) -> NominalDecl | None:
    """Return the nominal that a test names; else the only one of its file; else the only one of the program.

    None after a finding, or if its declaration has an error.
    """
    if test.nominal is not None:
        return find_nominal(context, test.nominal)
    known = list(context.symbols.nominals.values())
    own = [each for each in known if each.span.file == test.span.file] or known
    if len(own) == 1:
        return own[0]
    if own or not context.symbols.broken:
        names = listed(each.name.text for each in own)
        context.report.add(
            codes.NO_NOMINAL,
            test.name.span,
            f"the test does not say which of {len(own)} nominals it starts from" if own else "the test has no nominal",
            help=f"write `test ... from {own[0].name.text} {{ ... }}`; the nominals are {names}"
            if own
            else "declare or import a `nominal`, with the policy, the vehicle and the signals that a test starts with",
            labels=[(each.name.span, "a nominal") for each in own[:2]],
        )
    return None


def start_of(test: TestDecl, nominal: NominalDecl) -> TestStart:
    """Return the premises of a test and its nominal; those of the test come first."""
    askers = [None if test.request is None else test.request.asker, nominal.asker]
    said = [asker for asker in askers if asker is not None]
    phase = test.premises.phase or nominal.premises.phase
    orders = [each.order for each in (test.premises.phase, nominal.premises.phase) if each is not None and each.order]
    alone = () if phase is None else (phase.phase,)
    return TestStart(
        nominal=nominal,
        role=next((asker.role for asker in said if asker.role is not None), None),
        source=next((asker.source for asker in said if asker.source is not None), None),
        instant=test.premises.instant or nominal.premises.instant,
        phase=phase,
        order=orders[0] if orders else alone,
    )
