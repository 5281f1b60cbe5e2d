"""ArduCopter as recorded from 4.7: modes, boot sequence, refusals, and behaviour without commands.

It requests items with the legacy MISSION_REQUEST and accepts either form. Slot 0 of a mission is home, whatever was
uploaded there. It does not check waypoints against the fence, neither at upload nor at the start.
"""

from collections.abc import Callable
from math import inf, isfinite
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import COPTER_NAMES, CopterMode
from rtshcua.model.faults import FlightMode
from rtshcua.simulation import mission_protocol
from rtshcua.simulation.answers import Delays, Lanes
from rtshcua.simulation.ardupilot.commands import COMMANDS, above_home, enter_number
from rtshcua.simulation.ardupilot.parameters import HANDLING, PARAMETERS
from rtshcua.simulation.ardupilot.telemetry import BUILDERS, DEFAULT, GROUPS
from rtshcua.simulation.autopilot import LOW_TO_ARM, Autopilot, Flavour
from rtshcua.simulation.failsafe import FailsafeRules
from rtshcua.simulation.fence import Breach, FenceArea, FenceCircle, FenceLimits, FenceRules
from rtshcua.simulation.mission import MissionRules
from rtshcua.simulation.mission_protocol import PlanItem, TransferRules
from rtshcua.simulation.modes import NEEDS_POSITION, ModeTable
from rtshcua.simulation.place import HomePosition, Point
from rtshcua.simulation.sensors import BootPlan
from rtshcua.simulation.vehicle import Multirotor, VehicleEvent

_CRITICAL, _INFO = mavlink.MAV_SEVERITY_CRITICAL, mavlink.MAV_SEVERITY_INFO
_GUIDED = enums.MAV_MODE_FLAG_GUIDED_ENABLED
_BASE = (
    enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | enums.MAV_MODE_FLAG_STABILIZE_ENABLED
    | enums.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)
"""`base_mode` in every mode; modes that hold a place add the guided bit."""
_REPOSITION_M_S = 1.25
"""Half of WPNAV_ACCEL, as in `land_run_horizontal_control`."""

