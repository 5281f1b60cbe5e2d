"""Numbers, places, times, texts and names."""

from rtshcua.diagnostics.codes import BAD_PERIOD, DATUM_NOT_ALLOWED, NOT_EXACT, OUT_OF_BOUNDS, UNKNOWN_UNIT
from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.build.base import Base
from rtshcua.ground.language.exact import CANONICAL, Exact, Trouble, exact
from rtshcua.ground.language.moment import moment
from rtshcua.ground.language.wording import SHOWN, short
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
            self._check(found, self._source.slice(span), span, unit, datum)
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
        return Coordinates(
            span=span,
            latitude=self._degrees(span, latitude, 90, "latitude", north == "S"),
            longitude=self._degrees(span, longitude, 180, "longitude", east == "W"),
        )

    def time_of_day(self, span: Span, text: str) -> TimeOfDay:
        """A local time, in us since midnight."""
        hours, minutes = text.split(":")
        value = int(hours) * 60 + int(minutes)
        if value >= DAY or int(minutes) >= 60:
            self.report(OUT_OF_BOUNDS, f"`{text}` is not a time of day", span, "times go from `00:00` to `23:59`")
        return TimeOfDay(span=span, value=value * UNITS["min"].numerator)

    def moment(self, span: Span, raw: str) -> int:
        """A moment, `"2026-05-01T08:00Z"`, in us since the epoch."""
        try:
            return moment(raw[1:-1])
        except ValueError as error:
            help = "write it as in `2026-05-01T08:00Z` or `2026-05-01T10:00:00+02:00`"
            self.report(BAD_PERIOD, f"`{short(raw[1:-1])}` is not a moment: {error}", span, help)
            return 0

    def _degrees(self, span: Span, number: str, most: int, what: str, negative: bool) -> int:
        found = exact(number, "deg", negative)
        if abs(found.value) > most * UNITS["deg"].numerator or found.trouble is Trouble.OUT_OF_BOUNDS:
            self.report(
                OUT_OF_BOUNDS, f"`{short(number)}` is not a {what}", span, f"a {what} goes up to {most} degrees"
            )
        elif found.trouble is Trouble.NOT_EXACT:
            self.report(
                NOT_EXACT,
                f"the {what} `{short(number)}` has more than 7 decimals",
                span,
                "places are kept in 1e-7 degree, which is about 1 cm",
            )
        return found.value

    def _check(self, found: Exact, written: str, span: Span, unit: str | None = None, datum: str | None = None) -> None:
        """Reports what is wrong with a number, if anything is."""
        if found.trouble is Trouble.UNKNOWN_UNIT and unit is not None:
            meant = MEANT.get(unit.casefold()) or (nearest(unit, UNITS) if len(unit) <= SHOWN else None)
            fix = Fix(span, written.replace(unit, meant, 1), f"write `{meant}`") if meant else None
            known = ", ".join(f"`{name}`" for name in UNITS)
            help = f"did you mean `{meant}`?" if meant else f"units are {known}"
            self.report(UNKNOWN_UNIT, f"`{short(unit)}` is not a unit", span, help, fixes=(fix,) if fix else ())
        elif found.trouble is Trouble.NOT_EXACT:
            whole = CANONICAL[found.dimension]
            kept = f"a {found.dimension.value} is kept in whole {whole}" if whole else "it is a plain number"
            near = _written(found, unit) + (f" above {datum}" if datum else "")
            self.report(
                NOT_EXACT,
                f"`{short(written)}` is not a whole number" + (f" of {whole}" if whole else ""),
                span,
                f"{kept}; the nearest is `{near}`",
                fixes=(Fix(span, near, f"write `{near}`"),),
            )
        elif found.trouble is Trouble.OUT_OF_BOUNDS:
            self.report(OUT_OF_BOUNDS, f"`{short(written)}` is too large", span, "a quantity fits in 64 bits")


def _written(found: Exact, unit: str | None) -> str:
    """A canonical value in the unit that the author used, if it is whole there."""
    if unit is not None and found.value * UNITS[unit].denominator % UNITS[unit].numerator == 0:
        return f"{found.value * UNITS[unit].denominator // UNITS[unit].numerator} {unit}"
    return display(found.value, found.dimension)
