"""Inject the faults of a scenario into the simulated vehicle of a run.

Faults of the vehicle, its link, its surroundings and its pilot are injected into the simulator's process. Faults of
this computer and of agents need `rtshcua test`, because a run cannot kill and restart itself.
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
    """The incidents of one run; a refusal for a scenario that a run cannot fly."""
    scenario, code = flight.scenario, ExitCode.USAGE
    for incident in scenario.incidents:
        if isinstance(incident.fault, HostFault | AgentFault):
            text = f"`{incident.text}` can be injected in virtual time only"
            return Refusal("usage", text, "`rtshcua test` flies the scenario", code)
    if scenario.start.utc_us is not None:
        text = "the scenario sets its start time, but a run begins now"
        return Refusal("usage", text, "`rtshcua test` flies the scenario", code)
    if flavour is not None and flavour not in scenario.flavours:
        text = f"the scenario is for {', '.join(scenario.flavours)}"
        return Refusal("usage", text, "leave `--flavour` out, or name one of these", code)
    return Incidents(flight, flavour or scenario.flavours[0], scenario.first_seed if seed is None else seed)


class Incidents:
    """The incidents of one run, by a scenario and a seed."""

    def __init__(self, flight: ScenarioFlight, flavour: str, seed: int) -> None:
        self.scenario = flight.scenario
        self._flight = flight
        self._flavour, self._seed = flavour, seed
        self._triggers = Triggers(self.scenario, self._seed)
        self._agenda: list[tuple[int, int]] = []  # time and index of each due incident
        self.happened: list[str] = []

    @property
    def options(self) -> list[str]:
        """The simulator's options for the scenario."""
        start = self.scenario.start
        options = ["--flavour", self._flavour, "--seed", str(self._seed), "--estimate", "real"]
        if start.battery is not None:
            options += ["--battery", f"{start.battery / 100:g}"]
        if start.wind_mm_s is not None:
            options += ["--wind", f"{start.wind_mm_s / 1000:g},{start.wind_from_deg},{start.gust_mm_s / 1000:g}"]
        return options + equipment(self.scenario.has_camera, self.scenario.has_gimbal)

    def begin(self, policy: PreparedPolicy, mission: Mission, simulator: Simulator) -> Refusal | None:
        """Begin with this mission; a refusal if the scenario flies another one."""
        if _flown(mission, policy.policy) != _flown(self._flight.mission, self._of_scenario()):
            text = f"the scenario flies another mission than the bundle's `{mission.name}`, or under another policy"
            help = "compile the bundle again from the mission that the scenario `flies`"
            return Refusal("usage", text, help, ExitCode.USAGE)
        self._simulator = simulator
        self._triggers.begin(policy)
        self._schedule(self._triggers.start())
        return None

    def around(self, watch: Watch, start_us: int) -> Watch:
        """A watch that calls `watch` and then injects due incidents. The run began at the monotonic time `start_us`."""

        def both(now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
            watch(now, events, actions)
            at_us = now.monotonic_us - start_us
            self._schedule(self._triggers.turned(now, events, actions, at_us))
            self._happen(at_us)

        return both

    def met(self, ending: str, lines: Sequence[bytes]) -> list[Met]:
        """The expectations that can be checked from the records of the run, with their results."""
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
            text = f"{at_us / 1_000_000:.2f} s: {incident.text}"
            try:
                self._simulator.inject(format_fault(replace(incident.fault, at_us=0)))
            except SimulatorError as error:  # the run notices the lost simulator by itself
                text += f": {error}"
            self.happened.append(text)


def equipment(camera: bool | None, gimbal: bool | None) -> list[str]:
    """The simulator's options for a camera and a gimbal; None leaves it to the options before."""
    given = ("camera", camera), ("gimbal", gimbal)
    return [f"--{name}" if fitted else f"--no-{name}" for name, fitted in given if fitted is not None]


def _flown(mission: Mission, policy: Policy) -> tuple[object, ...]:
    """The parts of a mission and policy that decide how it flies. Ids are left out, because a scenario's mission is not
    bound, and so are file names.
    """
    steps = [
        (each.skill, each.phase, each.source, each.role, each.arguments, each.on_inadmissible)
        for each in mission.invocations
    ]
    return mission.name, steps, structs.replace(policy, sources=())