_UNSIGNED = frozenset({"RADIO_STATUS", "RADIO"})
_PARAMETERS = frozenset({"PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "PARAM_SET"})
"""The messages that another thread answers (`GCS_MAVLINK::param_io_timer`)."""

_CEILING, _CIRCLE, _POLYGON, _FLOOR = 1, 2, 4, 8
"""The bits of FENCE_TYPE."""
_REPORT, _RETURN, _LAND, _BRAKE = 0, 1, 2, 4
"""FENCE_ACTION; the smart returns (3, 5) are simulated as plain returns."""
_GIVE_UP_M = 100.0
"""Farther outside than this, it lands instead of returning."""
_VEL_LIMIT = 2


def _limits(value: Callable[[str], float], area: FenceArea) -> FenceLimits | None:
    """Return the fence of the FENCE_* parameters and the upload."""
    kinds = int(value("FENCE_TYPE"))
    if value("FENCE_ENABLE") < 1:
        return None
    included = area.included if kinds & _POLYGON else ()
    excluded = area.excluded if kinds & _POLYGON else ()
    if kinds & _CIRCLE:
        included = (*included, FenceCircle((0.0, 0.0), value("FENCE_RADIUS")))
    ceiling = value("FENCE_ALT_MAX") if kinds & _CEILING else inf
    floor = value("FENCE_ALT_MIN") if kinds & _FLOOR else -inf
    # `ModeRTL::compute_return_target` lowers a return to `get_safe_alt_max`
    return FenceLimits(FenceArea(included, excluded, every=True), ceiling, floor, ceiling - value("FENCE_MARGIN"))


def _name(limits: FenceLimits, point: Point) -> str:
    if point.up > limits.ceiling:
        return "Max Alt"
    for shape in limits.area.included:
        if isinstance(shape, FenceCircle) and shape.centre == (0.0, 0.0) and not shape.holds(point.north, point.east):
            return "Circle"
    return "Polygon"


_NAMES = {
    mission_protocol.WAYPOINT: "WP",
    mission_protocol.TAKEOFF: "Takeoff",
    mission_protocol.LAND: "Land",
    mission_protocol.RETURN: "RTL",
    mission_protocol.LOITER: "LoitUnlim",
    mission_protocol.LOITER_TIME: "LoitTime",
}


def _judge(
    items: tuple[PlanItem, ...], _vehicle: Multirotor, _home: HomePosition, _allows: Callable[[Point], bool]
) -> bool:
    return len(items) > 1


def _may_enter(items: tuple[PlanItem, ...], vehicle: Multirotor) -> bool:
    """Return whether AUTO may be entered: on the ground and armed, the first navigation item must be a takeoff."""
    on_ground = vehicle.armed and not vehicle.in_air
    return (
        not on_ground
        or next((item.command for item in items[1:] if item.command in _NAMES), None) == mission_protocol.TAKEOFF
    )


_PLACE, _VELOCITY = 0b111, 0b111_000
"""The bits of `type_mask` that disable the place and the velocity."""


class ArduCopter(Flavour):
    """The flavour ArduCopter."""

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    modes = ModeTable(
        numbers={
            FlightMode.MANUAL: CopterMode.STABILIZE,
            FlightMode.ALTITUDE: CopterMode.ALT_HOLD,
            FlightMode.MISSION: CopterMode.AUTO,
            FlightMode.GUIDED: CopterMode.GUIDED,
            FlightMode.LOITER: CopterMode.LOITER,
            FlightMode.RETURN: CopterMode.RTL,
            FlightMode.LAND: CopterMode.LAND,
            FlightMode.POSITION: CopterMode.POSHOLD,
            FlightMode.BRAKE: CopterMode.BRAKE,
        },
        base={
            mode: _BASE | (_GUIDED if mode in NEEDS_POSITION or mode is FlightMode.LAND else 0) for mode in FlightMode
        },
        start=FlightMode.MANUAL,
        armable=frozenset(
            {FlightMode.MANUAL, FlightMode.ALTITUDE, FlightMode.GUIDED, FlightMode.LOITER, FlightMode.POSITION}
        ),
        blind=_GUIDED,
        stands_by=True,
        names=COPTER_NAMES,
    )
    boot = BootPlan(  # the checks pass long before the position is valid
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
    lanes = Lanes(
        lambda received: received.name in _PARAMETERS,
        (
            Delays(
                (0, 200), (10, 3_000), (30, 4_300), (50, 5_500), (70, 5_900), (90, 6_900), (98, 13_200), (100, 23_100)
            ),
            Delays((0, 1_100), (10, 4_900), (30, 6_600), (50, 11_800), (60, 75_800), (100, 94_200)),
        ),
    )  # fmt: skip
    failsafes = FailsafeRules(
        position=((_CRITICAL, "EKF variance"), (_CRITICAL, "EKF Failsafe: changed to LAND Mode")),
        position_after_s=0.9,
        land_pause_s=4.0,
        position_back=(_CRITICAL, "EKF Failsafe Cleared"),
        level=(_CRITICAL, "Battery Failsafe"),
        low_voltage="BATT_LOW_VOLT",
        low_action="BATT_FS_LOW_ACT",
        low_text="Battery Failsafe",
    )
    texts = MappingProxyType(
        {
            VehicleEvent.ARMED: "Arming motors",
            VehicleEvent.DISARMED: "Disarming motors",
            VehicleEvent.TOUCHED: "SIM Hit ground at {speed:f} m/s",
            VehicleEvent.CRASHED: "Crash: Disarming: AngErr=80>30, Accel=1.0<3.0",
            VehicleEvent.AUTO_DISARMED: "Disarming motors",
        }
    )
    speaks_for_payload = True
    texts_need_ground_station = False
    check_text = "PreArm"
    falls_back = False
    beats_on_mode = reminds = tells_fence = True
    fix = mavlink.GPS_FIX_TYPE_RTK_FIXED
    coast_s = 7.0
    key_ahead_us = 60_000_000  # recorded; protects against replay of frames from before a restart (`load_signing_key`)
    handling, parameters = HANDLING, PARAMETERS
    names_batteries = False  # recorded: function and type are 0, unknown
    bytewise = False
    commands = COMMANDS
    builders, streams = BUILDERS, DEFAULT
    transfer = TransferRules(
        retry_us=1_000_000,
        abort_us=8_000_000,
        on_abort=mavlink.MAV_MISSION_OPERATION_CANCELLED,
        out_of_order=mavlink.MAV_MISSION_INVALID_SEQUENCE,
        busy=mavlink.MAV_MISSION_DENIED,
        capacity=(724, 84, 10),
        fence_items=mission_protocol.FENCE_ITEMS,
        keeps_home=True,
    )
    missions = MissionRules(
        first=1,
        judge=_judge,
        may_enter=_may_enter,
        waits_for_start=True,
        text=lambda number, item: f"Mission: {number} {_NAMES.get(item.command, 'Delay')}",
    )
    fence = FenceRules(limits=_limits, name=_name, every=True, critical=lambda _: False)

    def arming(self, a: Autopilot) -> tuple[str, ...]:
        """Return the failed arming checks. Modes that need no position can be armed in without one."""
        found = []
        if a.vehicle.crashed:
            found.append("Leaning")
        if not a.sensors.consistent:
            found.append("Accels inconsistent")
        elif a.vehicle.mode in NEEDS_POSITION:
            if not a.sensors.has_fix:
                found.append("GPS 1: Bad fix")
            elif not a.sensors.has_position:
                found.append("Need Position Estimate")
        if a.failsafes.low_voltage:
            found += ["Battery 1 low voltage failsafe", "Battery failsafe"]
        if a.battery.level <= LOW_TO_ARM:
            found.append("Battery 1 below minimum arming capacity")
        if not a.fence.allows(a.here):
            found.append("Vehicle breaching fence")
        return tuple(found)

    def release(self, *, keyed: bool) -> tuple[int, int]:
        """Return the recorded release."""
        return 4, 7

    def obeys_unsigned(self, a: Autopilot, name: str) -> bool:
        """Return whether the message is obeyed unsigned: any on the first channel (USB, recorded), else radio."""
        return a.usb or name in _UNSIGNED

    def home_item(self, home: HomePosition) -> PlanItem | None:
        """Return home as slot 0 of every mission."""
        return PlanItem(
            mission_protocol.WAYPOINT,
            mavlink.MAV_FRAME_GLOBAL,
            x=home.latitude,
            y=home.longitude,
            z=home.amsl_mm / 1000,
        )

    def on_setup_signing(self, a: Autopilot, message: Message) -> None:
        """Handle SETUP_SIGNING: refused while armed, even to disable signing, as recorded."""
        if a.vehicle.armed:
            a.say(mavlink.MAV_SEVERITY_WARNING, "ERROR: Won't setup signing when armed")
        else:
            a.signing.set_up(message, a.now_us)

    def on_set_mode(self, a: Autopilot, number: int) -> tuple[int, ...]:
        """Handle SET_MODE; acknowledged with the message's own id as the command."""
        return enter_number(a, number)

    def on_position_target(self, a: Autopilot, message: Message) -> None:
        """Fly to the target, or at its velocity if it has no place, in GUIDED in the air; otherwise ignore it."""
        self._fly_at(a, message)
        up = above_home(a, message.coordinate_frame, message.alt)
        if a.vehicle.mode is FlightMode.GUIDED and up is not None and not message.type_mask & 0b111:
            target = Point(*a.home.local(message.lat_int, message.lon_int), up)
            if a.fence.allows(target):
                a.vehicle.go_to(target)
                if not message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE and isfinite(message.yaw):
                    a.vehicle.turn_to(message.yaw)

    def on_local_target(self, a: Autopilot, message: Message) -> None:
        """Fly to a target in metres from home, north, east and down, or at its velocity, under the same conditions."""
        self._fly_at(a, message)
        if message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED and not message.type_mask & 0b111:
            target = Point(message.x, message.y, -message.z)
            if a.vehicle.mode is FlightMode.GUIDED and a.fence.allows(target):
                a.vehicle.go_to(target)

    @staticmethod
    def _fly_at(a: Autopilot, message: Message) -> None:
        """Fly at a velocity if the message has no place (`handle_message_set_position_target_local_ned`)."""
        mask = message.type_mask
        if a.vehicle.mode is FlightMode.GUIDED and mask & _PLACE == _PLACE and not mask & _VELOCITY:
            a.vehicle.fly_at(message.vx, message.vy, -message.vz)

    def on_data_stream(self, a: Autopilot, stream: int, rate_hz: int) -> None:
        """Set the interval of every message of the group, overriding SET_MESSAGE_INTERVAL."""
        for number in GROUPS.get(stream, ()):
            a.streams.set(number, 1_000_000 // rate_hz if rate_hz > 0 else -1)

    def on_plan(self, a: Autopilot, kind: int) -> None:
        """Report a stored plan and its number of items."""
        if kind == mission_protocol.MISSION:
            a.say(_INFO, "Flight plan received")
        elif kind == mission_protocol.FENCE:
            a.say(mavlink.MAV_SEVERITY_DEBUG, "Fence Indexed OK")
        name = {
            mission_protocol.MISSION: "MIS_TOTAL",
            mission_protocol.FENCE: "FENCE_TOTAL",
            mission_protocol.RALLY: "RALLY_TOTAL",
        }[kind]
        a.send(a.parameters.assign(name, len(a.plans.items(kind))))

    def on_sticks(self, a: Autopilot, for_us: int) -> None:
        """Shift the vehicle while landing (LAND_REPOSITION) and in LOITER and POSHOLD."""
        vehicle = a.vehicle
        if vehicle.mode in (FlightMode.LOITER, FlightMode.POSITION) or vehicle.descends:
            vehicle.shift_east(_REPOSITION_M_S * for_us / 1_000_000)

    def on_breach(self, a: Autopilot, breach: Breach) -> None:
        """Report a breach and take FENCE_ACTION, once.

        A mode change after that is obeyed for the rest of the breach ("Manual recovery"), as recorded.
        """
        kind = mavlink.FENCE_BREACH_MAXALT if breach.name == "Max Alt" else mavlink.FENCE_BREACH_BOUNDARY
        count = min(a.fence.count, 65_535)
        a.send(mavlink.MAVLink_fence_status_message(1, count, kind, a.boot_ms, _VEL_LIMIT))
        a.say(mavlink.MAV_SEVERITY_NOTICE, f"{breach.name} fence breached")
        action, vehicle = a.parameters.value("FENCE_ACTION"), a.vehicle
        if action == _REPORT:
            return
        if action == _LAND or breach.by > _GIVE_UP_M:
            vehicle.set_mode(FlightMode.LAND)
        elif action == _BRAKE:
            vehicle.set_mode(FlightMode.BRAKE)
        else:
            vehicle.set_mode(FlightMode.RETURN)

    def on_mode_in_breach(self, a: Autopilot) -> None:
        """Report manual recovery: a mode change during a breach counts as the pilot's."""
        a.say(_INFO, "Manual recovery started")

    def on_breach_cleared(self, a: Autopilot) -> None:
        """Report the end of a breach."""
        a.say(mavlink.MAV_SEVERITY_NOTICE, "Fence breach cleared")
