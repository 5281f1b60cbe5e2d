"""A single situation out of a box, and its replay in the evaluator that decides on board."""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.values import ABSENT, MISSING, PRESENT, TRUE, Truth, Value, point
from rtshcua.ground.analysis.box import VEHICLE, Box, Cell, Who, clipped
from rtshcua.ground.analysis.narrow import narrow
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.geometry.polygons import Point

#: how many values of a cell are tried where sums tie it to others
_TRIES = 3


class Witness(NamedTuple):
    """A situation: `values` and `places` are what the conditions read, for words; `at` is all of it."""

    at: Environment
    cells: Mapping[Cell, int | None]
    places: Mapping[Who, Point | None]
    box: Box

    def truth(self, node: tree.Node, space: Space) -> Truth:
        """The truth of a condition in this situation."""
        self.at.place = None
        return build(node, space.tables)(self.at)


def witness(box: Box, space: Space) -> Witness | None:
    """A situation in the box, which narrowing found nothing against; None where none was found."""
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


def plain(space: Space) -> Environment:
    """One situation of a space: of each value the plainest, and nothing of what may be missing."""
    return _environment(Box({}, {}, {}, {}, space.utc, space.phases, 0), {}, {}, space)


def halves(box: Box) -> list[Box]:
    """The box with the first half of the widest value that a sum ties to others, and with the other half."""
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
    """The value that is easiest to read: the roundest, and of these the one nearest to a bound."""
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


def _fixed(box: Box, space: Space, tied: list[Cell]) -> Box | None:
    """The box with single values in the cells that sums tie together."""
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


def _place(box: Box, who: Who, space: Space) -> Point | None:
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
    box: Box, cells: Mapping[Cell, int | None], places: Mapping[Who, Point | None], space: Space
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
    """Any one of a value's, missing rather than something."""
    low, high, gap, elements = value
    if gap != PRESENT:
        return MISSING
    return point(plainest((low, high, gap, elements)))
