"""Help for the fields of a declaration: quantities of one dimension, and names from a fixed list."""

from collections.abc import Collection

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import HEIGHT, number
from rtshcua.ground.checker.values import typed
from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.quantity import Dimension

#: the local projection has no use nearer to a pole (1e-7 degree)
MAX_LATITUDE = 850_000_000
MAX_LONGITUDE = 1_800_000_000


def quantity(context: Context, node: Quantity | None, dimension: Dimension, *, positive: bool = True) -> None:
    """Report a field that is no quantity of `dimension`, or not above zero where it must be."""
    if node is None or typed(context.scope(), node, number(dimension)) is None:
        return
    if node.value < 0 or (positive and node.value == 0):
        context.report.add(
            codes.NOT_POSITIVE,
            node.span,
            f"`{context.report.text(node.span)}` must be above zero"
            if positive
            else f"`{context.report.text(node.span)}` must not be negative",
        )


def height(context: Context, node: Quantity | None) -> None:
    """Report a field that is no altitude above home."""
    if node is not None:
        typed(context.scope(), node, HEIGHT)


def one_of(context: Context, code: Code, name: Name, known: Collection[str], what: str) -> bool:
    """Whether a name is among the known ones; reports it when it is not."""
    if name.text in known:
        return True
    context.report.add(
        code,
        name.span,
        f"there is no {what} `{name.text}`",
        help=suggestion(name.text, known) or "there are " + ", ".join(f"`{each}`" for each in known),
    )
    return False


def on_globe(context: Context, place: Coordinates) -> bool:
    """Whether coordinates can be projected; reports them when they cannot."""
    if abs(place.latitude) <= MAX_LATITUDE and abs(place.longitude) <= MAX_LONGITUDE:
        return True
    context.report.add(
        codes.BAD_COORDINATES,
        place.span,
        f"`{context.report.text(place.span)}` is not a place that can be flown to",
        help="latitudes go from 85 S to 85 N, longitudes from 180 W to 180 E",
    )
    return False
