"""Actions for numbers, coordinates, times, strings and names."""

from rtshcua.diagnostics.codes import BAD_COORDINATES, BAD_PERIOD, DATUM_NOT_ALLOWED, OUT_OF_BOUNDS, SYNTAX, Code
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.build.number_findings import degrees, report_trouble
from rtshcua.ground.language.build.reader import Action, Reader, several
from rtshcua.ground.language.exact_values import Trouble, exact, utc_us
from rtshcua.model.ir.expression import Coordinates, Quantity, TimeOfDay
from rtshcua.model.ir.node import Name
from rtshcua.model.quantity import UNITS, Datum, Dimension

DAY = 24 * 60  # minutes
LAST_US = DAY * UNITS["min"].numerator - 1  # of a day
DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")

FORMS: dict[str, Action] = {"names": several}


def name(reader: Reader, span: Span, text: str) -> Name:
    """A name. It has no row in `FORMS`, because names are the most frequent nodes."""
    return Name(span=span, text=text)


def text(reader: Reader, span: Span, raw: str) -> str:
    r"""A string in quotes; `\"` and `\\` are a quote and a backslash."""
    inner = raw[1:-1]
    return inner.replace('\\"', '"').replace("\\\\", "\\") if "\\" in inner else inner


def integer(reader: Reader, span: Span, number: str) -> int:
    """A plain whole number."""
    found = exact(number, None)
    report_trouble(reader, found, number, span)
    return found.value


def count(reader: Reader, span: Span, number: str) -> Quantity:
    """A plain whole number, with its span."""
    return Quantity(span=span, value=integer(reader, span, number), dimension=Dimension.COUNT)


def quantity(
    reader: Reader, span: Span, minus: str | None, number: str, unit: str | None, datum: str | None
) -> Quantity:
    """A number with its unit, in the canonical unit; a length with a datum is an altitude."""
    value, dimension, trouble = found = exact(number, unit, minus is not None)
    if trouble is not None:
        report_trouble(reader, found, reader.source.slice(span), span, unit, datum, plain=None if unit else number)
    if datum is None:
        return Quantity(span=span, value=value, dimension=dimension)
    if dimension is not Dimension.LENGTH and trouble is not Trouble.UNKNOWN_UNIT:
        reader.report(
            DATUM_NOT_ALLOWED,
            f"only a length can be above {datum}, not a {dimension.value}",
            span,
            f"write a length, as in `20 m above {datum}`",
        )
    return Quantity(span=span, value=value, dimension=Dimension.ALTITUDE, datum=Datum(datum))


def coordinates(reader: Reader, span: Span, latitude: str, north: str, longitude: str, east: str) -> Coordinates:
    """Coordinates in 1e-7 degree; south and west are negative."""
    values = (
        degrees(reader, span, latitude, "latitude", north == "S"),
        degrees(reader, span, longitude, "longitude", east == "W"),
    )
    beyond = [abs(each) > most * UNITS["deg"].numerator for each, most in zip(values, (90, 180), strict=True)]
    if any(beyond):
        written, what, most = (latitude, "latitude", 90) if beyond[0] else (longitude, "longitude", 180)
        swapped = abs(values[1]) <= 90 * UNITS["deg"].numerator and not beyond[1]
        reader.report(
            BAD_COORDINATES,
            f"`{short(written)}` is not a {what}: the maximum is {most} degrees",
            span,
            "write the latitude (`N` or `S`) first: latitude and longitude seem to be swapped" * swapped
            or "write latitude and longitude in degrees, as in `47.3977 N, 8.5456 E`",
        )
    return Coordinates(span=span, latitude=values[0], longitude=values[1])


def time_of_day(reader: Reader, span: Span, text: str) -> TimeOfDay:
    """A local time, in us since midnight."""
    hours, minutes = text.split(":")
    value = int(hours) * 60 + int(minutes)
    if value >= DAY or int(minutes) >= 60:
        reader.report(OUT_OF_BOUNDS, f"`{text}` is not a time of day", span, "times are from `00:00` to `23:59`")
    return TimeOfDay(span=span, value=value * UNITS["min"].numerator)


def day(reader: Reader, span: Span, first: Name, last: Name | None) -> tuple[int, ...]:
    """`monday`, `monday .. friday`, `friday .. monday`; monday is 0."""
    start = _day(reader, first)
    return (start,) if last is None else tuple((start + n) % 7 for n in range((_day(reader, last) - start) % 7 + 1))


def days(reader: Reader, span: Span, *given: tuple[int, ...]) -> tuple[int, ...]:
    """`monday .. wednesday, saturday`."""
    return tuple(sorted({day for days in given for day in days}))


def _day(reader: Reader, name: Name) -> int:
    if name.text in DAYS:
        return DAYS.index(name.text)
    near = nearest(name.text, DAYS)
    help = f"did you mean `{near}`?" if near else f"the days are {', '.join(f'`{day}`' for day in DAYS)}"
    reader.report(SYNTAX, f"`{short(name.text)}` is not a day of the week", name.span, help)
    return 0


def moment(reader: Reader, span: Span, raw: str) -> int:
    """A moment, `"2026-05-01T08:00Z"`, in us since the epoch."""
    return _moment(reader, span, raw, BAD_PERIOD)


def utc(reader: Reader, span: Span, raw: str) -> int:
    """The moment of a decision, in us since the epoch."""
    return _moment(reader, span, raw, SYNTAX)


def _moment(reader: Reader, span: Span, raw: str, code: Code) -> int:
    try:
        return utc_us(raw[1:-1])
    except ValueError as error:
        help = "write it as in `2026-05-01T08:00Z` or `2026-05-01T10:00:00+02:00`"
        reader.report(code, f"`{short(raw[1:-1])}` is not a moment: {error}", span, help)
        return 0
