"""Steps 2, 4 and 5: what is about time, and how long an admission holds (design 4.3).

2: not used before, not issued in the future, and its validity (paper symbol `vw`) is not over. UTC is known to within
an error, so each question has a third answer: the clock does not tell.

4: the decision means something in the mission's current phase (`vw`).

5: what remains to be done fits before the deadline, `L_rem <= ddl - t`, with t since the release.
"""

from rtshcua.decision.case import PASS, PASSED, Case, Found, Verdict
from rtshcua.model.flat.situation import State
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


_EARLY = (Verdict(Outcome.DEFER, Reason.PHASE_NOT_REACHED, None),)
_LATE = (Verdict(Outcome.DENY, Reason.PHASE_PASSED, None),)


def phase(case: Case) -> Found:
    """Deferred while one of its phases is still to come, denied when none is."""
    current = max(case.context.phase, -1) + 1  # the phases from the current one on; before the first, all are to come
    coming = case.invocation.invocation.phases << 1 >> current
    if coming & 1:
        return PASSED
    return _EARLY if coming >> 1 else _LATE


_NO_SLACK = Verdict(Outcome.FALLBACK, Reason.NO_SLACK, None)


def timing(case: Case) -> Found:
    """What would come too late is not wanted: the vehicle falls back. A release still to come gains nothing."""
    spare = case.invocation.invocation.contract.deadline_us - case.context.remaining_us
    (earliest, latest), (released_first, released_last) = case.monotonic, case.release
    if max(latest - released_first, 0) <= spare:
        return PASSED
    return (_NO_SLACK, PASS) if max(earliest - released_last, 0) <= spare else (_NO_SLACK,)


def valid_until(case: Case, state: State) -> int:
    """The earliest of deadline, end of validity and the moment when something that was read is stale, monotonic us.
    What a temporal monitor looked at counts as read; and what it says stands for `MAX_GAP` after its observation.

    The end of validity is mapped from UTC with the clock's error taken off.
    """
    invocation = case.invocation
    contract = invocation.invocation.contract
    now, utc, error = case.monotonic[0], case.utc[0], case.error[0]
    end = invocation.invocation.issued_at_us + contract.validity_us
    released, valid = case.release[0], end - utc - error
    left = (released - now if released < now else 0) + contract.deadline_us  # `min` is slow
    if valid < left:
        left = valid
    if invocation.rests_us < left:
        left = invocation.rests_us
    values, ages = state.values, state.ages
    for slot, stale in invocation.reads:
        if 0 <= stale - ages[slot] < left and values[slot] is not None:
            left = stale - ages[slot]
    return now + left
