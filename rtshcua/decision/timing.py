"""Step 5: what remains to be done fits before the deadline, `L_rem <= ddl - t`, with t since the release."""

from rtshcua.decision.case import Case
from rtshcua.decision.verdict import PASS, PASSED, Found, Verdict
from rtshcua.model.outcome import Outcome, Reason

_NO_SLACK = Verdict(Outcome.FALLBACK, Reason.NO_SLACK, None)


def timing(case: Case) -> Found:
    """What would come too late is not wanted: the vehicle falls back. A release still to come gains nothing."""
    spare = case.invocation.invocation.contract.deadline_us - case.context.remaining_us
    (earliest, latest), (released_first, released_last) = case.monotonic, case.release
    if max(latest - released_first, 0) <= spare:
        return PASSED
    return (_NO_SLACK, PASS) if max(earliest - released_last, 0) <= spare else (_NO_SLACK,)
