"""E0510: what a zone is made of, down to the zones that it names."""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.lookup import find_zone
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import Combination, Shape, ZoneDecl


def parts(shape: Shape) -> Iterator[Shape]:
    """A shape, and all shapes that it is made of."""
    yield shape
    if isinstance(shape, Combination):
        for each in shape.shapes:
            yield from parts(each)


def named(zone: ZoneDecl) -> Iterator[Reference]:
    """The zones that a zone is made of, by name."""
    return (each for each in parts(zone.shape) if isinstance(each, Reference))


def operands(context: Context, zone: ZoneDecl) -> Iterator[Shape]:
    """The shapes that a zone is made of, but for other zones: of these, reports names that stand for none."""
    for each in parts(zone.shape):
        if isinstance(each, Reference):
            find_zone(context, Name(span=each.span, text=each.name))
        elif not isinstance(each, Combination):
            yield each


def circles(context: Context) -> None:
    """Report each zone that is made of itself, once for each way in which it is."""
    zones = context.symbols.zones
    finished: set[str] = set()
    for start in zones:
        way: list[tuple[str, Iterator[Reference]]] = [(start, named(zones[start]))] if start not in finished else []
        while way:
            name, waiting = way[-1]
            reference = next(waiting, None)
            if reference is None:
                finished.add(name)
                way.pop()
            elif reference.name in (each for each, _ in way):
                _circle(context, reference, [each for each, _ in way])
            elif reference.name in zones and reference.name not in finished:
                way.append((reference.name, named(zones[reference.name])))


def _circle(context: Context, closing: Reference, way: list[str]) -> None:
    around = way[way.index(closing.name) :]
    context.report.add(
        codes.ZONE_CYCLE,
        closing.span,
        f"`{closing.name}` is made of itself"
        + (": " + ", which is made of ".join(f"`{each}`" for each in (*around, closing.name)) if around[1:] else ""),
        help="a zone is made of shapes, and of zones that are made of shapes",
        labels=[(context.symbols.zones[each].name.span, "declared here") for each in around],
    )
