"""Decides a case, and compares the decision with what was expected. Pure; only `decide` decides."""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.nearest import Nearest
from rtshcua.decision.values import TRUE
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.testing.case import PolicyCase
from rtshcua.ground.why.trace import Trace, read_values, trace
from rtshcua.model.decision import Decision
from rtshcua.model.flat.policy import Rule
from rtshcua.model.ir.tests import Expectation
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.model.quantity import Dimension, display

_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}
_MINUTE = 60_000_000  # us
#: how many permits a finding points at
MAX_PERMITS = 3


class CaseResult(NamedTuple):
    """A case, the way to its decision, what was expected, and whether it was met; where not, `finding` (E1411).

    `took_us`: how long that took, where somebody measured it.
    """

    case: PolicyCase
    trace: Trace
    expected: Expectation
    met: bool
    finding: Diagnostic | None
    took_us: int | None = None


def run_case(case: PolicyCase) -> CaseResult:
    """The case, decided. The finding underlines the expectation, and points at what decided."""
    found = trace(case.invocation, case.state, case.policy.prepared, case.context, case.now)
    wrong = list(_unmet(case, found.decision))
    return CaseResult(case, found, case.expected, not wrong, _finding(case, found, wrong) if wrong else None)


def decision_words(case: PolicyCase, decision: Decision) -> str:
    """A decision in the words of `expect`."""
    words = [decision.outcome.name.lower()]
    if decision.target is not None:
        words.append(case.policy.lowered.policy.contracts[decision.target.skill].name)
    return " ".join(words) + f" because {decision.reason.value}"


def _unmet(case: PolicyCase, decision: Decision) -> Iterator[str]:
    """What of the expectation is not so: the outcome alone, or else every part that is."""
    expected = case.expected
    outcome = decision.outcome.name.lower()
    if expected.outcome != outcome:
        yield f"`{expected.outcome}` is expected, and the decision is `{decision_words(case, decision)}`"
        return
    if expected.target is not None:
        flies = None if decision.target is None else case.policy.lowered.policy.contracts[decision.target.skill].name
        if flies != expected.target.text:
            what = "nothing may fly" if flies is None else f"`{flies}` flies"
            yield f"`{expected.target.text}` is expected to fly, and {what}"
    if expected.reason is not None and expected.reason.text != decision.reason.value:
        yield f"the reason `{expected.reason.text}` is expected, and it is `{decision.reason.value}`"
    if expected.clause is not None and decision.clause not in case.quoted:
        by = "no clause" if decision.clause is None else f"`{decision.clause.text}`"
        yield f"`{expected.clause.text}` is expected to decide, and {by} does"


def _finding(case: PolicyCase, found: Trace, wrong: list[str]) -> Diagnostic:
    decision = found.decision
    labels = []
    if decision.clause is not None:
        labels.append(Label(case.policy.span(decision.clause), f"this decided: `{decision_words(case, decision)}`"))
    elif decision.outcome is not Outcome.ALLOW:
        number, name = next((each.number, each.name) for each in found.steps if each.passed is False)
        assert case.test.request is not None
        labels.append(
            Label(case.test.request.span, f"step {number}, {name}, decided: no clause, but the request itself")
        )
    if decision.outcome is Outcome.ALLOW or (case.expected.outcome == "deny" and decision.outcome is not Outcome.DENY):
        labels += [Label(case.policy.span(each), "this permit allowed it") for each in _shown_permits(found, met=True)]
    elif decision.reason is Reason.OUT_OF_SCOPE:
        others = [each for each in _shown_permits(found, met=False) if each is not decision.clause]
        labels += [Label(case.policy.span(each), "this permit does not allow it either") for each in others]
    return Diagnostic(codes.NOT_MET, "; ".join(wrong), case.expected.span, _result_help(case, found), tuple(labels))


def _shown_permits(found: Trace, *, met: bool) -> list[Rule]:
    """The permits about the request that are true, or that are not; the first ones."""
    checks = (check for step in found.steps for check in step.checks if check.role == "permit")
    every = [each.clause for each in checks if isinstance(each.clause, Rule) and (each.truth == TRUE) is met]
    return every[:MAX_PERMITS]


def _result_help(case: PolicyCase, found: Trace) -> str | None:
    """What would have passed, or what is unknown, where the decision was a refusal; of an `allow`, what allowed it, and
    that nothing stood against it.
    """
    decision = found.decision
    if found.nearest:
        return "it would have passed with " + " and ".join(map(_would_pass, found.nearest))
    if decision.outcome is Outcome.ALLOW:
        nothing = f"no rule and no clause stands against it: a `{case.expected.outcome}` needs one that does"
        allowing = _shown_permits(found, met=True)
        if case.expected.outcome != "deny" or not allowing:
            return nothing
        return f"`{allowing[0].text}` allows it, and {nothing}, or a narrower `permit`"
    flat = case.invocation.invocation
    read = read_values(decision.clause, case.policy.prepared.policy, flat.contract, flat.arguments, case.state)
    stale = [f"`{each.name}` is stale" for each in read if each.stale and None not in each.values]
    missing = [f"`{each.name}` is unknown" for each in read if None in each.values]
    return ", ".join((*missing, *stale)) or None


def _would_pass(nearest: Nearest) -> str:
    if nearest.choices:
        return f"`{nearest.subject}` " + " or ".join(f"`{name}`" for name in nearest.choices)
    dimension = _DIMENSIONS.get(nearest.dimension)
    if nearest.dimension == "daytime":
        hours, minutes = divmod(nearest.value // _MINUTE, 60)
        return f"`{nearest.subject}` at {hours:02}:{minutes:02}"
    value = str(nearest.value) if dimension is None else display(nearest.value, dimension)
    return f"`{nearest.subject} = {value}`"
