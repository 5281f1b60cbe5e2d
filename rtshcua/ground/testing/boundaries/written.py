"""Values as the language writes them, exactly."""

from datetime import UTC, datetime, timedelta

from rtshcua.decision.situation import SINGLE
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.ground.testing.boundaries.scene import Value
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Parameter
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.zone import Projection, unproject
from rtshcua.model.quantity import Dimension, display

NOT_KNOWN = "unknown"
TRUTHS = {TRUE: "true", FALSE: "false", UNKNOWN: NOT_KNOWN}
assert TRUTHS.keys() == SINGLE
_DEGREE = 10_000_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def signal(policy: Policy, one: Signal, value: Value) -> str | None:
    """A value of a signal; None where the language has no words for it."""
    if value is None:
        return NOT_KNOWN
    if one.kind == POSITION:
        assert isinstance(value, tuple)
        return place(policy.projection, *value)
    assert isinstance(value, int)
    if one.kind == ENUMERATION:
        return dict(one.labels).get(value)
    return quantity(value, one.dimension)


def argument(policy: Policy, one: Parameter, value: Value) -> str | None:
    """A value of a parameter; None where the language has no words for it."""
    if one.kind == PLACE:
        assert isinstance(value, tuple)
        return place(policy.projection, *value)
    assert isinstance(value, int)
    if one.kind == CHOICE:
        return one.labels[value] if 0 <= value < len(one.labels) else None
    if one.kind == ZONE:
        return policy.zones[value].name if 0 <= value < policy.declared else None
    return quantity(value, one.dimension)


def quantity(value: int, dimension: str) -> str:
    """A number in the canonical unit of a dimension, with a unit that a person uses."""
    return display(value, Dimension(dimension))


def duration(us: int) -> str:
    """A duration."""
    return display(us, Dimension.DURATION)


def place(projection: Projection, x: int, y: int) -> str:
    """A place in local mm, to the nearest that can be written."""
    latitude, longitude = unproject(projection, x, y)
    return f"{_degrees(latitude, 'NS')}, {_degrees(longitude, 'EW')}"


def _degrees(value: int, sides: str) -> str:
    whole, part = divmod(abs(value), _DEGREE)
    return f"{whole}.{f'{part:07d}'.rstrip('0') or '0'} {sides[value < 0]}"


def moment(us: int) -> str:
    """A UTC time in us since the epoch, as RFC 3339 writes it."""
    text = (_EPOCH + timedelta(microseconds=us)).strftime("%Y-%m-%dT%H:%M:%S.%f")
    return f"{text.rstrip('0').rstrip('.')}Z"


def over_time(one: Monitor) -> str:
    """A condition over time, as rules have it; in brackets, which mean nothing, for it may be an `or`."""
    operand = f"({one.when.text})"
    match one.kind:
        case MonitorKind.RISING:
            return f"rising {operand}"
        case MonitorKind.FALLING:
            return f"falling {operand}"
        case MonitorKind.FOR_LAST:
            return f"{operand} for the last {duration(one.window_us)}"
        case _:
            return f"{operand} within the last {duration(one.window_us)}"
