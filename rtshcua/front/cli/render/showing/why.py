"""A trace on a page: each step of the decision, what it looked at, what decided, and what would have passed."""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.app.prepared_mission import Subject
from rtshcua.app.telling import prose
from rtshcua.app.telling.people import NOBODY, People
from rtshcua.app.why import AssumedCase, decide_assumed
from rtshcua.app.wording import utc
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.ground.why.trace import ConditionCheck, ReadValue, Trace, TracedStep, read_values
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.model.step_number import number_of
from rtshcua.onboard.calls import is_own

_TRUTHS: Mapping[int, str] = {TRUE: "true", FALSE: "false", UNKNOWN: "unknown"}
#: the roles of checks that pass when they are not true
_AGAINST = frozenset({"forbid", "confirm", "degrade"})


class Case(NamedTuple):
    """What was decided on."""

    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now
    phases: tuple[str, ...]
    aloft: bool | None = None  # whether something had been sent that may have lifted it off; None: not known
    people: People = NOBODY


def show_assumed(page: TextPage, subject: Subject, assumed: AssumedCase) -> dict[str, object] | Refusal:
    """Adds the decision on an assumed state to the page, with what was assumed."""
    found = decide_assumed(subject, assumed)
    if isinstance(found, Refusal):
        return found
    shown = show_why(page, found.trace, Case(found.invocation, found.state, found.context, found.now, subject.phases))
    page.head("Assumed")
    page.row(
        "state",
        "the contract's conditions hold for long enough; the vehicle is at its planned position; --state overrides",
    )
    page.row("time", f"{utc(found.now.utc_us)}, {assumed.waited_ms} ms after the release")
    if found.roles:
        page.row("approvals", f"{' and '.join(found.roles)}, when the step was released")
    return shown


def show_why(page: TextPage, trace: Trace, case: Case) -> dict[str, object]:
    """Add a trace to the page, and return it as JSON."""
    invocation = case.invocation
    policy, flat = invocation.policy.policy, invocation.invocation
    decision = trace.decision
    page.head(f"{_subject(policy, invocation)}: {decision.outcome.name.lower()}, {decision.reason.value}")
    if decision.clause is not None:
        page.row("because", prose.quoted(policy, flat, decision.clause))
        page.row("written", f"{_place(policy, decision.clause)}")
    if decision.outcome is Outcome.FALLBACK:
        page.row("flies", _flies(decision.target, case.aloft))
    for nearest in trace.nearest:
        page.row("would pass", prose.would_pass(nearest))
    page.head("Step by step")
    steps = [_step(page, step, case, decision.clause) for step in trace.steps]
    if trace.chain and decision.outcome is Outcome.FALLBACK:
        page.head("The chain, in order")
        for link in trace.chain:
            page.row("may fly" if link.admissible else "may not", link.text)
    return {
        "kind": "why",
        "step": flat.step,
        "step_number": number_of(flat.step),
        "skill": flat.contract.name,
        "outcome": decision.outcome.name.lower(),
        "reason": decision.reason.value,
        "clause": None if decision.clause is None else _text(decision.clause),
        "own": is_own(policy, flat, decision.clause),
        "written": None if decision.clause is None else _place(policy, decision.clause),
        "target": None if decision.target is None else decision.target.text,
        "aloft": case.aloft,
        "would_pass": [
            {
                "subject": each.subject,
                "value": each.value,
                "words": prose.nearest_value(each),
                "choices": list(each.choices),
            }
            for each in trace.nearest
        ],
        "steps": steps,
        "chain": [link._asdict() for link in trace.chain],
    }


def _flies(target: Link | None, aloft: bool | None) -> str:
    if aloft is False:
        return "nothing: the vehicle was on the ground, and nothing was sent"
    if target is None:
        return "nothing: no link may fly now"
    return target.text if aloft else f"{target.text}, in the air; on the ground nothing is sent"


def _subject(policy: Policy, invocation: PreparedInvocation) -> str:
    flat = invocation.invocation
    arguments = prose.arguments(policy, flat.contract.parameters, flat.arguments)
    return f"Step {number_of(flat.step)}, {flat.contract.name}({arguments})"


