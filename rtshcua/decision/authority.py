"""Step 3: the source may use the timing class, no `forbid` matches, and some `permit` does.

An unknown `forbid` may match, so it defers; an unknown `permit` may not, so it does not count.
"""

from rtshcua.decision.case import Case
from rtshcua.decision.rules import PreparedRule
from rtshcua.decision.truth import FALSE, TRUE, UNKNOWN
from rtshcua.decision.verdict import PASS, PASSED, Found, Verdict
from rtshcua.model.flat.contract import SourceKind, TimingClass
from rtshcua.model.outcome import Outcome, Reason

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
        verdicts.append(_without_permit(candidates.permits))
        if not permitted:
            return tuple(verdicts)
    if doubt is not None:
        verdicts.append(doubt)
    if not unforbidden:
        return tuple(verdicts)
    return (*verdicts, PASS) if verdicts else PASSED


def _without_permit(permits: tuple[PreparedRule, ...]) -> Verdict:
    """No permit speaks of this skill, role and source at all; or one does, and its condition is not met."""
    return Verdict(Outcome.DENY, Reason.OUT_OF_SCOPE, permits[0].rule) if permits else _NOT_PERMITTED
