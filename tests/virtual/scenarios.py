"""Flights of scenarios with the keys of the tests."""

from dataclasses import replace

from rtshcua.model.faults import Fault
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import AtTime, Expected, Incident, Scenario, ScenarioExpectation, Start, When
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.fitting import fitting
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.scenario import Keys, fly
from rtshcua.wire.keys import Duty
from virtual import case

CALM = Start()
KEYS = Keys(
    case.KEYS[Duty.LOG], {"supervisor": (case.KEYS[Duty.APPROVAL],)}, case.KEYS[Duty.MISSION], case.BOUNDARY_KEY
)


def incident(at_s: float, fault: Fault) -> Incident:
    """An incident with a fault at a time."""
    return when(AtTime(int(at_s * case.S), int(at_s * case.S)), fault)


def when(time: When, fault: Fault) -> Incident:
    """An incident with a fault and any trigger."""
    return Incident(time, fault, repr(fault))


def scenario(*incidents: Incident, start: Start = CALM, expects: tuple[Expected, ...] = ()) -> Scenario:
    """A scenario of these incidents."""
    expectations = tuple(ScenarioExpectation(what, repr(what), "test.rts", 0, 0) for what in expects)
    return Scenario("tried", ("px4", "ardupilot"), 1, 1, start, incidents, expectations)


def fast(policy: Policy, **fields: object) -> SimulationConfig:
    """A fitting vehicle that lands fast."""
    low: dict[str, object] = {} if policy.vehicle.return_altitude else {"return_mm": 16 * case.M}
    return fitting(policy, land_mm_s=case.LAND_MM_S, **low, **fields)


def flown(
    of: Scenario, flavour: str = "px4", *, bundle: bytes | None = None, seed: int = 1, attested: bool = True
) -> ScenarioFlown:
    """Fly a scenario: up, a leg, and home, or another bundle. `attested`: with a boundary that signs its evidence."""
    flies = case.seal(case.mission(case.low_steps())) if bundle is None else bundle
    keys = KEYS if attested else replace(KEYS, boundary=None)
    return fly(flies, case.root(boundary=attested)[1], keys, of, flavour, seed, chosen=fast)
