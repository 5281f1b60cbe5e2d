"""A decision on a link on a page: what it needed, what else might have flown, and the state that was recorded."""

from rtshcua.app.telling import prose
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.evidence.records import DecisionRecord
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.showing.why import truth_of
from rtshcua.ground.why.logged_decisions import LinkTrace, state_of
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.situation import State
from rtshcua.model.step_number import number_of, step_words


def show_link(
    page: TextPage, record: DecisionRecord, found: LinkTrace, of: PreparedInvocation | None, policy: Policy
) -> dict[str, object]:
    """Add a decision on a fallback to the page, and return it as JSON."""
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
