"""`rtshcua why` on a log: one decision on a step or a link, from the inputs that it records, and what ended the flight.

Without a number it begins with the cause, where the flight ended early, and goes on with the last decision on a step
that was not `allow`, else the last on a step.
"""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.app.wording import utc
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.gaps import STALLED
from rtshcua.evidence.note import octets
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.render.showing.link import show_link
from rtshcua.front.cli.render.showing.log import Names
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.showing.people import People
from rtshcua.front.cli.render.showing.why import Case, show_why
from rtshcua.front.cli.subject import Subject, after, unpacked
from rtshcua.ground.why.logged_decisions import context_of, now_of, of_contingency, state_of, trace_link
from rtshcua.ground.why.trace import trace
from rtshcua.model.outcome import Reason
from rtshcua.onboard.runtime.link import STOOD_STILL
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import STEP

#: effects that turn a flight homeward, or end it
_TURNS = frozenset({
    "violated", "failed", "taken-over", "interrupted", "recall", "cancellation", "gap", "link-lost", "long-silence",
    "crashed", "stranded", "not-landed", "resumed", "already-airborne", "left", "refused", "undecided", "stood-down",
    "boundary-lost", STOOD_STILL,
})  # fmt: skip
#: of these, what only says how it went on after the cause
_FOLLOWS = frozenset({"stood-down", "not-landed", "stranded", "left", "resumed", "already-airborne"})
#: what is over when something else is recorded
_OVER = {"link-back": ("link-lost", "long-silence"), "gap-over": ("gap",), "fresh": (STOOD_STILL,)}
#: what says that the computer stood still
_STALLS = (STOOD_STILL, STALLED)
#: how a condition and a decision say that they failed for want of what is known
_UNKNOWN, _FOR_UNKNOWN = ": unknown for longer than its grace", ("state/unknown", "safety/unknown")
_NO_SLACK = Reason.NO_SLACK.value
_MOST = 20  # what is told of how it ended, in records


class _Told(NamedTuple):
    """A record in one line."""

    seq: int
    at_us: int
    what: str


