"""Findings on numbers without an exact value in their canonical unit, with fixes."""

import re
from fractions import Fraction

from rtshcua.diagnostics.codes import NOT_EXACT, OUT_OF_BOUNDS, UNKNOWN_UNIT
from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.excerpt import SHOWN, short
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.build.reader import Reader
from rtshcua.ground.language.exact_values import CANONICAL, Exact, Trouble, exact
from rtshcua.model.flat.limits import MAX_DURATION, MAX_SPEED, MAX_VALUE
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.quantity import UNITS, Dimension, display

#: Other spellings of the units.
MEANT = {
    "metre": "m", "metres": "m", "meter": "m", "meters": "m", "mps": "m/s", "kph": "km/h", "kmh": "km/h",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "minute": "min", "minutes": "min", "mins": "min",
    "hr": "h", "hour": "h", "hours": "h", "msec": "ms", "\u03bcs": "us", "usec": "us", "percent": "%",
    "per cent": "%", "pct": "%", "degree": "deg", "degrees": "deg", "°": "deg", "º": "deg", "volt": "V", "volts": "V",
    "kilometer": "km", "kilometers": "km", "kilometre": "km", "kilometres": "km", "centimeter": "cm",
    "centimeters": "cm", "centimetre": "cm", "centimetres": "cm", "millimeter": "mm", "millimeters": "mm",
    "millimetre": "mm", "millimetres": "mm", "millisecond": "ms", "milliseconds": "ms", "microsecond": "us",
    "microseconds": "us", "kmph": "km/h", "mph": "mi/h", "fps": "ft/s", "fpm": "ft/min",
}  # fmt: skip

_FOOT = Fraction(3_048, 10)  # mm, exact since 1959
_NAUTICAL_MILE = Fraction(1_852_000)
_RADIAN = Fraction(180 * 10_000_000) / Fraction("3.14159265358979323846")
#: Common units that the language does not have: their dimension, and their size in its canonical unit. `nm` is none of
#: them: it is a nautical mile to some and a nanometre to others.
FOREIGN = {
    **dict.fromkeys(("ft", "foot", "feet", "'"), (Dimension.LENGTH, _FOOT)),
    **dict.fromkeys(("in", "inch", "inches", '"'), (Dimension.LENGTH, _FOOT / 12)),
    **dict.fromkeys(("yd", "yard", "yards"), (Dimension.LENGTH, _FOOT * 3)),
    **dict.fromkeys(("mi", "mile", "miles"), (Dimension.LENGTH, _FOOT * 5_280)),
    **dict.fromkeys(("NM", "nmi", "nautical mile", "nautical miles"), (Dimension.LENGTH, _NAUTICAL_MILE)),
    **dict.fromkeys(("kt", "kts", "kn", "knot", "knots"), (Dimension.SPEED, _NAUTICAL_MILE / 3_600)),
    **dict.fromkeys(("rad", "radian", "radians"), (Dimension.ANGLE, _RADIAN)),
}

#: The largest onboard value of a dimension, if it is not `MAX_VALUE`.
LARGEST = {
    Dimension.LENGTH: MAX_COORDINATE,
    Dimension.SPEED: MAX_SPEED,
    Dimension.DURATION: MAX_DURATION,
}

#: The dimension that a keyword before a number expects; the help for an unknown unit lists its units first.
DIMENSION_OF = {
    word: dimension
    for dimension, words in (
        (Dimension.LENGTH, "altitude height floor ceiling elevation error circle width grow length distance"),
        (Dimension.SPEED, "speed climb"),
        (Dimension.DURATION, "after deadline for last within grace lasts valid duration time"),
        (Dimension.RATIO, "energy battery reserve ratio"),
        (Dimension.ANGLE, "angle heading"),
        (Dimension.VOLTAGE, "voltage cell"),
    )
    for word in words.split()
}

#: The compass points after a latitude or a longitude, and their opposites.
POINTS = {"N": "S", "S": "N", "E": "W", "W": "E"}

_WRITTEN_NUMBER = re.compile(r"-? ?[0-9][0-9_]*(?:\.[0-9]+)?")
_EXPONENT = re.compile(r"[eE][0-9]*")

LOOK_BACK = 120  # characters before a number that are searched for such a keyword


