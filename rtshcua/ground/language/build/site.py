"""Actions for enumerations, signals, zones and vehicles."""

from typing import Any

from rtshcua.diagnostics.codes import BAD_PERIOD, NOT_EXACT, NOT_WRITTEN, SYNTAX, UNKNOWN_UNIT
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.language.build.literals import DAYS, LAST_US
from rtshcua.ground.language.build.reader import Action, Part, Reader, node, part, several
from rtshcua.ground.language.exact_values import exact_in
from rtshcua.model.ir.expression import Coordinates, Quantity, TimeOfDay
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import (
    Acceleration,
    Braking,
    CameraDecl,
    Circle,
    Combination,
    Corridor,
    Daily,
    Dates,
    GeoJson,
    NamedSpeed,
    OpticalLength,
    Polygon,
    Shape,
    VehicleDecl,
    ZoneDecl,
)
from rtshcua.model.ir.signals import EnumDecl, Enumerator, Selected, SignalDecl, SourceDecl
from rtshcua.model.quantity import UNITS, Dimension, UnitOfMeasure

#: the keys of the two kinds of `active` parts
DAILY, DATES = "active (times of day)", "active (dates)"

FULL = 100 * UNITS["%"].numerator

#: The most battery cells in series.
MOST_CELLS = 48

#: The units of sensors, focal lengths and pixels, in um, and the largest value.
OPTICAL = {
    name: UnitOfMeasure(Dimension.LENGTH, um)
    for name, um in (("um", 1), ("mm", 1_000), ("cm", 10_000), ("m", 1_000_000))
}
MOST_OPTICAL = 1_000_000

#: the required parts of a vehicle
REQUIRED = ("identity", "home", "speed", "climb", "position error", "energy", "reserve")

FORMS: dict[str, Action] = {
    "enumerators": several,
    "sentinels": several,
    "selector": several,
    "unknown": part("unknown at"),
    "every": part("every"),
    "stale": part("stale after"),
    "circle": node(Circle, "center", "radius"),
    "ring": several,
    "geojson": node(GeoJson, "path", "feature"),
    "floor": part("floor"),
    "ceiling": part("ceiling"),
    "entry": part("entry"),
    "home": part("home", several),
    "speed": part("speed"),
    "climb": part("climb"),
    "position_error": part("position error"),
    "reserve": part("reserve"),
    "time_zone": part("clock", node(Name, "text")),
    "elevation": part("elevation", several),
    "return_at": part("return"),
    "brakes": part("brakes", node(Braking, "speed", "time", "reaction")),
    "speeds": part("speeds", several),
    "named_speed": node(NamedSpeed, "name", "speed", "below"),
    "accelerates": part("accelerates", node(Acceleration, "speed", "time")),
    "wind": part("wind"),
    "not_fitted": part("without"),
    "servos": part("servos", several),
}


def enumerator(reader: Reader, span: Span, name: Name, value: int) -> Enumerator:
    """`fix_3d = 3`."""
    reader.undotted(name, "value")
    return Enumerator(span=span, name=name, value=value)


def enum(reader: Reader, span: Span, name: Name, dialect: Name | None, members: tuple[Enumerator, ...] | None) -> None:
    """`enum gps_fix = GPS_FIX_TYPE { ... }`."""
    reader.undotted(name, "enumeration")
    reader.declare(EnumDecl(span=span, name=name, dialect=dialect, members=members or ()), name)


def sentinel(reader: Reader, span: Span, *parts: str) -> Name:
    """A raw value or an enumerator that means "unknown"."""
    return Name(span=span, text="".join(parts))


def selected(reader: Reader, span: Span, field: Name, value: Name) -> Selected:
    """`orientation = 0`."""
    reader.undotted(field, "field")
    return Selected(span=span, field=field, value=value)


def source(reader: Reader, span: Span, *parts: Any) -> SourceDecl:
    """`GPS_RAW_INT.fix_type`, or two fields of one message, then the selected fields of `where`."""
    paths: tuple[Name, ...] = tuple(part for part in parts if isinstance(part, Name))
    where = parts[-1] if isinstance(parts[-1], tuple) else ()
    messages, fields = zip(*[_field(reader, path) for path in paths], strict=True)
    for other in messages[1:]:
        if other.text != messages[0].text:
            reader.report(
                SYNTAX,
                f"a source reads one message, not `{short(messages[0].text)}` and `{short(other.text)}`",
                span,
                "write `or` between sources of different messages",
            )
    if len(fields) > 2:
        reader.report(SYNTAX, f"a source has one or two fields, not {len(fields)}", span, "write one field or a pair")
    return SourceDecl(span=span, message=messages[0], fields=fields[:2], where=where)