class _Log:
    """What a log holds that an explanation needs, read once; `number` is the record that is asked for."""

    def __init__(self, path: Path, number: int | None) -> None:
        self.start_us = 0
        self.chosen: DecisionRecord | Effect | Close | Recover | Seal | None = None
        self.what = ""  # that record in one line
        self.subject: Subject | None = None  # the mission in force when the chosen record was written
        self.aloft = False  # something was sent before the chosen record that may have lifted it off
        self.ended: list[_Told] = []
        self.answers: list[tuple[int, _Told]] = []  # approvals, by their step
        self.allowed: _Told | None = None  # the same step, after the chosen record did not allow it
        self.stalls: list[_Told] = []  # when the computer stood still
        self.cause: _Told | None = None  # why it ended early, if it did
        self._caused_by = ""  # the event of that
        self._falls = False  # a link flies: what comes now is no cause any more
        self._late = False  # what came too late was the cause, as far as nothing else is
        self._path, self._number = path, number
        self._names = Names(None)
        self._in_force: Subject | None = None
        self._flown = False

    @property
    def begun(self) -> bool:
        """Whether its first record could be read."""
        return self._in_force is not None

    @property
    def people(self) -> People:
        """Who may have signed what it holds."""
        return self._names.people

    def read(self) -> ExitCode | None:
        """Read all of it; an exit code where it makes no sense, which was told."""
        with open_regular(self._path) as opened:
            for line in lines(opened):
                record = read(line)
                if isinstance(record, Flaw):
                    break
                refused = self._take(record)
                if refused is not None:
                    return refused
        return None

    def _take(self, record: AnyRecord) -> ExitCode | None:
        if isinstance(record, Genesis):
            found = unpacked(octets(record.bundle) or b"", f"the bundle in `{self._path}`")
            if isinstance(found, ExitCode):
                return found
            self.start_us, self._in_force, self._names = record.at_us, found, Names.of(record)
            return None
        self._names.follow(record)
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
            if isinstance(newer, ExitCode):
                return newer
            self._in_force = newer
        return None

    def _find_cause(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> None:
        """The last thing that turned the mission away from its steps, before a link flew: a step that is admitted
        later says that it went on all the same. What is not known because the computer stood still, that caused.
        """
        if self._caused_by == STOOD_STILL and _for_unknown(record):
            return
        if isinstance(record, DecisionRecord):
            if record.kind != STEP:
                self._falls = True
            elif record.outcome == "allow":
                self.cause, self._caused_by, self._falls, self._late = None, "", False, False
            elif record.outcome != "defer" and not self._falls and not (self._late and record.reason == _NO_SLACK):
                self.cause, self._caused_by = self._tell(record), "decision"
        elif isinstance(record, Effect) and not self._falls:
            if record.event == "refused" and record.detail == WITHDRAWN:
                self._late = True  # and its time may be over by now: why it came too late was told before
            elif record.event in _TURNS - _FOLLOWS:
                self.cause, self._caused_by = self._tell(record), record.event
            elif self._caused_by in _OVER.get(record.event, ()):
                self.cause, self._caused_by = None, ""
        elif isinstance(record, Close) and record.ending == "completed":
            self.cause = None

    def _tell(self, record: DecisionRecord | Effect | Close | Recover | Seal) -> _Told:
        return _Told(record.seq, record.at_us, self._names.tell(record))

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
        self.what, self.allowed = self._names.tell(record), None


def _for_unknown(record: DecisionRecord | Effect | Close | Recover | Seal) -> bool:
    """Whether it says that something failed for want of what is known."""
    if isinstance(record, DecisionRecord):
        return record.kind == STEP and record.reason in _FOR_UNKNOWN
    return isinstance(record, Effect) and record.event == "violated" and _UNKNOWN in record.detail


def from_log(page: TextPage, path: Path, number: int | None) -> dict[str, object] | ExitCode:
    """Adds the record asked for to the page, and what ended the flight."""
    log = _Log(path, number)
    refused = log.read()
    if refused is not None:
        return refused
    if not log.begun:
        return fail(ExitCode.EVIDENCE, f"`{path}`: {CUT_AT_FIRST}", slug="genesis/missing")
    chosen, subject = log.chosen, log.subject
    if chosen is None or subject is None:
        what = "no decision on a step" if number is None else f"no record {number} that can be explained"
        return fail(ExitCode.INPUT, f"`{path}` has {what}", "`rtshcua show` lists the records with their numbers")
    cause = log.cause if number is None else None
    if cause is not None and cause.seq != chosen.seq:
        _list(page, "The cause: why it ended early", [cause], log.start_us)
        denied = isinstance(chosen, DecisionRecord) and chosen.outcome != "allow"
        page.head(f"Before that, the last decision on a step{' that was not `allow`' if denied else ''}")
    page.text(f"record {chosen.seq} of {path}, {utc(chosen.utc_us)} (not verified)", indent=0)
    if isinstance(chosen, DecisionRecord):
        shown = _decision(page, chosen, subject, log.aloft, log.people)
    else:
        shown = _effect(page, chosen, log)
    if isinstance(shown, ExitCode):
        return shown
    allowed = [] if log.allowed is None else [log.allowed]
    _list(page, "After it, the same step was allowed", allowed, log.start_us)
    answers = [told for step, told in log.answers if isinstance(chosen, DecisionRecord) and step == chosen.step]
    _list(page, "What was answered about this step", answers, log.start_us)
    _list(page, "When the computer stood still: nothing was read, judged or sent", log.stalls, log.start_us)
    _list(
        page,
        "How it ended: what ended the mission early, if anything, and the decisions after it",
        log.ended[-_MOST:],
        log.start_us,
    )
    return shown | {
        "record": chosen.seq,
        "cause": None if cause is None else cause._asdict(),
        "allowed": None if log.allowed is None else log.allowed._asdict(),
        "answers": [told._asdict() for told in answers],
        "stalls": [told._asdict() for told in log.stalls],
        "ended": [told._asdict() for told in log.ended],
    }


def _decision(
    page: TextPage, chosen: DecisionRecord, subject: Subject, aloft: bool, people: People
) -> dict[str, object] | ExitCode:
    state = state_of(chosen)
    if len(state.values) != subject.policy.policy.slots or len(state.ages) != len(state.values):
        return fail(ExitCode.INPUT, f"record {chosen.seq} has a state of another policy")
    there = 0 <= chosen.step < len(subject.invocations)
    if chosen.kind == STEP and there:
        invocation = subject.invocations[chosen.step]
        case = Case(invocation, state, context_of(chosen), now_of(chosen), subject.phases, aloft, people)
        return show_why(page, trace(invocation, state, subject.policy, case.context, case.now), case)
    if chosen.kind != STEP and (there or of_contingency(chosen)):
        of = None if of_contingency(chosen) else subject.invocations[chosen.step]
        found = trace_link(chosen, of, subject.policy)
        if found is not None:
            return show_link(page, chosen, found, of, subject.policy.policy)
    return fail(ExitCode.INPUT, f"record {chosen.seq} decides on a step or link that the bundle does not have")


def _effect(page: TextPage, chosen: Effect | Close | Recover | Seal, log: _Log) -> dict[str, object]:
    event = chosen.event if isinstance(chosen, Effect) else chosen.type
    detail = chosen.detail if isinstance(chosen, Effect) else chosen.ending if isinstance(chosen, Close) else ""
    page.head(f"{event}: something that happened, not a decision")
    page.row("says", log.what.strip())
    return {"kind": "why", "event": event, "detail": detail}


def _list(page: TextPage, title: str, told: list[_Told], start_us: int) -> None:
    if not told:
        return
    page.head(title)
    for each in told:
        page.text(f"{each.seq:>5} {(each.at_us - start_us) / 1_000_000:>10.3f} s  {each.what}")
