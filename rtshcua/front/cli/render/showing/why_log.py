"""`rtshcua why` on a log: a decision, or what happened, and what ended the flight, on a page."""

from pathlib import Path

from rtshcua.app.logged_decision import LoggedDecision, RecordLine, StepExplained, explained, read_decision
from rtshcua.app.telling import prose
from rtshcua.app.telling.people import People
from rtshcua.app.telling.record_prose import Names
from rtshcua.app.wording import utc
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.records import Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.showing.why import Case, show_why, truth_of
from rtshcua.ground.why.logged_decisions import LinkTrace, state_of
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.situation import State
from rtshcua.model.step_number import number_of, step_words

_MOST = 20  # number of records shown about the end of the flight


def from_log(page: TextPage, path: Path, number: int | None) -> dict[str, object] | Refusal:
    """Adds the record asked for to the page, and what ended the flight. Raises OSError."""
    people = People()

    def words(genesis: Genesis) -> Names:
        nonlocal people
        names = Names.of(genesis)
        people = names.people
        return names

    log = read_decision(path, number, words)
    if isinstance(log, Refusal):
        return log
    chosen = log.chosen
    assert chosen is not None
    cause = log.cause
    if cause is not None and cause.seq != chosen.seq:
        _list(page, "Cause of the early end", [cause], log.start_us)
        denied = isinstance(chosen, DecisionRecord) and chosen.outcome != "allow"
        page.head(f"Before that, the last decision on a step{' that was not `allow`' if denied else ''}")
    page.text(f"record {chosen.seq} of {path}, {utc(chosen.utc_us)} (not verified)", indent=0)
    shown = _decision(page, chosen, log, people) if isinstance(chosen, DecisionRecord) else _effect(page, chosen, log)
    if isinstance(shown, Refusal):
        return shown
    allowed = [] if log.allowed is None else [log.allowed]
    _list(page, "Later decision that allowed the same step", allowed, log.start_us)
    answers = [told for step, told in log.answers if isinstance(chosen, DecisionRecord) and step == chosen.step]
    _list(page, "Approvals and refusals of this step", answers, log.start_us)
    _list(page, "Stalls of the computer: no input, decision or command", log.stalls, log.start_us)
    _list(
        page,
        "End of the flight: causes of an early end, and later decisions",
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
    page: TextPage, chosen: DecisionRecord, log: LoggedDecision, people: People
) -> dict[str, object] | Refusal:
    subject = log.subject
    assert subject is not None
    found = explained(chosen, subject)
    if isinstance(found, Refusal):
        return found
    if isinstance(found, StepExplained):
        case = Case(found.invocation, found.state, found.context, found.now, subject.phases, log.aloft, people)
        return show_why(page, found.trace, case)
    return show_link(page, chosen, found.trace, found.of, subject.policy.policy)


def _effect(page: TextPage, chosen: Effect | Close | Recover | Seal, log: LoggedDecision) -> dict[str, object]:
    event = chosen.event if isinstance(chosen, Effect) else chosen.type
    detail = chosen.detail if isinstance(chosen, Effect) else chosen.ending if isinstance(chosen, Close) else ""
    page.head(f"{event}: an event, not a decision")
    page.row("text", log.what.strip())
    return {"kind": "why", "event": event, "detail": detail}


def _list(page: TextPage, title: str, told: list[RecordLine], start_us: int) -> None:
    if not told:
        return
    page.head(title)
    for each in told:
        page.text(f"{each.seq:>5} {(each.at_us - start_us) / 1_000_000:>10.3f} s  {each.what}")


def show_link(
    page: TextPage, record: DecisionRecord, found: LinkTrace, of: PreparedInvocation | None, policy: Policy
) -> dict[str, object]:
    """Adds a decision on a link to the page, and gives it for a program."""
    whose = (
        "the contingency" if of is None else f"the fallback of {step_words(record.step)}, {of.invocation.contract.name}"
    )
    if found.rule is not None:
        whose = f"the degrade rule `{' '.join(found.rule.text.split())}`"
    page.head(f"{found.link.link.text}, of {whose}: {record.outcome}, {record.reason}")
    page.row("flies", prose.link(policy, found.link.link))
    page.row("asked for", "its skill's `require`, and that it does not lead further out of the airspace")
    for check in found.checks:
        text = "" if check.clause is None else " ".join(check.clause.text.split())
        page.row(check.role, f"{truth_of(check)}: `{text}`", indent=5, width=10)
    page.row("may fly", "yes" if found.admissible else "no")
    page.head("The chain, in order")
    for link in found.chain:
        page.row("may fly" if link.admissible else "may not", link.text)
    page.head("The state, as recorded")
    state = state_of(record)
    signals = [(signal.name, _reading(policy, signal, state)) for signal in policy.signals]
    width = max((len(name) for name, _ in signals), default=0)
    for name, reading in signals:
        page.row(name, reading, width=width)
    return {
        "kind": "why",
        "step": record.step,
        "step_number": None if of is None else number_of(record.step),
        "link": record.link,
        "of": whose,
        "text": found.link.link.text,
        "outcome": record.outcome,
        "reason": record.reason,
        "admissible": found.admissible,
        "checks": [{"clause": "" if c.clause is None else c.clause.text, "truth": truth_of(c)} for c in found.checks],
        "chain": [link._asdict() for link in found.chain],
        "state": dict(signals),
    }


def _reading(policy: Policy, signal: Signal, state: State) -> str:
    width = 2 if signal.kind == POSITION else 1
    values = [value for value in state.values[signal.slot : signal.slot + width] if value is not None]
    age_us = max(state.ages[signal.slot : signal.slot + width])
    stale = f", {prose.duration(age_us)} old: stale" if age_us > signal.stale_us else ""
    if len(values) < width:
        return "unknown"
    if signal.kind == POSITION:
        return prose.place(policy, values[0], values[1]) + stale
    if signal.kind == ENUMERATION:
        return dict(signal.labels).get(values[0], str(values[0])) + stale
    return prose.quantity(values[0], signal.dimension) + stale
