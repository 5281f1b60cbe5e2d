"""Flies the scenarios of files: every seed of each, on every kind of autopilot, in virtual time."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from typing import Final

from rtshcua.campaign.rounds import FlownMission
from rtshcua.campaign.scenario_trials import ScenarioTrial, tries
from rtshcua.campaign.workers import FlightWorkers, Here, WorkerProcesses, cores
from rtshcua.ground.testing.reporting import FlightResult, ScenarioResult, findings
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.virtual import development_keys

#: fewer are flown in this process
_FEW: Final = 4


class Flying:
    """Flies scenarios, on as many processes as there are cores once it is worth it.

    `say` gets how far it is in a line, which takes the place of the one before; an empty one when a scenario is flown.
    """

    def __init__(self, *, with_coverage: bool, say: Callable[[str], None]) -> None:
        self._with_coverage = with_coverage
        self._say = say
        self._workers: FlightWorkers | None = None

    def fly(self, scenarios: Sequence[ScenarioFlight]) -> Iterator[ScenarioResult]:
        """Fly all of them, in their order."""
        with closing(self):
            for scenario in scenarios:
                yield self._fly(scenario)

    def close(self) -> None:
        """Let the processes go."""
        if self._workers is not None:
            self._workers.close()
            self._workers = None

    def _fly(self, scenario: ScenarioFlight) -> ScenarioResult:
        policy, mission, start = scenario.policy.lowered.policy, scenario.mission, scenario.scenario.start
        if start.utc_us is not None:
            mission = development_keys.flies_at(mission, start.utc_us)
        field = FlownMission.of(policy, mission, mission.issued_at_us)
        wanted = list(tries(scenario.scenario))
        workers: FlightWorkers = Here()
        if len(wanted) >= _FEW and cores() > 1:
            workers = self._workers = self._workers or WorkerProcesses()
        flown: list[FlightResult] = []
        for each in workers.fly(ScenarioTrial(field, self._with_coverage), wanted):
            flown.append(each)
            self._say(f"{scenario.scenario.name}: {len(flown)} of {len(wanted)} flights")
        self._say("")
        flights = tuple(sorted(flown, key=lambda each: each.number))
        return ScenarioResult(scenario, flights, tuple(findings(scenario, flights)))
