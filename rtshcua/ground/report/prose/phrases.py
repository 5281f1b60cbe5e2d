"""Describes values, names and lists."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, assert_never

from rtshcua.model.ir.expression import (
    Arithmetic,
    Coordinates,
    Function,
    Grow,
    Quantity,
    Range,
    Reference,
    TimeOfDay,
    Value,
)
from rtshcua.model.ir.places import OpticalLength
from rtshcua.model.quantity import Datum, Dimension, display, micrometres

#: a name, or a pair of brackets without brackets in it
_CLOSED: Final = re.compile(r"`[^`]*`|\([^()`]*\)")
_LISTS: Final = re.compile(r"[,;:]| and | or ")


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The names of signals, zones and arguments in a description; `places` are the arguments that are places."""

    signals: frozenset[str] = frozenset()
    zones: frozenset[str] = frozenset()
    arguments: frozenset[str] = frozenset()
    places: frozenset[str] = frozenset()

    def asked(self, arguments: Iterable[str], places: Iterable[str] = ()) -> "Vocabulary":
        """The vocabulary with these arguments, of which some are places."""
        return replace(self, arguments=frozenset(arguments), places=frozenset(places))


def name(text: str) -> str:
    """A name of the sources, in backticks."""
    return f"`{text}`"


def listed(words: Sequence[str], last: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    return f"{', '.join(words[:-1])} {last} {words[-1]}" if len(words) > 1 else "".join(words)


def named(names: Iterable[str], last: str = "and") -> str:
    """A list of names."""
    return listed([name(each) for each in names], last)


def bracketed(words: str) -> str:
    """Put words in brackets if they contain a list that could merge with the text around it."""
    left, before = _CLOSED.sub("", words), words
    while left != before:
        left, before = _CLOSED.sub("", left), left
    return f"({words})" if _LISTS.search(left) else words


def sentence(words: str) -> str:
    """Add a capital letter and a full stop; names keep their case."""
    return f"{words[:1].upper()}{words[1:]}."


_OPERATORS: Final = {"+": "plus", "-": "minus", "*": "times", "/": "divided by"}
_FUNCTIONS: Final = {"abs": "the magnitude of", "min": "the least of", "max": "the greatest of"}
#: the references that are keywords
LOCAL_TIME: Final = "local time"
PHASE: Final = "phase"
_MINUTE: Final = 60_000_000


def describe_value(value: Value, names: Vocabulary) -> str:
    """Describe a value within a sentence."""
    match value:
        case Quantity():
            return quantity(value)
        case Coordinates():
            return coordinates(value)
        case TimeOfDay():
            return time_of_day(value.value)
        case Reference():
            return reference(value.name, names)
        case Arithmetic():
            return f"{_part(value.left, names)} {_OPERATORS[value.operator]} {_part(value.right, names)}"
        case Function():
            return f"{_FUNCTIONS[value.name]} {listed([_part(each, names) for each in value.operands])}"
    assert_never(value)


def _part(value: Value, names: Vocabulary) -> str:
    """Describe an operand, in brackets if it is an operation itself."""
    words = describe_value(value, names)
    return f"({words})" if isinstance(value, Arithmetic | Function) else words


def quantity(one: Quantity) -> str:
    """A number with its unit, and the datum of an altitude."""
    words = display(one.value, one.dimension)
    if one.datum is None:
        return f"{words} above home" if one.dimension is Dimension.ALTITUDE else words
    return f"{words} above {'home' if one.datum is Datum.HOME else 'sea level'}"


def optical(one: OpticalLength) -> str:
    """A length of a camera."""
    return micrometres(one.value)


def coordinates(place: Coordinates) -> str:
    """A place, WGS 84."""
    return f"{degrees(place.latitude, 'N', 'S')}, {degrees(place.longitude, 'E', 'W')}"


def degrees(value: int, positive: str, negative: str) -> str:
    """Write 1e-7 degrees with all seven decimals, so that columns are aligned."""
    whole, part = divmod(abs(value), 10_000_000)
    return f"{whole}.{part:07d} {negative if value < 0 else positive}"


def time_of_day(us: int) -> str:
    """A local time of day."""
    hours, minutes = divmod(us // _MINUTE, 60)
    return f"{hours:02d}:{minutes:02d}"


_LAST_US = 24 * 60 * _MINUTE - 1
_DAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


def whole_day(start: int, end: int) -> bool:
    """Whether these are the first and the last microsecond of a day."""
    return (start, end) == (0, _LAST_US)


def on_days(days: Sequence[int]) -> str:
    """Days of the week: `on Monday to Friday and Sunday`."""
    runs: list[list[int]] = []
    for day in days:
        if runs and runs[-1][-1] == day - 1:
            runs[-1].append(day)
        else:
            runs.append([day])
    parts: list[str] = []
    for run in runs:
        names = [_DAYS[day] for day in run]
        parts += [f"{names[0]} to {names[-1]}"] if len(run) > 2 else names
    return f"on {listed(parts)}"


def time_of_week(us: int) -> str:
    """A local time of the week."""
    day, time = divmod(us, 24 * 60 * _MINUTE)
    return f"{_DAYS[day]} {time_of_day(time)}"


def reference(text: str, names: Vocabulary) -> str:
    """Describe a name in a condition or a value."""
    if text in names.arguments:
        return f"the {name(text)} asked for"
    if text == LOCAL_TIME:
        return "the local time"
    if text == PHASE and text not in names.signals:
        return "the phase of the mission"
    if text in names.signals:
        return name(text)
    zone, dot, member = text.rpartition(".")
    if dot and member == "entry":
        whose = f"the {name(zone)} asked for" if zone in names.arguments else name(zone)
        return f"the entry of {whose}"
    return name(text)


def region(one: Reference | Grow, names: Vocabulary) -> str:
    """Describe the zone of a condition, with its margin."""
    if isinstance(one, Reference):
        return reference(one.name, names)
    inner = reference(one.zone.name, names)
    margin = one.margin
    if isinstance(margin, Quantity):
        way = "narrowed" if margin.value < 0 else "widened"
        return f"{inner} {way} by {display(abs(margin.value), Dimension.LENGTH)}"
    return f"{inner} widened by {_part(margin, names)}"


def between(one: Range, names: Vocabulary) -> str:
    """Describe the two ends of a range, which belong to it."""
    return f"{describe_value(one.low, names)} and {describe_value(one.high, names)}"
