"""What each field of a flight's report holds, which says whether it may stay in a redacted one.

The table names every field of every type that a report has: a field without a kind makes the import fail, so that
nothing new is shown before somebody decided what it is.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum, auto
from typing import Any, Final

from rtshcua.ground.drawing.drawn_site import (
    FlightMargins,
    PlaceView,
    PlannedStep,
    PlannedWay,
    Site,
    SitePoint,
    ZoneOutline,
    ZoneView,
)
from rtshcua.ground.flight.flight_content import (
    AutopilotLogView,
    DecisionView,
    FlightReport,
    GapView,
    ImageView,
    ListedRecord,
    ReadSignal,
    SignalCurve,
    SignalLimit,
    SummaryLine,
    TimelineEvent,
    TrackView,
)
from rtshcua.ground.flight.flown import SignalSeries, TrackPoint
from rtshcua.model.flat.zone import Projection


class FieldKind(Enum):
    """What a field holds. Of a tuple, it is the kind of each member."""

    PART = auto()  # values with fields of their own
    MACHINE = auto()  # a word of a closed list of ours, a number of records or steps, a digest of the whole log
    TIME = auto()  # a moment or a duration
    HEIGHT = auto()  # above home, or up and down
    VALUE = auto()  # of a signal; a redacted report has only signals that may stay
    TEXT = auto()  # a sentence of ours, with names in backticks
    NAME = auto()  # of a mission, a vehicle, a policy, a zone, a log
    WORD = auto()  # of the policy's language: a signal, an enumeration, the label of a value
    CALL = auto()  # a skill, perhaps with its arguments
    SOURCE = auto()  # a file, and where in it
    OUTSIDE = auto()  # text of others, as it came: a clause, a note
    PLACE = auto()  # a place, a part of one, a distance or a speed over ground, a height above sea or ground
    NO_PLACE = auto()  # the same, and None where there is none
    LOG = auto()  # the embedded log, which is redacted by records


_ = FieldKind

#: the kind of every field
KINDS: Final[Mapping[type, Mapping[str, FieldKind]]] = {
    FlightReport: {
        "title": _.TEXT, "made_by": _.MACHINE, "made_at": _.TIME, "mission": _.NAME, "vehicle": _.NAME, "begun": _.TIME,
        "begun_utc_us": _.TIME, "lasted_us": _.TIME, "log_ends_us": _.TIME,
        "ending": _.MACHINE, "steps_done": _.MACHINE, "steps": _.MACHINE,
        "highest": _.HEIGHT, "distance": _.NO_PLACE, "verdict": _.MACHINE, "pinned": _.TEXT, "origin": _.NAME, "root":
        _.MACHINE, "summary": _.PART, "projection": _.NO_PLACE, "site": _.PART, "way": _.PART, "track": _.PART, "bound":
        _.OUTSIDE, "timeline": _.PART, "decisions": _.PART, "images": _.PART, "signals": _.PART, "gaps": _.PART,
        "proven": _.TEXT, "unproven": _.TEXT, "records": _.PART, "totals": _.MACHINE, "log": _.LOG,
        "redacted": _.MACHINE, "simulated": _.MACHINE,
    },
    SummaryLine: {"question": _.MACHINE, "answer": _.TEXT},
    ReadSignal: {"name": _.WORD, "value": _.VALUE, "age_us": _.TIME},
    DecisionView: {
        "seq": _.MACHINE, "t_us": _.TIME, "until_us": _.TIME, "repeats": _.MACHINE, "subject": _.TEXT,
        "outcome": _.MACHINE, "reason": _.MACHINE, "meaning": _.MACHINE, "clause": _.OUTSIDE, "place": _.SOURCE,
        "flies": _.CALL, "reads": _.PART, "would_pass": _.OUTSIDE, "chain": _.OUTSIDE,
        "approvals": _.TEXT, "where": _.NO_PLACE,
    },
    TimelineEvent: {
        "lane": _.MACHINE, "t_us": _.TIME, "until_us": _.TIME, "kind": _.MACHINE, "told": _.TEXT, "seq": _.MACHINE,
    },
    ImageView: {
        "seq": _.MACHINE, "t_us": _.TIME, "camera": _.MACHINE, "number": _.MACHINE, "asked": _.MACHINE,
        "above_home": _.HEIGHT, "where": _.NO_PLACE, "heading": _.NO_PLACE, "pitch": _.HEIGHT, "of_vehicle": _.MACHINE,
        "accuracy": _.NO_PLACE,
    },
    SignalLimit: {"value": _.VALUE, "low": _.MACHINE, "told": _.OUTSIDE},
    SignalCurve: {"series": _.PART, "limits": _.PART},
    SignalSeries: {
        "name": _.WORD, "dimension": _.WORD, "datum": _.MACHINE, "labels": _.WORD, "stale_us": _.TIME,
        "points": _.VALUE,
    },
    GapView: {"what": _.MACHINE, "told": _.TEXT},
    ListedRecord: {"seq": _.MACHINE, "t_us": _.TIME, "told": _.TEXT},
    TrackView: {"points": _.PART, "places": _.PLACE},
    TrackPoint: {
        "t_us": _.TIME, "latitude": _.PLACE, "longitude": _.PLACE, "above_sea": _.PLACE, "above_home": _.HEIGHT,
        "above_ground": _.NO_PLACE, "north": _.PLACE, "east": _.PLACE, "down": _.HEIGHT, "heading": _.NO_PLACE,
    },
    AutopilotLogView: {"what": _.OUTSIDE, "agreement": _.OUTSIDE, "apart": _.OUTSIDE},
    Projection: {"latitude": _.PLACE, "longitude": _.PLACE, "east": _.PLACE, "north": _.PLACE},
    Site: {
        "policy": _.NAME, "zones": _.PLACE, "home": _.MACHINE, "home_within": _.PLACE, "return_altitude": _.HEIGHT,
        "elevation": _.NO_PLACE, "margins": _.PART,
    },
    FlightMargins: {"position_error": _.PLACE, "speed": _.PLACE, "braking": _.PLACE, "reaction_us": _.TIME},
    ZoneView: {
        "name": _.NAME, "note": _.OUTSIDE, "use": _.MACHINE, "shape": _.TEXT, "band": _.TEXT, "times": _.MACHINE,
        "ground": _.PART, "floor": _.HEIGHT, "ceiling": _.HEIGHT, "places": _.PLACE, "place": _.SOURCE,
        "changed": _.MACHINE, "derived": _.MACHINE, "timed": _.MACHINE,
    },
    ZoneOutline: {"rings": _.PLACE, "centre": _.NO_PLACE, "radius_squared": _.PLACE},
    PlaceView: {"what": _.OUTSIDE, "latitude": _.PLACE, "longitude": _.PLACE, "x": _.PLACE, "y": _.PLACE},
    PlannedWay: {"name": _.NAME, "steps": _.PLACE, "begin": _.PART},
    SitePoint: {"x": _.PLACE, "y": _.PLACE, "height": _.HEIGHT},
    PlannedStep: {
        "number": _.MACHINE, "path": _.PLACE, "motion": _.MACHINE, "altitude": _.HEIGHT, "speed": _.PLACE,
        "heights": _.HEIGHT,
    },
}  # fmt: skip


def fields_of(of: type) -> tuple[str, ...]:
    """The fields of a type of a report, in order."""
    if is_dataclass(of):
        return tuple(each.name for each in fields(of))
    found: Any = getattr(of, "_fields", None) or getattr(of, "__struct_fields__", ())
    return tuple(found)


for _type, _kinds in KINDS.items():
    if set(fields_of(_type)) != set(_kinds):
        raise TypeError(f"fields of {_type.__name__} without a kind: {set(fields_of(_type)) ^ set(_kinds)}")
