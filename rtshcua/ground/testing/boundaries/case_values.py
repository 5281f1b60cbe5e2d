"""Which values of a variable are worth a case each, and how the language writes them, exactly.

These are the values around its limits, every member, and that it is unknown.
"""

from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.situation import SINGLE
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.ground.testing.boundaries.clause_limits import ClauseLimit
from rtshcua.ground.testing.boundaries.scene import PolicyPart, SceneVariable, Value
from rtshcua.ground.testing.coverage_goals import AIRSPACE, ENERGY
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Parameter
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.zone import Projection, unproject
from rtshcua.model.quantity import Dimension, display


def around(limit: ClauseLimit) -> Iterator[Value]:
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


def always_tested(variable: SceneVariable, invocation: PreparedInvocation) -> Iterator[Value]:
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


def variables(parts: Iterable[PolicyPart], invocation: PreparedInvocation) -> Sequence[SceneVariable]:
    """Everything that some conditions read, and all parameters: arguments first, each in the order of its cells."""
    vehicle = invocation.policy.policy.vehicle
    where = {vehicle.position, vehicle.height}
    slots: set[int] = set()
    for part in parts:
        if part.role == ENERGY:
            slots.add(vehicle.battery)
        if part.role == AIRSPACE:
            slots |= where
        for atom in part.atoms:
            match atom:
                case tree.AtMost(terms, _) | tree.Equal(terms, _):
                    slots |= {term.at for term in terms if not term.argument}
                case tree.Member(False, at, _):
                    slots.add(at)
                case tree.SlotKnown(at):
                    slots.add(vehicle.position if at == vehicle.position + 1 else at)
                case tree.InsideZone() | tree.InsideArgument():
                    slots |= where
    cells = sorted(parameter.cell for parameter in invocation.invocation.contract.parameters)
    return [
        *(SceneVariable(True, cell) for cell in cells),
        *(SceneVariable(False, slot) for slot in sorted(slots - {-1})),
    ]


def ordered(values: Iterable[Value]) -> list[Value]:
    """Each value once: numbers upwards, places as they come, what is not known at the end."""
    unique = list(dict.fromkeys(values))
    numbers = sorted(value for value in unique if isinstance(value, int))
    places = [value for value in unique if isinstance(value, tuple)]
    return [*numbers, *places, *([None] if None in unique else [])]


def writable(
    value: Value, variable: SceneVariable, invocation: PreparedInvocation, bounds: Sequence[tuple[int, int]]
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


NOT_KNOWN = "unknown"
TRUTHS = {TRUE: "true", FALSE: "false", UNKNOWN: NOT_KNOWN}
assert TRUTHS.keys() == SINGLE
_DEGREE = 10_000_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def signal_text(policy: Policy, one: Signal, value: Value) -> str | None:
    """A value of a signal; None where the language has no words for it."""
    if value is None:
        return NOT_KNOWN
    if one.kind == POSITION:
        assert isinstance(value, tuple)
        return place_text(policy.projection, *value)
    assert isinstance(value, int)
    if one.kind == ENUMERATION:
        return dict(one.labels).get(value)
    return display(value, Dimension(one.dimension))


def argument_text(policy: Policy, one: Parameter, value: Value) -> str | None:
    """A value of a parameter; None where the language has no words for it."""
    if one.kind == PLACE:
        assert isinstance(value, tuple)
        return place_text(policy.projection, *value)
    assert isinstance(value, int)
    if one.kind == CHOICE:
        return one.labels[value] if 0 <= value < len(one.labels) else None
    if one.kind == ZONE:
        return policy.zones[value].name if 0 <= value < policy.declared else None
    return display(value, Dimension(one.dimension))


def duration_text(us: int) -> str:
    """A duration."""
    return display(us, Dimension.DURATION)


def place_text(projection: Projection, x: int, y: int) -> str:
    """A place in local mm, to the nearest that can be written."""
    latitude, longitude = unproject(projection, x, y)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _degrees(value: int, sides: str) -> str:
    whole, part = divmod(abs(value), _DEGREE)
    return f"{whole}.{f'{part:07d}'.rstrip('0') or '0'} {sides[value < 0]}"


def moment_text(us: int) -> str:
    """A UTC time in us since the epoch, as RFC 3339 writes it."""
    text = (_EPOCH + timedelta(microseconds=us)).strftime("%Y-%m-%dT%H:%M:%S.%f")
    return f"{text.rstrip('0').rstrip('.')}Z"


def monitor_text(one: Monitor) -> str:
    """A condition over time, as rules have it; in brackets, which mean nothing, for it may be an `or`."""
    operand = f"({one.when.text})"
    match one.kind:
        case MonitorKind.RISING:
            return f"rising {operand}"
        case MonitorKind.FALLING:
            return f"falling {operand}"
        case MonitorKind.FOR_LAST:
            return f"{operand} for the last {duration_text(one.window_us)}"
        case _:
            return f"{operand} within the last {duration_text(one.window_us)}"
