"""Step 2: not used before, not issued in the future, and its validity (paper symbol `vw`) is not over.

UTC is known to within an error, so each question has a third answer: the clock does not tell.
"""

from rtshcua.decision.case import Case
from rtshcua.decision.verdict import PASS, PASSED, Found, Verdict
from rtshcua.model.outcome import Outcome, Reason

_REPLAYED = Verdict(Outcome.DENY, Reason.REPLAYED, None)
_FUTURE = Verdict(Outcome.DENY, Reason.ISSUED_IN_FUTURE, None)
_EXPIRED = Verdict(Outcome.DENY, Reason.EXPIRED, None)
_UNCERTAIN = Verdict(Outcome.DEFER, Reason.CLOCK_UNCERTAIN, None)


def freshness(case: Case) -> Found:
    """Valid from the moment of issue to its end, both included."""
    invocation = case.invocation.invocation
    issued = invocation.issued_at_us
    end = issued + invocation.contract.validity_us
    (low, high), (least, most) = case.utc, case.error
    if case.context.consumed:
        return (_REPLAYED,)
    if issued <= low - most and high + most <= end:
        return PASSED
    verdicts: list[Verdict] = []
    if issued > low + least:
        verdicts.append(_FUTURE)
        if issued > high + most:
            return tuple(verdicts)
    if high - least > end:
        verdicts.append(_EXPIRED)
        if low - most > end:
            return tuple(verdicts)
    if most:
        verdicts.append(_UNCERTAIN)
    if issued <= high - least and low + least <= end:
        verdicts.append(PASS)
    return tuple(verdicts)