def _step(page: TextPage, step: TracedStep, case: Case, decisive: Decisive) -> dict[str, object]:
    invocation, state = case.invocation, case.state
    verdict = {True: "passes", False: "decides", None: "not reached"}[step.passed]
    fact = "" if step.passed is None else _fact(step.number, case)
    page.row(f"{step.number:<2} {step.name}", f"{verdict}{': ' * bool(fact)}{fact}", width=16)
    checks: list[dict[str, object]] = []
    for check in step.checks:
        read = read_values(
            check.clause,
            invocation.policy.policy,
            invocation.invocation.contract,
            invocation.invocation.arguments,
            state,
        )
        mark = ">" if check.clause is decisive and decisive is not None else " "
        text = "the charge to finish and to come home" if check.clause is None else _text(check.clause)
        values = ", ".join(_read(invocation, each) for each in read)
        told = prose.quoted(invocation.policy.policy, invocation.invocation, check.clause) or f"`{text}`"
        words_of = f"{truth_of(check)}: {told}" + (f"   with {values}" if values else "")
        page.row(f"{mark} {check.role}", words_of, indent=5, width=10)
        checks.append({"role": check.role, "clause": text, "truth": truth_of(check), "reads": _for_program(read)})
    return {"number": step.number, "name": step.name, "verdict": verdict, "fact": fact, "checks": checks}


def _fact(number: str, case: Case) -> str:
    """What a step read that is no clause."""
    flat, policy, context, now = case.invocation.invocation, case.invocation.policy.policy, case.context, case.now
    contract = flat.contract
    match number:
        case "1":
            return f"vehicle `{context.vehicle}`, {policy.name}@{context.policy_version}, the binding, every argument"
        case "2":
            used = "used before" if context.consumed else "not used before"
            end = utc(flat.issued_at_us + contract.validity_us)
            return f"issued {utc(flat.issued_at_us)}, valid until {end}, now {utc(now.utc_us)}; {used}"
        case "3":
            return f"role {policy.roles[flat.role]} through {prose.source(flat.source)}"
        case "3b":
            return "; ".join(dict.fromkeys(_answer(policy, each, now, case.people) for each in context.approvals))
        case "4":
            during = ", ".join(name for at, name in enumerate(case.phases) if flat.phases >> at & 1)
            current = case.phases[context.phase] if 0 <= context.phase < len(case.phases) else "none yet"
            return f"in phase {current}, and the step is valid in: {during}"
        case "5":
            waited = _milliseconds(max(now.monotonic_us - context.released_us, 0))
            return (
                f"released {waited} ago, deadline {prose.duration(contract.deadline_us)}, "
                f"sent at most {_milliseconds(context.remaining_us)} from now"
            )
        case _:
            return ""


def _milliseconds(us: int) -> str:
    """A measured time, rounded up to what a person can use."""
    return prose.duration(-(-us // 1_000) * 1_000) if us else "0 ms"


def _answer(policy: Policy, given: ConfirmAnswer, now: Now, people: People) -> str:
    """Who answered, what, and when."""
    role = policy.roles[given.role] if 0 <= given.role < len(policy.roles) else f"role {given.role}"
    ago_us = max(now.monotonic_us - given.monotonic_us, 0)
    said = "granted" if given.granted else "refused"
    by = people.by_number.get(given.person)
    return f"{said} as {role}{f' by {by}' if by else ''}, {utc(now.utc_us - ago_us)}, {ago_us / 1_000_000:.1f} s before"


def truth_of(check: ConditionCheck) -> str:
    """A check's truth in a word: rules that count against a step match, or do not."""
    word = _TRUTHS.get(check.truth, "unknown")
    if check.role in _AGAINST:
        return {"true": "matches", "false": "does not match"}.get(word, word)
    return word


def _text(clause: Decisive) -> str:
    return "" if clause is None else " ".join(clause.text.split())


def _place(policy: Policy, clause: Decisive) -> str:
    """The file that a clause stands in; a mission's own clauses count on from the policy's files."""
    if clause is None or not 0 <= clause.source < len(policy.sources):
        return "in the mission"
    return f"in {policy.sources[clause.source]}, from character {clause.start}"


def _read(invocation: PreparedInvocation, read: ReadValue) -> str:
    policy = invocation.policy.policy
    if read.signal is None:
        contract = invocation.invocation.contract
        named = [parameter for parameter in contract.parameters if parameter.name == read.name]
        return prose.arguments(policy, named, invocation.invocation.arguments)
    return f"{read.name} = {prose.read_value(policy, read)}"


def _for_program(read: list[ReadValue]) -> list[dict[str, object]]:
    return [{"name": each.name, "values": list(each.values), "stale": each.stale} for each in read]
