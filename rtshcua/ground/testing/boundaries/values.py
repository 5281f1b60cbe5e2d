"""Which values of a variable are worth a case each: those around its limits, every member, and not knowing it."""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.ground.testing.boundaries.limits import Limit
from rtshcua.ground.testing.boundaries.parts import Part, atoms
from rtshcua.ground.testing.boundaries.scene import Value, Variable
from rtshcua.ground.testing.coverage.universe import AIRSPACE, ENERGY
from rtshcua.model.flat.contract import CHOICE, QUANTITY, ZONE, Parameter
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, Signal


def around(limit: Limit) -> Iterator[Value]:
    """Both sides of a limit; of a number also the next beyond the rounder one, which is the one that people mean: so
    that 24.99 %, 25 % and 25.01 % are there whether the limit itself belongs to the one side or to the other.
    """
    yield from (limit.holds, limit.fails)
    one, other = limit.holds, limit.fails
    if isinstance(one, int) and isinstance(other, int) and limit.variable.at is not None:
        rounder = min(one, other, key=_figures)
        yield 2 * rounder - (other if rounder == one else one)


def _figures(value: int) -> tuple[int, int]:
    """How many figures a number takes without the zeros that end it."""
    return len(str(abs(value)).rstrip("0")), abs(value)


def parameter_of(invocation: PreparedInvocation, cell: int) -> Parameter:
    """The parameter whose first cell it is."""
    return next(each for each in invocation.invocation.contract.parameters if each.cell == cell)


def signal_of(policy: Policy, slot: int) -> Signal:
    """The signal whose first slot it is."""
    return next(each for each in policy.signals if each.slot == slot)


def always(variable: Variable, invocation: PreparedInvocation) -> Iterator[Value]:
    """What is worth a case whatever the limits are: every member of what has members, the ends of what a parameter may
    be and what is beyond, and that a signal is not known.
    """
    policy = invocation.policy.policy
    assert variable.at is not None
    if not variable.argument:
        signal = signal_of(policy, variable.at)
        if signal.kind == ENUMERATION:
            yield from reported(signal)
        yield None
        return
    parameter = parameter_of(invocation, variable.at)
    if parameter.kind == QUANTITY:
        yield from (parameter.low - 1, parameter.low, parameter.high, parameter.high + 1)
    elif parameter.kind == CHOICE:
        yield from range(len(parameter.labels))
    elif parameter.kind == ZONE:
        yield from range(policy.declared)


def reported(signal: Signal) -> Iterator[int]:
    """The members that a signal may be: one that all its sources call unknown is missing."""
    for value, _ in signal.labels:
        if not signal.sources or any(value not in source.unknown for source in signal.sources):
            yield value


def variables(parts: Iterable[Part], invocation: PreparedInvocation) -> Sequence[Variable]:
    """Everything that some conditions read, and all parameters: arguments first, each in the order of its cells."""
    vehicle = invocation.policy.policy.vehicle
    found = {Variable(True, parameter.cell) for parameter in invocation.invocation.contract.parameters}
    for part in parts:
        if part.role == ENERGY:
            found.add(Variable(False, vehicle.battery))
        if part.role == AIRSPACE:
            found |= {Variable(False, vehicle.position), Variable(False, vehicle.height)}
        for atom in () if part.node is None else atoms(part.node):
            match atom:
                case tree.AtMost(terms, _) | tree.Equal(terms, _):
                    found |= {Variable(False, term.at) for term in terms if not term.argument}
                case tree.Member(False, at, _):
                    found.add(Variable(False, at))
                case tree.Known(at):
                    found.add(Variable(False, vehicle.position if at == vehicle.position + 1 else at))
                case tree.Inside() | tree.InsideArgument():
                    found |= {Variable(False, vehicle.position), Variable(False, vehicle.height)}
                case _:
                    pass
    known = [variable for variable in found if variable.at != -1]
    return sorted(known, key=lambda one: (not one.argument, one.at or 0))


def ordered(values: Iterable[Value]) -> list[Value]:
    """Each value once: numbers upwards, places as they come, what is not known at the end."""
    unique = list(dict.fromkeys(values))
    numbers = sorted(value for value in unique if isinstance(value, int))
    places = [value for value in unique if isinstance(value, tuple)]
    return [*numbers, *places, *([None] if None in unique else [])]


def writable(
    value: Value, variable: Variable, invocation: PreparedInvocation, bounds: Sequence[tuple[int, int]]
) -> bool:
    """Whether a test may ask for a value: an argument may be out of its range by one, a signal not out of its own,
    which `bounds` has by its slot.
    """
    if not isinstance(value, int) or variable.at is None:
        return True
    if variable.argument:
        parameter = parameter_of(invocation, variable.at)
        return parameter.kind != QUANTITY or parameter.low - 1 <= value <= parameter.high + 1
    low, high = bounds[variable.at]
    return low <= value <= high
