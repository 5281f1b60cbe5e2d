"""Witnesses: a single situation from a box, its evaluation as on board, and its text.

An example of the text is `battery = 20 % and wind.speed = 7 m/s`.
"""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.times import LocalTime, time_of_week
from rtshcua.decision.values import ABSENT, MISSING, PRESENT, TRUE, Truth, Value, point
from rtshcua.ground.analysis.box import VEHICLE, Cell, ValueBox, Who, clipped, narrow
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.geometry.polygons import Point
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Contract
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display

#: the number of values that are tried for a cell that sums tie to others
_TRIES = 3


class Witness(NamedTuple):
    """A situation. `cells` and `places` are the values that the conditions read, for the text; `at` is complete."""

    at: Environment
    cells: Mapping[Cell, int | None]
    places: Mapping[Who, Point | None]
    box: ValueBox

    def truth(self, node: tree.Node, space: SituationSpace) -> Truth:
        """Return the truth value of a condition in this situation."""
        self.at.place = None
        return build(node, space.tables)(self.at)


def witness(box: ValueBox, space: SituationSpace) -> Witness | None:
    """Return a situation in a narrowed box, or None if none is found."""
    tied = {(term.argument, term.at) for form in box.forms for term in form}
    fixed = _fixed(box, space, [cell for cell in sorted(tied) if not box.cells[cell][2]])
    if fixed is None:
        return None
    cells: dict[Cell, int | None] = {
        cell: None if value[2] == ABSENT else plainest(value) for cell, value in fixed.cells.items()
    }
    places: dict[Who, Point | None] = {}
    for who in {who for who, _ in box.sides}:
        found = None if who == VEHICLE and box.located == ABSENT else _place(fixed, who, space)
        if found is None and not (who == VEHICLE and box.located == ABSENT):
            return None
        places[who] = found
    return Witness(_environment(fixed, cells, places, space), cells, places, fixed)


def plain(space: SituationSpace) -> Environment:
    """Return one situation of a space: the plainest of each value, and no value that may be missing."""
    return _environment(ValueBox({}, {}, {}, {}, space.utc, space.phases, 0), {}, {}, space)


def halves(box: ValueBox) -> list[ValueBox]:
    """Split a box at the middle of the widest value that a sum ties to others; empty if there is none."""
    tied = [
        cell for form in box.forms for cell in ((term.argument, term.at) for term in form) if not box.cells[cell][2]
    ]
    widest = max(tied, key=lambda cell: box.cells[cell][1] - box.cells[cell][0], default=None)
    if widest is None:
        return []
    low, high, _, _ = value = box.cells[widest]
    middle = (low + high) // 2
    parts = (clipped(value, low, middle), clipped(value, middle + 1, high)) if low < high else ()
    return [box.with_cell(widest, part) for part in parts if part is not None]


