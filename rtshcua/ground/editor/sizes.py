"""How large a zone is: its extent and its area, for a person."""

from fractions import Fraction

from rtshcua.ground.checker.data import DataFiles
from rtshcua.ground.checker.report import Report
from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.moved import parts
from rtshcua.ground.geometry.polygons import doubled_area
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.geometry.shapes import Disc, Shape, bounds
from rtshcua.ground.lower.ground_plan import GroundPlans
from rtshcua.model.ir.expression import Coordinates, Reference
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.places import ZoneDecl

_PI = Fraction(355, 113)  # to 3e-7; what is shown has three digits
_MM2 = 1_000_000  # in a square metre


def size_of(view: View, zone: ZoneDecl) -> str | None:
    """`120 m × 80 m, 9,400 m²`; None where the zone has no outline that could be measured."""
    if _is_circular(view, zone):
        return None
    home = next((vehicle.home for vehicle in view.symbols.vehicles.values()), None) or _somewhere(zone)
    projection = projection_at(*(home.latitude, home.longitude) if home is not None else (0, 0))
    data = DataFiles(view.program.data, view.program.data_names)
    plans = GroundPlans(projection, view.symbols.zones, data, Report(view.program.sources))
    try:
        shape = plans.of(zone)
    except (KeyError, ValueError, AssertionError):  # a part of it is not declared, or makes no outline
        return None
    return None if shape is None else _told(shape)


def _told(shape: Shape) -> str:
    west, south, east, north = bounds(shape)
    return f"{_metres(east - west)} × {_metres(north - south)}, {_area(shape):,} m²"


def _metres(length: int) -> str:
    return f"{(length + 500) // 1000:,} m"


def _area(shape: Shape) -> int:
    if isinstance(shape, Disc):
        return int(_PI * shape.radius * shape.radius / _MM2)
    doubled = sum(doubled_area(ring) for ring in shape.rings)
    return abs(doubled) // (2 * _MM2)


def _somewhere(node: Node) -> Coordinates | None:
    """Any place that is written in a zone."""
    waiting: list[object] = [node]
    while waiting:
        each = waiting.pop()
        if isinstance(each, Coordinates):
            return each
        if isinstance(each, Node):
            waiting += parts(each)
        elif type(each) is tuple:
            waiting += each
    return None


def _is_circular(view: View, zone: ZoneDecl) -> bool:
    """Whether a zone is made of itself, or of what nothing declares."""
    waiting: list[tuple[object, frozenset[str]]] = [(zone.shape, frozenset({zone.name.text}))]
    while waiting:
        each, above = waiting.pop()
        if isinstance(each, Reference):
            other = view.symbols.zones.get(each.name)
            if other is None or each.name in above:
                return True
            waiting.append((other.shape, above | {each.name}))
        elif isinstance(each, Node):
            waiting += [(value, above) for value in parts(each)]
        elif type(each) is tuple:
            waiting += [(value, above) for value in each]
    return False
