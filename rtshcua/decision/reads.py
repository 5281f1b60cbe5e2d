"""Which state slots code reads."""

from collections.abc import Iterable

from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.policy import Vehicle


def slots_read(clauses: Iterable[Clause], vehicle: Vehicle) -> tuple[int, ...]:
    """The slots that well-formed clauses read, ascending; asking where the vehicle is reads its position and height."""
    slots: set[int] = set()
    for clause in clauses:
        for at in range(0, len(clause.code), 3):
            op = clause.code[at]
            if op in (Op.SIGNAL, Op.SIGNAL_IN):
                slots.add(clause.code[at + 1])
            elif op in (Op.POSITION_IN, Op.POSITION_IN_ARGUMENT):
                slots.update(where(vehicle))
    return tuple(sorted(slots))


def where(vehicle: Vehicle) -> tuple[int, ...]:
    """The slots that tell where the vehicle is, as far as it has them."""
    position = () if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    return position if vehicle.height == -1 else (*position, vehicle.height)