def plainest(value: Value) -> int:
    """Return the value that is easiest to read: the roundest, and of these the one nearest to a bound."""
    low, high, _, elements = value
    if elements is not None:
        return min(elements)
    if low <= 0 <= high:
        return 0
    step = 1
    while step <= max(abs(low), abs(high)) and -(-low // (step * 10)) * step * 10 <= high:
        step *= 10
    for multiple in (5, 2):
        if -(-low // (step * multiple)) * step * multiple <= high:
            step *= multiple
            break
    return -(-low // step) * step if low > 0 else high // step * step


def _fixed(box: ValueBox, space: SituationSpace, tied: list[Cell]) -> ValueBox | None:
    """Return a box with single values in the cells that sums tie together, or None if none is found."""
    if not tied:
        return box
    cell, rest = tied[0], tied[1:]
    value = box.cells[cell]
    for choice in list(dict.fromkeys((plainest(value), value[0], value[1])))[:_TRIES]:
        made = box.with_cell(cell, point(choice))
        if narrow(made, space.plane):
            found = _fixed(made, space, rest)
            if found is not None:
                return found
    return None


def _place(box: ValueBox, who: Who, space: SituationSpace) -> Point | None:
    sides = {zone: side == TRUE for (other, zone), side in box.sides.items() if other == who and side in (1, 2)}
    if who == VEHICLE:
        x, y = space.slots[space.tables.known.x], space.slots[space.tables.known.y]
    else:
        x, y = space.arguments[who], space.arguments[who + 1]
    if x[0] == x[1] and y[0] == y[1]:
        return x[0], y[0]

    def allowed(place: Point) -> bool:
        return x[0] <= place[0] <= x[1] and y[0] <= place[1] <= y[1]

    return space.plane.place(sides, allowed)


def _environment(
    box: ValueBox, cells: Mapping[Cell, int | None], places: Mapping[Who, Point | None], space: SituationSpace
) -> Environment:
    slots = [_any(value) for value in space.slots]
    arguments = [_any(value) for value in space.arguments]
    for (argument, index), value in cells.items():
        (arguments if argument else slots)[index] = MISSING if value is None else point(value)
    known = space.tables.known
    for who, place in places.items():
        if who == VEHICLE:
            slots[known.x], slots[known.y] = (MISSING, MISSING) if place is None else map(point, place)
        elif place is not None:
            arguments[who], arguments[who + 1] = map(point, place)
    moment = box.utc[0][0]
    monitors = tuple(box.monitors.get(number, truth) for number, truth in enumerate(space.monitors))
    single = tuple(truth & -truth for truth in monitors)
    return Environment(slots, arguments, ((moment, moment),), space.error, None, single, max(box.phases))


def _any(value: Value) -> Value:
    """Return one of a value's possibilities, missing if possible."""
    low, high, gap, elements = value
    if gap != PRESENT:
        return MISSING
    return point(plainest((low, high, gap, elements)))


#: 1e-7 degree in a degree; text has 5 decimals, about a metre
_DEGREE = 10_000_000


def witness_text(witness: Witness, policy: Policy, contract: Contract | None) -> str:
    """Format the values that the conditions read: arguments, then signals, then the position."""
    found = [each for each in (_argument(witness, cell, policy, contract) for cell in _cells(contract)) if each]
    for signal in policy.signals:
        if signal.kind == POSITION:
            continue
        cell = (False, signal.slot)
        if cell in witness.cells:
            value = witness.cells[cell]
            found.append(
                f"`{signal.name}` unknown" if value is None else f"`{signal.name} = {_signal_text(signal, value)}`"
            )
    if VEHICLE in witness.places:
        place = witness.places[VEHICLE]
        found.append("the position unknown" if place is None else f"the vehicle at {_place_text(place, policy)}")
    return " and ".join(found) or "any time"


def _cells(contract: Contract | None) -> list[int]:
    return [] if contract is None else [parameter.cell for parameter in contract.parameters]


def _argument(witness: Witness, cell: int, policy: Policy, contract: Contract | None) -> str | None:
    assert contract is not None
    parameter = next(each for each in contract.parameters if each.cell == cell)
    if parameter.kind == PLACE:
        place = witness.places.get(cell)
        return None if place is None else f"`{parameter.name} = {_place_text(place, policy)}`"
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


def _signal_text(signal: Signal, value: int) -> str:
    if signal.kind == ENUMERATION:
        return dict(signal.labels).get(value, str(value))
    return _quantity(value, signal.dimension)


def _quantity(value: int, dimension: str) -> str:
    try:
        return display(value, Dimension(dimension))
    except ValueError:
        return str(value)


def _place_text(place: tuple[int, int], policy: Policy) -> str:
    latitude, longitude = unproject(policy.projection, *place)
    return f"{_degrees(latitude)} N, {_degrees(longitude)} E"


def _degrees(value: int) -> str:
    whole, rest = divmod(abs(value) + 50, _DEGREE)
    return f"{'-' if value < 0 else ''}{whole}.{rest // 100:05d}"


_DAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


def local_time_text(moment_us: int, local: LocalTime, *, day: bool = False) -> str:
    """Format a UTC time as local time of day, to the minute; with `day`, prefixed by the day of the week."""
    time_us = moment_us + local.offset(moment_us)
    minutes = time_us % DAY // 60_000_000
    return f"{_DAYS[time_of_week(time_us) // DAY] + ' ' if day else ''}{minutes // 60:02d}:{minutes % 60:02d}"
