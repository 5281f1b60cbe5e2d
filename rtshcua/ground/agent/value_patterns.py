"""Regular expressions for the strings of a specification, in ECMA-262 syntax without look-around.

JSON Schema cannot compare numbers inside strings, so a range of quantities becomes a pattern of digits.
"""

from collections.abc import Iterable
from typing import Final

from rtshcua.model.quantity import DISPLAY, UNITS, Dimension

_FIRST, _REST = "A-Za-z_", "A-Za-z0-9_"
#: coordinates of a place, WGS 84
COORDINATES: Final = (
    r"[0-8]?[0-9](?:\.[0-9]{1,7})? [NS], (?:1[0-7][0-9]|[0-9]?[0-9])(?:\.[0-9]{1,7})? [EW]"  # up to 89.9 and 179.9
)

#: a duration and a share of the charge in the overrides of a step, whose ranges depend on the skill's contract
DURATION: Final = r"^[1-9][0-9]{0,4} (?:ms|s|min)$"
SHARE: Final = r"^[1-9][0-9]? %$"


def whole(*alternatives: str) -> str:
    """The pattern of a whole string that is one of the alternatives."""
    return f"^(?:{'|'.join(alternatives)})$" if len(alternatives) != 1 else f"^{alternatives[0]}$"


def name_but(reserved: Iterable[str]) -> str:
    """The pattern of names without dots, except the reserved words."""
    return f"^{_after(sorted(set(reserved)), first=True)}$"


def _after(words: list[str], *, first: bool) -> str:
    """The pattern of the rest of a name; `words` are the rests of the reserved words that still match."""
    own = _FIRST if first else _REST
    heads = sorted({word[0] for word in words if word})
    # after a letter that continues no reserved word, anything may follow
    choices = [f"{_class(own, heads)}[{_REST}]*"]
    for head in heads:
        rests = [word[1:] for word in words if word.startswith(head)]
        choices.append(head + _after(rests, first=False))
    if not first and "" not in words:
        choices.append("")
    return f"(?:{'|'.join(choices)})"


def _class(own: str, heads: list[str]) -> str:
    """The character class `own` without the lower-case letters `heads`, written without negation."""
    kept = "".join(letter for letter in "abcdefghijklmnopqrstuvwxyz" if letter not in heads)
    return f"[{own.replace('a-z', kept)}]"


def unit_of(dimension: Dimension) -> str:
    """The unit of a dimension's quantities in a schema; empty for a count."""
    if dimension is Dimension.COUNT:
        return ""
    return "s" if dimension is Dimension.DURATION else DISPLAY[dimension][0]


def written(value: int, dimension: Dimension) -> str:
    """Write a canonical value exactly, in the unit of `unit_of`: `30250` of LENGTH is `30.25 m`."""
    places = _places(dimension)
    whole_, rest = divmod(abs(value), 10**places)
    fraction = str(rest).zfill(places).rstrip("0") if rest else ""
    number = f"{'-' if value < 0 else ''}{whole_}{'.' + fraction if fraction else ''}"
    return f"{number} {unit_of(dimension)}".rstrip()


def quantities(low: int, high: int, dimension: Dimension) -> str:
    """The pattern of the quantities from `low` to `high`, both canonical values, in the unit of `unit_of`.

    They have no more decimals than the canonical unit can hold, no leading zeros, and no `-0`.
    """
    places, unit = _places(dimension), unit_of(dimension)
    parts = [f"-(?:{one})" for one in _decimals(max(1, -high), -low, places)]
    parts += _decimals(max(0, low), high, places)
    return whole(*(f"{part} {unit}" if unit else part for part in parts))


def _places(dimension: Dimension) -> int:
    """The number of decimals that a quantity may have: three for a metre, because it is 1000 mm."""
    if dimension is Dimension.COUNT:
        return 0
    return len(str(UNITS[unit_of(dimension)].numerator)) - 1


def _decimals(low: int, high: int, places: int) -> list[str]:
    """Patterns of the decimal numbers from `low` to `high`, given in units of 10 ** -places and not negative."""
    if low > high:
        return []
    scale = 10**places
    (first, least), (last, most) = divmod(low, scale), divmod(high, scale)
    if first == last and (least, most) != (0, scale - 1):
        return [f"{first}{_fraction(least, most, places)}"]
    found = []
    if least:
        found.append(f"{first}{_fraction(least, scale - 1, places)}")
        first += 1
    if most != scale - 1:
        found.append(f"{last}{_fraction(0, most, places)}")
        last -= 1
    if first <= last:
        found.append(f"(?:{digits(first, last)}){_fraction(0, scale - 1, places)}")
    return found


def _fraction(low: int, high: int, places: int) -> str:
    """The pattern of a point and decimals from `low` to `high`, counted with `places` digits; no decimals mean zero."""
    if places == 0:
        return ""
    some = rf"\.(?:{'|'.join(_padded(low, high, places))})"
    return f"(?:{some})?" if low == 0 else some


def _padded(low: int, high: int, places: int) -> list[str]:
    """Patterns of one digit or more that, padded with zeros to `places` digits, are from `low` to `high`."""
    if (low, high) == (0, 10**places - 1):
        return [f"[0-9]{{1,{places}}}"]
    rest = 10 ** (places - 1)
    heads: dict[str, list[int]] = {}  # the leading digits, by the pattern that follows them
    for digit in range(low // rest, high // rest + 1):
        least, most = max(low - digit * rest, 0), min(high - digit * rest, rest - 1)
        after = f"(?:{'|'.join(_padded(least, most, places - 1))})" if places > 1 else ""
        heads.setdefault(f"{after}?" if after and least == 0 else after, []).append(digit)
    return [f"{_one_of(some)}{after}" for after, some in heads.items()]


def _one_of(some: list[int]) -> str:
    """The pattern of a run of consecutive digits."""
    return str(some[0]) if len(some) == 1 else f"[{some[0]}-{some[-1]}]"


def digits(low: int, high: int) -> str:
    """The pattern of the whole numbers from `low` to `high`, without leading zeros; `low` is not negative."""
    found: list[str] = []
    while low <= high:
        power = 1  # the largest power of ten whose block begins at `low` and ends by `high`
        while low % (power * 10) == 0 and low + power * 10 - 1 <= high and low >= power * 10:
            power *= 10
        count = 1
        digit = low // power % 10
        while digit + count <= 9 and low + (count + 1) * power - 1 <= high:
            count += 1
        head = str(low // power // 10) if low >= power * 10 else ""
        last = str(digit) if count == 1 else f"[{digit}-{digit + count - 1}]"
        zeros = len(str(power)) - 1
        found.append(head + last + ("[0-9]" if zeros == 1 else f"[0-9]{{{zeros}}}" if zeros else ""))
        low += count * power
    return "|".join(found)
