"""The simulated vehicle that fits a policy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.bounds import narrower, reach_of
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.ardupilot.parameters import PARAMETERS
from rtshcua.simulation.config import HOME, STOCK, AutopilotKind, Equipment, SimulationConfig
from rtshcua.simulation.place import HomePosition

_CRUISE_MM_S = 5_000
#: what a simulated vehicle flies at most, if nothing is chosen, and at all
_MOST_MM_S = 12_000
_FASTEST_MM_S = 15_000
_TOLD_IN = {
    "RADIO_STATUS": Equipment.RADIO, "DISTANCE_SENSOR": Equipment.RANGE, "OBSTACLE_DISTANCE": Equipment.RANGE,
    "WIND": Equipment.WIND, "WIND_COV": Equipment.WIND,
}  # fmt: skip


def _extras(policy: Policy) -> frozenset[Equipment]:
    """What has to be fitted for the signals of a policy to come."""
    messages = {source.message for signal in policy.signals for source in signal.sources}
    return STOCK | {extra for message, extra in _TOLD_IN.items() if message in messages}


def fitting(policy: Policy, **chosen: Any) -> SimulationConfig:
    """A vehicle with a policy's home, its endurance, its return, as fast as it says at least, with the sensors that it
    reads; `chosen` is what else it is.
    """
    vehicle, projection = policy.vehicle, policy.projection
    kept = _CRUISE_MM_S if vehicle.speeds is None else max(vehicle.speeds.cruise, vehicle.speeds.homeward)
    cruise = min(kept, vehicle.speed or kept, _FASTEST_MM_S)
    fits: dict[str, Any] = {
        "home": HomePosition(projection.latitude, projection.longitude, HOME.amsl_mm),
        "hover_us": vehicle.endurance_us,
        "extras": _extras(policy),
        "cruise_mm_s": cruise,
        "max_speed_mm_s": max(cruise, _MOST_MM_S),
    }
    if vehicle.return_altitude:
        fits["return_mm"] = vehicle.return_altitude
    return SimulationConfig(**(fits | chosen))


def with_room(config: SimulationConfig, policy: Policy, steps: Sequence[Invocation]) -> SimulationConfig:
    """The same vehicle, with a fence of its own that is as wide and high as a mission goes: so its owner would have set
    FENCE_RADIUS and FENCE_ALT_MAX, without which no real one is ready for it. A PX4 comes without such bounds.
    """
    if config.flavour is not AutopilotKind.ARDUPILOT:
        return config
    own = ARDUPILOT.own_fence
    values = {each.name: each.value for each in PARAMETERS if each.name in own.names} | dict(config.parameters)
    room = policy.vehicle.position_error + policy.vehicle.home_within
    wider = narrower(own, values, reach_of(steps, policy, (0, 0)), room, armed=True)
    return replace(config, parameters=(*config.parameters, *((each.parameter, each.needed) for each in wider)))
