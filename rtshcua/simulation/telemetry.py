"""The messages that both flavours send alike, built from the autopilot's state."""

import struct
from collections.abc import Mapping
from math import atan2, degrees, hypot

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message, maker
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Autopilot, Builder
from rtshcua.simulation.battery import Battery
from rtshcua.simulation.config import Equipment, Purpose
from rtshcua.simulation.failsafe import LOW_TO_LAND
from rtshcua.simulation.simulated_mark import marked
from rtshcua.simulation.surroundings import RANGE_MAX_M, RANGE_MIN_M, SECTORS

_HEARTBEAT = maker(mavlink.MAVLink_heartbeat_message)
_SYS_STATUS = maker(mavlink.MAVLink_sys_status_message)
_GPS_RAW_INT = maker(mavlink.MAVLink_gps_raw_int_message)
_GLOBAL_POSITION_INT = maker(mavlink.MAVLink_global_position_int_message)
_ATTITUDE = maker(mavlink.MAVLink_attitude_message)
_VFR_HUD = maker(mavlink.MAVLink_vfr_hud_message)
_BATTERY_STATUS = maker(mavlink.MAVLink_battery_status_message)
_HOME_POSITION = maker(mavlink.MAVLink_home_position_message)
_DISTANCE_SENSOR = maker(mavlink.MAVLink_distance_sensor_message)
_RADIO_STATUS = maker(mavlink.MAVLink_radio_status_message)
_EXTENDED_SYS_STATE = maker(mavlink.MAVLink_extended_sys_state_message)
_SYSTEM_TIME = maker(mavlink.MAVLink_system_time_message)

GOOD_FLAGS, LOST_FLAGS = 0x33F, 0x025
"""Bits that ESTIMATOR_STATUS_FLAGS and EKF_STATUS_FLAGS share: all valid; only attitude and height (as recorded)."""

_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
_NO_VOLTAGE = 65_535
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)


def heartbeat(a: Autopilot) -> Message:
    """HEARTBEAT: mode, armed flag and state."""
    vehicle, modes, mode = a.vehicle, a.flavour.modes, a.shown.mode
    base = modes.base[mode] | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if vehicle.armed else 0)
    if vehicle.blind and mode is FlightMode.LAND:
        base &= ~modes.blind
    active = vehicle.armed and (vehicle.in_air or not modes.stands_by)
    booting = a.sensors.booting
    if booting is not None:
        status = booting
    elif a.tells_danger(a.failsafes.low_voltage or (vehicle.armed and _in_danger(a))):
        status = mavlink.MAV_STATE_CRITICAL
    else:
        status = mavlink.MAV_STATE_ACTIVE if active else mavlink.MAV_STATE_STANDBY
    return _HEARTBEAT(mavlink.MAV_TYPE_QUADROTOR, a.flavour.autopilot, base, modes.numbers[mode], status, 3)


def _in_danger(a: Autopilot) -> bool:
    return not a.sensors.has_position or a.battery.level <= LOW_TO_LAND or a.fence.critical


def sys_status(a: Autopilot) -> Message | None:
    """SYS_STATUS: sensor health and the battery."""
    if not a.sensors.answers:
        return None
    present = _SENSORS | (mavlink.MAV_SYS_STATUS_GEOFENCE if a.flavour.tells_fence else 0)
    enabled = present if a.fence.in_force else _SENSORS
    healthy = present
    if a.fence.breach is not None:
        healthy &= ~mavlink.MAV_SYS_STATUS_GEOFENCE
    if not a.sensors.has_fix:
        healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_GPS
    if not a.sensors.consistent or a.sensors.unhealthy:
        healthy &= ~mavlink.MAV_SYS_STATUS_AHRS
    if a.failsafes.low_voltage:
        healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    if not a.vehicle.armed and not a.ready:
        healthy &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    battery = a.battery
    return _SYS_STATUS(
        present, enabled, healthy, 250, _millivolts(a, battery), battery.centiamperes, battery.percent, 0, 0, 0, 0, 0, 0
    )


def _millivolts(a: Autopilot, battery: Battery) -> int:
    return battery.millivolts if Equipment.VOLTAGE in a.extras else _NO_VOLTAGE


def gps_raw_int(a: Autopilot) -> Message:
    """GPS_RAW_INT: the receiver's measurement with noise; the last position while there is no fix."""
    sensors, body = a.sensors, a.vehicle.body
    if not sensors.receives:
        return _GPS_RAW_INT(a.now_us, 0, 0, 0, 0, 65_535, 65_535, 65_535, 65_535, 0)
    fix_type, satellites = (a.flavour.fix, 10) if sensors.has_fix else (mavlink.GPS_FIX_TYPE_NO_FIX, 3)
    point = sensors.fix(body)
    latitude, longitude = a.home.globe(point.north, point.east)
    amsl = a.home.amsl_mm + round(point.up * 1000)
    speed = round(hypot(body.v_north, body.v_east) * 100)
    course = round(degrees(atan2(body.v_east, body.v_north)) * 100) % 36_000
    return _GPS_RAW_INT(
        a.now_us, fix_type, latitude, longitude, amsl, 70, 110, speed, course, satellites, amsl, 900, 1780, 400
    )


