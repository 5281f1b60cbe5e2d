"""The experiments by name, and one unit of work of each in a process of a pool."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Final, NamedTuple

from rtshcua.evaluation import case_checks, evidence_costs, fallback_costs, flights, footprint
from rtshcua.evaluation.design import EvaluationPlan, WorkUnit
from rtshcua.evaluation.results import Result


class Experiment(NamedTuple):
    """One experiment: its units of work, what makes one, and which of them one process runs after each other."""

    units: Callable[[EvaluationPlan], Sequence[WorkUnit]]
    run: Callable[[WorkUnit], Sequence[Result]]
    together: Callable[[WorkUnit], object] = lambda unit: unit


EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    "X1": Experiment(flights.units, flights.run),
    "X3": Experiment(case_checks.units, case_checks.run),
    "X4": Experiment(fallback_costs.units, fallback_costs.run),
    "X6": Experiment(evidence_costs.units, evidence_costs.run),
    "X7": Experiment(footprint.units, footprint.run),
}
#: which experiment's results answer a name
SOURCES: Final[Mapping[str, str]] = {
    "X1": "X1", "X2": "X1", "X3": "X3", "X4": "X4", "X5": "X1", "X6": "X6", "X7": "X7",
}  # fmt: skip


class WorkBatch(NamedTuple):
    """Units that one process runs after each other."""

    number: int
    units: tuple[WorkUnit, ...]


class UnitResults(NamedTuple):
    """The results of a unit, how long it took, in s, when it ended, and the load of the computer then. `failed` says
    why there are none.
    """

    unit: WorkUnit
    results: tuple[Result, ...]
    took_s: float
    at: int
    load: float
    failed: str = ""


class BatchResults(NamedTuple):
    """The results of a batch."""

    number: int
    units: tuple[UnitResults, ...]


class EvaluationWork(NamedTuple):
    """Runs batches in a process of a pool; `scratch` is the folder for the files that a run makes."""

    scratch: str

    def fly(self, flight: WorkBatch) -> BatchResults:
        """Run the units of a batch."""
        before, tempfile.tempdir = tempfile.tempdir, self.scratch
        try:
            return BatchResults(flight.number, tuple(_measured(unit) for unit in flight.units))
        finally:
            tempfile.tempdir = before

    def lost(self, flight: WorkBatch) -> BatchResults:
        """Say that the process died."""
        died = "the process that ran it died twice"
        return BatchResults(flight.number, tuple(_failed(unit, 0.0, died) for unit in flight.units))


def batches(units: Sequence[WorkUnit]) -> Sequence[WorkBatch]:
    """The batches of units, in their order."""
    grouped = groupby(units, key=lambda unit: (unit.experiment, EXPERIMENTS[unit.experiment].together(unit)))
    return [WorkBatch(number, tuple(group)) for number, (_, group) in enumerate(grouped)]


def _measured(unit: WorkUnit) -> UnitResults:
    began_s = time.monotonic()
    try:
        results = tuple(EXPERIMENTS[unit.experiment].run(unit))
    except Exception as error:  # noqa: BLE001  one unit must not end the others
        return _failed(unit, time.monotonic() - began_s, f"{type(error).__name__}: {error}")
    return UnitResults(unit, results, time.monotonic() - began_s, int(time.time()), os.getloadavg()[0])


def _failed(unit: WorkUnit, took_s: float, why: str) -> UnitResults:
    return UnitResults(unit, (), took_s, int(time.time()), os.getloadavg()[0], why)
