"""What a step answers: the verdicts that are possible. A point has exactly one."""

from typing import NamedTuple, TypeAlias

from rtshcua.decision.truth import EVERYWHERE, FALSE, TRUE, UNKNOWN, Truth
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.outcome import Outcome, Reason

#: what can decide; None where it is a field of the contract itself, or of the request
Decisive: TypeAlias = Clause | Rule | Airspace | None


class Verdict(NamedTuple):
    """An outcome with its reason and the clause that decided."""

    outcome: Outcome
    reason: Reason
    clause: Decisive


#: Verdicts of a step in the order of the rule; `PASS`, if passing is possible, comes last.
Found: TypeAlias = tuple[Verdict, ...]

PASS = Verdict(Outcome.ALLOW, Reason.ADMITTED, None)
PASSED: Found = (PASS,)


class Tally:
    """A step that passes when all its conditions are true: false falls back, else unknown defers.

    `exact` says that a single situation is judged, so that a mixed truth is one over the places of one volume, where
    the condition must hold everywhere. Otherwise it is one over many situations, each with a volume of its own.
    """

    __slots__ = ("_doubt", "_exact", "_passes", "_unknown", "_verdicts")

    def __init__(self, unknown: Reason, exact: bool) -> None:
        self._unknown, self._exact = unknown, exact
        self._verdicts: list[Verdict] = []
        self._doubt: Verdict | None = None
        self._passes = True

    def fails(self, truth: Truth, reason: Reason, clause: Decisive) -> bool:
        """Count a condition that is not simply TRUE; whether the step surely fails, so that no other needs a look."""
        if self._exact:
            truth = EVERYWHERE[truth]
        if truth & FALSE:
            self._verdicts.append(Verdict(Outcome.FALLBACK, reason, clause))
        if truth & UNKNOWN and self._doubt is None:
            self._doubt = Verdict(Outcome.DEFER, self._unknown, clause)
        self._passes = self._passes and truth & TRUE != 0
        return truth == FALSE

    def found(self, failed: bool) -> Found:
        """The verdicts, given whether some condition surely fails."""
        if failed:
            return tuple(self._verdicts)
        if self._doubt is not None:
            self._verdicts.append(self._doubt)
        if not self._passes:
            return tuple(self._verdicts)
        return (*self._verdicts, PASS) if self._verdicts else PASSED
