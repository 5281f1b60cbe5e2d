"""A whole qualification in virtual time: each sortie is a flight of the same simulated vehicle."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from rtshcua import library
from rtshcua.adapters.doctor.diagnosis import settings_told
from rtshcua.adapters.qualification.checks import ends_after, judge
from rtshcua.adapters.qualification.missions import NAME, SortiePlan, source_of
from rtshcua.adapters.qualification.observed import ObservedQualification, ObservedSortie
from rtshcua.adapters.qualification.sortie import SORTIES, QualifyingDriver, Sortie
from rtshcua.adapters.vehicle.bounds import FlightReach
from rtshcua.app.programs import compile_sources, read_text
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.fitting import fitting
from rtshcua.virtual.vehicle import SECOND, START, VirtualClock, VirtualVehicle
from rtshcua.wire.qualification import QualificationCheck
from virtual import case
from virtual.flight import TICK_US, UTC_US, Flight

TRIAL = SortiePlan(10_000, 40_000, 5_000, 0)
Wrong = Callable[[VirtualVehicle], None]
Pilot = Callable[[VirtualVehicle, str], None]


@cache
def compiled() -> tuple[Policy, Mission]:
    found, _ = compile_sources([_source()], mission=None, issued_at_us=case.flat.ISSUED)
    assert found.policy is not None, found.diagnostics
    assert found.mission is not None
    return found.policy, found.mission


def _source() -> Path:
    return library.root() / "missions/standard.rts"


@cache
def bundle(sortie: Sortie, *, by_pilot: bool) -> tuple[bytes, Policy, Mission]:
    policy, mission = compiled()
    source = _source()
    text = source_of(sortie, TRIAL, source.name, policy, mission, by_pilot=by_pilot)
    program = read_text(str(source.parent / f"{NAME}.rts"), text).program
    found = compile_program(program, dialect.load(), mission=NAME, issued_at_us=case.flat.ISSUED)
    assert found.policy is not None, found.diagnostics
    assert found.mission is not None
    return case.seal(found.mission, found.policy), found.policy, found.mission


class Qualifying:
    """One simulated vehicle and its sorties. `wrong` changes its behaviour; `pilot` is asked to take over if it counts
    as a real vehicle.
    """

    def __init__(self, flavour: str, wrong: Wrong = lambda _: None, pilot: Pilot | None = None, **chosen: Any) -> None:
        self._pilot = pilot
        self._policy, _ = compiled()
        self._config: SimulationConfig = fitting(self._policy, flavour=AutopilotKind(flavour), **chosen)
        self._wrong = wrong
        self._vehicle: VirtualVehicle | None = None
        self._clock = VirtualClock(Now(START.monotonic_us, UTC_US, START.utc_error_us))
        self.drivers: list[QualifyingDriver] = []
        self.flights: list[Any] = []

    def fly(self, sorties: Sequence[Sortie] = SORTIES) -> list[QualificationCheck]:
        """Fly these sorties until one fails; return the checks."""
        found, missing = [], {each.name: "not asked for" for each in SORTIES}
        for sortie in sorties:
            found.append(self.sortie(sortie))
            del missing[sortie.name]
            why = ends_after(found[-1])
            if why is not None:
                missing = dict.fromkeys(missing, why)
                break
        self.observed = self._observed(found, missing)
        return judge(self.observed, self._policy)

    def sortie(self, sortie: Sortie) -> ObservedSortie:
        """Fly one sortie, from the ground to the ground."""
        data, policy, mission = bundle(sortie, by_pilot=self._pilot is not None)
        before, clock = self._vehicle, self._clock

        def asked(text: str) -> None:
            if self._pilot is not None:
                self._pilot(vehicle, text)

        vehicle = VirtualVehicle(policy, self._config, clock, FrameSession(), tick_us=TICK_US)
        if before is not None:
            vehicle.simulation = before.simulation
        driver = QualifyingDriver(
            policy, vehicle.frames, sortie=sortie, sends=self._pilot is None, steps=mission.invocations, ask=asked
        )
        vehicle.driver = driver
        if before is None:
            self._wrong(vehicle)
        else:
            vehicle.lose, vehicle.hurt = before.lose, before.hurt
        self._vehicle = vehicle
        flown = Flight(data, self._config, vehicle=vehicle).fly(most_s=300)
        self.flights.append(flown)
        vehicle.stand_still(300_000)  # a run closes its log before it observes the landing
        ended_us = clock.elapsed_us
        while not driver.seen.down and clock.elapsed_us - ended_us < 60 * SECOND:
            vehicle.poll(clock.monotonic_us, 100_000)
        self.drivers.append(driver)
        return driver.finish(flown.ending)

    @property
    def elapsed_us(self) -> int:
        """Return the total time."""
        return self._clock.elapsed_us

    def _observed(self, sorties: list[ObservedSortie], missing: dict[str, str]) -> ObservedQualification:
        first = self.drivers[0]
        questions, flavour = first.questions, first.flavour
        assert questions is not None
        assert flavour is not None
        settings = tuple(settings_told(flavour.name, questions.values.values, self._policy, FlightReach()))
        within, trip = flavour.mode_within_us, first.source.clock.round_trip_us
        return ObservedQualification(questions.firmware, within, trip, tuple(sorties), settings, missing)
