"""A flight told: its records and its telemetry as the content of a page."""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import isqrt
from pathlib import Path
from typing import Final, TypeAlias

from rtshcua import __version__
from rtshcua.app.autopilot_bindings import agreed, apart, described, read_bindings
from rtshcua.app.documents import Claimed
from rtshcua.app.flights.clause_places import ClausePlaces
from rtshcua.app.flights.decisions_told import MOST_EXPLAINED, DecisionWords
from rtshcua.app.flights.flight_reading import FlightRecords, telemetry_of
from rtshcua.app.flights.flight_telemetry import TelemetryReading, thinning_of
from rtshcua.app.flights.signal_limits import signal_limits
from rtshcua.app.logged_decision import LoggedDecision
from rtshcua.app.prepared_mission import Subject, prepared
from rtshcua.app.sidecar_files import run_folder
from rtshcua.app.telling import words
from rtshcua.app.telling.people import People
from rtshcua.app.telling.records_told import Names
from rtshcua.app.wording import many, true_to, utc
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.flight.flight_content import (
    AutopilotLogView,
    FlightReport,
    GapView,
    ListedRecord,
    SignalCurve,
    SummaryLine,
    TimelineEvent,
    TrackView,
)
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.signal import POSITION
from rtshcua.model.step_number import step_words
from rtshcua.wire.autopilot_binding import AutopilotBinding
from rtshcua.wire.request import STEP

#: the most records that are listed
_MOST_RECORDS: Final = 2_000
#: effects that are told in a lane of the timeline, with the lane and the class of the style
_IN_LANE: Final[Mapping[str, tuple[str, str]]] = {
    "replacement": ("proposed", "document"),
    "cancellation": ("proposed", "document"),
    "declined": ("proposed", "deny"),
    "client": ("proposed", "client"),
    "approval": ("approvals", "document"),
    "recall": ("approvals", "recall"),
    "obeyed": ("observed", "observed"),
    "landed": ("observed", "observed"),
    "violated": ("fallback", "violated"),
    "taken-over": ("vehicle", "violated"),
    "link-lost": ("vehicle", "violated"),
    "link-back": ("vehicle", "observed"),
    "gap": ("vehicle", "violated"),
    "stalled": ("vehicle", "violated"),
    "crashed": ("vehicle", "violated"),
    "boundary-lost": ("vehicle", "violated"),
}
_ENDINGS: Final = {
    "completed": "The mission was completed.",
    "not closed": "The log is not closed: how it ended is unknown.",
    "flying": "It is still flying.",
}
#: what ended a mission early, in words
_CAUSES: Final = {
    "violated": "could not go on",
    "failed": "failed",
    "taken-over": "was taken over by another pilot or program",
    "interrupted": "was interrupted from the keyboard",
    "recall": "was recalled",
    "cancellation": "was cancelled by its proposer",
    "link-lost": "lost the link to the vehicle",
    "long-silence": "heard nothing from the vehicle for too long",
    "gap": "could not keep its records",
    "crashed": "ended in a crash",
    "stood-down": "stood down",
    "boundary-lost": "lost the enforcement boundary",
    "undecided": "got no decision",
    "refused": "was refused by the vehicle",
}
_ENDS: Final = frozenset({"succeeded", "failed", "superseded", "refused", "not-landed"})


#: when the command of a step or link was dispatched, by its kind, step and link
_Running: TypeAlias = dict[tuple[int, int, int], tuple[int, Effect]]


