"""The values of a variable that get a case each, and their exact text in the language.

These are the values around its limits, every member of an enumeration, and `unknown`.
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
    """Yield both sides of a limit; for a number also the next value beyond the rounder side.

    The rounder side is usually the written limit, so that 24.99 %, 25 % and 25.01 % are tested, whichever side 25 %
    belongs to.
    """
    yield from (limit.holds, limit.fails)
    one, other = limit.holds, limit.fails
    if isinstance(one, int) and isinstance(other, int) and limit.variable.at is not None:
        rounder = min(one, other, key=_figures)
        yield 2 * rounder - (other if rounder == one else one)


def _figures(value: int) -> tuple[int, int]:
    """The number of significant digits of a number, and its absolute value."""
    return len(str(abs(value)).rstrip("0")), abs(value)


def parameter_of(invocation: PreparedInvocation, cell: int) -> Parameter:
    """The parameter with this first cell."""
    return next(each for each in invocation.invocation.contract.parameters if each.cell == cell)


def signal_of(policy: Policy, slot: int) -> Signal:
    """The signal with this first slot."""
    return next(each for each in policy.signals if each.slot == slot)


def always_tested(variable: SceneVariable, invocation: PreparedInvocation) -> Iterator[Value]:
    """Yield the values that get a case whatever the limits are: every member, the ends of a parameter's range and the
    values beyond them, and None for a signal.
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
    """Yield the members that a signal may have, without those that all its sources list as unknown."""
    for value, _ in signal.labels:
        if not signal.sources or any(value not in source.unknown for source in signal.sources):
            yield value


def variables(parts: Iterable[PolicyPart], invocation: PreparedInvocation) -> Sequence[SceneVariable]:
    """Return all parameters and all signals that the parts read: arguments first, each in the order of the cells."""
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
    """Return each value once: numbers in ascending order, places in the given order, None at the end."""
    unique = list(dict.fromkeys(values))
    numbers = sorted(value for value in unique if isinstance(value, int))
    places = [value for value in unique if isinstance(value, tuple)]
    return [*numbers, *places, *([None] if None in unique else [])]


def writable(
    value: Value, variable: SceneVariable, invocation: PreparedInvocation, bounds: Sequence[tuple[int, int]]
) -> bool:
    """Whether a test may have a value: an argument may be out of range by one, a signal must be within its `bounds`."""
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
    """The text of a value of a signal; None if the language cannot write it."""
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
    """The text of a value of a parameter; None if the language cannot write it."""
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
    """The text of a duration."""
    return display(us, Dimension.DURATION)


def place_text(projection: Projection, x: int, y: int) -> str:
    """The text of the writable place nearest to a place in local mm."""
    latitude, longitude = unproject(projection, x, y)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _degrees(value: int, sides: str) -> str:
    whole, part = divmod(abs(value), _DEGREE)
    return f"{whole}.{f'{part:07d}'.rstrip('0') or '0'} {sides[value < 0]}"


def moment_text(us: int) -> str:
    """The text (RFC 3339) of a UTC time in us since the epoch."""
    text = (_EPOCH + timedelta(microseconds=us)).strftime("%Y-%m-%dT%H:%M:%S.%f")
    return f"{text.rstrip('0').rstrip('.')}Z"


def monitor_text(one: Monitor) -> str:
    """The text of a condition over time, with its operand in brackets, because that may be an `or`."""
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
