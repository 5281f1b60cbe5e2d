"""A flight in six lines: what was asked, who allowed it, what flew, how it ended, whether the record is intact, and
what is not proven.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from rtshcua.app.documents import Claimed
from rtshcua.app.flights.collected_flight import CollectedFlight
from rtshcua.app.telling import prose
from rtshcua.app.wording import many, seconds
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.ground.flight.flight_content import SummaryLine, TrackView
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.outcome import Reason
from rtshcua.model.step_number import number_of, step_words
from rtshcua.onboard.runtime.link import STOOD_STILL
from rtshcua.wire.request import STEP

#: how many steps, answers or replacements a line names
_NAMED: Final = 4
#: without a record for longer, whatever writes the log has stopped: a flight seals its log every 10 s
_SILENT_US: Final = 30_000_000
_ENDINGS: Final = {
    "completed": "The mission was completed.",
    "not closed": "The log is not closed: how it ended is unknown.",
    "flying": "It was still flying at the last record.",
}
#: what ended a mission early, in words
CAUSES: Final = {
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
    "refused": "was refused",
    "stranded": "was left in the air with nothing that may fly",
    "not-landed": "ended without an observed landing",
    "already-airborne": "began with a vehicle that was in the air",
    "resumed": "was taken up again after an interruption, to come down",
    "left": "left the vehicle in the air",
    STOOD_STILL: "stood still: its computer was stopped",
}


class FlightSummary:
    """Tells a flight in six lines. `report` is that of its verification, None while it flies; without `details` texts
    from outside are left out.
    """

    def __init__(
        self, report: LogReport | None, flight: Flight, collected: CollectedFlight, track: TrackView | None, *,
        ending: str, made_at_us: int, details: bool,
    ) -> None:  # fmt: skip
        assert collected.names is not None
        self._report, self._flight, self._collected, self._track = report, flight, collected, track
        self._names, self._ending, self._made_at_us, self._details = collected.names, ending, made_at_us, details

    def lines(self) -> tuple[SummaryLine, ...]:
        """The six lines."""
        return (
            SummaryLine("What was asked", self._asked()),
            SummaryLine("Who allowed it", self._allowed()),
            SummaryLine("What flew", self._flew()),
            SummaryLine("How it ended, and why", self._ended()),
            SummaryLine("Is this record intact", self._intact()),
            SummaryLine("What is not proven", self._unproven()),
        )

    @property
    def done(self) -> set[int]:
        """The steps that succeeded."""
        return {each.step for each in self._effects("succeeded") if each.kind == STEP}

    def _effects(self, *events: str) -> Iterator[Effect]:
        return (each for each in self._flight.records if isinstance(each, Effect) and each.event in events)

    def _asked(self) -> str:
        first, last, policy = self._collected.mission(), self._flight.mission, self._flight.policy
        steps = last.invocations
        whose = dict.fromkeys(
            f"for role `{policy.roles[each.role]}` through {prose.source(each.source)}"
            for each in steps
            if 0 <= each.role < len(policy.roles)
        )
        intent = f" (“{first.intent}”)" if first.intent and self._details else ""
        by = f", proposed by `{first.proposer}`" if first.proposer else ""
        told = _listed([f"`{prose.call(policy, each)}`" for each in steps], ", ")
        newer = len(list(self._effects("replacement")))
        after = f" The steps are those after {many(newer, 'replacement')}." if newer else ""
        return f"Mission `{first.name}`{intent}{by} {' and '.join(whose)}: {many(len(steps), 'step')}, {told}.{after}"

    def _signers(self) -> str:
        """The keys of policy and mission, and whose these are."""
        bundle, people = self._collected.records.bundle, self._names.people
        if not isinstance(bundle, Claimed) or not self._details:
            return ""
        return f", signed by {people.signer(bundle.policy_kid)}; the mission by {people.signer(bundle.mission_kid)}"

    def _allowed(self) -> str:
        policy = self._flight.policy
        told = f"The policy `{policy.name}`, version {policy.version}{self._signers()}"
        if self._flight.genesis.mode == "none":
            return f"Nobody had to: in mode `none` nothing is enforced. {told} was only compared with what flew."
        return " ".join([f"{told}.", *(self._approved() or ["No person was asked to approve a step."])])

    def _approved(self) -> list[str]:
        """Sentences on what persons were asked; empty if they were not."""
        answers = list(self._effects("approval"))
        asked = {
            each.step
            for each in self._flight.records
            if isinstance(each, DecisionRecord) and each.kind == STEP and each.reason in _ASKS
        }
        parts = []
        for granted, what in ((True, "Granted by signature"), (False, "Refused by signature")):
            meant = (each for each in answers if self._collected.answers.get(each.seq) is granted)
            some = [f"{step_words(each.step)}{self._who(each)}" for each in meant]
            if some:
                parts.append(f"{what}: {_listed(some, '; ')}.")
        waiting = sorted(asked - {each.step for each in answers})
        if waiting:
            numbers = ", ".join(str(number_of(step)) for step in waiting)
            parts.append(f"A person was asked to approve step {numbers}, and nobody answered.")
        if answers and not parts:
            parts.append("The answers that were recorded make no sense.")
        return parts

    def _who(self, record: Effect) -> str:
        return f": {self._names.detail(record)}" if self._details else ""

    def _flew(self) -> str:
        steps = len(self._flight.mission.invocations)
        lasted = prose.duration(self._flight.lasted_us // 100_000 * 100_000)
        told = f"{len(self.done)} of {many(steps, 'step')} completed in {lasted}"
        if not any(self._effects("dispatched")):
            told = f"Nothing: no command was sent to the vehicle in {lasted}"
        if self._flight.telemetry is None and self._flight.names_telemetry:
            return f"{told}. The telemetry that the log names is missing, so its way is not known."
        if self._track is None and self._flight.telemetry is not None and self._flight.telemetry.track:
            return f"{told}. All positions in the telemetry are later than the last record of the log."
        if self._track is None:
            return f"{told}. There is no telemetry of its way."
        highest = max(each.above_home for each in self._track.points)
        text = f"{told}, up to {round(highest / 100) / 10} m above home"
        if self._track.places:
            far_mm = max(x * x + y * y for x, y in self._track.places) ** 0.5
            text += f" and {round(far_mm / 100) / 10} m from the declared home"
        return f"{text}, as the vehicle reported."

    def _ended(self) -> str:
        flight, cause = self._flight, self._collected.cause.cause
        told = _ENDINGS.get(self._ending, f"Ended early: {self._ending}.")
        if self._report is None:
            told += self._stopped()
        if cause is not None:
            record = flight.records[cause.seq]
            told += f" At {seconds(flight.since_begun(record))} {self._cause(record)}"
        after = [each for each in self._effects("dispatched") if cause is not None and each.seq > cause.seq]
        flown = [self._link(each) for each in after if each.kind != STEP]
        if flown:
            told += f" Then flew, from {seconds(flight.since_begun(after[0]))} on: {_listed(flown, ', then ')}."
        return told + self._came_down()

    def _link(self, record: Effect) -> str:
        """What a dispatched link flies."""
        what = self._names.text(record.kind, record.step, record.link) or self._names.detail(record)
        return f"`{what}`" if what and self._details else self._names.subject(record.kind, record.step, record.link)

    def _came_down(self) -> str:
        """Whether the vehicle was seen to land at the end."""
        told, motion = "", None
        for each in self._effects("dispatched", "succeeded", "landed", *_ALOFT):
            when = seconds(self._flight.since_begun(each))
            if each.event == "dispatched":
                told, motion = "", self._names.motion(each)
            elif each.event in _ALOFT:
                told = f" When it was last seen, at {when}, it had not landed."
            elif each.event == "landed" or motion in _DOWN:
                told = f" It landed at {when}, as it reported."
        return told

    def _stopped(self) -> str:
        """Whether the log of a flight under way still grows."""
        if self._collected.flaw:
            return f" Then the log breaks off: {self._collected.flaw}."
        last = self._flight.records[-1]
        silent_us = self._made_at_us - last.utc_us
        if self._ending != "flying" or silent_us < _SILENT_US:
            return ""
        return f" That was {silent_us // 1_000_000} s ago: whatever records the flight has stopped."

    def _cause(self, record: AnyRecord) -> str:
        """The cause of an early end, in a sentence."""
        if isinstance(record, DecisionRecord):
            return self._denied(record)
        if not isinstance(record, Effect):
            return f"the log says: {' '.join(self._names.tell(record).split())}."
        subject = self._names.subject(record.kind, record.step, record.link)
        detail = self._names.detail(record).rstrip(".") if self._details else ""
        clause, _, values = detail.rpartition(": ")
        if record.event == "violated" and clause:
            detail = f"`{clause}` decided, with {values}"
        elif record.event == "taken-over" and detail:
            detail = f"its flight mode became {detail}"
        return f"{subject or 'the flight'} {CAUSES.get(record.event, record.event)}{f': {detail}' if detail else ''}."

    def _denied(self, record: DecisionRecord) -> str:
        subject = self._names.subject(record.kind, record.step, record.link)
        views = self._collected.decision_views()
        view = next((each for each in views if each.seq <= record.seq and each.subject == subject
                     and each.reason == record.reason), None)  # fmt: skip
        told = f"{subject} was not allowed"
        if view is not None and view.meaning:
            told += f": {view.meaning[:1].lower()}{view.meaning[1:].rstrip('.')}"
        clause = "" if record.clause is None else f"`{' '.join(record.clause.split())}`"
        values = [f"{each.name} = {each.value}" for each in (() if view is None else view.reads) if clause]
        if clause:
            told += f" ({clause}{', with ' * bool(values)}{_listed(values, ', ')})"
        return f"{told}."

    def _intact(self) -> str:
        report = self._report
        if report is None:
            if self._ending == "flying":
                return "Not verified yet: the log is still being written."
            return "Not verified yet: the log is closed, but nobody verified it."
        if report.failure is not None:
            return f"No: record {report.failure.record} fails ({report.failure.slug}): {report.failure.text}."
        if report.verdict is LogVerdict.INCOMPLETE:
            short = "" if report.shortfall is None else f": {report.shortfall.text}"
            return f"As far as it goes: {many(report.records, 'record')} in order, but incomplete{short}."
        again = "every decision was computed again, with the same result"
        return f"Yes: {many(report.records, 'record')}, signed and closed; {again}."

    def _unproven(self) -> str:
        if self._report is None:
            return "Everything on this page: the log was not verified."
        told = [claim.text for claim in self._report.unproven]
        if not told:
            return "Nothing is left open."
        first = told[0].rstrip(".")
        more = f" And {many(len(told) - 1, 'other thing')}, listed below." if len(told) > 1 else ""
        return f"{first[:1].upper()}{first[1:]}.{more}"


#: effects after which the vehicle may still fly
_ALOFT: Final = ("not-landed", "stranded", "left")
#: motions that end on the ground
_DOWN: Final = frozenset({MotionKind.HOME, MotionKind.LAND})
#: reasons of decisions that wait for a person, or waited in vain
_ASKS: Final = frozenset({Reason.AWAITING_APPROVAL.value, Reason.APPROVAL_TIMED_OUT.value})


def _listed(texts: Sequence[str], between: str) -> str:
    more = f" and {len(texts) - _NAMED} more" if len(texts) > _NAMED else ""
    return between.join(texts[:_NAMED]) + more
