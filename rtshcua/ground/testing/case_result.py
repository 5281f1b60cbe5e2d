"""Decides a case with `decide`, and compares the decision with the expectation. Pure."""

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
#: the most permits that a finding labels
MAX_PERMITS = 3


class CaseResult(NamedTuple):
    """The result of a case: the trace of its decision, the expectation, whether it was met, and else a `finding`.

    `took_us` is the time that it took, if measured.
    """

    case: PolicyCase
    trace: Trace
    expected: Expectation
    met: bool
    finding: Diagnostic | None
    took_us: int | None = None


def run_case(case: PolicyCase) -> CaseResult:
    """Decide a case. The finding underlines the expectation and labels what decided."""
    found = trace(case.invocation, case.state, case.policy.prepared, case.context, case.now)
    wrong = list(_unmet(case, found.decision))
    return CaseResult(case, found, case.expected, not wrong, _finding(case, found, wrong) if wrong else None)


def decision_words(case: PolicyCase, decision: Decision) -> str:
    """Describe a decision in the syntax of `expect`."""
    words = [decision.outcome.name.lower()]
    if decision.target is not None:
        words.append(case.policy.lowered.policy.contracts[decision.target.skill].name)
    return " ".join(words) + f" because {decision.reason.value}"


def _unmet(case: PolicyCase, decision: Decision) -> Iterator[str]:
    """Yield the parts of the expectation that are not met: the outcome alone, or else every other part."""
    expected = case.expected
    outcome = decision.outcome.name.lower()
    if expected.outcome != outcome:
        yield f"expected `{expected.outcome}`; the decision is `{decision_words(case, decision)}`"
        return
    if expected.target is not None:
        flies = None if decision.target is None else case.policy.lowered.policy.contracts[decision.target.skill].name
        if flies != expected.target.text:
            what = "nothing may fly" if flies is None else f"`{flies}` flies"
            yield f"expected `{expected.target.text}` to fly; {what}"
    if expected.reason is not None and expected.reason.text != decision.reason.value:
        yield f"expected the reason `{expected.reason.text}`; it is `{decision.reason.value}`"
    if expected.clause is not None and decision.clause not in case.quoted:
        by = "no clause" if decision.clause is None else f"`{decision.clause.text}`"
        yield f"expected `{expected.clause.text}` to decide; {by} decided"


def _finding(case: PolicyCase, found: Trace, wrong: list[str]) -> Diagnostic:
    decision = found.decision
    labels = []
    if decision.clause is not None:
        labels.append(Label(case.policy.span(decision.clause), f"this decided: `{decision_words(case, decision)}`"))
    elif decision.outcome is not Outcome.ALLOW:
        number, name = next((each.number, each.name) for each in found.steps if each.passed is False)
        assert case.test.request is not None
        labels.append(
            Label(case.test.request.span, f"step {number}, {name}, decided by the request itself, not by a clause")
        )
    if decision.outcome is Outcome.ALLOW or (case.expected.outcome == "deny" and decision.outcome is not Outcome.DENY):
        labels += [Label(case.policy.span(each), "this permit allowed it") for each in _shown_permits(found, met=True)]
    elif decision.reason is Reason.OUT_OF_SCOPE:
        others = [each for each in _shown_permits(found, met=False) if each is not decision.clause]
        labels += [Label(case.policy.span(each), "this permit does not allow it either") for each in others]
    return Diagnostic(codes.NOT_MET, "; ".join(wrong), case.expected.span, _result_help(case, found), tuple(labels))


def _shown_permits(found: Trace, *, met: bool) -> list[Rule]:
    """The first permits about the request that are met, or that are not."""
    checks = (check for step in found.steps for check in step.checks if check.role == "permit")
    every = [each.clause for each in checks if isinstance(each.clause, Rule) and (each.truth == TRUE) is met]
    return every[:MAX_PERMITS]


def _result_help(case: PolicyCase, found: Trace) -> str | None:
    """Return the help: for a refusal the values that would have passed, or that are unknown; for an `allow` its
    cause.
    """
    decision = found.decision
    if found.nearest:
        return "it would have passed with " + " and ".join(map(_would_pass, found.nearest))
    if decision.outcome is Outcome.ALLOW:
        allowing = _shown_permits(found, met=True)
        if case.expected.outcome != "deny" or not allowing:
            return f"no rule and no clause prevents it: a `{case.expected.outcome}` needs one that does"
        return f"`{allowing[0].text}` allows it: make it narrower, or add a rule or clause that prevents the request"
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
