"""A condition in the best case: what only the state of the vehicle decides is taken to go the right way."""

from typing import Final

from rtshcua.decision import tree

#: the condition of a rule without one
ALWAYS: Final = tree.AtMost((), 0)
NEVER: Final = tree.AtMost((), -1)


def hopeful(node: tree.Node, hope: bool, fixed: frozenset[int] | None = None) -> tree.Node:
    """A condition whose atoms about the state are what brings it nearest to `hope`.

    Arguments, the time and the phase are known. `fixed` are slots of the state that are known too, and with them the
    place: None where nothing of the state is.
    """
    match node:
        case tree.Both(left, right):
            return tree.Both(hopeful(left, hope, fixed), hopeful(right, hope, fixed))
        case tree.Either(left, right):
            return tree.Either(hopeful(left, hope, fixed), hopeful(right, hope, fixed))
        case tree.Not(operand):
            return tree.Not(hopeful(operand, not hope, fixed))
        case tree.AtMost(terms, _) | tree.Equal(terms, _):
            known = all(term.argument or term.at in (fixed or ()) for term in terms)
        case tree.Member(argument, index, _):
            known = argument or index in (fixed or ())
        case tree.Known(index):
            known = index in (fixed or ())
        case tree.Inside() | tree.InsideArgument():
            known = fixed is not None
        case _:
            known = isinstance(node, tree.PointInside | tree.InWindow | tree.InWeek | tree.InPhase)
    return node if known else ALWAYS if hope else NEVER
