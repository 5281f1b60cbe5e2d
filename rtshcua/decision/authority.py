"""Steps 1, 3 and 3b: the request is what was signed, somebody may ask for it, and whoever must confirm it did.

1: it is for this vehicle and the policy in force, within its own ranges. Signatures were verified once, at load; what
is compared here is the digest that they cover.

3: the source may use the timing class, no `forbid` matches, and some `permit` does. An unknown `forbid` may match, so
it defers; an unknown `permit` may not, so it does not count.

3b: a `confirm` rule that matches, or may match, needs an approval by its role, or by two different people, one for
each of its two roles. The approval (of two, the later one) moves the release (design 4.3). A refusal, or an approval
that did not come within the rule's time after the release, denies.
"""

from collections.abc import Sequence

from rtshcua.decision.case import PASSED, Case, Found, Verdict, concluded
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.model.flat.contract import SourceKind, TimingClass
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import Approval
from rtshcua.model.outcome import Outcome, Reason

_BINDING = (Verdict(Outcome.DENY, Reason.BINDING_MISMATCH, None),)
_VEHICLE = (Verdict(Outcome.DENY, Reason.WRONG_VEHICLE, None),)
_VERSION = (Verdict(Outcome.DENY, Reason.POLICY_VERSION, None),)
_ARGUMENT = (Verdict(Outcome.DENY, Reason.ARGUMENT_RANGE, None),)


def integrity(case: Case) -> Found:
    """Denies what differs from what was signed. An invocation prepared under another policy is of another version."""
    context, invocation, policy = case.context, case.invocation, case.policy
    if context.binding != invocation.invocation.binding:
        return _BINDING
    if context.vehicle != policy.policy.vehicle.identity:
        return _VEHICLE
    if context.policy_version != policy.policy.version or invocation.policy is not policy:
        return _VERSION
    return PASSED if invocation.misfit is None else _ARGUMENT


#: the timing classes that a source may use: an agent never reacts, a reflex does nothing else
CLASSES: dict[int, frozenset[int]] = {
    SourceKind.AGENT: frozenset({TimingClass.SEMANTIC, TimingClass.TACTICAL}),
    SourceKind.OPERATOR: frozenset({TimingClass.SEMANTIC, TimingClass.TACTICAL}),
    SourceKind.ONBOARD: frozenset({TimingClass.TACTICAL}),
    SourceKind.REFLEX: frozenset({TimingClass.REFLEX}),
}

_CLASS = (Verdict(Outcome.DENY, Reason.CLASS_NOT_PERMITTED, None),)
_NOT_PERMITTED = Verdict(Outcome.DENY, Reason.NOT_PERMITTED, None)


def authority(case: Case) -> Found:
    """Denied when a `forbid` is true or no `permit` is, even where another `forbid` is unknown; then that defers."""
    invocation, at = case.invocation.invocation, case.at
    if invocation.contract.timing_class not in CLASSES[invocation.source]:
        return _CLASS
    candidates = case.invocation.candidates
    verdicts: list[Verdict] = []
    doubt: Verdict | None = None
    unforbidden = True
    for rule in candidates.forbids:
        truth = rule.condition(at)
        if truth == FALSE:
            continue
        if truth & TRUE:
            verdicts.append(Verdict(Outcome.DENY, Reason.FORBIDDEN, rule.rule))
            if truth == TRUE:
                return tuple(verdicts)
        if truth & UNKNOWN and doubt is None:
            doubt = Verdict(Outcome.DEFER, Reason.FORBID_UNKNOWN, rule.rule)
        unforbidden = unforbidden and truth & FALSE != 0
    permitted = False
    for rule in candidates.permits:
        truth = rule.condition(at)
        if truth == TRUE:
            break
        permitted = permitted or truth & TRUE != 0
    else:
        rules = candidates.permits  # none speaks of this skill, role and source at all, or no condition is met
        verdicts.append(Verdict(Outcome.DENY, Reason.OUT_OF_SCOPE, rules[0].rule) if rules else _NOT_PERMITTED)
        if not permitted:
            return tuple(verdicts)
    if unforbidden and not verdicts and doubt is None:
        return PASSED
    return concluded(verdicts, doubt, unforbidden)


def _granted(rule: Rule, answers: Sequence[Approval]) -> list[int]:
    """When grants that came in time were enough, monotonic us: one of the role, or those of two people."""
    first = [each for each in answers if each.role == rule.approver]
    if rule.second == -1:
        return [each.monotonic_us for each in first]
    return [
        max(one.monotonic_us, other.monotonic_us)
        for one in first
        for other in answers
        if other.role == rule.second and other.person != one.person
    ]


def confirmation(case: Case) -> Found:
    """Denied when any rule's answer denies, else deferred when any is awaited."""
    verdicts: list[Verdict] = []
    doubt: Verdict | None = None
    passes = True
    (earliest, latest), released_us = case.monotonic, case.context.released_us
    for rule in case.invocation.candidates.confirms:
        truth = rule.condition(case.at)
        if truth == FALSE:
            continue
        certain, end = not truth & FALSE, released_us + rule.rule.within_us
        asked = (rule.rule.approver, rule.rule.second)
        answers = [each for each in case.context.approvals if each.rule == rule.number and each.role in asked]
        refused = not all(each.granted for each in answers)
        times = [] if refused else _granted(rule.rule, [each for each in answers if each.monotonic_us <= end])
        if times:
            granted, (first, last) = min(times), case.release
            case.release = (max(first, granted) if certain else first, max(last, granted))
            continue
        awaited = not refused and earliest <= end
        if refused:
            verdicts.append(Verdict(Outcome.DENY, Reason.APPROVAL_REFUSED, rule.rule))
        elif latest > end:
            verdicts.append(Verdict(Outcome.DENY, Reason.APPROVAL_TIMED_OUT, rule.rule))
        if not awaited and certain:
            return tuple(verdicts)
        if awaited and doubt is None:
            doubt = Verdict(Outcome.DEFER, Reason.AWAITING_APPROVAL, rule.rule)
        passes = passes and not certain
    if passes and not verdicts and doubt is None:
        return PASSED
    return concluded(verdicts, doubt, passes)