class CollectedFlight:
    """What one pass over the records collects."""

    def __init__(self, log: Path, sources: Sequence[Path]) -> None:
        self.records = FlightRecords()
        self.cause = LoggedDecision(log, None, self._names_of, self._subject_of)
        self.names: Names | None = None
        self.decisions: DecisionWords | None = None
        self.told: list[ListedRecord] = []
        self.left_out = 0
        self.log, self._sources = log, sources
        self._start_us = 0
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

    def flight(self) -> Flight | Refusal:
        """The flight so far."""
        return self.records.flight(self.log, None if self._reading is None else self._reading.telemetry())

    @property
    def persons(self) -> tuple[str, ...]:
        """The persons who may have signed documents."""
        return () if self.names is None else tuple(dict.fromkeys(self.names.people.by_key.values()))

    def _names_of(self, genesis: Genesis) -> Names:
        bundle = self.records.bundle
        self.names = Names(bundle if isinstance(bundle, Claimed) else None, People.of(genesis))
        return self.names

    def _subject_of(self, _: Genesis) -> Subject | Refusal:
        bundle = self.records.bundle
        if isinstance(bundle, Claimed):
            return prepared(bundle.policy, bundle.mission)
        return Refusal("genesis/bundle", f"the bundle in `{self.log}` cannot be read: {bundle}")

    def take(self, record: AnyRecord) -> None:
        """Take the next valid record."""
        self.records.take(record)
        self.cause.take(record)  # the names follow it
        if isinstance(record, Genesis):
            self._start_us = record.at_us
            self._begin_telemetry(record)
            subject = self.cause.in_force
            if subject is not None and self.names is not None:
                policy, mission = subject.policy.policy, subject.mission
                places = ClausePlaces(
                    (*policy.sources, *mission.sources),
                    (*policy.source_digests, *mission.source_digests),
                    self._sources,
                )
                self.decisions = DecisionWords(subject, self.names, self._start_us, places)
        elif isinstance(record, DecisionRecord | Effect) and self.decisions is not None:
            self.decisions.take(record)
        if len(self.told) >= _MOST_RECORDS:
            self.left_out += 1
        elif self.names is not None:
            self.told.append(ListedRecord(record.seq, record.at_us - self._start_us, self.names.tell(record).strip()))


