"""The style, as tables: how wide lines are, which items there are, and in which column what follows a first word is.

A test holds `ITEMS` against the grammar: a declaration or an item that it gains must be entered here.
"""

from typing import NamedTuple

WIDTH = 120
INDENT = 2


class Style(NamedTuple):
    """How an item is laid out.

    `breaks` are the words before which a line may end where the author ended it, or where it would be too long. What
    follows the first word is `aligned` with that of the item's neighbours, in the column of the block, or is not.
    `cuts` name what begins a column in a run of like items that take a line each.
    """

    breaks: frozenset[str] = frozenset()
    aligned: bool = True
    cuts: tuple[str, ...] = ()


def _style(*breaks: str, aligned: bool = True, cuts: tuple[str, ...] = ()) -> Style:
    return Style(frozenset(breaks), aligned, cuts)


#: in a block of these, how wide the column of first words is; longer ones stand out. A fixed width, so that a line that
#: comes or goes changes no other.
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
    "unknown", "stale", "floor", "ceiling", "entry", "daily", "on_days", "dates",
    # of vehicles
    "identity", "home", "speed", "climb", "position_error", "endurance", "reserve", "cells", "clock", "time_zone",
    "elevation", "return_at", "brakes", "speeds", "accelerates", "wind", "not_fitted",
    # of skills and steps
    "climb_to", "fly_to", "cover_area", "hold_for", "stay", "timing_class", "deadline", "duration", "grace",
    "require", "assume", "maintain", "fallback", "energy", "record",
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
    "signal": _style("or", "where", cuts=(":", "=", "unknown", "stale")),
    "zone": _style("feature", "hole", cuts=("=", "from")),
    "validity": _style("during"),
    "sized": _style("during"),
    "airspace": _style("inside", "outside", aligned=False),
    "phase": _style(aligned=False, cuts=("{",)),
    "asked": _style("by", "through"),
    "expectation": _style("because", "<_AT_CLAUSE>"),
    "row": _style(cuts=("expect",)),
    "incident": _style("<FAULT>", aligned=False, cuts=("<FAULT>",)),
    "demand": _style("because", "<_AT_CLAUSE>"),
}

#: what an opening bracket after it belongs to, and stands close to: the rest of a call, a shape or a list
CALLS = frozenset(
    {"<NAME>", "<LINK_NAME>", "<FAULT>", "<FUNCTION>", "<COMBINE>", "<_GROW>", "<_CIRCLE>", "<_POLYGON>", "<_CORRIDOR>"}
)
#: other words before an opening bracket of a list
LISTS = CALLS | {"hole", "sizes"}
#: what a number may follow as its sum's or product's left side; after anything else a sign is the number's own
OPERANDS = frozenset(
    {"<NAME>", "<NUMBER>", "<UNIT>", "<TIME_OF_DAY>", "<LOCAL_TIME>", "<LINK_NAME>", ")", "home", "sea", "E", "W"}
)
#: the comma after these belongs to a place on the ground, `47.39 N, 8.54 E`
PLACES = frozenset({"N", "S"})
#: words whose condition begins after them
LEADS = frozenset({"when", "require", "assume", "maintain"})
