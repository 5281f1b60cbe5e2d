"""PX4 as recorded from v1.16: modes, boot sequence, refusals, and behaviour without commands.

An upload is acknowledged before the mission is checked, so the ACK does not mean that the mission can be flown. Until
the check is done the previous result holds, and MISSION_START right after an upload is denied, as recorded.
"""

from collections.abc import Callable
from math import hypot, inf, isfinite, nan
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import PX4_NAMES, Px4Mode
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.answers import Delays, Lanes
from rtshcua.simulation.autopilot import LOW_TO_ARM, Autopilot, Flavour
from rtshcua.simulation.failsafe import FailsafeRules
from rtshcua.simulation.fence import Breach, FenceArea, FenceLimits, FenceRules
from rtshcua.simulation.mission import MissionRules
from rtshcua.simulation.mission_protocol import (
    AMSL_FRAMES,
    ERROR,
    FENCE_ITEMS,
    NAVIGATION,
    RELATIVE_FRAMES,
    RETURN_POINT,
    PlanItem,
    TransferRules,
)
from rtshcua.simulation.modes import NEEDS_POSITION, ModeTable
from rtshcua.simulation.place import HomePosition, Point
from rtshcua.simulation.px4.commands import COMMANDS, enter_number, fly_kept
from rtshcua.simulation.px4.parameters import HANDLING, PARAMETERS
from rtshcua.simulation.px4.telemetry import BUILDERS, CONSTANT, DEFAULT, LEAST_US, ONLY_STREAMED
from rtshcua.simulation.sensors import BootPlan
from rtshcua.simulation.vehicle import Multirotor, VehicleEvent

_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
_ORBITS = enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | enums.MAV_MODE_FLAG_STABILIZE_ENABLED
_BY_PILOT = _ORBITS | enums.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
_BY_ITSELF = _ORBITS | enums.MAV_MODE_FLAG_AUTO_ENABLED | enums.MAV_MODE_FLAG_GUIDED_ENABLED
_AUTOMATIC = frozenset(
    {FlightMode.TAKEOFF, FlightMode.LOITER, FlightMode.MISSION, FlightMode.RETURN, FlightMode.LAND, FlightMode.ORBIT}
)

_RECORDED = 1, 16
_SIGNS_BY_PARAMETER = 1, 17
"""The first release with signing (https://github.com/PX4/PX4-Autopilot/pull/25284)."""
_SIGNS_BY_KEY = 1, 18
"""The release that removed MAV_SIGN_CFG (https://github.com/PX4/PX4-Autopilot/pull/26894)."""
_UNSIGNED = frozenset({"RADIO_STATUS", "ADSB_VEHICLE", "COLLISION"})
_COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
_BY_RECEIVER = frozenset({mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL})
"""The commands that the MAVLink receiver answers itself; it passes others to the commander (`Mavlink::send`)."""

_WARN, _HOLD, _RETURN, _TERMINATE, _LAND = 1, 2, 3, 4, 5
"""GF_ACTION; 0 is no action."""
_LATE: dict[float, FlightMode] = {_RETURN: FlightMode.RETURN, _LAND: FlightMode.LAND}


def _limits(value: Callable[[str], float], area: FenceArea) -> FenceLimits | None:
    """Return the fence of the GF_* parameters and the upload."""
    if value("GF_ACTION") == 0:
        return None
    across, high = value("GF_MAX_HOR_DIST"), value("GF_MAX_VER_DIST")
    if area == FenceArea() and not across > 0 and not high > 0:
        return None
    # all limits apply: `Geofence::checkPointAgainstAllGeofences`
    return FenceLimits(area, high if high > 0 else inf, across=across if across > 0 else inf)


def _acts(value: Callable[[str], float]) -> bool:
    """Return whether a breach is a failsafe; since 1.15 a warning is not (PX4-Autopilot pull request 22879)."""
    return value("GF_ACTION") > _WARN


FARTHEST_FIRST_M = 10_000.0
"""MIS_DIST_1WP: the greatest distance of the first waypoint from home."""


def _judge(
    items: tuple[PlanItem, ...], _vehicle: Multirotor, home: HomePosition, allows: Callable[[Point], bool]
) -> bool:
    """Return whether the mission is feasible: every place inside the fence, and the first one not too far."""
    first = True
    for item in items:
        if item.command not in NAVIGATION or not item.has_place:
            continue
        north, east = home.local(item.x, item.y)
        up = item.z - home.amsl_mm / 1000 if item.frame in AMSL_FRAMES else item.z
        if not allows(Point(north, east, up if isfinite(up) else 0.0)):
            return False
        if first and hypot(north, east) > FARTHEST_FIRST_M:
            return False
        first = False
    return bool(items)


