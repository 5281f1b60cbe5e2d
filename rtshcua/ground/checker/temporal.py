"""E0320, E0321: what is observed over time is there whether or not a skill runs, and no further back than is kept.

An edge asks for the moment at which its condition becomes true, so it reads the condition both ways: no side of a grown
zone, which is rounded towards one of them, would be the safe one; nor one of a band that is known to within an error.
"""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.checker.phases import is_about_phase
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.types import DURATION
from rtshcua.ground.checker.values import typed
from rtshcua.model.flat.limits import MAX_WINDOW
from rtshcua.model.ir.expression import Edge, ForLast, Grow, Inside, Near, Quantity, Reference, WithinLast
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.quantity import Datum, Dimension, display

Temporal = ForLast | WithinLast | Near | Edge


def check_window(scope: Scope, window: Quantity) -> None:
    """A window is a duration above zero that fits on board."""
    if typed(scope, window, DURATION) is None or 0 < window.value <= MAX_WINDOW:
        return
    longer = window.value > 0
    scope.report.add(
        codes.WINDOW_LENGTH,
        window.span,
        f"`{scope.report.text(window.span)}` is longer than what is kept on board"
        if longer
        else f"a window of `{scope.report.text(window.span)}` has no moment in it",
        help=f"a window is longer than `0 s`, and at most `{display(MAX_WINDOW, Dimension.DURATION)}`",
    )


def check_observable(scope: Scope, node: Temporal) -> None:
    """Report what the condition under a temporal operator, at any depth, may not read."""
    for part in walk(node):
        if is_about_phase(part):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                "what is observed over time cannot ask for the mission's phase",
                help="ask for the phase beside it, as in `phase == inspection and ... for the last 3 s`",
                labels=[(node.span, "this is observed whether or not a mission flies")],
            )
        elif isinstance(part, Reference) and isinstance(found := scope.find(part.name), Argument):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                f"what is observed over time cannot read the argument `{part.name}`",
                help="compare signals, zones and times with what is written out",
                labels=[
                    (node.span, "this is observed whether or not the skill runs"),
                    (found.declaration.span, f"`{part.name}` is declared here"),
                ],
            )
        elif isinstance(part, Edge):
            _exact(scope, part)


def _exact(scope: Scope, edge: Edge) -> None:
    """Report a zone under an edge that is not known exactly: a grown one, or one whose band is above sea where some
    vehicle's elevation is known to within an error only.
    """
    for part in walk(edge.operand):
        if isinstance(part, Inside) and not isinstance(part.region, Grow):
            _banded(scope, edge, part.region)
        if isinstance(part, Grow):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                f"`{'rising' if edge.rising else 'falling'}` cannot read a grown zone",
                help="declare a zone of the shape that you mean",
                labels=[(edge.span, "an edge reads its condition both ways, and a grown zone is safe one way only")],
            )


def _banded(scope: Scope, edge: Edge, region: Reference) -> None:
    zone = scope.find(region.name)
    bands = (zone.floor, zone.ceiling) if isinstance(zone, ZoneDecl) else ()
    above_sea = next((each for each in bands if each is not None and each.datum is Datum.SEA), None)
    errors = (each.elevation_within for each in scope.symbols.vehicles.values())
    error = next((each for each in errors if each is not None and each.value > 0), None)
    if above_sea is None or error is None:
        return
    scope.report.add(
        codes.TIMED_ARGUMENT,
        region.span,
        f"`{'rising' if edge.rising else 'falling'}` cannot read `{region.name}`, whose height above sea is not known "
        "exactly",
        help="declare a zone whose floor and ceiling are above home",
        labels=[
            (edge.span, "an edge reads its condition both ways, and the band is safe one way only"),
            (above_sea.span, "above sea"),
            (error.span, "how far the real elevation may differ"),
        ],
    )
