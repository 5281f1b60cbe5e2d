"""A scenario on the simulated vehicle of a run, as life goes: what goes wrong goes wrong when the scenario says so.

What happens to the vehicle, its link, its surroundings and its pilot happens in its own process. What happens to this
computer, and to those who hand in documents, is for `rtshcua test`: no run can die and be started anew by itself.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from heapq import heappop, heappush

from msgspec import structs

from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.model.faults import AgentFault, HostFault
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Action, Event
from rtshcua.simulation.fault_syntax import format_fault
from rtshcua.virtual.expectations import Met, recorded
from rtshcua.virtual.scenario import Due, Triggers

Watch = Callable[[Now, Sequence[Event], Sequence[Action]], None]


def plan_incidents(flight: ScenarioFlight, flavour: str | None, seed: int | None) -> "Incidents | Refusal":
    """What goes wrong in one run, by a scenario and a seed; no run can have all of it."""
    scenario, code = flight.scenario, ExitCode.USAGE
    for incident in scenario.incidents:
        if isinstance(incident.fault, HostFault | AgentFault):
            text = f"`{incident.text}` goes wrong in virtual time alone"
            return Refusal("usage", text, "`rtshcua test` flies the scenario", code)
    if scenario.start.utc_us is not None:
        text = "the scenario says at what time it begins, and a run begins now"
        return Refusal("usage", text, "`rtshcua test` flies the scenario", code)
    if flavour is not None and flavour not in scenario.flavours:
        text = f"the scenario is flown aboard {', '.join(scenario.flavours)}"
        return Refusal("usage", text, "leave `--flavour` out, or name one of these", code)
    return Incidents(flight, flavour or scenario.flavours[0], scenario.first_seed if seed is None else seed)


class Incidents:
    """What goes wrong in one run, by one scenario and seed."""

    def __init__(self, flight: ScenarioFlight, flavour: str, seed: int) -> None:
        self.scenario = flight.scenario
        self._flight = flight
        self._flavour, self._seed = flavour, seed
        self._triggers = Triggers(self.scenario, self._seed)
        self._agenda: list[tuple[int, int]] = []  # when, and the number of what happens
        self.happened: list[str] = []

    @property
    def words(self) -> list[str]:
        """The options of the simulated vehicle's process that the scenario asks for."""
        start = self.scenario.start
        words = ["--flavour", self._flavour, "--seed", str(self._seed), "--estimate", "real"]
        if start.battery is not None:
            words += ["--battery", f"{start.battery / 100:g}"]
        if start.wind_mm_s is not None:
            words += ["--wind", f"{start.wind_mm_s / 1000:g},{start.wind_from_deg},{start.gust_mm_s / 1000:g}"]
        return words

    def begin(self, policy: PreparedPolicy, mission: Mission, simulator: Simulator) -> Refusal | None:
        """The run begins, of this mission; why it does not, where that is not the scenario's."""
        if _flown(mission, policy.policy) != _flown(self._flight.mission, self._of_scenario()):
            text = f"the scenario flies another mission than the bundle's `{mission.name}`, or under another policy"
            help = "the mission that it `flies` makes the bundle: compile it again from the same sources"
            return Refusal("usage", text, help, ExitCode.USAGE)
        self._simulator = simulator
        self._triggers.begin(policy)
        self._schedule(self._triggers.start())
        return None

    def around(self, watch: Watch, start_us: int) -> Watch:
        """What watches the loop of the run, with this beside it; it began at `start_us` of its monotonic clock."""

        def both(now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
            watch(now, events, actions)
            at_us = now.monotonic_us - start_us
            self._schedule(self._triggers.turned(now, events, actions, at_us))
            self._happen(at_us)

        return both

    def met(self, ending: str, lines: Sequence[bytes]) -> list[Met]:
        """What of what is expected can be read from the records of the run, and whether it was met."""
        return recorded(self.scenario.expectations, ending, lines, self._of_scenario(), self._flight.mission)

    def _of_scenario(self) -> Policy:
        return self._flight.policy.lowered.policy

    def _schedule(self, due: Iterable[Due]) -> None:
        for number, at_us in due:
            heappush(self._agenda, (at_us, number))

    def _happen(self, at_us: int) -> None:
        while self._agenda and self._agenda[0][0] <= at_us:
            _, number = heappop(self._agenda)
            incident = self.scenario.incidents[number]
            told = f"{at_us / 1_000_000:.2f} s: {incident.text}"
            try:
                self._simulator.inject(format_fault(replace(incident.fault, at_us=0)))
            except SimulatorError as error:  # the run finds out by itself, as it would of any vehicle that is gone
                told += f": {error}"
            self.happened.append(told)


def _flown(mission: Mission, policy: Policy) -> tuple[object, ...]:
    """What two missions have in common that fly alike: a scenario's is not bound, so it has no ids; nor does it matter
    what the files are called.
    """
    steps = [
        (each.skill, each.phase, each.source, each.role, each.arguments, each.on_inadmissible)
        for each in mission.invocations
    ]
    return mission.name, steps, structs.replace(policy, sources=())