def global_position_int(a: Autopilot) -> Message | None:
    """GLOBAL_POSITION_INT: the estimate. It continues unchanged when the fix is lost, as recorded."""
    body, sensors = a.vehicle.body, a.sensors
    if not sensors.tells_position:
        return None
    if not sensors.receives:
        return _GLOBAL_POSITION_INT(a.boot_ms, 0, 0, 0, 0, 0, 0, 0, 0)
    point = sensors.estimate(body)
    v_north, v_east, v_up = sensors.velocity(body)
    latitude, longitude = a.home.globe(point.north, point.east)
    up = round(point.up * 1000) if sensors.has_origin else 0
    return _GLOBAL_POSITION_INT(
        a.boot_ms,
        latitude,
        longitude,
        a.home.amsl_mm + up,
        up,
        round(v_north * 100),
        round(v_east * 100),
        round(-v_up * 100),
        round(degrees(body.yaw) * 100) % 36_000,
    )


def attitude(a: Autopilot) -> Message:
    """ATTITUDE, without rates."""
    body = a.vehicle.body
    return _ATTITUDE(a.boot_ms, body.roll, body.pitch, body.yaw, 0.0, 0.0, 0.0)


def vfr_hud(a: Autopilot) -> Message:
    """VFR_HUD: speeds, heading, throttle and altitude."""
    body = a.vehicle.body
    throttle = round(min(100.0, 45 * a.battery.load)) if a.vehicle.in_air else 0
    v_north, v_east, v_up = a.sensors.velocity(body)
    airspeed = hypot(body.v_north - a.air.north, body.v_east - a.air.east) if a.vehicle.in_air else 0.0
    return _VFR_HUD(
        airspeed,
        hypot(v_north, v_east),
        round(degrees(body.yaw)) % 360,
        throttle,
        a.home.amsl_mm / 1000 + body.up,
        v_up,
    )


_FUNCTIONS = {
    Purpose.FLIGHT: mavlink.MAV_BATTERY_FUNCTION_ALL,
    Purpose.PROPULSION: mavlink.MAV_BATTERY_FUNCTION_PROPULSION,
    Purpose.AVIONICS: mavlink.MAV_BATTERY_FUNCTION_AVIONICS,
    Purpose.PAYLOAD: mavlink.MAV_BATTERY_FUNCTION_PAYLOAD,
}


def battery_status(a: Autopilot) -> Message:
    """BATTERY_STATUS of each battery in turn; the first one replaces a battery whose report is not due."""
    number = a.battery_reports % len(a.batteries)
    a.battery_reports += 1
    if number in a.battery_told_us and a.now_us - a.battery_told_us[number] < a.battery_every_us[number]:
        number = 0
    a.battery_told_us[number] = a.now_us
    purpose, battery = a.batteries[number]
    told = a.flavour.names_batteries  # ArduPilot does not report what a battery feeds (recorded)
    if battery.level <= 0.07:
        charge = mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
    elif battery.level <= 0.15:
        charge = mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    else:
        charge = mavlink.MAV_BATTERY_CHARGE_STATE_OK
    rises = a.gauge_rise if a.battery_reports % 5 == 0 else 0
    voltages = [_millivolts(a, battery)] + [_NO_VOLTAGE] * 9
    return _BATTERY_STATUS(
        number,
        _FUNCTIONS[purpose] if told else mavlink.MAV_BATTERY_FUNCTION_UNKNOWN,
        mavlink.MAV_BATTERY_TYPE_LIPO if told else mavlink.MAV_BATTERY_TYPE_UNKNOWN,
        32_767,
        voltages,
        battery.centiamperes,
        round(battery.used_mah),
        -1,
        min(battery.percent + rises, 100),
        0,
        charge,
    )


def home_position(a: Autopilot) -> Message | None:
    """HOME_POSITION; None until home is set."""
    if not a.sensors.has_origin:
        return None
    home = a.home
    return _HOME_POSITION(
        home.latitude, home.longitude, home.amsl_mm, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, a.now_us
    )


def distance_sensor(a: Autopilot) -> Message | None:
    """DISTANCE_SENSOR of the forward or downward range finder, in turn; the maximum range if nothing is there."""
    ahead, down = Equipment.RANGE in a.extras, Equipment.ALTIMETER in a.extras
    a.looked_down = down and not (ahead and a.looked_down)
    if a.looked_down:
        return _looks_down(a)
    return _looks_ahead(a) if ahead else None


def _looks_down(a: Autopilot) -> Message:
    """DISTANCE_SENSOR of the downward range finder, as recorded from PX4's simulation."""
    return _DISTANCE_SENSOR(
        a.boot_ms, 0, 10_000, round(a.vehicle.body.up * 100), mavlink.MAV_DISTANCE_SENSOR_LASER, 0,
        mavlink.MAV_SENSOR_ROTATION_PITCH_270, 0,
    )  # fmt: skip


