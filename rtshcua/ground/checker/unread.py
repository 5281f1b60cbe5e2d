"""E0115: what a GeoJSON feature says of heights, times and radii, in members and numbers that no zone takes over.

A zone's heights and times are those of its declaration (`floor`, `ceiling`, `active`). A file that has others of its
own (ED-318, ED-269, the FAA's and other feeds) means a smaller zone than its outline, and the whole is unsafe where the
policy keeps the vehicle inside of it. So they are an error. `docs/codes/E0115.md` has the rule as a table.
"""

import re
from collections.abc import Iterator
from decimal import Decimal
from enum import Enum
from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.refused import Refused

MOST_TOLD = 4


class What(Enum):
    """What a member's name says that it holds."""

    HEIGHT = "height"
    TIME = "time"
    RADIUS = "radius"
    LENGTH = "length"


#: parts of names, without what stands between their words; some of national feeds, French and German
_STEMS = {
    What.HEIGHT: ("altitude", "ceiling", "height", "elevation", "vertical", "lowerlimit", "upperlimit", "hauteur",
                  "plafond", "plancher", "h\u00f6he", "hoehe", "obergrenze", "untergrenze"),
    What.TIME: ("applicab", "schedule", "datetime", "starttime", "endtime", "startdate", "enddate", "validfrom",
                "validto", "validuntil", "timesofuse", "timeofuse", "expir", "notbefore", "notafter"),
    What.RADIUS: ("radius", "diameter"),
}  # fmt: skip
#: whole words of names
_WORDS = {
    What.HEIGHT: {"alt", "agl", "amsl", "asl", "msl", "floor", "floors", "upper", "lower", "layer", "elev", "z",
                  "limite", "zmin", "zmax", "minz", "maxz", "minalt", "maxalt", "top", "bottom",
                  "level", "levels", "fl"},
    What.TIME: {"time", "times", "start", "starts", "end", "ends", "begin", "begins", "from", "until", "till", "since",
                "valid", "validity", "effective", "eff", "permanent", "temporary", "active", "activation", "day",
                "days", "weekday", "weekdays", "hours", "hour", "wkhr", "period", "periods", "season", "curfew", "date",
                "dates"},
    What.RADIUS: {"extent", "buffer"},
}  # fmt: skip
#: a time in a name with such a word is of the record, not of the area
_OF_THE_RECORD = {
    "created", "creation", "edit", "edited", "editor", "modified", "modification", "update", "updated", "changed",
    "issued", "published", "imported", "exported", "downloaded", "retrieved", "surveyed", "captured", "generated",
}  # fmt: skip
#: names that are known to say something else
_HARMLESS = {"admin_level"}
_NAMES = {"id", "name", "title"}
#: what RFC 7946 itself calls so, and what is looked at apart
_STRUCTURE = {"type", "coordinates", "geometry", "geometries", "features", "crs", "bbox"}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
#: a text that is one length, with what it counts from, or a flight level
_LENGTH = re.compile(
    r"\s*(?:FL\s*[0-9]{1,3}|[+-]?[0-9]+(?:[.,][0-9]+)?\s*(?:m|ft|feet|met(?:er|re)s?|km|nm))"
    r"(?:\s*(?:agl|amsl|msl|asl|gnd|sfc))?\s*",
    re.IGNORECASE,
)


def refuse_unread(tree: dict[str, Any], pointer: str = "") -> None:
    """Raises `Refused` where an object of GeoJSON has such members, at whatever depth, in a feature's geometry
    too; the features of a collection are not looked at.
    """
    found = [*_members(tree.get("geometry"), f"{pointer}/geometry"), *_members(tree, pointer)]
    if not found:
        return
    told = [f"a {what.value} at `{place}`" for place, what in found[:MOST_TOLD]]
    more = f" and {len(found) - MOST_TOLD} more" if len(found) > MOST_TOLD else ""
    raise Refused(codes.GEOJSON_UNREAD, f"it says what a zone does not take over: {', '.join(told)}{more}", _HELP)


_HELP = (
    "write heights as `floor` and `ceiling`, times as `active`, a circle as `circle(...)` in the source, "
    "and take these members out of the file"
)


def refuse_height(numbers: list[str], pointer: str) -> None:
    """Raises `Refused` where a position (RFC 7946, 3.1.1) has a third number other than zero."""
    for text in numbers[2:]:
        if Decimal(text):
            raise Refused(
                codes.GEOJSON_UNREAD,
                f"the position at `{pointer}` has a height, {text}, which a zone does not take over",
                "write heights as `floor` and `ceiling` in the source, and take them out of the file's positions",
            )


def said_by(name: str) -> What | None:
    """What a member holds by its name; None for what is harmless."""
    if name in _HARMLESS:
        return None
    words = {word.casefold() for word in _WORD.findall(name)}
    run = name.casefold().replace("_", "").replace("-", "").replace(" ", "")
    for what in _WORDS:
        if what is What.TIME and words & _OF_THE_RECORD:
            continue
        if words & _WORDS[what] or any(stem in run for stem in _STEMS[what]):
            return what
    return None


def _is_height(number: Any) -> bool:
    text = getattr(number, "text", None)
    return not isinstance(text, str) or bool(Decimal(text))


def _members(tree: Any, pointer: str) -> Iterator[tuple[str, What]]:
    if isinstance(tree, list):
        for number, each in enumerate(tree):
            yield from _members(each, f"{pointer}/{number}")
    if not isinstance(tree, dict):
        return
    for name, value in tree.items():
        place = f"{pointer}/{name.replace('~', '~0').replace('/', '~1')}"  # RFC 6901, 3
        if name == "bbox" and isinstance(value, list) and len(value) > 4:
            if any(_is_height(value[each]) for each in range(2, len(value), 3)):
                yield place, What.HEIGHT
        elif name in _STRUCTURE or value is None or value in ("", [], {}):
            continue
        elif (what := said_by(name)) is not None:
            yield place, what
        elif isinstance(value, str) and name not in _NAMES and _LENGTH.fullmatch(value):
            yield place, What.LENGTH
        else:
            yield from _members(value, place)