_NUMBER = r"-?[0-9]{1,3}(?:\.[0-9]{1,12})?"
#: two numbers without a unit, as coordinates are written elsewhere, and the text before a value
_TWO_NUMBERS = re.compile(rf"(?P<latitude>{_NUMBER})\s*,\s*(?P<longitude>{_NUMBER})(?=\s*[,)])")
_NUMBER_BEFORE = re.compile(rf"[(=]\s*(?P<pair>{_NUMBER}\s*,\s*)$")
_BEFORE_VALUE = re.compile(r"[(=]\s*$")


def degrees(reader: Reader, span: Span, number: str, what: str, negative: bool) -> int:
    """Return a latitude or a longitude in 1e-7 degree."""
    found = exact(number, "deg", negative)
    if found.trouble is Trouble.OUT_OF_BOUNDS:
        return 360 * UNITS["deg"].numerator
    if found.trouble is Trouble.NOT_EXACT:
        reader.report(
            NOT_EXACT,
            f"the {what} `{short(number)}` has more than 7 decimals",
            span,
            "the resolution of coordinates is 1e-7 degree, about 1 cm",
        )
    return found.value


def report_trouble(
    reader: Reader,
    found: Exact,
    written: str,
    span: Span,
    unit: str | None = None,
    datum: str | None = None,
    plain: str | None = None,
) -> None:
    """Report the trouble of a number, if any; `plain` are the digits of a value without a unit."""
    match found.trouble:
        case Trouble.UNKNOWN_UNIT if unit is not None:
            _unknown_unit(reader, unit, written, span)
        case Trouble.NOT_EXACT:
            _not_exact(reader, found, written, span, unit, datum, plain)
        case Trouble.OUT_OF_BOUNDS:
            limit = LARGEST.get(found.dimension, MAX_VALUE)
            whole_units = 0 if unit is None else limit * UNITS[unit].denominator // UNITS[unit].numerator
            most = f"{whole_units} {unit}" if whole_units else display(limit, found.dimension)
            reader.report(OUT_OF_BOUNDS, f"`{short(written)}` is too large", span, f"the maximum is `{most}`")


def _unknown_unit(reader: Reader, unit: str, written: str, span: Span) -> None:
    if unit in POINTS or _EXPONENT.fullmatch(unit):
        _no_unit(reader, unit, written, span)
        return
    folded, foreign = unit.casefold(), size_of(unit)
    meant: str | None = MEANT.get(folded, folded)
    if meant not in UNITS:
        meant = nearest(unit, UNITS) if foreign is None and len(unit) <= SHOWN else None
    number = _WRITTEN_NUMBER.match(written)
    fixes: tuple[Fix, ...] = ()
    if foreign is not None and meant is None and number is not None:
        value = Fraction(number[0].replace("_", "").replace(" ", "")) * foreign[1]
        about = "" if value.denominator == 1 else "about "
        help = f"`{short(written)}` is {about}`{display(round(value), foreign[0])}`"
    elif meant:
        help = f"did you mean `{meant}`?"
        fixes = (Fix(span, written.replace(unit, meant, 1), f"write `{meant}`"),)
    else:
        expected = _expected_dimension(reader, span)
        names = sorted(UNITS, key=lambda name: UNITS[name].dimension is not expected)
        help = "units are " + ", ".join(f"`{name}`" for name in names)
    reader.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit", span, help, fixes=fixes)


def size_of(unit: str) -> tuple[Dimension, Fraction] | None:
    """The dimension of a unit in any common spelling, and its size in the canonical unit; None if it is unknown."""
    folded = unit.casefold()
    for name in (unit, MEANT.get(folded, folded)):
        if name in UNITS:
            return UNITS[name].dimension, Fraction(UNITS[name].numerator, UNITS[name].denominator)
        if name in FOREIGN:
            return FOREIGN[name]
    way, slash, time = MEANT.get(folded, folded).partition("/")
    of_way, of_time = (size_of(way), size_of(time)) if slash and "/" not in time else (None, None)
    if of_way is None or of_time is None or (of_way[0], of_time[0]) != (Dimension.LENGTH, Dimension.DURATION):
        return None
    return Dimension.SPEED, of_way[1] / of_time[1] * UNITS["s"].numerator