def _looks_ahead(a: Autopilot) -> Message:
    seen = a.surroundings.ahead(a.vehicle.body)
    return _DISTANCE_SENSOR(
        a.boot_ms,
        int(RANGE_MIN_M * 100),
        int(RANGE_MAX_M * 100),
        int((RANGE_MAX_M if seen is None else seen) * 100),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        1 if Equipment.ALTIMETER in a.extras else 0,
        mavlink.MAV_SENSOR_ROTATION_NONE,
        255,
    )


def obstacle_distance(a: Autopilot) -> Message | None:
    """OBSTACLE_DISTANCE from ahead clockwise; a centimetre more than the maximum range means no obstacle."""
    if Equipment.RANGE not in a.extras:
        return None
    furthest = int(RANGE_MAX_M * 100)
    seen = a.surroundings.around(a.vehicle.body)
    return mavlink.MAVLink_obstacle_distance_message(
        a.now_us,
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        [furthest + 1 if distance is None else int(distance * 100) for distance in seen],
        360 // SECTORS,
        int(RANGE_MIN_M * 100),
        furthest,
        360 / SECTORS,
        0.0,
        mavlink.MAV_FRAME_BODY_FRD,
    )


def radio_status(a: Autopilot) -> Message:
    """RADIO_STATUS of the radio: signal strength 254 at full quality, and `txbuf` as the link quality in %."""
    percent = a.link_quality // 100
    rssi = 254 * percent // 100
    return _RADIO_STATUS(rssi, rssi, percent, 30, 30, 0, 0)


def extended_sys_state(vtol: int) -> Builder:
    """EXTENDED_SYS_STATE; `vtol` is its `vtol_state`."""
    return lambda a: _EXTENDED_SYS_STATE(vtol, a.shown.landed)


def autopilot_version(capabilities: int, kind: int, numbered: int) -> Builder:
    """AUTOPILOT_VERSION; `kind` is FIRMWARE_VERSION_TYPE, `numbered` its `vendor_id` and `uid`."""
    zeros = [0] * 8

    def build(a: Autopilot) -> Message:
        major, minor = a.release
        version = major << 24 | minor << 16 | kind
        custom = (zeros, *marked(a.speed))
        parts = (0, 0, numbered, *custom, 0, 0, numbered)
        return mavlink.MAVLink_autopilot_version_message(_CAPABILITIES | capabilities, version, *parts)

    return build


def system_time(a: Autopilot) -> Message:
    """SYSTEM_TIME: UTC once the receiver has it (0 before, as recorded), and the time since the start."""
    return _SYSTEM_TIME(a.utc_us + a.now_us if a.sensors.receives else 0, a.boot_ms)


AVAILABLE_MODES = 435
"""Not in the pymavlink dialect: https://mavlink.io/en/messages/common.html#AVAILABLE_MODES."""
_LAYOUT = struct.Struct("<IIBBB35s")

CURRENT_MODE = 436
"""Not in the pymavlink dialect: https://mavlink.io/en/messages/common.html#CURRENT_MODE."""
_CURRENT_MODE_LAYOUT = struct.Struct("<IIB")

_STANDARD: Mapping[FlightMode, int] = {
    FlightMode.POSITION: 1, FlightMode.ALTITUDE: 4, FlightMode.RETURN: 5, FlightMode.MISSION: 6, FlightMode.LAND: 7,
    FlightMode.TAKEOFF: 8
}  # fmt: skip
"""MAV_STANDARD_MODE of a mode; 0 for the others."""


class _Packed(mavlink.MAVLink_message):  # type: ignore[misc]
    """A message that the dialect lacks, with its payload already packed."""

    id: int
    name: str
    extra: int

    def __init__(self, payload: bytes) -> None:
        super().__init__(self.id, self.name)
        self._bytes = payload

    def pack(self, mav: Message, force_mavlink1: bool = False) -> Message:
        """Return the frame."""
        return self._pack(mav, self.extra, self._bytes, force_mavlink1=force_mavlink1)


class _AvailableModes(_Packed):
    id, name, extra = AVAILABLE_MODES, "AVAILABLE_MODES", 134


class _CurrentMode(_Packed):
    id, name, extra = CURRENT_MODE, "CURRENT_MODE", 193


def available_modes(a: Autopilot, number: int) -> bool:
    """Queue the mode of this number from 1, or all modes for 0; return False if there is no such mode."""
    modes = a.flavour.modes
    listed = list(modes.numbers.items())
    if not 0 <= number <= len(listed):
        return False
    for index, (mode, custom) in enumerate(listed, start=1):
        if number in (0, index):
            name = modes.name(mode).encode()
            payload = _LAYOUT.pack(custom, 0, len(listed), index, _STANDARD.get(mode, 0), name)
            a.send(_AvailableModes(payload))
    return True


def current_mode(a: Autopilot) -> Message:
    """CURRENT_MODE of the reported mode."""
    mode = a.shown.mode
    number = a.flavour.modes.numbers[mode]
    payload = _CURRENT_MODE_LAYOUT.pack(number, number, _STANDARD.get(mode, 0))
    return _CurrentMode(payload)


COMMON: dict[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: distance_sensor,
    mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: obstacle_distance,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: lambda a: a.mission.message(),
}
"""The shared message builders, by id."""
