"""Configure a simulated vehicle for a policy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.bounds import narrower, reach_of
from rtshcua.adapters.vehicle.payload_sender import PICTURES
from rtshcua.mavlink import enums
from rtshcua.model.flat.contract import Addressee
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.ardupilot.parameters import PARAMETERS
from rtshcua.simulation.config import HOME, STOCK, AutopilotKind, Equipment, SimulationConfig
from rtshcua.simulation.place import HomePosition

_CRUISE_MM_S = 5_000
#: the maximum speed: default, and limit of the simulation
_MOST_MM_S = 12_000
_FASTEST_MM_S = 15_000
_TOLD_IN = {
    "RADIO_STATUS": Equipment.RADIO, "DISTANCE_SENSOR": Equipment.RANGE, "OBSTACLE_DISTANCE": Equipment.RANGE,
    "WIND": Equipment.WIND, "WIND_COV": Equipment.WIND,
}  # fmt: skip

_POINTS_GIMBAL = frozenset(
    {
        enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        enums.MAV_CMD_DO_MOUNT_CONTROL,
        enums.MAV_CMD_DO_SET_ROI_LOCATION,
        enums.MAV_CMD_DO_SET_ROI_NONE,
    }
)


def _extras(policy: Policy) -> frozenset[Equipment]:
    """Return the equipment that a policy's signals need."""
    messages = {source.message for signal in policy.signals for source in signal.sources}
    return STOCK | {extra for message, extra in _TOLD_IN.items() if message in messages}


def fitting(policy: Policy, **chosen: Any) -> SimulationConfig:
    """Return a vehicle with the policy's home, endurance, return altitude, least speeds, sensors, and the camera and
    gimbal that its contracts command; `chosen` overrides fields.
    """
    vehicle, projection = policy.vehicle, policy.projection
    kept = _CRUISE_MM_S if vehicle.speeds is None else max(vehicle.speeds.cruise, vehicle.speeds.homeward)
    cruise = min(kept, vehicle.speed or kept, _FASTEST_MM_S)
    emitted = [each for contract in policy.contracts for each in contract.emits]
    fits: dict[str, Any] = {
        "home": HomePosition(projection.latitude, projection.longitude, HOME.amsl_mm),
        "hover_us": vehicle.endurance_us,
        "extras": _extras(policy),
        "camera": any(each.addressee == Addressee.CAMERA or each.command in PICTURES for each in emitted),
        "gimbal": any(each.addressee == Addressee.GIMBAL or each.command in _POINTS_GIMBAL for each in emitted),
        "cruise_mm_s": cruise,
        "max_speed_mm_s": max(cruise, _MOST_MM_S),
    }
    if vehicle.return_altitude:
        fits["return_mm"] = vehicle.return_altitude
    return SimulationConfig(**(fits | chosen))


def with_room(config: SimulationConfig, policy: Policy, steps: Sequence[Invocation]) -> SimulationConfig:
    """Return the vehicle with its own fence widened to hold the mission, as its owner would set FENCE_RADIUS and
    FENCE_ALT_MAX; otherwise preflight checks fail. PX4 has no such default fence.
    """
    if config.flavour is not AutopilotKind.ARDUPILOT:
        return config
    own = ARDUPILOT.own_fence
    values = {each.name: each.value for each in PARAMETERS if each.name in own.names} | dict(config.parameters)
    room = policy.vehicle.position_error + policy.vehicle.home_within
    wider = narrower(own, values, reach_of(steps, policy, (0, 0)), room, armed=True)
    return replace(config, parameters=(*config.parameters, *((each.parameter, each.needed) for each in wider)))
