"""A change of a value, as it is told to a person or an agent."""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.decision.change import Change, nearest_in
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.values import point
from rtshcua.model.flat.contract import QUANTITY, ZONE, Contract
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION

LOCAL_TIME = "local time"
DAYTIME = "daytime"


class Nearest(NamedTuple):
    """A value of `subject` (a parameter, a signal, or the local time) that would have passed, the nearest there is.

    `value` is in the canonical unit of `dimension` (`daytime`: us since local midnight). For an enumeration or a zone,
    `choices` are the names that would pass, and `value` is the ordinal or index of the first.
    """

    subject: str
    dimension: str
    value: int
    choices: tuple[str, ...]


def offer(change: Change, contract: Contract, policy: Policy, at: Environment) -> Nearest | None:
    """The nearest value that a change allows, or None where the subject has no such value."""
    if change.at is None:
        local = point(at.utc[0][0] + policy.vehicle.utc_offset_us)
        return Nearest(LOCAL_TIME, DAYTIME, nearest_in(change, local), ())
    if change.argument:
        return _argument(change, change.at, contract, policy, at)
    return _signal(change, change.at, policy, at)


def _argument(change: Change, cell: int, contract: Contract, policy: Policy, at: Environment) -> Nearest | None:
    parameter = next(parameter for parameter in contract.parameters if parameter.cell == cell)
    name, dimension = parameter.name, parameter.dimension
    if parameter.kind != QUANTITY:
        names = tuple(zone.name for zone in policy.zones) if parameter.kind == ZONE else parameter.labels
        possible = range(parameter.low, parameter.high + 1)
        return _choice(name, dimension, change, ((ordinal, names[ordinal]) for ordinal in possible))
    low, high = max(change.low, parameter.low), min(change.high, parameter.high)
    if low > high:
        return None
    return Nearest(name, dimension, nearest_in(change._replace(low=low, high=high), at.arguments[cell]), ())


def _signal(change: Change, slot: int, policy: Policy, at: Environment) -> Nearest | None:
    signal = next(signal for signal in policy.signals if signal.slot == slot)
    if signal.kind == ENUMERATION:
        return _choice(signal.name, signal.dimension, change, signal.labels)
    return Nearest(signal.name, signal.dimension, nearest_in(change, at.slots[slot]), ())


def _choice(subject: str, dimension: str, change: Change, labels: Iterable[tuple[int, str]]) -> Nearest | None:
    fitting = sorted((value, label) for value, label in labels if change.allows(value))
    if not fitting:
        return None
    return Nearest(subject, dimension, fitting[0][0], tuple(label for _, label in fitting))
