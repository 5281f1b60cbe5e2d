"""`rtshcua why` on a log: explain one decision on a step or fallback from its recorded inputs, and the flight's end.

Without a record number: the cause of an early end, then the last decision on a step that was not `allow`, or else the
last decision on a step.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.app.prepared_mission import Subject, after, unpacked
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.gaps import STALLED
from rtshcua.evidence.note import octets
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.ground.why.logged_decisions import LinkTrace, context_of, now_of, of_contingency, state_of, trace_link
from rtshcua.ground.why.trace import Trace, trace
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Reason
from rtshcua.onboard.runtime.link import STOOD_STILL
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import STEP

#: effects that abort a mission or end a flight
_TURNS = frozenset({
    "violated", "failed", "taken-over", "interrupted", "recall", "cancellation", "gap", "link-lost", "long-silence",
    "crashed", "stranded", "not-landed", "resumed", "already-airborne", "left", "refused", "undecided", "stood-down",
    "boundary-lost", STOOD_STILL,
})  # fmt: skip
#: those of them that only follow from a cause
_FOLLOWS = frozenset({"stood-down", "not-landed", "stranded", "left", "resumed", "already-airborne"})
#: effects that end earlier ones
_OVER = {"link-back": ("link-lost", "long-silence"), "gap-over": ("gap",), "fresh": (STOOD_STILL,)}
#: effects that report a stalled computer
_STALLS = (STOOD_STILL, STALLED)
#: how violated conditions and decisions report unknown inputs
_UNKNOWN, _FOR_UNKNOWN = ": unknown for longer than its grace", ("state/unknown", "safety/unknown")
_NO_SLACK = Reason.NO_SLACK.value


class RecordWords(Protocol):
    """Tells the records of a log in words."""

    def follow(self, record: AnyRecord) -> None:
        """Takes the next record: after a replacement the steps have other words."""

    def tell(self, record: AnyRecord) -> str:
        """A record as one line of text."""


class StepExplained(NamedTuple):
    """A decision on a step: its inputs, and the trace of it."""

    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now
    trace: Trace


class LinkExplained(NamedTuple):
    """A decision on a link, of the fallback of a step, or of the contingency."""

    trace: LinkTrace
    of: PreparedInvocation | None


class RecordLine(NamedTuple):
    """A record as one line of text."""

    seq: int
    at_us: int
    what: str


class LoggedDecision:
    """The parts of a log that an explanation needs, read once; `number`: the requested record; `subject` gives the
    mission of the bundle, if somebody has prepared it already.
    """

    def __init__(
        self, path: Path, number: int | None, words: Callable[[Genesis], RecordWords],
        subject: Callable[[Genesis], Subject | Refusal] | None = None,
    ) -> None:  # fmt: skip
        self._subject_of = subject or self._unpacked
        self.start_us = 0
        self.chosen: DecisionRecord | Effect | Close | Recover | Seal | None = None
        self.what = ""  # that record as one line
        self.subject: Subject | None = None  # the mission in force when the chosen record was written
        self.aloft = False  # a command before the chosen record may have started a take-off
        self.ended: list[RecordLine] = []
        self.answers: list[tuple[int, RecordLine]] = []  # approvals, by their step
        self.allowed: RecordLine | None = None  # a later decision that allowed the same step
        self.stalls: list[RecordLine] = []  # when the computer stalled
        self.cause: RecordLine | None = None  # the cause of an early end
        self._caused_by = ""  # the event of the cause
        self._falls = False  # a fallback flies: later records are not the cause
        self._late = False  # a late permit is the cause unless another one is found
        self._path, self._number, self._words_of = path, number, words
        self._words: RecordWords | None = None
        self._in_force: Subject | None = None
        self._flown = False

    @property
    def in_force(self) -> Subject | None:
        """The mission in force after the last record; None before the first one."""
        return self._in_force

    @property
    def begun(self) -> bool:
        """Whether the first record could be read."""
        return self._in_force is not None

    def read(self) -> Refusal | None:
        """Read all of it; a refusal where it makes no sense."""
        with open_regular(self._path) as opened:
            for line in lines(opened):
                record = read(line)
                if isinstance(record, Flaw):
                    break
                refused = self.take(record)
                if refused is not None:
                    return refused
        return None

    def take(self, record: AnyRecord) -> Refusal | None:
        """Take the next record of the log; a refusal where it makes no sense."""
        if isinstance(record, Genesis):
            found = self._subject_of(record)
            if isinstance(found, Refusal):
                return found
            self.start_us, self._in_force, self._words = record.at_us, found, self._words_of(record)
            return None
        if self._words is not None:
            self._words.follow(record)
        self._choose(record)
        self._find_cause(record)
        if isinstance(record, Effect) and record.event in _STALLS:
            self.stalls.append(self._tell(record))
        if isinstance(record, Seal):
            return None
        if isinstance(record, Effect):
            self._flown = (self._flown or record.event == "dispatched") and record.event != "landed"
        if isinstance(record, DecisionRecord):
            if record.kind != STEP:
                self.ended.append(self._tell(record))
        elif isinstance(record, Close | Recover):
            self.ended.append(self._tell(record))
        elif record.event == "approval":
            self.answers.append((record.step, self._tell(record)))
        elif record.event in _TURNS:
            self.ended.append(self._tell(record))
        elif record.event == "replacement" and self._in_force is not None:
            newer = after(self._in_force, record.detail)
            if isinstance(newer, Refusal):
                return newer
            self._in_force = newer
        return None

    def _unpacked(self, genesis: Genesis) -> Subject | Refusal:
        return unpacked(octets(genesis.bundle) or b"", f"the bundle in `{self._path}`")

    def _find_cause(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> None:
        """Find the last event that aborted the mission, before a fallback flew.

        A step admitted later shows that the mission continued. Unknown inputs after a stall count as caused by it.
        """
        if self._caused_by == STOOD_STILL and _for_unknown(record):
            return
        if isinstance(record, DecisionRecord):
            self._falls = record.kind != STEP  # a link may fly while a step waits, and then the step is decided again
            if record.kind != STEP:
                return
            if record.outcome == "allow":
                self.cause, self._caused_by, self._late = None, "", False
            elif record.outcome != "defer" and not (self._late and record.reason == _NO_SLACK):
                self.cause, self._caused_by = self._tell(record), "decision"
        elif isinstance(record, Effect) and not self._falls:
            if record.event == "refused" and record.detail == WITHDRAWN:
                self._late = True  # the step's time may be over by now; the cause is in an earlier record
            elif record.event in _TURNS - _FOLLOWS:
                self.cause, self._caused_by = self._tell(record), record.event
            elif self._caused_by in _OVER.get(record.event, ()):
                self.cause, self._caused_by = None, ""
        elif isinstance(record, Close) and record.ending == "completed":
            self.cause = None

    def _tell(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> RecordLine:
        return RecordLine(record.seq, record.at_us, "" if self._words is None else self._words.tell(record))

    def _choose(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> None:
        if self._number is not None:
            if record.seq == self._number:
                self._hold(record)
            return
        if not isinstance(record, DecisionRecord) or record.kind != STEP:
            return
        held = self.chosen
        if not isinstance(held, DecisionRecord) or held.outcome == "allow" or record.outcome != "allow":
            self._hold(record)
        elif held.step == record.step:
            self.allowed = self._tell(record)

    def _hold(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> None:
        self.chosen, self.subject, self.aloft = record, self._in_force, self._flown
        self.what, self.allowed = self._tell(record).what, None


def _for_unknown(record: DecisionRecord | Effect | Close | Recover | Seal) -> bool:
    """Return whether a record reports a failure because of unknown inputs."""
    if isinstance(record, DecisionRecord):
        return record.kind == STEP and record.reason in _FOR_UNKNOWN
    return isinstance(record, Effect) and record.event == "violated" and _UNKNOWN in record.detail


def read_decision(path: Path, number: int | None, words: Callable[[Genesis], RecordWords]) -> LoggedDecision | Refusal:
    """The record of this number; without one the last decision on a step that was not `allow`, else the last on a step.

    `words` makes what tells records in one line. Raises OSError.
    """
    log = LoggedDecision(path, number, words)
    refused = log.read()
    if refused is not None:
        return refused
    if not log.begun:
        return Refusal("genesis/missing", f"`{path}`: {CUT_AT_FIRST}", "", ExitCode.EVIDENCE)
    if log.chosen is None or log.subject is None:
        what = "no decision on a step" if number is None else f"no explainable record {number}"
        return Refusal("input", f"`{path}` has {what}", "run `rtshcua show` for the records and their numbers")
    if number is not None:
        log.cause = None
    return log


def explained(chosen: DecisionRecord, subject: Subject) -> StepExplained | LinkExplained | Refusal:
    """A recorded decision, derived again from the inputs in its record."""
    state = state_of(chosen)
    if len(state.values) != subject.policy.policy.slots or len(state.ages) != len(state.values):
        return Refusal("input", f"the state in record {chosen.seq} does not match the policy")
    there = 0 <= chosen.step < len(subject.invocations)
    if chosen.kind == STEP and there:
        invocation, context, now = subject.invocations[chosen.step], context_of(chosen), now_of(chosen)
        return StepExplained(invocation, state, context, now, trace(invocation, state, subject.policy, context, now))
    if chosen.kind != STEP and (there or of_contingency(chosen)):
        of = None if of_contingency(chosen) else subject.invocations[chosen.step]
        found = trace_link(chosen, of, subject.policy)
        if found is not None:
            return LinkExplained(found, of)
    return Refusal("input", f"record {chosen.seq} decides on a step or fallback that is not in the bundle")
