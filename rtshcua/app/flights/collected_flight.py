"""What one pass over the records of a flight collects for its page, also while they are still written."""

from base64 import b64decode
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from rtshcua.app.documents import Claimed
from rtshcua.app.flights.clause_places import ClausePlaces
from rtshcua.app.flights.decision_views import DecisionViews
from rtshcua.app.flights.flight_reading import FlightRecords, telemetry_of
from rtshcua.app.flights.flight_telemetry import TelemetryReading, thinning_of
from rtshcua.app.logged_decision import LoggedDecision
from rtshcua.app.prepared_mission import Subject, subject_of
from rtshcua.app.telling.document_prose import said
from rtshcua.app.telling.people import People
from rtshcua.app.telling.record_prose import Names
from rtshcua.app.wording import many
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect, Genesis
from rtshcua.ground.flight.flight_content import DecisionView, GapView, ListedRecord
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.mission import Mission
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.untrusted import Untrusted

#: the most records that are listed
_MOST_RECORDS: Final = 2_000


class CollectedFlight:
    """What one pass over the records collects."""

    def __init__(self, log: Path, sources: Sequence[Path]) -> None:
        self.records = FlightRecords()
        self.cause = LoggedDecision(log, None, self._names_of, self._subject_of)
        self.names: Names | None = None
        self.decisions: DecisionViews | None = None
        self.told: list[ListedRecord] = []
        #: what is wrong with the line at which a growing log breaks off; empty while nothing is
        self.flaw = ""
        #: whether each recorded answer of a person grants, by its record; None if it makes no sense
        self.answers: dict[int, bool | None] = {}
        self._left_out = 0
        self.log, self._sources = log, sources
        self._reading: TelemetryReading | None = None

    def _begin_telemetry(self, genesis: Genesis) -> None:
        path, policy = telemetry_of(self.log), self.records.policy()
        if path is not None and policy is not None:
            self._reading = TelemetryReading(policy, genesis.utc_us, thinning_of(path))

    @property
    def heard(self) -> TelemetryReading | None:
        """What takes the telemetry that somebody reads anyway; known after the first record."""
        return self._reading

    def update_telemetry(self) -> bool:
        """Read what the telemetry has more; return whether there was any. Raises OSError."""
        path = telemetry_of(self.log)
        if self._reading is None and self.records.genesis is not None:
            self._begin_telemetry(self.records.genesis)
        return path is not None and self._reading is not None and self._reading.follow(path)

    def flight(self, *, growing: bool = False) -> Flight | Refusal:
        """The flight so far. The next record of a `growing` log is still to come: nothing counts as later."""
        if self._reading is None:
            return self.records.flight(self.log, None)
        lasted_us = self.records.times.lasted_us
        heard = self._reading.telemetry(lasted_us)
        return self.records.flight(self.log, heard._replace(later_us=0) if growing else heard)

    @property
    def persons(self) -> tuple[str, ...]:
        """The persons who may have signed documents."""
        return () if self.names is None else tuple(dict.fromkeys(self.names.people.by_key.values()))

    def _names_of(self, genesis: Genesis) -> Names:
        bundle = self.records.bundle
        self.names = Names(bundle if isinstance(bundle, Claimed) else None, People.of(genesis))
        return self.names

    def _subject_of(self, _: Genesis) -> Subject | Refusal:
        if self.records.prepared is not None:
            return subject_of(self.records.prepared)
        return Refusal("genesis/bundle", f"the bundle in `{self.log}` cannot be read: {self.records.bundle}")

    def take(self, record: AnyRecord) -> None:
        """Take the next valid record."""
        t_us = self.records.take(record)
        self.cause.take(record)  # the names follow it
        if isinstance(record, Genesis):
            self._begin_telemetry(record)
            subject = self.cause.in_force
            if subject is not None and self.names is not None:
                places = ClausePlaces(subject.policy.policy, subject.mission, self._sources)
                self.decisions = DecisionViews(subject, self.names, places)
        elif isinstance(record, DecisionRecord | Effect) and self.decisions is not None:
            self.decisions.take(record, t_us)
        if isinstance(record, Effect) and record.event == "approval":
            self.answers[record.seq] = _granted(record)
        if len(self.told) >= _MOST_RECORDS:
            self._left_out += 1
        elif self.names is not None:
            self.told.append(ListedRecord(record.seq, t_us, self.names.tell(record).strip()))

    def mission(self) -> Mission:
        """The mission of the bundle, before any replacement; call it after the first record."""
        assert isinstance(self.records.bundle, Claimed)
        return self.records.bundle.mission

    def decision_views(self) -> tuple[DecisionView, ...]:
        """The decisions in words."""
        return () if self.decisions is None else self.decisions.views

    def gaps(self) -> Iterator[GapView]:
        """What the page leaves out."""
        if self.decisions is not None and self.decisions.unexplained:
            yield GapView("page", f"{many(self.decisions.unexplained, 'decision')} are told without their values")
        if self._left_out:
            yield GapView("page", f"{many(self._left_out, 'record')} are not listed; `rtshcua show` lists all")


def _granted(record: Effect) -> bool | None:
    """Whether a recorded answer grants; None if it makes no sense."""
    try:
        body = said(b64decode(record.detail, validate=True)).body
    except (ValueError, Untrusted):
        return None
    return bool(body.granted) if isinstance(body, ApprovalDocument) else None
