"""What temporal monitors said, against what the log knows of their past.

Each decision record holds the state of one observation, and what the monitors said there. The observations in between
are not recorded, so nobody can work out again what a monitor said; but each record tells the truth of its condition at
that moment, and a monitor must not say what these truths rule out: not TRUE `for the last 3 s` with a FALSE in them.
"""

from typing import Final

from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.situation import SINGLE, environment, situation
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.evidence.finding import Flaw
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.flat.situation import Now, State

_WORDS: Final = {TRUE: "true", FALSE: "false", UNKNOWN: "unknown"}
_ALL: Final = TRUE | FALSE | UNKNOWN
_NEVER: Final = -(1 << 62)


class Observed:
    """Follows the decisions of one log; what it keeps is bounded by the policy: when each truth was last recorded."""

    def __init__(self, policy: PreparedPolicy) -> None:
        self._policy = policy
        self._last = [{TRUE: _NEVER, FALSE: _NEVER, UNKNOWN: _NEVER} for _ in policy.monitors]

    def check(self, state: State, now: Now) -> Flaw | None:
        """What is wrong with what the monitors said at a recorded moment, given those before, or None."""
        at_us = now.monotonic_us
        at = environment(situation(state, self._policy, now), self._policy, (), NO_PHASE)
        flaw: Flaw | None = None
        for monitor, last, said, flat in zip(
            self._policy.monitors, self._last, state.monitors, self._policy.policy.monitors, strict=True
        ):
            found = monitor.condition(at)
            truth = found if found in SINGLE else UNKNOWN  # as `decision.temporal` has it
            last[truth] = at_us
            may = _may(monitor.kind, truth, {one for one in last if last[one] >= at_us - monitor.window_us})
            if flaw is None and not said & may:
                text = (
                    f"a monitor of `{flat.when.text}` said what its condition rules out, in this record or one before"
                )
                expected = " or ".join(word for one, word in _WORDS.items() if one & may)
                flaw = Flaw("decision/monitor", text, _WORDS[said], expected)
        return flaw


def _may(kind: int, now: Truth, recorded: set[Truth]) -> Truth:
    """What a monitor may say, by the truth of its condition now, and those that were recorded in its window."""
    match kind:
        case MonitorKind.FOR_LAST:  # the least of more truths than these
            return FALSE if FALSE in recorded else FALSE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.WITHIN_LAST:  # the greatest of more truths than these
            return TRUE if TRUE in recorded else TRUE | UNKNOWN if UNKNOWN in recorded else _ALL
        case MonitorKind.RISING:
            return FALSE if now == FALSE else FALSE | UNKNOWN if now == UNKNOWN else _ALL
        case _:
            return FALSE if now == TRUE else FALSE | UNKNOWN if now == UNKNOWN else _ALL
