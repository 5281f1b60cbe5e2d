"""The observed state of a vehicle. A command counts as done only by what is observed here.

Position and height are known only while the autopilot's estimator confirms them. GLOBAL_POSITION_INT continues
unchanged after the estimator has lost its position, and begins before it has one; the pre-arm bit of SYS_STATUS is set
seconds too early (recorded flights of ArduCopter 4.7). Only the flags of ESTIMATOR_STATUS (PX4) and EKF_STATUS_REPORT
(ArduPilot) show it; up to 0x200 they mean the same in both.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import acos, cos, degrees, hypot, isfinite
from typing import Any, Final, NamedTuple

from rtshcua.adapters.vehicle.suspicion import UNBROKEN_US
from rtshcua.mavlink import enums
from rtshcua.model.flat.mission import TURN

#: ESTIMATOR_STATUS_FLAGS, EKF_STATUS_FLAGS
ATTITUDE: Final = 0x01
VELOCITY_HORIZONTAL: Final = 0x02
VELOCITY_VERTICAL: Final = 0x04
POSITION_RELATIVE: Final = 0x08
POSITION: Final = 0x10
HEIGHT: Final = 0x20
#: PX4: GPS glitch; ArduPilot: not initialised. Either way the position is unusable.
_GLITCH: Final = 0x400
#: ArduPilot alone: GPS glitching
_GLITCHING: Final = 0x8000

#: An older report confirms nothing; reports are requested several times within this time.
STALE_US: Final = 2_000_000
#: mm above home: motors that stop higher than this did not stop for a landing, unless a landing was observed
ABOVE: Final = 3_000
#: mm/s: faster than any landing, and faster than a vehicle on the ground moves
FALLS: Final = 3_000
STOPPED: Final = 500
#: us after its motors stopped a falling vehicle is faster than that
SETTLES_US: Final = 400_000
#: us: a report without a stamp may be younger than the last stamp by this;
STAMPED_US: Final = 300_000
#: us: after the computer stood still, reports that waited are read within this time
UNREAD_US: Final = 2_000_000

_WHERE: Final = POSITION | VELOCITY_HORIZONTAL | ATTITUDE
_HIGH: Final = HEIGHT | VELOCITY_VERTICAL | ATTITUDE
_ACROSS: Final = VELOCITY_HORIZONTAL | ATTITUDE
_UP: Final = VELOCITY_VERTICAL | ATTITUDE

#: The estimator flags that a field depends on. Other fields do not come from the estimator.
_RESTS_ON: Mapping[str, Mapping[str, int]] = {
    "GLOBAL_POSITION_INT": {
        "lat": _WHERE, "lon": _WHERE, "alt": _HIGH, "relative_alt": _HIGH, "vx": _ACROSS, "vy": _ACROSS, "vz": _UP,
        "hdg": ATTITUDE,
    },
    "LOCAL_POSITION_NED": {
        "x": POSITION_RELATIVE | _ACROSS, "y": POSITION_RELATIVE | _ACROSS, "z": _HIGH,
        "vx": _ACROSS, "vy": _ACROSS, "vz": _UP,
    },
    "VFR_HUD": {"alt": _HIGH, "climb": _UP, "groundspeed": _ACROSS, "heading": ATTITUDE},
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), ATTITUDE),
}  # fmt: skip


_NONE: Final = frozenset[str]()


class Estimator:
    """The last report of the estimator: `flags` and the time of the report. Heights are above home, so they mean
    nothing before home is set: the estimator must have had a position once.
    """

    def __init__(self, report: str = "") -> None:
        self.report = report
        self._flags = 0
        self._at_us: int | None = None
        self._homed = False
        # the last result of `doubtful`, and its arguments
        self._doubted: tuple[tuple[str, int, bool] | None, frozenset[str]] = None, _NONE

    def take(self, flags: int, at_us: int) -> None:
        """Take in a report made at `at_us` (see `source_time`); one older than the last is ignored."""
        if self._at_us is not None and at_us < self._at_us:
            return
        self._flags, self._at_us = flags, at_us
        self._homed = self._homed or self.position(at_us)

    def vouches(self, bits: int, now_us: int) -> bool:
        """Whether a recent report has all these flags and no sign of a fault."""
        if self._at_us is None or now_us - self._at_us > STALE_US:
            return False
        astray = bits & (POSITION | POSITION_RELATIVE | VELOCITY_HORIZONTAL) and self._flags & (_GLITCH | _GLITCHING)
        return not astray and self._flags & bits == bits

    def is_stale(self, now_us: int) -> bool:
        """Whether there is no recent report."""
        return self._at_us is None or now_us - self._at_us > STALE_US

    def position(self, now_us: int) -> bool:
        """Whether the position is known."""
        return self.vouches(_WHERE, now_us)

    def height(self, now_us: int) -> bool:
        """Whether the height above home is known."""
        return self._homed and self.vouches(_HIGH, now_us)

    def vouches_for(self, message: str, field: str, now_us: int) -> bool:
        """Whether the estimator confirms this field of a message; True for fields that do not depend on it."""
        fields = _RESTS_ON.get(message)
        bits = 0 if fields is None else fields.get(field, 0)
        if bits & HEIGHT and field == "relative_alt":
            return self.height(now_us)
        return not bits or self.vouches(bits, now_us)

    def doubtful(self, message: str, now_us: int) -> frozenset[str]:
        """The fields of a message that the estimator does not confirm."""
        fields = _RESTS_ON.get(message)
        if fields is None:
            return _NONE
        if self.is_stale(now_us):
            return frozenset(fields)
        key = (message, self._flags, self._homed)
        if self._doubted[0] != key:
            self._doubted = key, frozenset(field for field in fields if not self.vouches_for(message, field, now_us))
        return self._doubted[1]

    def missing(self, now_us: int) -> str | None:
        """What the estimator lacks, in words; None when it has a position and a height."""
        if self._at_us is None:
            return f"no report of the estimator ( {self.report})"
        if now_us - self._at_us > STALE_US:
            return f"the estimator's reports have stopped ( {self.report})"
        if not self.position(now_us):
            return f"the estimator has no position (flags 0x{self._flags:x})"
        return None if self.height(now_us) else f"the estimator has no height (flags 0x{self._flags:x})"


# ---------------------------------------------------------------- the whole state

_IN_AIR = (enums.MAV_LANDED_STATE_IN_AIR, enums.MAV_LANDED_STATE_TAKEOFF, enums.MAV_LANDED_STATE_LANDING)
_FIX_3D = 3
_CRITICAL = (5, 6)  # MAV_STATE: CRITICAL, EMERGENCY
_DEBUG = 7  # MAV_SEVERITY
_ABOVE_SEA = (enums.MAV_FRAME_GLOBAL, enums.MAV_FRAME_GLOBAL_INT)
#: the messages that `ObservedVehicle.take` uses, besides the report of the estimator
HEEDED: Final = (
    "HEARTBEAT", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "POSITION_TARGET_GLOBAL_INT", "GPS_RAW_INT", "SYS_STATUS",
    "ATTITUDE", "DISTANCE_SENSOR",
)  # fmt: skip
_FORWARD: Final = 0  # MAV_SENSOR_ROTATION_NONE
_OF_DOWN: Final = ("HEARTBEAT", "EXTENDED_SYS_STATE")
_REASONS = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied")
_PREARM: Final = 0x1000_0000  # MAV_SYS_STATUS_PREARM_CHECK

#: the bits of MAV_SYS_STATUS_SENSOR that matter for arming
_SENSORS: Final = {
    0x01: "gyroscope", 0x02: "accelerometer", 0x04: "magnetometer", 0x08: "barometer", 0x20: "GPS",
    0x8000: "motor outputs", 0x1_0000: "remote control", 0x10_0000: "geofence", 0x20_0000: "attitude and heading",
    0x100_0000: "logging", 0x200_0000: "battery", 0x4000_0000: "propulsion",
}  # fmt: skip


class Placed(NamedTuple):
    """One position report, at the time of its measurement in us: mm above home, None where the estimator did not
    confirm it then, and the sink rate in mm/s.
    """

    at_us: int
    height: int | None
    descent: int


Reported = tuple[int, int, int]
"""Where an autopilot says that it flies to: latitude and longitude in 1e-7 degree, mm above mean sea level."""


class NoDatum(RuntimeError):
    """A height cannot be converted, because the vehicle has not reported the altitude of its home."""


@dataclass(slots=True)
class ObservedVehicle:
    """The last reports, None or 0 before the first. Angles in 1e-7 degree, lengths in mm, speeds in mm/s, times in us.

    Position, height and speed are the last ones that the estimator confirmed; `located` and `levelled` say whether it
    confirms them now, for a position that is not old; `heading` is that of the nose, 1/100 degree from true north, if
    it is known, as of the last position; `placed` is the last report, however old. `target` is the autopilot's reported
    target. `speed_us` is the link time at which the last known speed was measured, because reports that waited are old.
    `descent` is the sink rate and `tilt` the tilt in degrees (measured at `tilt_us`), confirmed or not.

    `beats` counts heartbeats, `targets` reports of a target (the last at `target_us`) and `landings` reports of
    `landed_state`. `heard` counts the received frames of the autopilot, `numbered` the frames it had sent by then
    according to their numbers, and `answers` its answers to requests for messages. `up_us` is link time, see
    `LinkWatch`; `stood_us` is when the computer last resumed after standing still. `ahead` is what its range finder
    last saw in front, at `ahead_us`. `notes` collects texts for the operator.

    `disarms`: one heartbeat reports the motors off. They count as off when the next one confirms it or, while two
    senders use its ids (`disputed`), when nothing else is reported for a while.
    """

    estimator: Estimator = field(default_factory=Estimator)
    mode: int | None = None
    armed: bool = False
    disarms: bool = False
    disputed: bool = False
    _disarms_us: int = 0
    landed_state: int = 0
    landings: int = 0
    latitude: int = 0
    longitude: int = 0
    located: bool = False
    height: int = 0
    levelled: bool = False
    heading: int | None = None
    home_amsl: int | None = None
    speed: int | None = None
    speed_us: int = 0
    descent: int = 0
    placed_us: int = 0
    placed: Placed | None = None
    down_us: int = 0
    tilt: int = 0
    tilt_us: int = 0
    target: Reported | None = None
    target_us: int = 0
    targets: int = 0
    fix: int = 0
    prearm: bool = False
    unwell: tuple[str, ...] = ()
    heartbeat_us: int | None = None
    beats: int = 0
    heard: int = 0
    numbered: int = 0
    answers: int = 0
    ahead: int | None = None
    ahead_us: int = 0
    made_us: dict[str, int] = field(default_factory=dict)  # when the last message of each name was made
    places: dict[str, int] = field(default_factory=dict)  # and its place in the order of sending
    now_us: int = 0
    stood_us: int | None = None
    up_us: int = 0
    critical: bool = False
    notes: list[str] = field(default_factory=list)
    text: str = ""
    text_severity: int = _DEBUG
    prearm_text: str = ""

    def take(self, name: str, message: Any, now_us: int, at_us: int | None, place: int) -> bool:
        """Take in one message of the autopilot, made at `at_us` (None: unknown) and sent in this `place`; one older
        than the last of its name is ignored. Return whether it holds news: a report of mode or position, or a change of
        anything else except tilt.
        """
        places, made_us = self.places, self.made_us
        if place < places.get(name, place):
            return False
        places[name] = place
        if at_us is not None:
            if at_us < made_us.get(name, at_us):
                return False
            made_us[name] = at_us
        if name not in _OF_DOWN:
            return self._take(name, message, now_us, at_us)
        was_down = self.down
        news = self._take(name, message, now_us, at_us)
        if self.down and not was_down:
            self.down_us = now_us
        return news

    def _take(self, name: str, message: Any, now_us: int, at_us: int | None) -> bool:
        match name:  # the most frequent first
            case "ATTITUDE":
                self.tilt = _tilt(message.roll, message.pitch)
                self.tilt_us = now_us if at_us is None else at_us
            case "HEARTBEAT":
                self.mode = message.custom_mode
                armed = bool(message.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED)
                self._count_motors(armed=armed)
                self.heartbeat_us = now_us
                self.beats += 1
                self._judge(message.system_status)
                return True
            case "EXTENDED_SYS_STATE":
                was, self.landed_state = self.landed_state, message.landed_state
                self.landings += 1
                return bool(was != self.landed_state)
            case "GLOBAL_POSITION_INT" if at_us is not None:
                height = message.relative_alt if self.estimator.height(at_us) else None
                self.placed = Placed(at_us, height, 10 * message.vz)
                if now_us - at_us > STALE_US:
                    return False
                self._place(message, now_us, at_us)
                return True
            case "POSITION_TARGET_GLOBAL_INT":
                before = self.target
                if message.coordinate_frame in _ABOVE_SEA and isfinite(message.alt):
                    self.target = message.lat_int, message.lon_int, round(message.alt * 1_000)
                    self.target_us = now_us
                    self.targets += 1
                return before != self.target
            case "DISTANCE_SENSOR":
                if message.orientation == _FORWARD:
                    self.ahead, self.ahead_us = 10 * message.current_distance, now_us
            case "GPS_RAW_INT":
                fix, self.fix = self.fix, message.fix_type
                return bool(fix != self.fix)
            case "SYS_STATUS":
                health = self.prearm, self.unwell
                # PX4 1.16 sets the bit of the check without saying that there is such a check (recorded)
                self.prearm = bool(message.onboard_control_sensors_health & _PREARM)
                self.unwell = _unwell(message)
                return health != (self.prearm, self.unwell)
            case self.estimator.report if at_us is not None:
                self.estimator.take(message.flags, at_us)
                return self._doubt(now_us)
        return False

    def waited(self, since_us: int) -> bool:
        """Whether the last heartbeat is from before `since_us` and was read only after the computer resumed."""
        if self.stood_us is None or (self.heartbeat_us or 0) - self.stood_us > UNREAD_US:
            return False
        return self.made_us.get("HEARTBEAT", since_us) + STAMPED_US < since_us

    def count(self, place: int) -> None:
        """Count a frame that the autopilot sent in this place."""
        self.heard += 1
        self.numbered = max(self.numbered, place)

    def pass_time(self, now_us: int) -> bool:
        """Let time pass, so that positions and reports of the estimator grow old; return whether one became too old."""
        self.now_us = now_us
        if now_us - self.made_us.get("GLOBAL_POSITION_INT", now_us) <= STALE_US:
            return self.estimator.is_stale(now_us) and self._doubt(now_us)
        was = self.located or self.levelled or self.speed is not None
        self.located, self.levelled, self.speed = False, False, None
        return was

    def _doubt(self, now_us: int) -> bool:
        """Drop the position once the estimator no longer confirms it; return whether that happened now."""
        was = self.located, self.levelled
        self.located = self.located and self.estimator.position(now_us)
        self.levelled = self.levelled and self.estimator.height(now_us)
        return was != (self.located, self.levelled)

    def say(self, severity: int, text: str) -> None:
        """Keep a text of the vehicle: the most severe one since `hush`, and the last reason against arming."""
        if severity <= self.text_severity:
            self.text, self.text_severity = text, severity
        if text.startswith(_REASONS):
            self.prearm_text = text

    def amsl(self, height: int) -> int:
        """The altitude above mean sea level of a height above home, both in mm. Raises NoDatum where the altitude of
        home is not known.

        All our heights are in mm above home; PX4's commands take altitudes above mean sea level, whatever frame they
        name. Confusing the two has crashed real vehicles, so they are converted only here and in `_place`.
        """
        if self.home_amsl is None:
            raise NoDatum("the vehicle has not reported the altitude of its home, so no altitude can be commanded")
        return self.home_amsl + height

    def hush(self) -> None:
        """Forget the kept text: later texts may be about something new."""
        self.text, self.text_severity = "", _DEBUG

    @property
    def airborne(self) -> bool:
        """Whether it is in the air by its own report; an armed vehicle without such a report counts as in the air."""
        return self.landed_state in _IN_AIR or (self.landed_state == 0 and self.armed)

    @property
    def landing(self) -> bool:
        """Whether it reports that it is landing."""
        return self.landed_state == enums.MAV_LANDED_STATE_LANDING

    @property
    def down(self) -> bool:
        """Whether it is on the ground with its motors off."""
        return self.landed_state == enums.MAV_LANDED_STATE_ON_GROUND and not self.armed

    @property
    def comes_to_rest(self) -> bool:
        """Whether it is on the ground with its motors off, even by one report only."""
        return self.landed_state == enums.MAV_LANDED_STATE_ON_GROUND and (self.disarms or not self.armed)

    @property
    def may_rest(self) -> bool:
        """Whether it comes to rest as far as is known: its motors are reported off, and the report that it flies is
        old.
        """
        if self.comes_to_rest:
            return True
        said_us = self.made_us.get("EXTENDED_SYS_STATE")
        stale = said_us is not None and (self.heartbeat_us or 0) - said_us > STALE_US
        return stale and (self.disarms or not self.armed)

    @property
    def rests(self) -> bool:
        """Whether it is down and seen to lie still: a vehicle that is disarmed in the air reports at once that it is on
        the ground, and falls.
        """
        if not self.down:
            return False
        is_silent = (self.heartbeat_us or 0) - max(self.placed_us, self.down_us) >= STALE_US
        if abs(self.descent) > STOPPED:
            return is_silent  # its speed is no longer reported
        return self.placed_us >= self.down_us + SETTLES_US or is_silent

    @property
    def unready(self) -> str | None:
        """What prevents arming, in words; None if nothing is reported."""
        if self.heartbeat_us is None:
            return "no heartbeat from an autopilot"
        if self.landed_state == 0:
            return "the vehicle does not report whether it is on the ground"
        if self.fix < _FIX_3D:
            return "no 3D position fix"
        astray = self.estimator.missing(self.now_us)
        if astray is not None:
            return astray
        if not (self.located and self.levelled):
            return "no position report since the estimator has a position"
        return None if self.prearm else f"the vehicle's checks before arming fail{self._reasons()}"

    @property
    def prearm_fails(self) -> bool:
        """Whether only the vehicle's own checks prevent arming."""
        return not self.prearm and self.located and self.levelled and self.estimator.missing(self.now_us) is None

    def _reasons(self) -> str:
        """The reasons, in the vehicle's untrusted words or by its unhealthy sensors."""
        if self.prearm_text:
            return f": {self.prearm_text}"
        return f": {', '.join(self.unwell)} not healthy" if self.unwell else ""

    def _count_motors(self, *, armed: bool) -> None:
        """Update whether the motors run. Stopped motors end a flight, so one report is not enough, nor are several
        while heartbeats contradict each other.
        """
        if armed or not self.armed:
            self.armed, self.disarms = armed, False
        elif not self.disarms:
            self.disarms, self._disarms_us = True, self.up_us
        elif not self.disputed or self.up_us - self._disarms_us >= UNBROKEN_US:
            self.armed = self.disarms = False

    def _judge(self, status: int) -> None:
        """Note a change of the critical state. A failsafe need not change the mode: a low battery on the way home does
        not.
        """
        critical = status in _CRITICAL
        if critical != self.critical:
            says = "the vehicle reports a critical state" if critical else "the vehicle's state is no longer critical"
            self.notes.append(says)
        self.critical = critical

    def _place(self, message: Any, now_us: int, at_us: int) -> None:
        estimator = self.estimator
        self.located, self.levelled = estimator.position(now_us), estimator.height(now_us)
        if self.located:
            self.latitude, self.longitude = message.lat, message.lon
        if self.levelled:
            self.height = message.relative_alt
            if self.located:
                self.home_amsl = message.alt - message.relative_alt
        turned = message.hdg < TURN and estimator.vouches_for("GLOBAL_POSITION_INT", "hdg", now_us)
        self.heading = message.hdg if turned else None  # 65535: unknown
        known = estimator.vouches_for("GLOBAL_POSITION_INT", "vx", now_us)
        # from cm/s; a vehicle with an unknown speed does not count as still
        self.speed = round(10 * hypot(message.vx, message.vy, message.vz)) if known else None
        if known:
            self.speed_us = self.up_us - (now_us - at_us)
        self.descent, self.placed_us = 10 * message.vz, now_us


def _tilt(roll: float, pitch: float) -> int:
    """The angle in degrees between the vehicle's vertical axis and the world's, from ATTITUDE in radians."""
    if not (isfinite(roll) and isfinite(pitch)):
        return 0
    return round(degrees(acos(max(-1.0, min(1.0, cos(roll) * cos(pitch))))))


def _unwell(message: Any) -> tuple[str, ...]:
    """The sensors that are present and enabled, but not healthy."""
    used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    ill = used & ~message.onboard_control_sensors_health
    return tuple([name for bit, name in _SENSORS.items() if ill & bit])
