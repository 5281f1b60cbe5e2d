"""How ArduCopter comes up: as recorded from 4.7. The checks pass long before there is a position."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.boot import BootPlan

_INFO = mavlink.MAV_SEVERITY_INFO

BOOT = BootPlan(
    answers_s=2.5,
    standby_s=3.0,
    booting=mavlink.MAV_STATE_BOOT,
    initialised_s=5.5,
    attitude_s=6.0,
    receiver_s=10.0,
    origin_s=20.0,
    checks_s=23.5,
    position_s=41.6,
    tells_early=True,
    texts=(
        (1.9, _INFO, "Barometer 1 calibration complete"),
        (1.9, _INFO, "Barometer 2 calibration complete"),
        (2.4, _INFO, "ArduPilot Ready"),
        (2.4, _INFO, "AHRS: DCM active"),
        (4.4, _INFO, "EKF3 IMU0 initialised"),
        (4.4, _INFO, "EKF3 IMU1 initialised"),
        (4.4, _INFO, "AHRS: EKF3 active"),
        (5.8, _INFO, "EKF3 IMU0 tilt alignment complete"),
        (5.8, _INFO, "EKF3 IMU1 tilt alignment complete"),
        (5.9, _INFO, "EKF3 IMU0 MAG0 initial yaw alignment complete"),
        (5.9, _INFO, "EKF3 IMU1 MAG0 initial yaw alignment complete"),
        (9.8, _INFO, "GPS 1: probing for u-blox at 230400 baud"),
        (9.8, _INFO, "GPS 1: detected u-blox"),
        (20.0, _INFO, "EKF3 IMU0 origin set"),
        (20.0, _INFO, "Field Elevation Set: {amsl}m"),
        (20.2, _INFO, "EKF3 IMU1 origin set"),
        (41.6, _INFO, "EKF3 IMU0 is using GPS"),
        (41.6, _INFO, "EKF3 IMU1 is using GPS"),
    ),
)
