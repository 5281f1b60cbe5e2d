"""The content of a flight's report as one immutable value, which `rtshcua report --json` prints.

Texts are sentences with names in backticks. Times are in us since the log's first record; lengths in mm; places in the
policy's local plane, x east and y north of the declared home.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final, NamedTuple

from rtshcua.ground.drawing.drawn_site import PlannedWay, Site
from rtshcua.ground.flight.flown import SignalSeries, TrackPoint
from rtshcua.model.flat.zone import Projection

#: the lanes of the timeline, in order
LANES: Final = ("proposed", "compiled", "decided", "dispatched", "observed", "fallback", "approvals", "vehicle")


class SummaryLine(NamedTuple):
    """One of the six lines at the top: a question and its answer."""

    question: str
    answer: str


class ReadSignal(NamedTuple):
    """A value that a decision read, in words, and its age in us; None for an argument."""

    name: str
    value: str
    age_us: int | None


class DecisionView(NamedTuple):
    """A decision, or `repeats` equal ones in a row until `until_us`, in words. `seq` is the number of the first record;
    `clause` is what decided, as it was written, and `place` where. `would_pass` are the nearest values
    with which a step would have passed, `chain` the links of a fallback and whether each may fly. `where` is where the
    vehicle was.
    """

    seq: int
    t_us: int
    until_us: int
    repeats: int
    subject: str
    outcome: str
    reason: str
    meaning: str
    clause: str
    place: str
    flies: str
    reads: tuple[ReadSignal, ...]
    would_pass: tuple[str, ...]
    chain: tuple[str, ...]
    approvals: tuple[str, ...]
    where: tuple[int, int] | None


class TimelineEvent(NamedTuple):
    """An event of a lane: its end if it lasts, a class of the style, its words, and the record that it links to."""

    lane: str
    t_us: int
    until_us: int | None
    kind: str
    told: str
    seq: int | None = None


class SignalLimit(NamedTuple):
    """A limit of a signal in a condition: the value in canonical units, whether it is a lower limit, and the words."""

    value: int
    low: bool
    told: str


class SignalCurve(NamedTuple):
    """A signal over time, with the limits that conditions of the policy compare it with."""

    series: SignalSeries
    limits: tuple[SignalLimit, ...]


class GapView(NamedTuple):
    """Something that is missing, in words."""

    what: str
    told: str


class ListedRecord(NamedTuple):
    """A record of the log in words."""

    seq: int
    t_us: int
    told: str


class TrackView(NamedTuple):
    """The flown track: its points, and their local places, which a redacted track does not have."""

    points: tuple[TrackPoint, ...]
    places: tuple[tuple[int, int], ...]


class ImageView(NamedTuple):
    """An image as its camera reported it, or a picture that failed (`number` None); `seq` is its record, `where` its
    place, `asked` how often the report was requested again. `heading` is from north and `pitch` from the horizon, in
    1/100 degree, of the camera, or of the vehicle if `of_vehicle`. `accuracy` is that of the GPS, horizontally.
    """

    seq: int
    t_us: int
    camera: int
    number: int | None
    asked: int
    above_home: int | None
    where: tuple[int, int] | None
    heading: int | None
    pitch: int | None
    of_vehicle: bool
    accuracy: int | None


class AutopilotLogView(NamedTuple):
    """The autopilot's own log, bound to this one: what it is, and whether its track agrees with ours, in words."""

    what: str
    agreement: str
    apart: str


class FlightReport(NamedTuple):
    """Everything that a page shows of one flight.

    `highest` is the greatest height above home, and `distance` that over ground, by the telemetry. `log_ends_us`
    is the time of the last record if the telemetry goes on after it: what is later is drawn apart, and not counted.
    `verdict` is that of the verification that made the page, `verified`, `incomplete` or `failed`; or else the log is
    still `growing`, or closed and `unverified`. `images` are those of the log, and `gaps` tells which are missing.
    `log` is the log as the page embeds it, empty if it is too large; `redacted` names what was removed.
    `projection` is that of the local plane. `simulated`: the flight says that nothing flew.
    """

    title: str
    made_by: str
    made_at: str
    mission: str
    vehicle: str
    begun: str
    begun_utc_us: int
    lasted_us: int
    log_ends_us: int | None
    ending: str
    steps_done: int
    steps: int
    highest: int | None
    distance: int | None
    verdict: str
    pinned: str
    origin: str
    root: str
    summary: tuple[SummaryLine, ...]
    projection: Projection | None
    site: Site
    way: PlannedWay
    track: TrackView | None
    bound: tuple[AutopilotLogView, ...]
    timeline: tuple[TimelineEvent, ...]
    decisions: tuple[DecisionView, ...]
    images: tuple[ImageView, ...]
    signals: tuple[SignalCurve, ...]
    gaps: tuple[GapView, ...]
    proven: tuple[str, ...]
    unproven: tuple[str, ...]
    records: tuple[ListedRecord, ...]
    totals: Mapping[str, int]
    log: str
    redacted: tuple[str, ...]
    simulated: bool

    @property
    def verified(self) -> str:
        """The verdict in words."""
        return self.summary[4].answer

    def without_log(self) -> "FlightReport":
        """The report without the octets of the log."""
        return self._replace(log="")


def as_plain(value: Any) -> Any:
    """A report, or a part of it, as objects and lists for JSON."""
    if isinstance(value, tuple):
        if hasattr(value, "_asdict"):
            return {name: as_plain(each) for name, each in value._asdict().items()}
        return [as_plain(each) for each in value]
    if isinstance(value, Mapping):
        return {str(key): as_plain(each) for key, each in value.items()}
    if isinstance(value, Projection):
        return {name: getattr(value, name) for name in value.__struct_fields__}
    if is_dataclass(value):
        return {each.name: as_plain(getattr(value, each.name)) for each in fields(value)}
    return value
