"""Step 6: the preconditions (`require`, paper symbol `pre`) and the assumptions (`assume`, `sc`) hold now."""

from rtshcua.decision.case import Case
from rtshcua.decision.truth import TRUE
from rtshcua.decision.verdict import Found, Tally
from rtshcua.model.outcome import Reason

_UNKNOWN = Reason.STATE_UNKNOWN


def state(case: Case) -> Found:
    """Falls back on the first clause that is false, else defers on the first that is unknown."""
    tally = Tally(_UNKNOWN, case.exact)
    return tally.found(failed=_fails(case, tally))


def _fails(case: Case, tally: Tally) -> bool:
    """Whether some clause surely fails."""
    for guards in (case.invocation.require, case.invocation.assume):
        for clause, condition in guards:
            truth = condition(case.at)
            if truth != TRUE and tally.fails(truth, Reason.STATE_VIOLATED, clause):
                return True
    return False
