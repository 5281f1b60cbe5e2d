"""The simulated vehicle that fits a policy."""

from typing import Any

from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.config import HOME, SimulationConfig
from rtshcua.simulation.place import Home

_CRUISE_MM_S = 5_000


def fitting(policy: Policy, **chosen: Any) -> SimulationConfig:
    """A vehicle with a policy's home, its endurance, its return, and no faster than it; `chosen` is what else it is."""
    vehicle, projection = policy.vehicle, policy.projection
    fits: dict[str, Any] = {
        "home": Home(projection.latitude, projection.longitude, HOME.amsl_mm),
        "hover_us": vehicle.endurance_us,
        "cruise_mm_s": min(_CRUISE_MM_S, vehicle.speed or _CRUISE_MM_S),
    }
    if vehicle.return_altitude:
        fits["return_mm"] = vehicle.return_altitude
    return SimulationConfig(**(fits | chosen))
