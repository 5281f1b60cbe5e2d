"""Numbers, places, times, texts and names."""

import re
from fractions import Fraction

from rtshcua.diagnostics.codes import (
    BAD_COORDINATES,
    BAD_PERIOD,
    DATUM_NOT_ALLOWED,
    NOT_EXACT,
    OUT_OF_BOUNDS,
    SYNTAX,
    UNKNOWN_UNIT,
    Code,
)
from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.build.base import Base
from rtshcua.ground.language.exact import CANONICAL, Exact, Trouble, exact
from rtshcua.ground.language.moment import moment
from rtshcua.ground.language.wording import SHOWN, short
from rtshcua.model.flat.limits import MAX_DURATION, MAX_SPEED, MAX_VALUE
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.ir.expression import Coordinates, Quantity, TimeOfDay
from rtshcua.model.ir.node import Name
from rtshcua.model.quantity import UNITS, Datum, Dimension, display

#: Other ways to write the units, and the ones meant.
MEANT = {
    "metre": "m", "metres": "m", "meter": "m", "meters": "m", "mps": "m/s", "kph": "km/h", "kmh": "km/h",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "minute": "min", "minutes": "min", "mins": "min",
    "hr": "h", "hour": "h", "hours": "h", "msec": "ms", "µs": "us", "usec": "us", "percent": "%", "pct": "%",
    "degree": "deg", "degrees": "deg", "°": "deg",
}  # fmt: skip

DAY = 24 * 60  # minutes
DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")

#: The largest number of each dimension that is kept on board, where it is not `MAX_VALUE`.
LARGEST = {
    Dimension.LENGTH: MAX_COORDINATE,
    Dimension.SPEED: MAX_SPEED,
    Dimension.DURATION: MAX_DURATION,
}

