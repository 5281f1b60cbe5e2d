"""What an export says of a flight, and how its values are written: exactly, with units, and with each height's datum.

Values are integers until they are written. A text that comes from outside (names, intents, texts of the vehicle) passes
`shown` in every format: control, invisible and reordering characters become visible, as `<U+202E>`.
"""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.flight.flown import Flight, TrackPoint
from rtshcua.ground.flight.track import exists, parts
from rtshcua.model.step_number import number_of

#: decimals of a value in 1e-7 degree, in mm or mm/s, in 1/100 degree, and in us
DEGREES, METRES, HEADING, SECONDS = 7, 3, 2, 6
#: the first UTC that MCAP cannot represent (2**64 ns, in the year 2554), us
NO_TIME: Final = 2**64 // 1_000


class ExportedRecord(NamedTuple):
    """A decision or an event of the log in words. `name` is the outcome of a decision, or the slug of an event; `step`
    is a step index, -1 for none.
    """

    t_us: int
    is_decision: bool
    name: str
    reason: str
    step: int
    words: str

    @property
    def step_number(self) -> int | None:
        """The number of the step, from 1; None for none."""
        return number_of(self.step) if self.step >= 0 else None

    @property
    def label(self) -> str:
        """The step and the name, in short."""
        name = shown(self.name)
        return name if self.step_number is None else f"step {self.step_number}: {name}"


class FlightExport(NamedTuple):
    """A flight that is exported, with the records of its log in words; what made the file; whether the log verifies,
    and the same in words.
    """

    flight: Flight
    told: tuple[ExportedRecord, ...]
    made_by: str
    verified: bool
    log_status: str

    @property
    def decisions(self) -> tuple[ExportedRecord, ...]:
        """The decisions among the records."""
        return tuple(each for each in self.told if each.is_decision)

    @property
    def track(self) -> tuple[TrackPoint, ...]:
        """The track of the telemetry; empty without telemetry."""
        return () if self.flight.telemetry is None else self.flight.telemetry.track

    @property
    def title(self) -> str:
        """The mission and the vehicle."""
        return f"{shown(self.flight.mission.name)} of {shown(self.flight.genesis.vehicle)}"

    def description(self, *more: str) -> tuple[str, ...]:
        """What the file is made from, line by line; `more` is about its format."""
        policy, intent = self.flight.policy, self.flight.mission.intent
        return (
            f"mission {self.title} under {shown(policy.name)}@{policy.version},"
            f" begun {utc_text(self.flight.genesis.utc_us)}",
            *([f"intent: {shown(intent)}"] if intent else []),
            *more,
            f"log: {shown(self.log_status)}; an export is never a record, only the log is evidence",
            f"made by {self.made_by}",
        )


def with_usable_track(flight: Flight) -> tuple[Flight, int]:
    """The flight without the points of its track that no format can hold, and their number: places that do not exist,
    0 N 0 E, which autopilots report before they know where they are, and times outside of 1970 to 2554.
    """
    telemetry = flight.telemetry
    if telemetry is None:
        return flight, 0
    kept = tuple(each for each in telemetry.track if _is_usable(each, flight.genesis.utc_us))
    dropped = len(telemetry.track) - len(kept)
    signals = tuple(
        each._replace(points=tuple(one for one in each.points if 0 <= flight.utc_of(one[0]) < NO_TIME))
        for each in telemetry.signals
    )
    texts = tuple(each for each in telemetry.texts if 0 <= flight.utc_of(each.t_us) < NO_TIME)
    return flight._replace(telemetry=telemetry._replace(track=kept, signals=signals, texts=texts)), dropped


def _is_usable(point: TrackPoint, begun_us: int) -> bool:
    return exists(point) and 0 <= begun_us + point.t_us < NO_TIME


def segments(track: Sequence[TrackPoint]) -> Iterator[tuple[TrackPoint, ...]]:
    """The parts of a track between gaps; what was flown in a gap is not known."""
    return (tuple(track[part.start : part.stop]) for part in parts(track))


def decimal(value: int, digits: int) -> str:
    """`value / 10**digits`, exactly, with all decimals."""
    if not digits:
        return str(value)
    whole, rest = divmod(abs(value), 10**digits)
    return f"{'-' if value < 0 else ''}{whole}.{rest:0{digits}d}"


def number(value: int, digits: int) -> float:
    """`value / 10**digits` for JSON: the nearest double, which is written with these decimals."""
    return value / int(10**digits)


def utc_text(us: int, digits: int = SECONDS) -> str:
    """A UTC time in us since the Unix epoch as ISO 8601 (xsd:dateTime), cut to so many decimals of a second."""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=us)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{us % 1_000_000 // 10 ** (SECONDS - digits):0{digits}d}Z"


def shown(text: str) -> str:
    """A text from outside as one line that every format and reader can hold."""
    return visible(text)
