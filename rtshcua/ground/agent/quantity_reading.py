"""Reads quantities that the language does not accept, to advise the agent: `25 meters`, `82 ft`, `+25 m`, `25,0 m`.

The result is used in advice only, never in a flight: how the language writes the same value, or why that is unclear.
"""

import re
import unicodedata
from fractions import Fraction
from typing import Final, NamedTuple

from rtshcua.ground.agent.value_patterns import unit_of
from rtshcua.ground.language.build.number_findings import MEANT
from rtshcua.model.quantity import UNITS, Dimension

_FOOT = Fraction(3048, 10)  # mm, exact since 1959
_KNOT = Fraction(1_852_000, 3_600)  # mm/s
#: common units that the language does not have: their dimension, and their size in its canonical unit
_FOREIGN: Final = {
    **dict.fromkeys(("ft", "foot", "feet", "'"), (Dimension.LENGTH, _FOOT)),
    **dict.fromkeys(("in", "inch", "inches", '"'), (Dimension.LENGTH, _FOOT / 12)),
    **dict.fromkeys(("yd", "yard", "yards"), (Dimension.LENGTH, _FOOT * 3)),
    **dict.fromkeys(("mi", "mile", "miles"), (Dimension.LENGTH, _FOOT * 5_280)),
    **dict.fromkeys(("nm", "nmi"), (Dimension.LENGTH, Fraction(1_852_000))),
    **dict.fromkeys(("kilometer", "kilometers", "kilometre", "kilometres"), (Dimension.LENGTH, Fraction(1_000_000))),
    **dict.fromkeys(("kt", "kts", "kn", "knot", "knots"), (Dimension.SPEED, _KNOT)),
    **dict.fromkeys(("mph", "mi/h", "miles/h"), (Dimension.SPEED, _FOOT * 5_280 / 3_600)),
    **dict.fromkeys(("ft/s", "fps", "feet/s"), (Dimension.SPEED, _FOOT)),
    **dict.fromkeys(("ft/min", "fpm", "feet/min"), (Dimension.SPEED, _FOOT / 60)),
    **dict.fromkeys(("volt", "volts"), (Dimension.VOLTAGE, Fraction(1_000))),
}  # fmt: skip
_HOME = ("above home", "above take-off", "above takeoff", "relative")
_GROUND = ("agl", "above ground", "above ground level", "above terrain")
_SEA = ("amsl", "asl", "msl", "above sea", "above sea level", "above mean sea level")
_NUMBER = re.compile(
    r"([+-]?) ?([0-9][0-9_]{0,15}(?:[.,][0-9]{1,12})?|\.[0-9]{1,12})(?:[eE]([+-]?[0-9]{1,2}))? ?([^0-9.,].{0,60})?"
)
_MINUS = "\u2010\u2011\u2012\u2013\u2212\ufe63"
#: full-width forms of ASCII, U+FF01 to U+FF5E, and how far they are from it
_WIDE, _WIDE_END, _FROM_ASCII = 0xFF01, 0xFF5E, 0xFEE0


class ReadQuantity(NamedTuple):
    """A value in the canonical unit of its dimension, None if unclear. `why` says what the language does not accept; it
    is empty if the text is accepted.
    """

    value: Fraction | None
    why: str


def read_quantity(text: str, dimension: Dimension) -> ReadQuantity:
    """Read a text as a quantity of a dimension."""
    unit = unit_of(dimension)
    plain = " ".join(_ascii(text).split())
    found = _NUMBER.fullmatch(plain)
    if found is None:
        return ReadQuantity(None, f"expected a number with a unit, such as `{f'20 {unit}'.rstrip()}`")
    sign, number, exponent, rest = found.groups()
    if re.fullmatch(r"[0-9_]+,[0-9]{3}", number):
        return ReadQuantity(None, f"`{number}` is ambiguous: use a decimal point, and `_` between groups of digits")
    value = _value(sign, number, exponent)
    written, datum = _unit_and_datum(rest or "")
    if datum in _GROUND or datum in _SEA:
        above = "ground" if datum in _GROUND else "sea"
        return ReadQuantity(None, f"this is a height above {above}; expected a height above home")
    if not written and not unit:
        return ReadQuantity(value, "")
    if not written:
        why = f"`{number}` has no unit; this is the value in {_unit_in_words(dimension)}"
        return ReadQuantity(value * UNITS[unit].numerator, why)
    known = _unit(written)
    if known is None:
        return ReadQuantity(None, f"unknown unit `{written}`")
    if known[0] is not (Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension):
        return ReadQuantity(None, f"`{written}` is a unit of {known[0].value}; expected {dimension.value}")
    value *= known[1]
    if written not in UNITS:
        return ReadQuantity(value, f"the language has no unit `{written}`; {plain} is {decimal(value, dimension)}")
    accepted = plain == text.strip() and not any((sign == "+", exponent, "," in number, datum))
    return ReadQuantity(value, "" if accepted else "this is how the language writes the same value")


def _value(sign: str, number: str, exponent: str | None) -> Fraction:
    value = Fraction(number.replace(",", ".").replace("_", "")) * Fraction(10) ** int(exponent or 0)
    return -value if sign == "-" else value


def _ascii(text: str) -> str:
    """The text with the spaces, digits, minus signs and full-width letters of other scripts replaced by ASCII."""
    return "".join(map(_plain, text))


def _plain(character: str) -> str:
    if character.isdecimal():
        return str(unicodedata.decimal(character))
    if unicodedata.category(character) == "Zs":
        return " "
    if character in _MINUS:
        return "-"
    if _WIDE <= ord(character) <= _WIDE_END:
        return chr(ord(character) - _FROM_ASCII)
    return character


def _unit_and_datum(rest: str) -> tuple[str, str]:
    """Return the unit, as the tables write it, and the datum of a height; both may be empty."""
    folded = rest.casefold()
    datum = next((each for each in (*_GROUND, *_SEA, *_HOME) if folded == each or folded.endswith(f" {each}")), "")
    unit = rest[: len(rest) - len(datum)].strip()
    return re.sub(r" ?(?:/| per ) ?", "/", unit), datum


def _unit(written: str) -> tuple[Dimension, Fraction] | None:
    """The dimension and size of a unit in any common spelling; None if the unit is unknown."""
    folded = written.casefold()
    parts = "/".join(MEANT.get(part, part) for part in folded.split("/"))
    for name in (written, MEANT.get(folded, ""), parts):
        if name in UNITS:
            return UNITS[name].dimension, Fraction(UNITS[name].numerator, UNITS[name].denominator)
        if name.casefold() in _FOREIGN:
            return _FOREIGN[name.casefold()]
    return None


def _unit_in_words(dimension: Dimension) -> str:
    """The name of the unit of a dimension."""
    unit = unit_of(dimension)
    words = {"m": "metres", "m/s": "metres a second", "s": "seconds", "%": "per cent", "deg": "degrees", "V": "volts"}
    return words.get(unit, f"`{unit}`")


def decimal(value: Fraction, dimension: Dimension) -> str:
    """Write a value of the canonical unit in the unit of `unit_of`, with at most six decimals."""
    unit = unit_of(dimension)
    whole = round(value * 1_000_000 * (UNITS[unit].denominator if unit else 1) / (UNITS[unit].numerator if unit else 1))
    digits = f"{abs(whole) // 1_000_000}.{abs(whole) % 1_000_000:06}".rstrip("0").rstrip(".")
    return f"{'-' if whole < 0 else ''}{digits} {unit}".rstrip()