def signal(reader: Reader, span: Span, name: Name, type: Name, *rest: SourceDecl | Part) -> None:
    """`signal battery : ratio = BATTERY_STATUS.battery_remaining unknown at -1 stale after 5 s`."""
    found = reader.parts("signal", name, [item for item in rest if isinstance(item, Part)], ("stale after",))
    if not reader.sound:
        reader.abandon(name)
        return
    reader.declare(
        SignalDecl(
            span=span,
            name=name,
            type=type,
            sources=tuple(item for item in rest if isinstance(item, SourceDecl)),
            unknown_at=found.get("unknown at", ()),
            every=found.get("every"),
            stale_after=found["stale after"],
        ),
        name,
    )


def _field(reader: Reader, path: Name) -> tuple[Name, Name]:
    """The message and the field of `MESSAGE.field`, each with its span."""
    message, dot, field = path.text.partition(".")
    if not dot or "." in field:
        reader.report(
            SYNTAX,
            f"`{short(path.text)}` does not name a message and its field",
            path.span,
            "write the message, a dot and the field, as in `GPS_RAW_INT.fix_type`",
        )
    file, start, end = path.span
    middle = start + len(message)
    first = Name(span=Span(file, start, middle), text=message)
    return first, Name(span=Span(file, min(middle + 1, end), end), text=field)


def hole(reader: Reader, span: Span, corners: tuple[Coordinates, ...]) -> tuple[Coordinates, ...]:
    """`hole (47.3 N, 8.5 E, ...)`."""
    return corners


def polygon(reader: Reader, span: Span, corners: tuple[Coordinates, ...], *holes: tuple[Coordinates, ...]) -> Polygon:
    """`polygon(47.3 N, 8.5 E, ...) hole (...)`."""
    return Polygon(span=span, corners=corners, holes=holes)


def corridor(reader: Reader, span: Span, *parts: Any) -> Corridor:
    """`corridor(47.3 N, 8.5 E, 47.4 N, 8.5 E, width 40 m)`."""
    *points, width = parts
    return Corridor(span=span, points=tuple(points), width=width)


def combination(reader: Reader, span: Span, operator: Any, *shapes: Shape) -> Node:
    """`union(shape, ...)`, `difference(shape, ...)`."""
    made = Combination(span=span, operator=operator, shapes=shapes)
    return reader.nested(made, *shapes, help="declare the inner shapes as zones and name them here")


def daily(reader: Reader, span: Span, start: TimeOfDay, end: TimeOfDay, days: tuple[int, ...] | None) -> Part:
    """`active 08:00 .. 18:00`, `active 08:00 .. 18:00 on monday .. friday`."""
    if start.value == end.value:
        help = "remove `active` if the zone applies all day"
        reader.report(BAD_PERIOD, "the active period of the zone is empty", span, help)
    return Part(DAILY, span, Daily(span=span, start=start, end=end, days=days or ()))


def on_days(reader: Reader, span: Span, days: tuple[int, ...]) -> Part:
    """`active on saturday, sunday`."""
    start, end = TimeOfDay(span=span, value=0), TimeOfDay(span=span, value=LAST_US)
    if len(days) == len(DAYS):
        help = "remove `active` if the zone always applies"
        reader.report(BAD_PERIOD, "`active` names all days of the week", span, help)
    return Part(DAILY, span, Daily(span=span, start=start, end=end, days=days))


def dates(reader: Reader, span: Span, start: int, end: int) -> Part:
    """`active "2026-05-01T08:00Z" .. "2026-05-02T18:00Z"`."""
    if reader.sound and start >= end:
        reader.report(BAD_PERIOD, "the active period ends before it begins", span, "write the earlier moment first")
    return Part(DATES, span, Dates(span=span, start_us=start, end_us=end))


def zone(reader: Reader, span: Span, name: Name, shape: Shape, *given: Part) -> None:
    """`zone bridge_a = polygon(...) floor 0 m ceiling 60 m entry ...`."""
    reader.undotted(name, "zone")
    found = reader.parts("zone", name, given)
    reader.declare(
        ZoneDecl(
            span=span,
            name=name,
            shape=shape,
            floor=found.get("floor"),
            ceiling=found.get("ceiling"),
            entry=found.get("entry"),
            daily=found.get(DAILY),
            dates=found.get(DATES),
        ),
        name,
    )


