"""How long an admission holds (design 4.3): it bounds the permit."""

from rtshcua.decision.case import Case
from rtshcua.model.flat.situation import State


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
