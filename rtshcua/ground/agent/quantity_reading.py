"""Reads values that the language does not accept, to advise the agent: `25 meters`, `82 ft`, `+25 m`, `47.4N 8.5E`.

The result is used in advice only, never in a flight: how the language writes the same value, or why that is unclear.
"""

import re
import unicodedata
from fractions import Fraction
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.agent.value_patterns import COORDINATES, unit_of
from rtshcua.ground.language.build.number_findings import size_of
from rtshcua.model.quantity import UNITS, Dimension

_HOME = ("above home", "above home position", "above launch", "above take-off", "above takeoff", "relative")
_GROUND = ("agl", "above ground", "above ground level", "above terrain")
_SEA = ("amsl", "asl", "msl", "above sea", "above sea level", "above mean sea level")
_NUMBER = re.compile(
    r"([+-]?) ?([0-9][0-9_]{0,15}(?:[.,][0-9]{1,12})?|\.[0-9]{1,12})(?:[eE]([+-]?[0-9]{1,2}))? ?([^0-9.,].{0,60})?"
)
#: a comma before three digits: it may separate decimals, or thousands
_AMBIGUOUS = re.compile(r"[1-9][0-9]{0,2},[0-9]{3}")
_MINUS = "\u2010\u2011\u2012\u2013\u2212\ufe63"
#: characters that nobody sees and that change nothing: a soft hyphen, and spaces and joiners without width
_NO_WIDTH = "\u00ad\u200b\u200c\u200d\u2060\ufeff"
#: full-width forms of ASCII, U+FF01 to U+FF5E, and how far they are from it
_WIDE, _WIDE_END, _FROM_ASCII = 0xFF01, 0xFF5E, 0xFEE0
#: the longest text that is read, in characters
_LONGEST: Final = 200
_SAME: Final = "this is how the language writes the same value"
_UNIT_NAMES: Final = {
    "m": "metres", "m/s": "metres a second", "s": "seconds", "%": "per cent", "deg": "degrees", "V": "volts",
}  # fmt: skip

_DEGREES = (
    r"(?P<before{0}>[NSEW]?) ?(?P<sign{0}>[+-]?)(?P<whole{0}>[0-9]{{1,3}}(?:\.[0-9]{{1,15}})?)"
    r"(?: ?(?:[°º]|deg(?:rees)?))?(?: ?(?P<minutes{0}>[0-9]{{1,2}}(?:\.[0-9]{{1,12}})?) ?['\u2032\u2019])?"
    r"(?: ?(?P<seconds{0}>[0-9]{{1,2}}(?:\.[0-9]{{1,12}})?) ?(?:[\"\u2033\u201d]|''))? ?(?P<after{0}>[NSEW]?)"
)
#: two coordinates, in either order
_PAIR = re.compile(rf"\(?{_DEGREES.format('_1')}(?: ?[,;/] ?| ){_DEGREES.format('_2')}\)?", re.IGNORECASE)
_LATITUDE, _LONGITUDE = ("lat", "latitude"), ("lon", "lng", "long", "longitude")
PLACE_FORM: Final = "coordinates such as `47.39927 N, 8.54572 E`"
#: 1e-7 degree
_RESOLUTION: Final = 10_000_000


class ReadQuantity(NamedTuple):
    """A value in the canonical unit of its dimension, None if unclear. `why` says what the language does not accept; it
    is empty if the text is accepted.
    """

    value: Fraction | None
    why: str


class ReadPlace(NamedTuple):
    """A place as the language writes it, and what the language does not accept; None if unclear, and why, where the
    text has coordinates.
    """

    text: str | None
    why: str


def read_quantity(text: str, dimension: Dimension) -> ReadQuantity:
    """Read a text as a quantity of a dimension. A number without its unit is unclear."""
    unit = unit_of(dimension)
    plain = _unquoted(_ascii(text[: _LONGEST + 1]))
    found = _NUMBER.fullmatch(plain) if len(text) <= _LONGEST else None
    if found is None:
        return ReadQuantity(None, f"expected a number with a unit, such as `{f'20 {unit}'.rstrip()}`")
    sign, number, exponent, rest = found.groups()
    if re.search("[0-9]", rest or ""):
        return ReadQuantity(None, f"expected one value, such as `{f'20 {unit}'.rstrip()}`")
    if _AMBIGUOUS.fullmatch(number):
        return ReadQuantity(None, f"`{number}` is ambiguous: use a decimal point, and `_` between groups of digits")
    value = _value(sign, number, exponent)
    if not rest and not unit:
        return ReadQuantity(value, "")
    if not rest:
        meant = decimal(value * UNITS[unit].numerator, dimension)
        return ReadQuantity(None, f"`{plain}` has no unit; if it is in {_UNIT_NAMES.get(unit, unit)}, write `{meant}`")
    same = plain == text.strip() and sign != "+" and not exponent and "," not in number
    return _with_unit(value, rest, dimension, plain, same)


def _with_unit(value: Fraction, rest: str, dimension: Dimension, plain: str, same: bool) -> ReadQuantity:
    """A value with the text after it. `same`: the language accepts the text before the unit."""
    written, datum = _unit_and_datum(rest)
    known = size_of(written)
    if known is None:
        example = f"20 {unit_of(dimension)}".rstrip()
        return ReadQuantity(None, f"unknown unit `{visible(rest)}`; expected a value such as `{example}`")
    if known[0] is not (Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension):
        return ReadQuantity(None, f"`{written}` is a unit of {known[0].value}; expected {dimension.value}")
    value *= known[1]
    meant = decimal(value, dimension)
    if datum in _GROUND or datum in _SEA:
        above = "ground" if datum in _GROUND else "sea"
        return ReadQuantity(
            None, f"this is a height above {above}; a height of {meant} above home is written `{meant}`"
        )
    if written not in UNITS:
        about = "" if (value * 1_000_000 / UNITS[unit_of(dimension)].numerator).denominator == 1 else "about "
        return ReadQuantity(value, f"the language has no unit `{written}`; {plain} is {about}{meant}")
    return ReadQuantity(value, "" if same and rest == written else _SAME)


