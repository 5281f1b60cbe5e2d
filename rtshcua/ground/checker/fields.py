"""Checks of fields of declarations: quantities of one dimension, and names from a fixed list."""

from collections.abc import Collection, Mapping

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import HEIGHT, Type, number
from rtshcua.ground.checker.values import typed
from rtshcua.model.flat.limits import MAX_DURATION, MAX_SPEED, MAX_VALUE
from rtshcua.model.flat.zone import HIGHEST, MAX_COORDINATE
from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.quantity import Datum, Dimension, display

#: the largest onboard value of each dimension
LARGEST: Mapping[Dimension, int] = {
    Dimension.LENGTH: MAX_COORDINATE,
    Dimension.ALTITUDE: HIGHEST - 1,
    Dimension.SPEED: MAX_SPEED,
    Dimension.DURATION: MAX_DURATION,
    Dimension.ANGLE: MAX_VALUE,
    Dimension.RATIO: MAX_VALUE,
    Dimension.VOLTAGE: MAX_VALUE,
    Dimension.COUNT: MAX_VALUE,
}

ABOVE_SEA = number(Dimension.ALTITUDE, Datum.SEA)
MAX_ELEVATION = 9_000_000  # mm: no ground is higher

#: the local projection is not valid nearer to a pole (1e-7 degree)
MAX_LATITUDE = 850_000_000
MAX_LONGITUDE = 1_800_000_000


def quantity(
    context: CheckContext,
    node: Quantity | None,
    dimension: Dimension,
    *,
    positive: bool = True,
    most: int | None = None,
) -> None:
    """Report a field of another dimension, below its minimum, or too large."""
    if node is None or not _is(context, node, number(dimension)):
        return
    size(context, node, dimension, node.value, most)
    if node.value < 0 or (positive and node.value == 0):
        context.report.add(
            codes.NOT_POSITIVE,
            node.span,
            f"`{context.report.text(node.span)}` must be above zero"
            if positive
            else f"`{context.report.text(node.span)}` must not be negative",
        )


def height(context: CheckContext, node: Quantity | None) -> None:
    """Report a field that is not an altitude, above home or above sea."""
    expected = HEIGHT if node is None or node.datum is not Datum.SEA else ABOVE_SEA
    if node is not None and _is(context, node, expected):
        size(context, node, Dimension.ALTITUDE, node.value)


def elevation(context: CheckContext, node: Quantity | None) -> None:
    """Report a field that is not an altitude above sea."""
    if node is not None and _is(context, node, ABOVE_SEA):
        size(context, node, Dimension.ALTITUDE, node.value, MAX_ELEVATION)


def _is(context: CheckContext, node: Quantity, expected: Type) -> bool:
    """Whether a number has a type; reports it if not."""
    return number(node.dimension, node.datum) is expected or typed(context.scope(), node, expected) is not None


def size(context: CheckContext, node: Node, dimension: Dimension, value: int, most: int | None = None) -> bool:
    """Whether a number of a dimension fits on board; reports it if not."""
    limit = LARGEST[dimension] if most is None else most
    if abs(value) <= limit:
        return True
    context.report.add(
        codes.NUMBER_SIZE,
        node.span,
        f"`{context.report.text(node.span)}` is too large",
        help=f"the maximum is {display(limit, dimension)}",
    )
    return False


def one_of(context: CheckContext, code: Code, name: Name, known: Collection[str], what: str) -> bool:
    """Whether a name is known; reports it if not."""
    if name.text in known:
        return True
    context.report.add(
        code,
        name.span,
        f"unknown {what} `{name.text}`",
        help=suggestion(name.text, known) or "accepted: " + ", ".join(f"`{each}`" for each in known),
        fix=correction(context.report, name.span, name.text, known),
    )
    return False


def on_globe(context: CheckContext, place: Coordinates) -> bool:
    """Whether coordinates can be projected; reports them if not."""
    if abs(place.latitude) <= MAX_LATITUDE and abs(place.longitude) <= MAX_LONGITUDE:
        return True
    context.report.add(
        codes.BAD_COORDINATES,
        place.span,
        f"`{context.report.text(place.span)}` is outside the supported coordinates",
        help="latitudes are from 85 S to 85 N, longitudes from 180 W to 180 E",
    )
    return False
