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
COLUMNS = {
    "vehicle": 8,
    "skill": 8,
    "mission": 8,
    "step": 8,
    "nominal": 8,
    "policy": 7,
    "template": 7,
    "test": 6,
    "scenario": 6,
}

_RULE = _style("by", "through", "when", "to")
_PART = _style()
_WITHOUT_COLUMN = _style(aligned=False)

#: all declarations and items, by the actions of their rules
ITEMS = {
    # declarations
    "import_file": _PART,
    "enum": _PART,
    "signal": _style("or", "where", cuts=(":", "=", "unknown", "stale")),
    "zone": _style("feature", "hole", cuts=("=", "from")),
    "vehicle": _PART,
    "skill": _PART,
    "sizes": _PART,
    "role": _PART,
    "template": _PART,
    "policy": _PART,
    "mission": _PART,
    "nominal": _PART,
    "test": _PART,
    "scenario": _PART,
    # of signals and zones
    "unknown": _PART,
    "stale": _PART,
    "floor": _PART,
    "ceiling": _PART,
    "entry": _PART,
    "daily": _PART,
    "on_days": _PART,
    "dates": _PART,
    # of vehicles
    "identity": _PART,
    "home": _PART,
    "speed": _PART,
    "climb": _PART,
    "position_error": _PART,
    "endurance": _PART,
    "reserve": _PART,
    "cells": _PART,
    "clock": _PART,
    "time_zone": _PART,
    "elevation": _PART,
    "return_at": _PART,
    "brakes": _PART,
    "speeds": _PART,
    "accelerates": _PART,
    "wind": _PART,
    "not_fitted": _PART,
    # of skills and steps
    "climb_to": _PART,
    "fly_to": _PART,
    "cover_area": _PART,
    "hold_for": _PART,
    "stay": _PART,
    "timing_class": _PART,
    "deadline": _PART,
    "validity": _style("during"),
    "duration": _PART,
    "grace": _PART,
    "require": _PART,
    "assume": _PART,
    "maintain": _PART,
    "fallback": _PART,
    "energy": _PART,
    "record": _PART,
    "sized": _style("during"),
    # of policies and templates
    "permit": _RULE,
    "forbid": _RULE,
    "confirm": _RULE,
    "degrade": _RULE,
    "delegate": _RULE,
    "use": _WITHOUT_COLUMN,
    "airspace": _style("inside", "outside", aligned=False),
    "contingency": _WITHOUT_COLUMN,
    "without_evidence": _WITHOUT_COLUMN,
    "without_link": _WITHOUT_COLUMN,
    # of missions
    "intent": _PART,
    "proposed": _PART,
    "most_steps": _PART,
    "phase": _style(aligned=False, cuts=("{",)),
    "repeat": _WITHOUT_COLUMN,
    "step": _WITHOUT_COLUMN,
    # of nominals and tests
    "under": _PART,
    "aboard": _PART,
    "asker": _PART,
    "given": _PART,
    "instant": _PART,
    "in_phase": _PART,
    "answer": _PART,
    "released": _PART,
    "issued": _PART,
    "issued_ahead": _PART,
    "in_force": _PART,
    "identified": _PART,
    "deed": _WITHOUT_COLUMN,
    "asked": _style("by", "through"),
    "expectation": _style("because", "<_AT_CLAUSE>"),
    "rows": _WITHOUT_COLUMN,
    "row": _style(cuts=("expect",)),
    # of scenarios
    "flown_mission": _PART,
    "flavours": _PART,
    "seeds": _PART,
    "start": _PART,
    "incident": _style("<FAULT>", aligned=False, cuts=("<FAULT>",)),
    "demand": _style("because", "<_AT_CLAUSE>"),
    "ends": _PART,
    "flies": _PART,
    "never": _PART,
    "reaction": _PART,
    "distance": _PART,
    "lands": _PART,
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
