"""ArduCopter's parameters, as far as this vehicle has them, and how it flies."""

from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.parameters import Parameter
from rtshcua.simulation.vehicle import Handling

PARAMETERS = (
    Parameter("DISARM_DELAY", integer=True, attribute="idle_disarm_s"),
    Parameter("FENCE_ENABLE", integer=True),
    Parameter("LAND_SPEED", attribute="land_speed", scale=100),
    Parameter("RTL_ALT", attribute="return_up", scale=100),
    Parameter("SYSID_MYGCS", integer=True, value=255),
    Parameter("SYSID_THISMAV", integer=True, value=1),
    Parameter("WPNAV_SPEED", attribute="cruise", scale=100),
    Parameter("WPNAV_SPEED_DN", attribute="descent", scale=100),
    Parameter("WPNAV_SPEED_UP", attribute="climb", scale=100),
)
"""In the order of their indices."""


def handling(config: SimulationConfig) -> Handling:
    """ArduCopter's defaults."""
    return Handling(
        cruise=config.cruise_mm_s / 1000,
        max_speed=config.max_speed_mm_s / 1000,
        climb=2.5,
        descent=1.5,
        land_speed=0.5,
        land_below=10.0,
        return_up=15.0,
        takeoff_up=2.5,
        landed_disarm_s=1.0,
    )
