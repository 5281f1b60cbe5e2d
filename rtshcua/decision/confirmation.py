"""Step 3b: a `confirm` rule that matches, or may match, needs an approval by its role.

The approval moves the release (design 4.3). A refusal, or an approval that did not come within the rule's time after
the release, denies.
"""

from rtshcua.decision.case import Case
from rtshcua.decision.rules import PreparedRule
from rtshcua.decision.truth import FALSE
from rtshcua.decision.verdict import PASS, PASSED, Found, Verdict
from rtshcua.model.outcome import Outcome, Reason


def confirmation(case: Case) -> Found:
    """Denied when any rule's answer denies, else deferred when any is awaited."""
    verdicts: list[Verdict] = []
    doubt: Verdict | None = None
    passes = True
    for rule in case.invocation.candidates.confirms:
        truth = rule.condition(case.at)
        if truth == FALSE:
            continue
        certain = not truth & FALSE
        granted = _granted(rule, case)
        if granted is not None:
            earliest, latest = case.release
            case.release = (max(earliest, granted) if certain else earliest, max(latest, granted))
            continue
        denial, awaited = _unanswered(rule, case)
        if denial is not None:
            verdicts.append(denial)
            if certain and awaited is None:
                return tuple(verdicts)
        doubt = doubt or awaited
        passes = passes and not certain
    if doubt is not None:
        verdicts.append(doubt)
    if not passes:
        return tuple(verdicts)
    return (*verdicts, PASS) if verdicts else PASSED


def _granted(rule: PreparedRule, case: Case) -> int | None:
    """When the rule's role approved in time, if it did and never refused."""
    if _refused(rule, case):
        return None
    latest = case.context.released_us + rule.rule.within_us
    times = [
        approval.monotonic_us
        for approval in case.context.approvals
        if approval.rule == rule.number and approval.role == rule.rule.approver and approval.monotonic_us <= latest
    ]
    return min(times) if times else None


def _refused(rule: PreparedRule, case: Case) -> bool:
    return any(
        approval.rule == rule.number and approval.role == rule.rule.approver and not approval.granted
        for approval in case.context.approvals
    )


def _unanswered(rule: PreparedRule, case: Case) -> tuple[Verdict | None, Verdict | None]:
    """How the rule denies, and how it waits, where each is possible."""
    if _refused(rule, case):
        return Verdict(Outcome.DENY, Reason.APPROVAL_REFUSED, rule.rule), None
    end = case.context.released_us + rule.rule.within_us
    earliest, latest = case.monotonic
    return (
        Verdict(Outcome.DENY, Reason.APPROVAL_TIMED_OUT, rule.rule) if latest > end else None,
        Verdict(Outcome.DEFER, Reason.AWAITING_APPROVAL, rule.rule) if earliest <= end else None,
    )
