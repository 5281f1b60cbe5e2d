"""E1401: where a test starts from, and what it and its nominal say together."""

from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.lookup import find_nominal
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.tests import InPhase, Instant, NominalDecl, TestDecl


class Start(NamedTuple):
    """What a test begins with: its own words, and its nominal's where it has none. None: neither says it."""

    nominal: NominalDecl
    role: Name | None
    source: Name | None
    instant: Instant | None
    phase: InPhase | None
    order: tuple[Name, ...]  # of the phases; never empty where there is a phase


def nominal_of(context: Context, test: TestDecl) -> NominalDecl | None:
    """The nominal that a test names; else the only one of its file, or, where that has none, the only one there is.

    None after a finding, and where its declaration has an error.
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
            f"there are {len(own)} nominals, and the test does not say from which it starts"
            if own
            else "nothing says where the test starts from",
            help=f"write `test ... from {own[0].name.text} {{ ... }}`; there are {names}"
            if own
            else "declare or import a `nominal`, with the policy, the vehicle and the signals that a test starts with",
            labels=[(each.name.span, "a nominal") for each in own[:2]],
        )
    return None


def start_of(test: TestDecl, nominal: NominalDecl) -> Start:
    """What the two say together; what the test says replaces what the nominal says."""
    askers = [None if test.request is None else test.request.asker, nominal.asker]
    said = [asker for asker in askers if asker is not None]
    phase = test.premises.phase or nominal.premises.phase
    orders = [each.order for each in (test.premises.phase, nominal.premises.phase) if each is not None and each.order]
    alone = () if phase is None else (phase.phase,)
    return Start(
        nominal=nominal,
        role=next((asker.role for asker in said if asker.role is not None), None),
        source=next((asker.source for asker in said if asker.source is not None), None),
        instant=test.premises.instant or nominal.premises.instant,
        phase=phase,
        order=orders[0] if orders else alone,
    )
