"""A change of a value, as it is told to a person or an agent: by names and in its dimension."""

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

#: a value and its name; a quantity has none
Option = tuple[int, str]


class Offer(NamedTuple):
    """The values that a change allows its subject: the nearest quantity, or each ordinal or zone with its name."""

    change: Change
    subject: str
    dimension: str
    options: tuple[Option, ...]


def offer(change: Change, contract: Contract, policy: Policy, at: Environment) -> Offer:
    """What a change offers; there are no options where the subject has no such value."""
    if change.at is None:
        local = point(at.utc[0][0] + policy.vehicle.utc_offset_us)
        return Offer(change, LOCAL_TIME, DAYTIME, ((nearest_in(change, local), ""),))
    if change.argument:
        return _argument(change, change.at, contract, policy, at)
    return _signal(change, change.at, policy, at)


def _argument(change: Change, cell: int, contract: Contract, policy: Policy, at: Environment) -> Offer:
    parameter = next(parameter for parameter in contract.parameters if parameter.cell == cell)
    if parameter.kind == QUANTITY:
        low, high = max(change.low, parameter.low), min(change.high, parameter.high)
        within = change._replace(low=low, high=high)
        options: tuple[Option, ...] = ((nearest_in(within, at.arguments[cell]), ""),) if low <= high else ()
    else:
        names = tuple(zone.name for zone in policy.zones) if parameter.kind == ZONE else parameter.labels
        options = _named(change, ((value, names[value]) for value in range(parameter.low, parameter.high + 1)))
    return Offer(change, parameter.name, parameter.dimension, options)


def _signal(change: Change, slot: int, policy: Policy, at: Environment) -> Offer:
    signal = next(signal for signal in policy.signals if signal.slot == slot)
    if signal.kind == ENUMERATION:
        return Offer(change, signal.name, signal.dimension, _named(change, signal.labels))
    return Offer(change, signal.name, signal.dimension, ((nearest_in(change, at.slots[slot]), ""),))


def _named(change: Change, labels: Iterable[Option]) -> tuple[Option, ...]:
    return tuple(sorted(option for option in labels if change.allows(option[0])))