class Px4(Flavour):
    """The flavour PX4."""

    autopilot = mavlink.MAV_AUTOPILOT_PX4
    modes = ModeTable(
        numbers={
            FlightMode.MANUAL: Px4Mode.MANUAL,
            FlightMode.ALTITUDE: Px4Mode.ALTITUDE,
            FlightMode.POSITION: Px4Mode.POSITION,
            FlightMode.ORBIT: Px4Mode.ORBIT,
            FlightMode.TAKEOFF: Px4Mode.TAKEOFF,
            FlightMode.LOITER: Px4Mode.HOLD,
            FlightMode.MISSION: Px4Mode.MISSION,
            FlightMode.RETURN: Px4Mode.RETURN,
            FlightMode.LAND: Px4Mode.LAND,
            FlightMode.GUIDED: Px4Mode.OFFBOARD,
        },
        base=dict.fromkeys(FlightMode, _BY_ITSELF)
        | dict.fromkeys((FlightMode.MANUAL, FlightMode.ALTITUDE, FlightMode.POSITION), _BY_PILOT)
        | {FlightMode.ORBIT: _ORBITS},
        start=FlightMode.LOITER,
        armable=frozenset(FlightMode) - {FlightMode.RETURN, FlightMode.LAND},
        names=PX4_NAMES,
    )
    boot = BootPlan(
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
    lanes = Lanes(
        lambda received: received.name in _COMMANDS and getattr(received.message, "command", None) not in _BY_RECEIVER,
        (
            Delays(
                (0, 300), (10, 4_200), (30, 7_500), (50, 8_800), (70, 12_200), (90, 18_500), (98, 34_200),
                (100, 333_000),
            ),
            Delays(
                (0, 1_500), (10, 3_800), (30, 7_200), (50, 8_700), (70, 12_000), (90, 20_200), (98, 53_600),
                (100, 63_000),
            ),
        ),
    )  # fmt: skip
    failsafes = FailsafeRules(
        position=((_CRITICAL, "Failsafe: no global position, landing blindly\t"),),
        level=(_CRITICAL, "Emergency battery level, landing immediately\t"),
    )
    texts = MappingProxyType(
        {
            VehicleEvent.ARMED: "Armed by external command\t",
            VehicleEvent.DISARMED: "Disarmed by external command\t",
            VehicleEvent.TAKEOFF: "Takeoff detected\t",
            VehicleEvent.RETURN: "Returning to launch\t",
            VehicleEvent.RETURN_CLIMB: "RTL: start return at {amsl} m ({up} m above destination)\t",
            VehicleEvent.HOME: "RTL: land at destination\t",
            VehicleEvent.LANDED: "Landing detected\t",
            VehicleEvent.TIPPED: "Attitude failure detected\t",
            VehicleEvent.AUTO_DISARMED: "Disarmed by landing\t",
        }
    )
    speaks_for_payload = False
    texts_need_ground_station = True
    check_text = "Preflight Fail"
    falls_back = True
    status_lag_us = 10_000, 15_000
    beats_on_mode = reminds = tells_fence = False
    fix = mavlink.GPS_FIX_TYPE_3D_FIX
    coast_s = 5.0
    handling, parameters = HANDLING, PARAMETERS
    names_batteries = True
    bytewise = True
    commands = COMMANDS
    target_timeout_us = 1_000_000
    builders, streams = BUILDERS, DEFAULT
    constant, only_streamed, least_us = CONSTANT, ONLY_STREAMED, LEAST_US
    transfer = TransferRules(
        learns_int=True,
        retry_us=250_000,
        abort_us=5_000_000,
        busy=ERROR,
        opens_downloads=True,
        capacity=(500, 64, 32),
        fence_items=FENCE_ITEMS - {RETURN_POINT},
    )
    missions = MissionRules(
        judge=_judge,
        judged_us=150_000,
        return_is_mode=True,
        after=FlightMode.LOITER,
        tells_all=True,
    )
    fence = FenceRules(limits=_limits, name=lambda _limits, _point: "Geofence", every=False, critical=_acts)

    def arming(self, a: Autopilot) -> tuple[str, ...]:
        """Return the failed arming checks."""
        found = []
        if a.vehicle.crashed:
            found.append("Attitude failure (roll)")
        if not a.sensors.consistent:
            found.append("system is starting up")
        if a.vehicle.mode in NEEDS_POSITION and not a.sensors.has_position:
            found.append("no valid global position")
        if a.sensors.receives and not a.sensors.has_fix:
            found.append("GPS fix too low")
        if a.battery.level <= LOW_TO_ARM:
            found.append("battery too low")
        if not a.fence.allows(a.here):
            found.append("vehicle outside geofence")
        return tuple(found)

    def release(self, *, keyed: bool) -> tuple[int, int]:
        """Return the recorded release, or with a key the first one that accepts keys on any link."""
        return _SIGNS_BY_KEY if keyed else _RECORDED

    def obeys_unsigned(self, a: Autopilot, name: str) -> bool:
        """Return whether the message is obeyed unsigned.

        1.17 depends on MAV_SIGN_CFG: 0 (default) always, 1 on USB only, 2 never. 1.18: never. Some messages are always
        obeyed unsigned (`mavlink_sign_control.cpp`, `unsigned_messages`).
        """
        if a.release >= _SIGNS_BY_KEY:
            return name in _UNSIGNED or name == "HEARTBEAT"
        wanted = a.parameters.value("MAV_SIGN_CFG")
        return wanted == 0 or (wanted == 1 and a.usb) or name in _UNSIGNED

    def on_setup_signing(self, a: Autopilot, message: Message) -> None:
        """Handle SETUP_SIGNING: 1.16 ignores it, 1.17 accepts it on USB only, 1.18 on any link while disarmed."""
        if a.release < _SIGNS_BY_PARAMETER:
            return
        if a.release < _SIGNS_BY_KEY:
            if a.usb:
                a.signing.set_up(message, a.now_us)
        elif a.vehicle.armed:
            a.say(_CRITICAL, "MAVLink signing: rejected while armed\t")
        else:
            a.signing.set_up(message, a.now_us)

    def on_entered(self, a: Autopilot) -> None:
        """On entering Hold, fly to the target of a DO_REPOSITION of the last half second."""
        fly_kept(a)

    def on_set_mode(self, a: Autopilot, number: int) -> tuple[int, ...]:
        """Handle SET_MODE; never acknowledged."""
        enter_number(a, number)
        return ()

    def on_position_target(self, a: Autopilot, message: Message) -> None:
        """Handle a position target: it keeps OFFBOARD alive, and is flown to in OFFBOARD only."""
        if message.coordinate_frame in AMSL_FRAMES:
            up = message.alt - a.home.amsl_mm / 1000
        else:
            up = message.alt if message.coordinate_frame in RELATIVE_FRAMES else nan
        if message.type_mask & 0b111 or not isfinite(up):
            return
        a.last_target_us = a.now_us
        if a.vehicle.mode is FlightMode.GUIDED:
            # the overshoot past such a target was not recorded
            a.vehicle.go_to(Point(*a.home.local(message.lat_int, message.lon_int), up), past=False)

    def on_sticks(self, a: Autopilot, for_us: int) -> None:
        """Leave an automatic mode for Position, or for Altitude without a position (COM_RC_OVERRIDE)."""
        vehicle = a.vehicle
        if vehicle.armed and vehicle.mode in _AUTOMATIC:
            vehicle.set_mode(FlightMode.POSITION if a.can_enter(FlightMode.POSITION) else FlightMode.ALTITUDE)

    def on_breach(self, a: Autopilot, breach: Breach) -> None:
        """Take GF_ACTION, once; later commands are obeyed, as recorded.

        It holds at the place where the breach was detected, and flies back to it. Before a return or a landing it holds
        for COM_FAIL_ACT_T, so that the pilot can enter another mode (docs.px4.io/v1.15/en/config/safety).
        """
        action, vehicle = a.parameters.value("GF_ACTION"), a.vehicle
        waits_s = a.parameters.value("COM_FAIL_ACT_T")
        if action == _WARN:
            a.say(mavlink.MAV_SEVERITY_WARNING, "Geofence exceeded\t")
        elif action in _LATE and waits_s > 0:
            a.say(_CRITICAL, f"Failsafe activated: holding for {waits_s:g} s\t")
            self._hold(vehicle)
            a.delayed = a.now_us + round(waits_s * 1e6), _LATE[action]
        elif action == _RETURN:
            a.say(_CRITICAL, "Failsafe activated: switching to Return\t")
            vehicle.set_mode(FlightMode.RETURN)
        elif action == _TERMINATE:
            a.say(mavlink.MAV_SEVERITY_EMERGENCY, "Failsafe activated: terminating\t")
            vehicle.disarm()
        elif action == _LAND:
            a.say(_CRITICAL, "Failsafe activated: switching to Land\t")
            vehicle.set_mode(FlightMode.LAND)
        else:
            a.say(_CRITICAL, "Failsafe activated: switching to Hold\t")
            self._hold(vehicle)

    @staticmethod
    def _hold(vehicle: Multirotor) -> None:
        vehicle.set_mode(FlightMode.LOITER)
        vehicle.go_to(Point(vehicle.body.north, vehicle.body.east, vehicle.body.up))
