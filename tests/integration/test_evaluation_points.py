"""Every point of the evaluation flies in virtual time on both autopilots, and each step is admitted and dispatched."""

from itertools import product

import pytest

from rtshcua.evaluation.design import POINTS, EvaluationPoint
from rtshcua.evaluation.sources import compiled, fitted
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Ending
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.fitting import with_room
from virtual import case
from virtual.flight import Flight

#: flown by `make test`; every fifth of the others by `make slow`, all by `make soak`
SAMPLE = (
    (EvaluationPoint("short", 100_000), AutopilotKind.PX4),
    (EvaluationPoint("short", 1_500_000), AutopilotKind.ARDUPILOT),
)
FLIGHTS = [
    pytest.param(*each, marks=() if each in SAMPLE else pytest.mark.slow if number % 5 == 0 else pytest.mark.soak)
    for number, each in enumerate(product(POINTS, AutopilotKind))
]


@pytest.mark.parametrize(("point", "flavour"), FLIGHTS)
def test_point_flies_with_each_step_admitted(point: EvaluationPoint, flavour: AutopilotKind) -> None:
    policy, mission = compiled(*point, case.flat.ISSUED)
    steps = len(mission.invocations)

    def vehicle(policy: Policy) -> SimulationConfig:
        return with_room(fitted(policy, flavour=flavour), policy, mission.invocations)

    flight = Flight(case.seal(mission, policy), vehicle)
    flown = flight.fly()
    assert flown.ending is Ending.COMPLETED
    assert flown.decisions() == [(step, "allow", "admitted") for step in range(steps)]
    assert len(flown.dispatched()) == steps, "and nothing else, so no fallback"
    assert flown.audit().report.verdict is LogVerdict.VERIFIED
    asked = flight.vehicle.driver.stream_requests.plan.intervals
    for signal in policy.signals:
        for message in (source.message for source in signal.sources):
            assert asked[message] <= point.deadline_us // 2, f"`{message}`: two reports within the deadline"