def quantity_text(value: Any) -> str | None:
    """The text of a quantity that is a string, a number, or an object of a `value` and its `unit`."""
    if isinstance(value, dict) and set(value) == {"value", "unit"} and isinstance(value["unit"], str):
        number = quantity_text(value["value"])
        return None if number is None else f"{number} {value['unit']}"
    return str(value) if isinstance(value, str | int | float) and not isinstance(value, bool) else None


def read_place(value: Any) -> ReadPlace:
    """Read a text, or an object with a latitude and a longitude, as coordinates. Two numbers alone are unclear: some
    write the longitude first.
    """
    text = _pair_of(value)
    found = _PAIR.fullmatch(_unquoted(_ascii(text))) if len(text) <= _LONGEST else None
    if found is None:
        return ReadPlace(None, "")
    first, second = (_coordinate(found, each) for each in ("_1", "_2"))
    points = first[1] + second[1]
    if points in ("EN", "ES", "WN", "WS"):
        first, second = second, first
    elif points not in ("", "NE", "NW", "SE", "SW"):
        return ReadPlace(None, "")
    place = f"{_degrees(*first, 'NS')}, {_degrees(*second, 'EW')}"
    signed = points and "-" in found["sign_1"] + found["sign_2"]
    if signed or re.fullmatch(COORDINATES, place) is None:
        return ReadPlace(None, "")
    if not points and not isinstance(value, dict):
        return ReadPlace(None, f"unclear which number is the latitude; if it is the first one, write `{place}`")
    exact = all((value * _RESOLUTION).denominator == 1 for value, _ in (first, second))
    return ReadPlace(place, _SAME if exact else f"{_SAME}, rounded")


def _pair_of(value: Any) -> str:
    """The text of a text, a list, or an object of a latitude and a longitude, in this order; else empty."""
    if isinstance(value, dict):
        named = {str(key).casefold(): each for key, each in value.items()}
        ordered = [[named[key] for key in keys if key in named] for keys in (_LATITUDE, _LONGITUDE)]
        value = [each for found in ordered for each in found] if [len(each) for each in ordered] == [1, 1] else ""
        return ", ".join(map(str, value)) if len(named) == 2 else ""
    if isinstance(value, list):
        return ", ".join(str(each) for each in value[:3])
    return value if isinstance(value, str) else ""


def _coordinate(found: "re.Match[str]", which: str) -> tuple[Fraction, str]:
    """One coordinate in degrees, negative by its sign alone, and its compass point; empty if it has none."""
    whole, minutes, seconds = (Fraction(found[f"{part}{which}"] or 0) for part in ("whole", "minutes", "seconds"))
    value = whole + minutes / 60 + seconds / 3_600
    point = (found[f"before{which}"] + found[f"after{which}"]).upper()
    return (-value if found[f"sign{which}"] == "-" else value), point


def _degrees(value: Fraction, point: str, points: str) -> str:
    """Write a coordinate with its compass point, one of `points` by its sign if it has none."""
    whole = round(abs(value) * _RESOLUTION)
    digits = f"{whole // _RESOLUTION}.{whole % _RESOLUTION:07}".rstrip("0").rstrip(".")
    return f"{digits} {point or points[value < 0]}"


def _value(sign: str, number: str, exponent: str | None) -> Fraction:
    value = Fraction(number.replace(",", ".").replace("_", "")) * Fraction(10) ** int(exponent or 0)
    return -value if sign == "-" else value


def _ascii(text: str) -> str:
    """The text with the spaces, digits, minus signs and full-width letters of other scripts replaced by ASCII, without
    characters that have no width, and with one space between words.
    """
    return " ".join("".join(map(_plain, text)).split())


def _plain(character: str) -> str:
    if character.isdecimal():
        return str(unicodedata.decimal(character))
    if character in _NO_WIDTH:
        return ""
    if unicodedata.category(character) == "Zs":
        return " "
    if character in _MINUS:
        return "-"
    if _WIDE <= ord(character) <= _WIDE_END:
        return chr(ord(character) - _FROM_ASCII)
    return character


def _unquoted(text: str) -> str:
    """The text without quotation marks around it."""
    return text[1:-1].strip() if len(text) > 2 and text[0] == text[-1] and text[0] in "\"'`" else text


def _unit_and_datum(rest: str) -> tuple[str, str]:
    """Return the unit, as the tables write it, and the datum of a height; both may be empty."""
    rest = rest.rstrip(".").replace("(", " ").replace(")", " ")
    rest = " ".join(rest.split())
    folded = rest.casefold()
    datum = next((each for each in (*_GROUND, *_SEA, *_HOME) if folded == each or folded.endswith(f" {each}")), "")
    unit = rest[: len(rest) - len(datum)].strip()
    return re.sub(r" ?/ ?| per (?!cent)", "/", unit), datum


def decimal(value: Fraction, dimension: Dimension) -> str:
    """Write a value of the canonical unit in the unit of `unit_of`, with at most six decimals."""
    unit = unit_of(dimension)
    whole = round(value * 1_000_000 * (UNITS[unit].denominator if unit else 1) / (UNITS[unit].numerator if unit else 1))
    digits = f"{abs(whole) // 1_000_000}.{abs(whole) % 1_000_000:06}".rstrip("0").rstrip(".")
    return f"{'-' if whole < 0 else ''}{digits} {unit}".rstrip()
