"""Statistics of the raw results: by cell, averaged over the deadlines, and paired between two modes.

Percentiles are by nearest rank. All durations are in nanoseconds, as in the raw results.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from statistics import fmean, median
from typing import Final, NamedTuple

from rtshcua.evaluation.design import DEADLINES_US, MISSIONS, POINTS, RUNS, EvaluationPoint
from rtshcua.evaluation.results import PointFlight, Result, StepTiming

#: which durations of a flight are meant
Durations = Callable[[PointFlight], Iterable[int]]
#: what one number stands for many
Reduction = Callable[[Sequence[int]], float]


def percentile(values: Sequence[int], percent: int) -> int:
    """Return a percentile of at least one value, by nearest rank."""
    return sorted(values)[max(-(-len(values) * percent // 100), 1) - 1]


def p95(values: Sequence[int]) -> int:
    """Return the 95th percentile of at least one value."""
    return percentile(values, 95)


def end_to_end(flight: PointFlight) -> Iterator[int]:
    """The end-to-end latencies of a flight's invocations that were dispatched."""
    return (each.end_to_end_ns for each in flight.invocations if each.end_to_end_ns is not None)


def validation(flight: PointFlight) -> Iterator[int]:
    """The validation latencies of a flight's invocations."""
    return (each.validation_ns for each in flight.invocations)


def dispatch(flight: PointFlight) -> Iterator[int]:
    """The dispatch latencies of a flight's invocations that were dispatched."""
    return (each.dispatch_ns for each in flight.invocations if each.dispatch_ns is not None)


def remaining(flight: PointFlight) -> Iterator[int]:
    """What of each end-to-end latency is neither validation nor dispatch: decoding, state and the request."""
    for each in flight.invocations:
        if each.end_to_end_ns is not None:
            yield each.end_to_end_ns - each.validation_ns - (each.dispatch_ns or 0)


def proposal(flight: PointFlight) -> Iterator[int]:
    """The latency from the mission's text to its first command frame."""
    return iter((flight.proposal_ns,))


def in_time(step: StepTiming, deadline_us: int) -> bool:
    """Whether a step's first command frame was sent by its deadline."""
    return step.end_to_end_ns is not None and step.end_to_end_ns <= 1_000 * deadline_us


def misses(flight: PointFlight) -> int:
    """The missed deadlines of a flight: by its count and by its times, whichever are more."""
    return max(flight.misses, sum(not in_time(each, flight.deadline_us) for each in flight.invocations))


def fallbacks(flight: PointFlight) -> int:
    """The fallbacks of a flight: by its count and by its outcomes, whichever are more."""
    return max(flight.fallbacks, sum(each.outcome == "fallback" for each in flight.invocations))


class Distribution(NamedTuple):
    """The number of values, their median, percentiles and maximum."""

    values: int
    median: float
    p95: int
    p99: int
    largest: int


def distribution(values: Iterable[int]) -> Distribution | None:
    """Return the distribution of values; None if there are none."""
    ordered = sorted(values)
    if not ordered:
        return None
    high, highest = percentile(ordered, 95), percentile(ordered, 99)
    return Distribution(len(ordered), median(ordered), high, highest, ordered[-1])


class Averaged(NamedTuple):
    """The mean of some cells, the least and the greatest of them, and how many there are."""

    mean: float
    low: float
    high: float
    cells: int


def averaged(values: Iterable[float]) -> Averaged | None:
    """Return the mean and the range of values; None if there are none."""
    kept = list(values)
    return Averaged(fmean(kept), min(kept), max(kept), len(kept)) if kept else None


#: the published quantities of X5: median validation, median and P95 end-to-end
PAIRED: Final[tuple[tuple[str, Durations, Reduction], ...]] = (
    ("median validation", validation, median),
    ("median end-to-end", end_to_end, median),
    ("P95 end-to-end", end_to_end, p95),
)


class FlightTable:
    """The flights of X1 by mode, point and seed. A flight that was repeated counts once, by its first line."""

    def __init__(self, results: Iterable[Result]) -> None:
        self._cells: defaultdict[tuple[str, EvaluationPoint], dict[int, PointFlight]] = defaultdict(dict)
        for each in results:
            if isinstance(each, PointFlight):
                self._cells[each.mode, EvaluationPoint(each.mission, each.deadline_us)].setdefault(each.seed, each)

    def cell(self, mode: str, point: EvaluationPoint) -> tuple[PointFlight, ...]:
        """Return the flights of a cell."""
        return tuple(self._cells.get((mode, point), {}).values())

    def flights(self, mode: str) -> tuple[PointFlight, ...]:
        """Return all flights of a mode."""
        return tuple(flight for point in POINTS for flight in self.cell(mode, point))

    def complete(self, mode: str) -> bool:
        """Whether each cell of a mode has all its flights."""
        return all(len(self.cell(mode, point)) >= RUNS for point in POINTS)

    def spread(self, mode: str, point: EvaluationPoint, of: Durations) -> Distribution | None:
        """Return the distribution over all invocations of a cell."""
        return distribution(value for flight in self.cell(mode, point) for value in of(flight))

    def average(self, mode: str, mission: str, of: Durations, by: Reduction) -> Averaged | None:
        """Return the mean and the range over the deadline cells of a mission and mode."""
        cells = ([v for each in self.cell(mode, point) for v in of(each)] for point in _points(mission))
        return averaged(by(values) for values in cells if values)

    def added(self, mode: str, base: str, point: EvaluationPoint, of: Durations, by: Reduction) -> float | None:
        """Return what a mode adds to another at a point: the median difference of the pairs of flights with the same
        seed; None if there is no pair.
        """
        mine, theirs = self._cells.get((mode, point), {}), self._cells.get((base, point), {})
        pairs = ((list(of(mine[seed])), list(of(theirs[seed]))) for seed in mine.keys() & theirs.keys())
        differences = [by(more) - by(less) for more, less in pairs if more and less]
        return median(differences) if differences else None

    def added_average(self, mode: str, base: str, mission: str | None, of: Durations, by: Reduction) -> Averaged | None:
        """Return the mean and the range of what a mode adds to another, over the points of a mission, or over all
        points.
        """
        points = POINTS if mission is None else _points(mission)
        found = (self.added(mode, base, point, of, by) for point in points)
        return averaged(each for each in found if each is not None)

    def flatness(self, mode: str) -> float | None:
        """Return the ratio of the largest to the smallest of the missions' median end-to-end latencies; None if a
        mission was not flown.
        """
        middles = [self.average(mode, mission, end_to_end, median) for mission in MISSIONS]
        found = [each.mean for each in middles if each is not None]
        return max(found) / min(found) if len(found) == len(MISSIONS) and min(found) > 0 else None


def _points(mission: str) -> tuple[EvaluationPoint, ...]:
    return tuple(EvaluationPoint(mission, deadline_us) for deadline_us in DEADLINES_US)
