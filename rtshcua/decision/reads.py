"""Which state slots code reads."""

from collections.abc import Iterable

from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.policy import Monitor, Vehicle


def slots_read(clauses: Iterable[Clause], vehicle: Vehicle, monitors: tuple[Monitor, ...] = ()) -> tuple[int, ...]:
    """The slots that well-formed clauses read, themselves or through the policy's temporal monitors, ascending; asking
    where the vehicle is reads its position and height.
    """
    slots: set[int] = set()
    left, seen = list(clauses), set[int]()
    while left:
        code = left.pop().code
        for at in range(0, len(code), 3):
            op = code[at]
            if op in (Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN):
                slots.add(code[at + 1])
            elif op in (Op.POSITION_IN, Op.POSITION_IN_ARGUMENT):
                slots.update(where(vehicle))
            elif op == Op.MONITOR and code[at + 1] not in seen:
                seen.add(code[at + 1])
                left.append(monitors[code[at + 1]].when)
    return tuple(sorted(slots))


def monitored(clauses: Iterable[Clause]) -> bool:
    """Whether well-formed clauses ask a temporal monitor anything."""
    return any(Op.MONITOR in clause.code[::3] for clause in clauses)


def where(vehicle: Vehicle) -> tuple[int, ...]:
    """The slots that tell where the vehicle is, as far as it has them."""
    position = () if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    return position if vehicle.height == -1 else (*position, vehicle.height)