def identity(reader: Reader, span: Span, text: str) -> Part:
    """`identity "quad-07"`."""
    if not text.strip():
        help = 'write the identity of the vehicle, as in `identity "quad-07"`: a bundle runs only on that vehicle'
        reader.report(NOT_WRITTEN, "the identity is empty", span, help)
    return Part("identity", span, text)


def endurance(reader: Reader, span: Span, charge: Quantity, hover: Quantity, flight: Quantity | None) -> Part:
    """`energy 100 % = 18 min hover`, `energy 100 % = 18 min hover, 14 min flight`."""
    if charge.dimension is not Dimension.RATIO or charge.value != FULL:
        written = short(reader.source.slice(charge.span))
        reader.report(
            SYNTAX,
            f"the hover time must be that of a full battery, not of `{written}`",
            charge.span,
            "write it as in `energy 100 % = 18 min hover`",
        )
    return Part("energy", span, (hover, flight))


def cells(reader: Reader, span: Span, count: Quantity) -> Part:
    """`cells 4`."""
    if not 1 <= count.value <= MOST_CELLS:
        found = f"the number of cells must be from 1 to {MOST_CELLS}, not `{reader.source.slice(count.span)}`"
        reader.report(SYNTAX, found, count.span, "write it as in `cells 4`")
    return Part("cells", span, count)


def clock(reader: Reader, span: Span, sign: str, offset: TimeOfDay) -> Part:
    """`clock utc +02:00`."""
    value = -offset.value if sign == "-" else offset.value
    return Part("clock", span, Quantity(span=span, value=value, dimension=Dimension.DURATION))


def optical(reader: Reader, span: Span, number: str, unit: str) -> OpticalLength:
    """`13.2 mm`, in whole um."""
    scale = OPTICAL.get(unit)
    if scale is None:
        help = f"its units are {listed(OPTICAL)}, as in `13.2 mm`"
        reader.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit of a sensor, a focal length or a pixel", span, help)
        return OpticalLength(span=span, value=1)
    found = exact_in(number, scale)
    if found.trouble is not None or not 0 < found.value <= MOST_OPTICAL:
        said = short(reader.source.slice(span))
        help = "write a length from 1 um to 1 m, as in `13.2 mm` or `4.4 um`"
        reader.report(NOT_EXACT, f"`{said}` is not a whole number of um between 1 um and 1 m", span, help)
    return OpticalLength(span=span, value=found.value)


def camera(reader: Reader, span: Span, name: Name, *values: Any) -> Part:
    """`camera mapper sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 ...`."""
    reader.undotted(name, "camera")
    width, height, focal, columns, rows, interval, exposure, portrait = values
    made = CameraDecl(
        span=span, name=name, width=width, height=height, focal=focal, columns=columns, rows=rows, interval=interval,
        exposure=exposure, portrait=portrait is not None,
    )  # fmt: skip
    return Part("camera", span, made)


def vehicle(reader: Reader, span: Span, name: Name, *given: Part) -> None:
    """`vehicle quad { ... }`."""
    reader.undotted(name, "vehicle")
    found = reader.parts("vehicle", name, given, REQUIRED, listed=("camera",))
    if not reader.sound:
        reader.abandon(name)
        return
    home, within = found["home"]
    hover, flight = found["energy"]
    elevation, elevation_within = found.get("elevation", (None, None))
    clock = found.get("clock")
    reader.declare(
        VehicleDecl(
            span=span,
            name=name,
            identity=found["identity"],
            home=home,
            within=within,
            speed=found["speed"],
            climb=found["climb"],
            position_error=found["position error"],
            endurance=hover,
            reserve=found["reserve"],
            utc_offset=clock if isinstance(clock, Quantity) else None,
            time_zone=clock if isinstance(clock, Name) else None,
            elevation=elevation,
            elevation_within=elevation_within,
            return_altitude=found.get("return"),
            braking=found.get("brakes"),
            without=found.get("without", ()),
            speeds=found.get("speeds", ()),
            acceleration=found.get("accelerates"),
            wind=found.get("wind"),
            flight=flight,
            cells=found.get("cells"),
            cameras=tuple(found["camera"]),
            servos=found.get("servos", ()),
        ),
        name,
    )
