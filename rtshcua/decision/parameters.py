"""The parameters of a contract and the argument cells that they own."""

from rtshcua.model.flat.contract import PLACE, Contract, Parameter
from rtshcua.model.flat.zone import MAX_COORDINATE


def cells(contract: Contract) -> int:
    """How many argument cells a contract has."""
    return sum(2 if parameter.kind == PLACE else 1 for parameter in contract.parameters)


def misfit(arguments: tuple[int, ...], contract: Contract) -> Parameter | None:
    """The first parameter whose argument is out of its range; a place has no range but that of all coordinates."""
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            low, high, last = -MAX_COORDINATE, MAX_COORDINATE, parameter.cell + 1
        else:
            low, high, last = parameter.low, parameter.high, parameter.cell
        if not all(low <= argument <= high for argument in arguments[parameter.cell : last + 1]):
            return parameter
    return None


def first_cell(contract: Contract, kind: int) -> int:
    """The cell of the first parameter of a kind, of which there is one: that is what a skill flies to, or covers."""
    return next(parameter.cell for parameter in contract.parameters if parameter.kind == kind)
