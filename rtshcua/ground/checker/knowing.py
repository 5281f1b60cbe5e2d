"""E0204, E0324: `s is known` is asked of a signal, and stands where unknown and false are not turned round.

It is true or unknown, and never false: what is unknown permits nothing, so no condition may hold because something is
not known. Under `not` it could never be true, and an edge waits for it to be false.
"""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.fitting import declaration_labels
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.checker.scope import Scope
from rtshcua.ground.checker.values import typed
from rtshcua.model.ir.expression import Edge, Known, Not
from rtshcua.model.ir.signals import SignalDecl


def check_known(scope: Scope, node: Known) -> None:
    """Report what is asked to be known and is no signal."""
    if typed(scope, node.subject) is None or isinstance(scope.find(node.subject.name), SignalDecl):
        return
    scope.report.add(
        codes.WRONG_KIND,
        node.subject.span,
        f"`{node.subject.name}` is no signal, so it is always known",
        help="ask it of a signal, as in `position is known`",
        labels=declaration_labels(scope, node.subject),
    )


def check_unturned(scope: Scope, node: Not | Edge) -> None:
    """Report each `is known` under a `not` or an edge."""
    word = "not" if isinstance(node, Not) else "rising" if node.rising else "falling"
    for part in walk(node.operand):
        if isinstance(part, Known):
            scope.report.add(
                codes.TURNED_KNOWN,
                part.span,
                f"`{scope.report.text(part.span)}` is true or unknown, never false: `{word}` has nothing to turn",
                help="what follows where a signal is not known, the contract's `fallback` says; ask that it is known",
                labels=[(node.span, f"under this `{word}`")],
            )
