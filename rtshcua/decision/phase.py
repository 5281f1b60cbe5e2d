"""Step 4: the decision means something in the mission's current phase (paper symbol `vw`)."""

from rtshcua.decision.case import Case
from rtshcua.decision.verdict import PASSED, Found, Verdict
from rtshcua.model.outcome import Outcome, Reason

_EARLY = (Verdict(Outcome.DEFER, Reason.PHASE_NOT_REACHED, None),)
_LATE = (Verdict(Outcome.DENY, Reason.PHASE_PASSED, None),)


def phase(case: Case) -> Found:
    """Deferred while one of its phases is still to come, denied when none is."""
    current = max(case.context.phase, -1) + 1  # the phases from the current one on; before the first, all are to come
    coming = case.invocation.invocation.phases << 1 >> current
    if coming & 1:
        return PASSED
    return _EARLY if coming >> 1 else _LATE