def _not_exact(
    reader: Reader, found: Exact, written: str, span: Span, unit: str | None, datum: str | None, plain: str | None
) -> None:
    whole = CANONICAL[found.dimension]
    message = f"`{short(written)}` is not a whole number"
    kept = f"a {found.dimension.value} must be whole {whole}" if whole else "a number without a unit must be whole"
    if plain is not None and datum is None:
        if _place(reader, written, span):
            return
        if len(plain) <= SHOWN:
            reader.report(NOT_EXACT, message, span, f"{kept}; {_exactly(plain)}")
            return
    near = _written(found, unit) + (f" above {datum}" if datum else "")
    message += f" of {whole}" if whole else ""
    fix = Fix(span, near, f"write `{near}`")
    reader.report(NOT_EXACT, message, span, f"{kept}; the nearest is `{near}`", fixes=(fix,))


def _place(reader: Reader, written: str, span: Span) -> bool:
    """Whether a number is part of `47.4, 8.5`, probably coordinates; reports both numbers once."""
    text, last = reader.source.text, reader.diagnostics[-1] if reader.diagnostics else None
    previous = last.span if last is not None and last.code is NOT_EXACT else None
    if previous is not None and previous.start <= span.start and span.end <= previous.end:
        return True
    before = _NUMBER_BEFORE.search(text[max(0, span.start - LOOK_BACK) : span.start])
    start = span.start
    if before is not None:
        start -= len(before["pair"])
    pair = _TWO_NUMBERS.match(text, start)
    if pair is None or pair.end() < span.end or _BEFORE_VALUE.search(text[max(0, start - LOOK_BACK) : start]) is None:
        return False
    latitude, longitude = pair["latitude"], pair["longitude"]
    if max(abs(Fraction(latitude)) * 2, abs(Fraction(longitude))) > 180:
        return False
    north, east = "S" if latitude[0] == "-" else "N", "W" if longitude[0] == "-" else "E"
    place = f"{latitude.lstrip('-')} {north}, {longitude.lstrip('-')} {east}"
    both = Span(span.file, start, pair.end("longitude"))
    help, fix = f"for a place, write `{place}`", Fix(both, place, f"write `{place}`")
    reader.report(NOT_EXACT, f"`{short(written)}` is not a whole number", both, help, fixes=(fix,))
    return True


def _no_unit(reader: Reader, unit: str, written: str, span: Span) -> None:
    """Report `-47.4 N, 8.5 E` as a value, and `2e3`."""
    if unit in POINTS:
        plain = written.removeprefix("-").strip()
        opposite = plain[: -len(unit)] + POINTS[unit]
        help = "write latitude and longitude as in `47.3977 N, 8.5456 E`"
        if written.startswith("-"):
            help = f"coordinates have no sign: write `{opposite}` or `{plain}`"
        last = reader.diagnostics[-1].span if reader.diagnostics else None
        if unit in "EW" and last is not None and reader.source.text[last.end : span.start].strip() == ",":
            return  # the latitude before it was reported
    else:
        help = "exponents are not supported: write all digits, which `_` may group, as in `20_000 m`"
    reader.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit", span, help)


def _expected_dimension(reader: Reader, span: Span) -> Dimension | None:
    """The dimension that the keywords before a number expect, if any."""
    before = re.findall(r"[a-z]+", reader.source.text[max(0, span.start - LOOK_BACK) : span.start])
    return next((DIMENSION_OF[word] for word in reversed(before) if word in DIMENSION_OF), None)


def _exactly(digits: str) -> str:
    """How to write a plain number with decimals exactly."""
    value = Fraction(digits.replace("_", ""))
    ratio = f", or `{display(int(value * 10_000), Dimension.RATIO)}`" if (value * 10_000).denominator == 1 else ""
    return f"in a product, write `({value})`{ratio}"


def _written(found: Exact, unit: str | None) -> str:
    """A canonical value in the author's unit if it is whole in that unit."""
    if unit is not None and found.value * UNITS[unit].denominator % UNITS[unit].numerator == 0:
        return f"{found.value * UNITS[unit].denominator // UNITS[unit].numerator} {unit}"
    return display(found.value, found.dimension)
