"""A redacted picture of a flight: without positions, without names, or without both.

What is removed is removed from the values before a page is made of them. Texts from outside (details of effects, texts
of the vehicle, intents) are left out, for nobody can say what they contain. What is left is searched for what should be
gone, and if anything is found there is no page.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Recover, Seal
from rtshcua.ground.flight.flight_content import FlightReport, ListedRecord, TrackView
from rtshcua.ground.flight.flight_page import own_words
from rtshcua.ground.flight.flown import Flight, TrackPoint

#: what can be removed, in the order in which a page names it
REDACTABLE: Final = ("position", "names")
#: a coordinate as our texts write it, with at least four decimals, and the way from home
_COORDINATE: Final = re.compile(
    r"-?\d{1,3}\.\d{4,}(?: ?[NSEW]\b)?(?:, -?\d{1,3}\.\d{4,}(?: ?[NSEW]\b)?)?|-?\d{8,10}(?= )"
)
_FROM_HOME: Final = re.compile(r"-?[\d.]+ m from (?:the declared )?home(?:, bearing \d+°)?|at home\b")
_ABOVE_SEA: Final = re.compile(r",? ?-?[\d.]+ m above (?:the |mean )?sea(?: level)?")
#: a shorter name is not searched for in what is left: it stands in other words
_LEAST: Final = 3


def redaction_of(text: str | None) -> tuple[str, ...] | Refusal:
    """What `--redact` names, in the order of `REDACTABLE`."""
    if text is None:
        return ()
    named = [each.strip() for each in text.split(",")]
    wrong = [each for each in named if each not in REDACTABLE]
    if wrong:
        help = "accepted: `position`, `names`, or both: `position,names`"
        return Refusal("usage", f"`{wrong[0]}` cannot be left out", help, code=ExitCode.USAGE)
    return tuple(each for each in REDACTABLE if each in named)


def may_stay(removed: Iterable[str]) -> Callable[[bytes], bool]:
    """Whether the line of a record may stay in a redacted log. A genesis has the bundle, and with it names and places;
    the checkpoints of signed records name the vehicle; a decision has the position in its state; a detail may have
    anything.
    """
    names = "names" in removed

    def stays(line: bytes) -> bool:
        record = read(line)
        if isinstance(record, Effect):
            return not record.detail
        if isinstance(record, Seal | Recover | Close):
            return not names
        return False

    return stays


class Redaction:
    """Removes what should not be seen from the report of a flight."""

    def __init__(self, flight: Flight, persons: Iterable[str], removed: tuple[str, ...]) -> None:
        self.position, self.names = "position" in removed, "names" in removed
        self._removed = removed
        self._replaced = dict(_placeholders(flight, persons)) if self.names else {}
        ordered = sorted(self._replaced, key=len, reverse=True)
        self._pattern = (
            re.compile("|".join(rf"(?<!\w){re.escape(name)}(?!\w)" for name in ordered)) if ordered else None
        )
        self._slots = flight.policy.vehicle

    def report(self, report: FlightReport, flight: Flight) -> FlightReport:
        """The report without what is removed."""
        velocity = {each.name for each in flight.policy.signals
                    if each.slot in (self._slots.north, self._slots.east)}  # fmt: skip
        report = report._replace(
            records=tuple(_bare(each, flight.genesis.at_us) for each in flight.records[: len(report.records)]),
            redacted=self._removed,
            origin="" if self.names else report.origin,
            decisions=tuple(each._replace(place="" if self.names else each.place) for each in report.decisions),
        )
        if self.position:
            report = report._replace(
                track=None if report.track is None else TrackView(tuple(map(_upright, report.track.points)), ()),
                distance=None,
                projection=None,
                site=replace(report.site, zones=(), elevation=None),
                way=replace(report.way, steps=()),
                signals=tuple(each for each in report.signals if each.series.name not in velocity),
                decisions=tuple(
                    each._replace(where=None, reads=tuple(read for read in each.reads if not _is_place(read.value)))
                    for each in report.decisions
                ),
            )
        cleaned: FlightReport = _mapped(report, self._text)
        return cleaned

    def left(self, page: str) -> Refusal | None:
        """The refusal of a page in which something is left that should be gone."""
        text = page.partition("<script")[0]
        found = [each[0] for each in self._pattern.finditer(text)] if self._pattern is not None else []
        found = [each for each in found if len(each) >= _LEAST and each not in own_words()]
        if self.position:
            found += [each[0] for each in _COORDINATE.finditer(text[text.find("</style>") :])]
        if not found:
            return None
        what = f"the page would still have `{found[0]}`: it is not written"
        return Refusal("redaction", what, "please report it", code=ExitCode.FAULT)

    def _text(self, text: str) -> str:
        if self._pattern is not None:
            text = self._pattern.sub(lambda found: self._replaced[found[0]], text)
        if self.position:
            text = _COORDINATE.sub("(place)", _FROM_HOME.sub("(place)", _ABOVE_SEA.sub("", text)))
        return text


def _upright(point: TrackPoint) -> TrackPoint:
    """A point of a track with its heights above home and above the ground alone."""
    return TrackPoint(point.t_us, 0, 0, 0, point.above_home, point.above_ground, 0, 0, 0, None)


def _is_place(value: str) -> bool:
    return _COORDINATE.search(value) is not None


def _bare(record: AnyRecord, start_us: int) -> ListedRecord:
    """A record without its details."""
    if isinstance(record, DecisionRecord):
        told = f"decision: {record.outcome}, {record.reason}"
    elif isinstance(record, Effect):
        told = f"effect: {record.event}"
    else:
        told = record.type
    return ListedRecord(record.seq, record.at_us - start_us, told)


def _placeholders(flight: Flight, persons: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each name with what stands in its place."""
    policy, mission = flight.policy, flight.mission
    for name, told in (
        (mission.name, "the mission"), (mission.proposer, "a proposer"), (policy.name, "the policy"),
        (policy.vehicle.name, "the vehicle"), (flight.genesis.vehicle, "the vehicle"),
        (policy.vehicle.identity, "the vehicle"), (flight.genesis.mission, "the mission"),
    ):  # fmt: skip
        if name:
            yield name, told
    for number, name in enumerate((*policy.sources, *mission.sources), 1):
        yield name, f"source {number}"
    for number, zone in enumerate(policy.zones[: policy.declared], 1):
        yield zone.name, f"zone_{number}"
    for number, person in enumerate(persons, 1):
        yield person, f"person {number}"


def _mapped(value: Any, change: Callable[[str], str]) -> Any:
    """A value with each of its texts changed."""
    if isinstance(value, str):
        return change(value)
    if isinstance(value, tuple):
        made = [_mapped(each, change) for each in value]
        return type(value)(*made) if hasattr(value, "_fields") else tuple(made)
    if isinstance(value, dict):
        return {key: _mapped(each, change) for key, each in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{each.name: _mapped(getattr(value, each.name), change) for each in fields(value)})
    return value