#: What words before a number ask for; the help for an unknown unit shows the units of that first.
ASKING = {
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

#: The points of the compass, which stand after a latitude or a longitude, and their opposites.
POINTS = {"N": "S", "S": "N", "E": "W", "W": "E"}

_EXPONENT = re.compile(r"[eE][0-9]*")

LOOK_BACK = 120  # characters before a number in which such a word is looked for


def whole_day(span: Span) -> tuple[TimeOfDay, TimeOfDay]:
    """The first and the last us of a day."""
    last = DAY * UNITS["min"].numerator - 1
    return TimeOfDay(span=span, value=0), TimeOfDay(span=span, value=last)


_NUMBER = r"-?[0-9]{1,3}(?:\.[0-9]{1,12})?"
#: two numbers without a unit, as a place is written elsewhere; and what stands around a value of its own
_TWO_NUMBERS = re.compile(rf"(?P<latitude>{_NUMBER})\s*,\s*(?P<longitude>{_NUMBER})(?=\s*[,)])")
_NUMBER_BEFORE = re.compile(rf"[(=]\s*(?P<pair>{_NUMBER}\s*,\s*)$")
_BEFORE_VALUE = re.compile(r"[(=]\s*$")


class Literals(Base):
    """Values that are written out."""

    def name(self, span: Span, text: str) -> Name:
        """A name where it stands."""
        return Name(span=span, text=text)

    def names(self, span: Span, *names: Name) -> tuple[Name, ...]:
        """Names with commas between them."""
        return names

    def text(self, span: Span, raw: str) -> str:
        r"""A text in quotes; `\"` and `\\` stand for the quote and the backslash."""
        inner = raw[1:-1]
        return inner.replace('\\"', '"').replace("\\\\", "\\") if "\\" in inner else inner

    def integer(self, span: Span, number: str) -> int:
        """A plain whole number."""
        found = exact(number, None)
        self._check(found, number, span)
        return found.value

    def count(self, span: Span, number: str) -> Quantity:
        """A plain whole number, with its place."""
        return Quantity(span=span, value=self.integer(span, number), dimension=Dimension.COUNT)

    def quantity(self, span: Span, minus: str | None, number: str, unit: str | None, datum: str | None) -> Quantity:
        """A number with its unit, in the canonical unit; a length above something is an altitude."""
        value, dimension, trouble = found = exact(number, unit, minus is not None)
        if trouble is not None:
            self._check(found, self._source.slice(span), span, unit, datum, plain=None if unit else number)
        if datum is None:
            return Quantity(span=span, value=value, dimension=dimension)
        if dimension is not Dimension.LENGTH and trouble is not Trouble.UNKNOWN_UNIT:
            self.report(
                DATUM_NOT_ALLOWED,
                f"only a length can be above {datum}, this is a {dimension.value}",
                span,
                f"write a length, as in `20 m above {datum}`",
            )
        return Quantity(span=span, value=value, dimension=Dimension.ALTITUDE, datum=Datum(datum))

    def coordinates(self, span: Span, latitude: str, north: str, longitude: str, east: str) -> Coordinates:
        """A place on the ground; south and west are negative."""
        values = (
            self._degrees(span, latitude, "latitude", north == "S"),
            self._degrees(span, longitude, "longitude", east == "W"),
        )
        beyond = [abs(each) > most * UNITS["deg"].numerator for each, most in zip(values, (90, 180), strict=True)]
        if any(beyond):
            written, what, most = (latitude, "latitude", 90) if beyond[0] else (longitude, "longitude", 180)
            swapped = abs(values[1]) <= 90 * UNITS["deg"].numerator and not beyond[1]
            self.report(
                BAD_COORDINATES,
                f"`{short(written)}` is not a {what}: a {what} goes up to {most} degrees",
                span,
                "are latitude and longitude the wrong way round? the latitude, `N` or `S`, stands first" * swapped
                or "a place is its latitude and longitude in degrees, as in `47.3977 N, 8.5456 E`",
            )
        return Coordinates(span=span, latitude=values[0], longitude=values[1])

    def time_of_day(self, span: Span, text: str) -> TimeOfDay:
        """A local time, in us since midnight."""
        hours, minutes = text.split(":")
        value = int(hours) * 60 + int(minutes)
        if value >= DAY or int(minutes) >= 60:
            self.report(OUT_OF_BOUNDS, f"`{text}` is not a time of day", span, "times go from `00:00` to `23:59`")
        return TimeOfDay(span=span, value=value * UNITS["min"].numerator)

    def day(self, span: Span, first: Name, last: Name | None) -> tuple[int, ...]:
        """`monday`, `monday .. friday`, `friday .. monday`, from 0 on."""
        start = self._day(first)
        return (start,) if last is None else tuple((start + n) % 7 for n in range((self._day(last) - start) % 7 + 1))

    def days(self, span: Span, *given: tuple[int, ...]) -> tuple[int, ...]:
        """`monday .. wednesday, saturday`."""
        return tuple(sorted({day for days in given for day in days}))

    def _day(self, name: Name) -> int:
        if name.text in DAYS:
            return DAYS.index(name.text)
        near = nearest(name.text, DAYS)
        help = f"did you mean `{near}`?" if near else f"they are {', '.join(f'`{day}`' for day in DAYS)}"
        self.report(SYNTAX, f"`{short(name.text)}` is no day of the week", name.span, help)
        return 0

    def moment(self, span: Span, raw: str) -> int:
        """A moment, `"2026-05-01T08:00Z"`, in us since the epoch."""
        return self._moment(span, raw, BAD_PERIOD)

    def utc(self, span: Span, raw: str) -> int:
        """The moment of a decision, in us since the epoch."""
        return self._moment(span, raw, SYNTAX)

    def _moment(self, span: Span, raw: str, code: Code) -> int:
        try:
            return moment(raw[1:-1])
        except ValueError as error:
            help = "write it as in `2026-05-01T08:00Z` or `2026-05-01T10:00:00+02:00`"
            self.report(code, f"`{short(raw[1:-1])}` is not a moment: {error}", span, help)
            return 0

    def _degrees(self, span: Span, number: str, what: str, negative: bool) -> int:
        found = exact(number, "deg", negative)
        if found.trouble is Trouble.OUT_OF_BOUNDS:
            return 360 * UNITS["deg"].numerator
        if found.trouble is Trouble.NOT_EXACT:
            self.report(
                NOT_EXACT,
                f"the {what} `{short(number)}` has more than 7 decimals",
                span,
                "places are kept in 1e-7 degree, which is about 1 cm",
            )
        return found.value

    def _check(
        self,
        found: Exact,
        written: str,
        span: Span,
        unit: str | None = None,
        datum: str | None = None,
        plain: str | None = None,
    ) -> None:
        """Reports what is wrong with a number, if anything is; `plain` are the digits of a value without a unit."""
        if found.trouble is Trouble.UNKNOWN_UNIT and unit is not None:
            meant = MEANT.get(unit.casefold()) or (nearest(unit, UNITS) if len(unit) <= SHOWN else None)
            fix = Fix(span, written.replace(unit, meant, 1), f"write `{meant}`") if meant else None
            if unit in POINTS or _EXPONENT.fullmatch(unit):
                self._no_unit(unit, written, span)
                return
            asked = self._asked(span)
            names = sorted(UNITS, key=lambda name: UNITS[name].dimension is not asked)
            help = f"did you mean `{meant}`?" if meant else "units are " + ", ".join(f"`{name}`" for name in names)
            self.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit", span, help, fixes=(fix,) if fix else ())
        elif found.trouble is Trouble.NOT_EXACT:
            whole = CANONICAL[found.dimension]
            kept = f"a {found.dimension.value} is kept in whole {whole}" if whole else "it is a plain number"
            near = _written(found, unit) + (f" above {datum}" if datum else "")
            if plain is not None and datum is None and self._place(written, span):
                return
            if plain is not None and datum is None and len(plain) <= SHOWN:
                self.report(NOT_EXACT, f"`{short(written)}` is not a whole number", span, f"{kept}; {_exactly(plain)}")
                return
            self.report(
                NOT_EXACT,
                f"`{short(written)}` is not a whole number" + (f" of {whole}" if whole else ""),
                span,
                f"{kept}; the nearest is `{near}`",
                fixes=(Fix(span, near, f"write `{near}`"),),
            )
        elif found.trouble is Trouble.OUT_OF_BOUNDS:
            limit = LARGEST.get(found.dimension, MAX_VALUE)
            whole_units = 0 if unit is None else limit * UNITS[unit].denominator // UNITS[unit].numerator
            most = f"{whole_units} {unit}" if whole_units else display(limit, found.dimension)
            self.report(OUT_OF_BOUNDS, f"`{short(written)}` is too large", span, f"at most `{most}` fits")

    def _place(self, written: str, span: Span) -> bool:
        """Reports `47.4, 8.5` where a place is meant, once for both numbers; whether this is one of two such."""
        text, last = self._source.text, self.diagnostics[-1] if self.diagnostics else None
        told = last.span if last is not None and last.code is NOT_EXACT else None
        if told is not None and told.start <= span.start and span.end <= told.end:
            return True
        before = _NUMBER_BEFORE.search(text[max(0, span.start - LOOK_BACK) : span.start])
        start = span.start
        if before is not None:
            start -= len(before["pair"])
        pair = _TWO_NUMBERS.match(text, start)
        if (
            pair is None
            or pair.end() < span.end
            or _BEFORE_VALUE.search(text[max(0, start - LOOK_BACK) : start]) is None
        ):
            return False
        latitude, longitude = pair["latitude"], pair["longitude"]
        if max(abs(Fraction(latitude)) * 2, abs(Fraction(longitude))) > 180:
            return False
        north, east = "S" if latitude[0] == "-" else "N", "W" if longitude[0] == "-" else "E"
        place = f"{latitude.lstrip('-')} {north}, {longitude.lstrip('-')} {east}"
        both = Span(span.file, start, pair.end("longitude"))
        help, fix = f"for a place, write `{place}`", Fix(both, place, f"write `{place}`")
        self.report(NOT_EXACT, f"`{short(written)}` is not a whole number", both, help, fixes=(fix,))
        return True

    def _no_unit(self, unit: str, written: str, span: Span) -> None:
        """`-47.4 N, 8.5 E` where a value stands, and `2e3`."""
        if unit in POINTS:
            plain = written.removeprefix("-").strip()
            opposite = plain[: -len(unit)] + POINTS[unit]
            help = "a place is its latitude and longitude, as in `47.3977 N, 8.5456 E`"
            if written.startswith("-"):
                help = f"a place has no sign: write `{opposite}`, or `{plain}`"
            last = self.diagnostics[-1].span if self.diagnostics else None
            if unit in "EW" and last is not None and self._source.text[last.end : span.start].strip() == ",":
                return  # the longitude of a latitude that was reported
        else:
            help = "numbers have no exponents: write all digits, which `_` may group, as in `20_000 m`"
        self.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit", span, help)

    def _asked(self, span: Span) -> Dimension | None:
        """The dimension that the last telling word before a number asks for, as far as words tell."""
        before = re.findall(r"[a-z]+", self._source.text[max(0, span.start - LOOK_BACK) : span.start])
        return next((ASKING[word] for word in reversed(before) if word in ASKING), None)


def _exactly(digits: str) -> str:
    """A plain number with decimals, as what it is exactly."""
    value = Fraction(digits.replace("_", ""))
    ratio = f", or `{display(int(value * 10_000), Dimension.RATIO)}`" if (value * 10_000).denominator == 1 else ""
    return f"in a product, write `({value})`{ratio}"


def _written(found: Exact, unit: str | None) -> str:
    """A canonical value in the unit that the author used, if it is whole there."""
    if unit is not None and found.value * UNITS[unit].denominator % UNITS[unit].numerator == 0:
        return f"{found.value * UNITS[unit].denominator // UNITS[unit].numerator} {unit}"
    return display(found.value, found.dimension)
