"""Temporal monitors by their definition, independent of `rtshcua.decision.temporal`.

The whole history is kept, and each question evaluates the step function of a condition moment by moment.

Truths are letters, F < U < T. A condition's history is its truth at each observation, with the moment in us.
"""

from rtshcua.model.flat.policy import MonitorKind

ORDER = "FUT"
GAP = 1_000_000  # us
History = list[tuple[int, str]]


def at_moment(history: History, tau: int) -> set[str]:
    """The step function at one moment: the truths of the observations there, or else the previous truth."""
    here = {letter for time, letter in history if time == tau}
    if here:
        return here
    earlier = [(time, letter) for time, letter in history if time < tau]
    later = [time for time, _ in history if time > tau]
    if not earlier:
        return {"U"}
    time, letter = earlier[-1]
    assert later, "nobody asks about the future"
    return {"U"} if later[0] - time > GAP else {letter}


def in_window(history: History, start: int, end: int) -> set[str]:
    """All truths from `start` to `end`. They only change at observations, so both sides of each suffice."""
    moments = {start, end}
    for time, _ in history:
        moments |= {time - 1, time, time + 1}
    return set().union(*(at_moment(history, tau) for tau in moments if start <= tau <= end))


def negated(letter: str) -> str:
    return {"T": "F", "F": "T", "U": "U"}[letter]


def says(kind: int, window: int, history: History) -> str:
    """The truth of a monitor at the last observation of its condition's history."""
    now, last = history[-1]
    before = history[-2][1] if len(history) > 1 else "U"
    match kind:
        case MonitorKind.FOR_LAST:
            return min(in_window(history, now - window, now), key=ORDER.index)
        case MonitorKind.WITHIN_LAST:
            return max(in_window(history, now - window, now), key=ORDER.index)
        case MonitorKind.RISING:
            return min(negated(before), last, key=ORDER.index)
        case _:
            return min(before, negated(last), key=ORDER.index)
