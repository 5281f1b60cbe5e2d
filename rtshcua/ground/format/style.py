"""The style as tables: line widths, items, and columns of the text after a first word.

A test compares `ITEMS` with the grammar: a new declaration or item needs an entry here.
"""

from typing import NamedTuple

WIDTH = 120
INDENT = 2


class Style(NamedTuple):
    """The layout of an item.

    `breaks` are the words before which a line may end, where the author ended it or where it would be too long.
    `aligned` says whether the text after the first word is aligned in the column of the block. `cuts` are the words
    that start a column in a run of similar items on one line each.
    """

    breaks: frozenset[str] = frozenset()
    aligned: bool = True
    cuts: tuple[str, ...] = ()


def _style(*breaks: str, aligned: bool = True, cuts: tuple[str, ...] = ()) -> Style:
    return Style(frozenset(breaks), aligned, cuts)


#: the width of the column of first words in a block; longer words exceed it. The width is fixed, so that a new or
#: removed line does not change others.
COLUMNS = (
    dict.fromkeys(("vehicle", "skill", "mission", "step", "nominal"), 8)
    | dict.fromkeys(("policy", "template"), 7)
    | dict.fromkeys(("test", "scenario"), 6)
)

_RULE = _style("by", "through", "when", "to")
_WITHOUT_COLUMN = _style(aligned=False)

#: the items without a style of their own, by the actions of their rules
_PLAIN_ITEMS = (
    # declarations
    "import_file", "enum", "vehicle", "skill", "sizes", "role", "template", "policy", "mission", "nominal", "test",
    "scenario",
    # of signals and zones
    "unknown", "every", "stale", "floor", "ceiling", "entry", "daily", "on_days", "dates",
    # of vehicles
    "identity", "home", "speed", "climb", "position_error", "endurance", "reserve", "cells", "clock", "time_zone",
    "elevation", "return_at", "brakes", "speeds", "accelerates", "wind", "not_fitted",
    "servos",
    # of skills and steps
    "climb_to", "fly_to", "cover_area", "cover_levels", "hold_for", "stay", "timing_class", "deadline", "duration",
    "grace", "require", "assume", "maintain", "fallback", "energy", "record",
    # of missions
    "intent", "proposed", "most_steps",
    # of nominals and tests
    "under", "aboard", "asker", "given", "instant", "in_phase", "answer", "released", "issued", "issued_ahead",
    "in_force", "identified",
    # of scenarios
    "flown_mission", "flavours", "seeds", "start", "ends", "flies", "never", "reaction", "distance", "lands",
)  # fmt: skip
#: all declarations and items
ITEMS = dict.fromkeys(_PLAIN_ITEMS, Style()) | {
    **dict.fromkeys(("permit", "forbid", "confirm", "degrade", "delegate"), _RULE),
    **dict.fromkeys(
        ("use", "contingency", "without_evidence", "without_link", "repeat", "step", "deed", "rows"), _WITHOUT_COLUMN
    ),
    "signal": _style("or", "where", cuts=(":", "=", "unknown", "every", "stale")),
    "zone": _style("feature", "hole", cuts=("=", "from")),
    "validity": _style("during"),
    "sized": _style("during"),
    "accepts": _style("where", "with"),
    "pictures": _style("every", "resolution", "overlap", "blur", "relief"),
    "camera": _style("focal", "pixels", "every", "exposure"),
    "emits": _style("with", "succeeds"),
    "airspace": _style("inside", "outside", aligned=False),
    "phase": _style(aligned=False, cuts=("{",)),
    "asked": _style("by", "through"),
    "expectation": _style("because", "<_AT_CLAUSE>"),
    "row": _style(cuts=("expect",)),
    "incident": _style("<FAULT>", aligned=False, cuts=("<FAULT>",)),
    "demand": _style("because", "<_AT_CLAUSE>"),
}

#: words without a blank before an opening bracket: of a call, a shape or a list
CALLS = frozenset(
    {"<NAME>", "<LINK_NAME>", "<FAULT>", "<FUNCTION>", "<COMBINE>", "<_GROW>", "<_CIRCLE>", "<_POLYGON>", "<_CORRIDOR>"}
)
#: other words before an opening bracket of a list
LISTS = CALLS | {"hole", "sizes"}
#: tokens that may end the left operand of a sum; after any other token a sign belongs to the number
OPERANDS = frozenset(
    {"<NAME>", "<NUMBER>", "<UNIT>", "<TIME_OF_DAY>", "<LOCAL_TIME>", "<LINK_NAME>", ")", "home", "sea", "E", "W"}
)
#: the comma after these belongs to coordinates, `47.39 N, 8.54 E`
PLACES = frozenset({"N", "S"})
#: words before a condition
LEADS = frozenset({"when", "require", "assume", "maintain"})