class FlightTelling:
    """Tells a flight. `report` is that of its verification, None while it flies; `pinned` names the root key.

    Without `details` texts from outside are left out.
    """

    def __init__(
        self, report: LogReport | None, flight: Flight, collected: CollectedFlight, *, made_at_us: int, pinned: str,
        details: bool = True,
    ) -> None:  # fmt: skip
        self._report, self._flight, self._collected = report, flight, collected
        self._log = collected.log
        self._made_at_us, self._pinned = made_at_us, pinned
        assert collected.names is not None
        self._names = collected.names
        telemetry = flight.telemetry
        track = () if telemetry is None else telemetry.track
        home = None if telemetry is None or telemetry.home is None else telemetry.home.above_sea
        if home is None and track:
            home = track[0].above_sea - track[0].above_home
        places = tuple(flight.local(each.latitude, each.longitude) for each in track)
        self._track = TrackView(track, places) if track else None
        self._elevation = home
        self._details = details
        self._times = [each.t_us for each in track]

    def report(self) -> FlightReport:
        """The content of the page, without the log."""
        flight, report, genesis = self._flight, self._report, self._flight.genesis
        last = flight.records[-1]
        lasted_us = flight.since_begun(last.at_us)
        decisions = tuple(
            each._replace(where=self._where(each.t_us))
            for each in (() if self._collected.decisions is None else self._collected.decisions.views)
        )
        ending = last.ending if isinstance(last, Close) else "flying" if report is None else "not closed"
        return FlightReport(
            title=f"Flight of `{flight.mission.name}` on `{genesis.vehicle}`",
            made_by=f"rtshcua {__version__}",
            made_at=utc(self._made_at_us),
            mission=flight.mission.name,
            vehicle=genesis.vehicle,
            begun=utc(genesis.utc_us),
            begun_utc_us=genesis.utc_us,
            lasted_us=lasted_us,
            ending=ending,
            steps_done=len(self._done()),
            steps=len(flight.mission.invocations),
            highest=None if self._track is None else max(each.above_home for each in self._track.points),
            distance=None if self._track is None else _distance(self._track.places),
            verdict="growing" if report is None else report.verdict.value,
            verified=self._verified(),
            pinned=self._pinned,
            origin=origin_of(genesis.vehicle, genesis.boot),
            root="" if report is None else report.root.hex(),
            summary=self._summary(ending),
            projection=flight.policy.projection,
            site=site_of(flight.policy, self._elevation),
            way=way_of(flight.mission),
            track=self._track,
            bound=tuple(self._bound()) if self._details else (),
            timeline=self._timeline(),
            decisions=decisions,
            signals=self._signals(),
            gaps=self._gaps(),
            proven=tuple(claim.text for claim in (() if report is None else report.proven)),
            unproven=tuple(claim.text for claim in (() if report is None else report.unproven)),
            records=tuple(self._collected.told),
            totals={} if report is None else dict(report.counts),
            log="",
            redacted=(),
        )

    # ------------------------------------------------------------------------------------------ in six lines

    def _summary(self, ending: str) -> tuple[SummaryLine, ...]:
        return (
            SummaryLine("What was asked", self._asked()),
            SummaryLine("Who allowed it", self._allowed()),
            SummaryLine("What flew", self._flew()),
            SummaryLine("How it ended, and why", self._ended(ending)),
            SummaryLine("Is this record intact", self._verified()),
            SummaryLine("What nothing vouches for", self._unvouched()),
        )

    def _asked(self) -> str:
        mission, policy = self._flight.mission, self._flight.policy
        steps = mission.invocations
        whose = dict.fromkeys(
            f"for role `{policy.roles[each.role]}` through {words.source(each.source)}"
            for each in steps
            if 0 <= each.role < len(policy.roles)
        )
        intent = f" (“{mission.intent}”)" if mission.intent and self._details else ""
        told = ", ".join(f"`{words.call(policy, each)}`" for each in steps[:4])
        more = f" and {len(steps) - 4} more" if len(steps) > 4 else ""
        by = f", proposed by `{mission.proposer}`" if mission.proposer else ""
        return f"Mission `{mission.name}`{intent}{by} {' and '.join(whose)}: {many(len(steps), 'step')}, {told}{more}."

    def _allowed(self) -> str:
        policy = self._flight.policy
        granted = [each for each in self._flight.records if isinstance(each, Effect) and each.event == "approval"]
        told = f"The signed policy `{policy.name}`, version {policy.version}"
        if not granted:
            return f"{told}. No person was asked to approve a step."
        said = "; ".join(f"{step_words(each.step)}: {self._document(each)}" for each in granted[:4])
        more = f"; and {len(granted) - 4} more" if len(granted) > 4 else ""
        return f"{told}, and by their signatures: {said}{more}."

    def _document(self, record: Effect) -> str:
        return self._names.detail(record)

    def _flew(self) -> str:
        done = self._done()
        steps = len(self._flight.mission.invocations)
        lasted = words.duration(self._flight.since_begun(self._flight.records[-1].at_us) // 100_000 * 100_000)
        told = f"{len(done)} of {many(steps, 'step')} completed in {lasted}"
        if self._track is None:
            return f"{told}. There is no telemetry of its way."
        highest = max(each.above_home for each in self._track.points)
        farthest = max(x * x + y * y for x, y in self._track.places)
        far_m = round(farthest**0.5 / 100) / 10
        text = f"{told}, up to {round(highest / 100) / 10} m above home and {far_m} m from the declared home"
        return f"{text}, as the vehicle reported."

    def _done(self) -> set[int]:
        """The steps that succeeded."""
        effects = (each for each in self._flight.records if isinstance(each, Effect))
        return {each.step for each in effects if each.event == "succeeded" and each.kind == STEP}

    def _ended(self, ending: str) -> str:
        flight, cause = self._flight, self._collected.cause.cause
        told = _ENDINGS.get(ending, f"Ended early: {ending}.")
        if cause is not None:
            told += f" At {_seconds(cause.at_us - flight.genesis.at_us)} {self._cause(flight.records[cause.seq])}"
        flown = next(
            (each for each in flight.records if isinstance(each, Effect) and each.event == "dispatched"
             and each.kind != STEP and (cause is None or each.seq > cause.seq)), None
        )  # fmt: skip
        if flown is not None:
            subject = self._names.subject(flown.kind, flown.step, flown.link)
            what = self._names.detail(flown)
            named = f", `{what}`," if what and what not in subject else ""
            told += f" So at {_seconds(flight.since_begun(flown.at_us))} the {subject}{named} flew."
        return told

    def _cause(self, record: AnyRecord) -> str:
        """The cause of an early end, in a sentence."""
        if isinstance(record, DecisionRecord):
            subject = self._names.subject(record.kind, record.step, record.link)
            clause = "" if record.clause is None else f", because of `{' '.join(record.clause.split())}`"
            return f"{subject} was not allowed ({record.reason}){clause}."
        if not isinstance(record, Effect):
            return f"the log says: {' '.join(self._names.tell(record).split())}."
        subject = self._names.subject(record.kind, record.step, record.link)
        what = _CAUSES.get(record.event, record.event)
        detail = self._names.detail(record) if self._details else ""
        return f"{subject or 'the flight'} {what}{f': {detail}' if detail else ''}.".replace("..", ".")

    def _verified(self) -> str:
        report = self._report
        if report is None:
            return "Not verified yet: the log is still being written."
        if report.failure is not None:
            return f"No: record {report.failure.record} fails ({report.failure.slug}): {report.failure.text}."
        if report.verdict is LogVerdict.INCOMPLETE:
            short = "" if report.shortfall is None else f": {report.shortfall.text}"
            return f"As far as it goes: {many(report.records, 'record')} in order, but incomplete{short}."
        again = "every decision was computed again, with the same result"
        return f"Yes: {many(report.records, 'record')}, signed and closed; {again}."

    def _unvouched(self) -> str:
        if self._report is None:
            return "Anything on this page: it shows what is being recorded, before anybody verified it."
        told = [claim.text for claim in self._report.unproven]
        if not told:
            return "Nothing is left open."
        first = told[0].rstrip(".")
        more = f" And {many(len(told) - 1, 'other thing')}, listed below." if len(told) > 1 else ""
        return f"{first[:1].upper()}{first[1:]}.{more}"

    # ------------------------------------------------------------------------------------------ parts

    def _where(self, t_us: int) -> tuple[int, int] | None:
        if self._track is None:
            return None
        at = min(bisect_left(self._times, t_us), len(self._times) - 1)
        return self._track.places[at]

    def _timeline(self) -> tuple[TimelineEvent, ...]:
        flight, genesis = self._flight, self._flight.genesis
        received_us = genesis.received_us - genesis.at_us
        issued_us = flight.mission.issued_at_us - genesis.utc_us
        events = [
            TimelineEvent("proposed", issued_us, None, "document", f"mission `{flight.mission.name}` issued"),
            TimelineEvent("compiled", received_us, None, "document", "the signed bundle received on board", 0),
        ]
        running: _Running = {}
        for record in flight.records:
            if isinstance(record, DecisionRecord):
                t_us, told = flight.since_begun(record.at_us), " ".join(self._names.tell(record).split())
                lane = "decided" if record.kind == STEP else "fallback"
                events.append(TimelineEvent(lane, t_us, None, record.outcome, told, record.seq))
            elif isinstance(record, Effect):
                events += self._of_effect(record, running)
        end_us = flight.since_begun(flight.records[-1].at_us)
        for began_us, record in running.values():
            events.append(self._ran(record, began_us, end_us, "its end is not recorded"))
        return tuple(_merged(events))

    def _of_effect(
        self, record: Effect, running: dict[tuple[int, int, int], tuple[int, Effect]]
    ) -> list[TimelineEvent]:
        t_us, ref = self._flight.since_begun(record.at_us), (record.kind, record.step, record.link)
        if record.event == "dispatched":
            ended = [self._ran(began, began_us, t_us, "replaced") for began_us, began in running.values()]
            running.clear()
            running[ref] = t_us, record
            return ended
        if record.event in _ENDS and ref in running:
            began_us, began = running.pop(ref)
            return [self._ran(began, began_us, t_us, record.event)]
        if record.event in _IN_LANE:
            lane, kind = _IN_LANE[record.event]
            told = " ".join(self._names.tell(record).removeprefix("·").split())
            if not self._details:
                told = f"{record.event} {self._names.subject(*ref)}".strip()
            return [TimelineEvent(lane, t_us, None, kind, told, record.seq)]
        return []

    def _ran(self, record: Effect, from_us: int, to_us: int, how: str) -> TimelineEvent:
        lane = "dispatched" if record.kind == STEP else "fallback"
        told = f"{self._names.subject(record.kind, record.step, record.link)}: {how}"
        return TimelineEvent(lane, from_us, to_us, "step" if record.kind == STEP else "link", told, record.seq)

    def _bound(self) -> Iterator[AutopilotLogView]:
        """The autopilot's logs that are bound to this flight."""
        folder = run_folder(self._log)
        for found in () if folder is None else read_bindings(folder):
            if isinstance(found.content, AutopilotBinding):
                binding = found.content
                whole = binding.compared == binding.points and not binding.deviations
                yield AutopilotLogView(described(binding), agreed(binding), "" if whole else apart(binding))

    def _signals(self) -> tuple[SignalCurve, ...]:
        telemetry = self._flight.telemetry
        if telemetry is None:
            return ()
        limits = signal_limits(self._flight.policy, self._flight.mission)
        slots = {each.name: each.slot for each in self._flight.policy.signals if each.kind != POSITION}
        return tuple(SignalCurve(each, limits.get(slots[each.name], ())) for each in telemetry.signals)

    def _gaps(self) -> tuple[GapView, ...]:
        flight, report, telemetry = self._flight, self._report, self._flight.telemetry
        gaps = [GapView("clock", f"times of day are {true_to(flight.genesis.utc_error_us)}")]
        if report is not None:
            tail = report.records - report.anchored
            if tail:
                gaps.append(GapView("witnesses", f"{many(tail, 'record')} at the end, which no witness holds"))
            gaps += [
                GapView("records", f"nothing was recorded for {_seconds(gap.us)} before record {gap.record}")
                for gap in report.gaps
            ]
        if telemetry is None:
            gaps.append(GapView("telemetry", "there is none: no track, no signals"))
        else:
            if telemetry.damaged is not None:
                gaps.append(GapView("telemetry", f"the file breaks off at octet {telemetry.damaged}"))
            for silence in telemetry.silences[:20]:
                between = f"from {_seconds(silence.from_us)} to {_seconds(silence.to_us)}"
                gaps.append(GapView("frames", f"no frame of the autopilot {between}"))
            if len(telemetry.silences) > 20:
                gaps.append(GapView("frames", f"and {len(telemetry.silences) - 20} more silences"))
            silent = [each.name for each in telemetry.signals if all(value is None for _, value in each.points)]
            if silent:
                gaps.append(
                    GapView("signals", f"never known in the telemetry: {', '.join(f'`{name}`' for name in silent)}")
                )
        explained = self._collected.decisions
        if explained is not None and explained.explained >= MOST_EXPLAINED:
            gaps.append(GapView("page", f"only the first {MOST_EXPLAINED} decisions are explained in full"))
        if self._collected.left_out:
            gaps.append(
                GapView("page", f"{many(self._collected.left_out, 'record')} are not listed; `rtshcua show` lists all")
            )
        return tuple(gaps)


def _distance(places: Sequence[tuple[int, int]]) -> int:
    """The length of a track over ground, mm."""
    return sum(isqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) for (x0, y0), (x1, y1) in pairwise(places))


def _seconds(us: int) -> str:
    return f"{us / 1_000_000:.1f} s"


def _merged(events: Sequence[TimelineEvent]) -> list[TimelineEvent]:
    """The events by time; equal moments of a lane in a row, such as those of a step that waits, as one."""
    kept: dict[str, TimelineEvent] = {}
    merged: list[TimelineEvent] = []
    for event in sorted(events, key=lambda each: each.t_us):
        last = kept.get(event.lane)
        if last is None or (last.kind, last.told, last.until_us) != (event.kind, event.told, None):
            merged.append(event)
        kept[event.lane] = event
    return merged
