"""A witness in words: `battery = 20 % and wind.speed = 7 m/s`."""

from rtshcua.decision.times import LocalTime, time_of_week
from rtshcua.ground.analysis.box import VEHICLE
from rtshcua.ground.analysis.witness import Witness
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Contract
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

#: what of a coordinate a person reads: 1e-7 degree in 1e-5, about a metre
_DEGREE = 10_000_000


def words(witness: Witness, policy: Policy, contract: Contract | None) -> str:
    """What the conditions read in a witness, in the order of arguments, signals and the rest."""
    found = [each for each in (_argument(witness, cell, policy, contract) for cell in _cells(contract)) if each]
    for signal in policy.signals:
        if signal.kind == POSITION:
            continue
        cell = (False, signal.slot)
        if cell in witness.cells:
            value = witness.cells[cell]
            found.append(f"`{signal.name}` unknown" if value is None else f"`{signal.name} = {_signal(signal, value)}`")
    if VEHICLE in witness.places:
        place = witness.places[VEHICLE]
        found.append("the position unknown" if place is None else f"the vehicle at {_place(place, policy)}")
    return " and ".join(found) or "any time"


def _cells(contract: Contract | None) -> list[int]:
    return [] if contract is None else [parameter.cell for parameter in contract.parameters]


def _argument(witness: Witness, cell: int, policy: Policy, contract: Contract | None) -> str | None:
    assert contract is not None
    parameter = next(each for each in contract.parameters if each.cell == cell)
    if parameter.kind == PLACE:
        place = witness.places.get(cell)
        return None if place is None else f"`{parameter.name} = {_place(place, policy)}`"
    value = witness.cells.get((True, cell))
    if value is None:
        return None
    if parameter.kind == QUANTITY:
        text = _quantity(value, parameter.dimension)
    elif parameter.kind == ZONE:
        text = policy.zones[value].name
    else:
        text = parameter.labels[value]
    return f"`{parameter.name} = {text}`"


def _signal(signal: Signal, value: int) -> str:
    if signal.kind == ENUMERATION:
        return dict(signal.labels).get(value, str(value))
    return _quantity(value, signal.dimension)


def _quantity(value: int, dimension: str) -> str:
    try:
        return display(value, Dimension(dimension))
    except ValueError:
        return str(value)


def _place(place: tuple[int, int], policy: Policy) -> str:
    latitude, longitude = unproject(policy.projection, *place)
    return f"{_degrees(latitude)} N, {_degrees(longitude)} E"


def _degrees(value: int) -> str:
    whole, rest = divmod(abs(value) + 50, _DEGREE)
    return f"{'-' if value < 0 else ''}{whole}.{rest // 100:05d}"


_DAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


def clock(moment_us: int, local: LocalTime, *, day: bool = False) -> str:
    """The local time of day of a moment of UTC, to the minute; with `day`, that of the week too."""
    time_us = moment_us + local.offset(moment_us)
    minutes = time_us % DAY // 60_000_000
    return f"{_DAYS[time_of_week(time_us) // DAY] + ' ' if day else ''}{minutes // 60:02d}:{minutes % 60:02d}"
