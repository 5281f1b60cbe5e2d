"""How PX4 comes up: as recorded from v1.16."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.boot import BootPlan

BOOT = BootPlan(
    answers_s=0.2,
    standby_s=3.8,
    booting=mavlink.MAV_STATE_UNINIT,
    initialised_s=0.5,
    attitude_s=1.6,
    receiver_s=0.1,
    origin_s=1.9,
    checks_s=5.0,
    position_s=2.4,
    tells_early=False,
)
