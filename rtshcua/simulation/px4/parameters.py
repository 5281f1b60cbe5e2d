"""PX4's parameters, as far as this vehicle has them, and how it flies."""

from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.parameters import Parameter
from rtshcua.simulation.vehicle import Handling

PARAMETERS = (
    Parameter("COM_DISARM_LAND", attribute="landed_disarm_s"),
    Parameter("COM_DISARM_PRFLT", attribute="idle_disarm_s"),
    Parameter("COM_LOW_BAT_ACT", integer=True, value=3),
    Parameter("MAV_SYS_ID", integer=True, value=1),
    Parameter("MIS_TAKEOFF_ALT", attribute="takeoff_up"),
    Parameter("MPC_LAND_SPEED", attribute="land_speed"),
    Parameter("MPC_XY_CRUISE", attribute="cruise"),
    Parameter("MPC_Z_VEL_MAX_DN", attribute="descent"),
    Parameter("MPC_Z_VEL_MAX_UP", attribute="climb"),
    Parameter("RTL_RETURN_ALT", attribute="return_up"),
)
"""In the order of their indices."""


def handling(config: SimulationConfig) -> Handling:
    """PX4's defaults."""
    return Handling(
        cruise=config.cruise_mm_s / 1000,
        max_speed=config.max_speed_mm_s / 1000,
        climb=3.0,
        descent=1.5,
        land_speed=0.7,
        land_below=5.0,
        return_up=30.0,
        takeoff_up=2.5,
        after_takeoff=Mode.LOITER,
        after_landing=Mode.LOITER,
    )
