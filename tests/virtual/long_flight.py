"""A long flight in virtual time: leg after leg, back and forth, and home."""

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission, Plan
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.config import SimulationConfig
from virtual import case

ENDURANCE_US = 36_000 * case.S


def legs(count: int, *, home: bool = False) -> tuple[Mission, Policy, SimulationConfig]:
    """A mission of this many legs of 200 m, with a policy and a battery that allow ten hours; `home`: it ends there."""
    steps = [case.step(0, 0, flat.TAKEOFF, Plan(MotionKind.CLIMB, (), 15 * case.M, 0), 15 * case.M)]
    for number in range(1, count):
        place = (150 * case.M if number % 2 else -50 * case.M, 0)
        leg = case.step(1, 1, flat.GOTO, Plan(MotionKind.FLY, place, 15 * case.M, 0), *place, 15 * case.M)
        steps.append(replace(leg, step=number, invocation_id=number.to_bytes(16, "big")))
    if home:
        back = case.step(2, 2, flat.HOME, Plan(MotionKind.HOME, (0, 0), 0, 0))
        steps.append(replace(back, step=count, invocation_id=count.to_bytes(16, "big")))
    policy = case.policy()
    contracts = tuple(replace(each, validity_us=ENDURANCE_US, duration_us=0) for each in policy.contracts)
    steps = [replace(each, contract=replace(each.contract, validity_us=ENDURANCE_US, duration_us=0)) for each in steps]
    vehicle = replace(policy.vehicle, endurance_us=ENDURANCE_US)
    config = case.simulated("px4", hover_us=ENDURANCE_US)
    return case.mission(steps), replace(policy, contracts=contracts, vehicle=vehicle), config
