"""What the vehicle was seen to do: the only ground on which a command counts as done.

Position and height are known only while the autopilot's own estimator vouches for them. GLOBAL_POSITION_INT goes on as
if nothing had happened while the estimator has no position any more, and begins before it has one; the pre-arm bit of
SYS_STATUS turns good seconds too early (recorded flights of ArduCopter 4.7). Only the flags of ESTIMATOR_STATUS (PX4)
and EKF_STATUS_REPORT (ArduPilot) tell; up to 0x200 they mean the same in both.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import acos, cos, degrees, hypot, isfinite
from typing import Any, Final, NamedTuple

from rtshcua.adapters.vehicle.suspicion import UNBROKEN_US
from rtshcua.mavlink import enums

#: ESTIMATOR_STATUS_FLAGS, EKF_STATUS_FLAGS
ATTITUDE: Final = 0x01
VELOCITY_HORIZONTAL: Final = 0x02
VELOCITY_VERTICAL: Final = 0x04
POSITION_RELATIVE: Final = 0x08
POSITION: Final = 0x10
HEIGHT: Final = 0x20
#: PX4: GPS glitch; ArduPilot: not initialised. Either way its position is worth nothing.
_GLITCH: Final = 0x400
#: ArduPilot alone: GPS glitching
_GLITCHING: Final = 0x8000

#: A report that is older than this vouches for nothing; it is asked for several times within.
STALE_US: Final = 2_000_000
#: mm above home: motors that stop higher than this did not stop for a landing, unless it was seen to land
ABOVE: Final = 3_000
#: mm/s: no landing comes down so fast, and what lies on the ground does not move so fast
FALLS: Final = 3_000
STOPPED: Final = 500
#: us after its motors stopped, what falls is faster than that
SETTLES_US: Final = 400_000
#: us: what has no stamp of its own may be younger than the last one before it by this;
STAMPED_US: Final = 300_000
#: and so long after the computer stood still all that waited meanwhile was read
UNREAD_US: Final = 2_000_000

_WHERE: Final = POSITION | VELOCITY_HORIZONTAL | ATTITUDE
_HIGH: Final = HEIGHT | VELOCITY_VERTICAL | ATTITUDE
_ACROSS: Final = VELOCITY_HORIZONTAL | ATTITUDE
_UP: Final = VELOCITY_VERTICAL | ATTITUDE

#: What a field rests on. What is not here does not come from the estimator.
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
    """The last report, by `flags` and when it was made. A height is above home, so it means nothing before there is
    one: the estimator must have had a position once.
    """

    def __init__(self, report: str = "") -> None:
        self.report = report
        self._flags = 0
        self._at_us: int | None = None
        self._homed = False
        self._doubted: tuple[tuple[str, int, bool] | None, frozenset[str]] = None, _NONE  # the last answer, and to what

    def take(self, flags: int, at_us: int) -> None:
        """A report came that was made at `at_us` (see `source_time`); one that is older than the last is set aside."""
        if self._at_us is not None and at_us < self._at_us:
            return
        self._flags, self._at_us = flags, at_us
        self._homed = self._homed or self.position(at_us)

    def vouches(self, bits: int, now_us: int) -> bool:
        """Whether a report that is not stale has all these flags, and no sign of being astray."""
        if self._at_us is None or now_us - self._at_us > STALE_US:
            return False
        astray = bits & (POSITION | POSITION_RELATIVE | VELOCITY_HORIZONTAL) and self._flags & (_GLITCH | _GLITCHING)
        return not astray and self._flags & bits == bits

    def is_stale(self, now_us: int) -> bool:
        """Whether it has not reported, or not for too long."""
        return self._at_us is None or now_us - self._at_us > STALE_US

    def position(self, now_us: int) -> bool:
        """Whether it knows where it is."""
        return self.vouches(_WHERE, now_us)

    def height(self, now_us: int) -> bool:
        """Whether it knows how high above home it is."""
        return self._homed and self.vouches(_HIGH, now_us)

    def vouches_for(self, message: str, field: str, now_us: int) -> bool:
        """Whether what this field of a message says is known to the estimator; true of what does not come from it."""
        fields = _RESTS_ON.get(message)
        bits = 0 if fields is None else fields.get(field, 0)
        if bits & HEIGHT and field == "relative_alt":
            return self.height(now_us)
        return not bits or self.vouches(bits, now_us)

    def doubtful(self, message: str, now_us: int) -> frozenset[str]:
        """The fields of a message that are not vouched for."""
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
        """What it has not got, in words; None when it has a position and a height."""
        if self._at_us is None:
            return f"no report of the estimator ( {self.report})"
        if now_us - self._at_us > STALE_US:
            return f"the estimator's reports have stopped ( {self.report})"
        if not self.position(now_us):
            return f"the estimator has no position (flags 0x{self._flags:x})"
        return None if self.height(now_us) else f"the estimator has no height (flags 0x{self._flags:x})"


# ---------------------------------------------------------------- all that it says of itself

_IN_AIR = (enums.MAV_LANDED_STATE_IN_AIR, enums.MAV_LANDED_STATE_TAKEOFF, enums.MAV_LANDED_STATE_LANDING)
_FIX_3D = 3
_CRITICAL = (5, 6)  # MAV_STATE: CRITICAL, EMERGENCY
_DEBUG = 7  # MAV_SEVERITY
_ABOVE_SEA = (enums.MAV_FRAME_GLOBAL, enums.MAV_FRAME_GLOBAL_INT)
#: the messages that `ObservedVehicle.take` looks at, beside the report of the estimator
HEEDED: Final = (
    "HEARTBEAT", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "POSITION_TARGET_GLOBAL_INT", "GPS_RAW_INT", "SYS_STATUS",
    "ATTITUDE", "DISTANCE_SENSOR",
)  # fmt: skip
_FORWARD: Final = 0  # MAV_SENSOR_ROTATION_NONE
_OF_DOWN: Final = ("HEARTBEAT", "EXTENDED_SYS_STATE")
_REASONS = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied")
_PREARM: Final = 0x1000_0000  # MAV_SYS_STATUS_PREARM_CHECK

#: MAV_SYS_STATUS_SENSOR, as far as arming rests on them
_SENSORS: Final = {
    0x01: "gyroscope", 0x02: "accelerometer", 0x04: "magnetometer", 0x08: "barometer", 0x20: "GPS",
    0x8000: "motor outputs", 0x1_0000: "remote control", 0x10_0000: "geofence", 0x20_0000: "attitude and heading",
    0x100_0000: "logging", 0x200_0000: "battery", 0x4000_0000: "propulsion",
}  # fmt: skip


class Placed(NamedTuple):
    """What one report of its place said of the moment at which it was measured, in us: mm above home, None where the
    estimator did not vouch for that then, and how fast it sank, in mm/s.
    """

    at_us: int
    height: int | None
    descent: int


Reported = tuple[int, int, int]
"""Where an autopilot says that it flies to: latitude and longitude in 1e-7 degree, mm above mean sea level."""


class NoDatum(RuntimeError):
    """A height was to be converted before the vehicle said how high its home lies."""


@dataclass(slots=True)
class ObservedVehicle:
    """The last reports, None or 0 before the first. Angles 1e-7 degree, lengths mm, speeds mm/s, times us.

    Place, height and speed are those that the estimator last vouched for; `located` and `levelled` say whether it does
    so now, of a position that is not old; `placed` is the last report of all, however old. `target` is where the
    autopilot says that it flies to. `speed_us` is the link time at which the last speed that is known was measured:
    after a hold-up what waited is of long before. `descent` is how fast it sinks and `tilt` how many degrees it
    leans (`tilt_us`: measured then), whoever vouches for that. `beats` counts heartbeats and `targets` reports of a
    target (`target_us`: told last); `up_us` is link time, see `LinkWatch`, `stood_us` when the computer last went
    on that stood still. `heard` counts frames of the autopilot, `numbered` those that it sent by then, as their
    numbers tell, and `answers` its answers to questions for messages. `ahead` is what its range finder last saw in
    front, at `ahead_us`. `notes` collects what an operator should know. `disarms`: one heartbeat says that the
    motors are off; they count as off when the next one says so, too, or, while two speak under its ids
    (`disputed`), when nothing else is said for a while. `landings` counts reports of `landed_state`.
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
    made_us: dict[str, int] = field(default_factory=dict)  # when the last of each message was made
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
        """Take in one message of the autopilot's component that was made at `at_us` (None: nobody knows) and sent in
        this `place`, but for one that is older than the last of its name. Whether there is news in it: a report of
        mode or place, or anything else that was not so before; a tilt is none.
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
        match name:  # what comes most often, first
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
        """Whether the last heartbeat was read only now that the computer goes on, and is of before `since_us`."""
        if self.stood_us is None or (self.heartbeat_us or 0) - self.stood_us > UNREAD_US:
            return False
        return self.made_us.get("HEARTBEAT", since_us) + STAMPED_US < since_us

    def count(self, place: int) -> None:
        """A frame came that the autopilot sent in this place."""
        self.heard += 1
        self.numbered = max(self.numbered, place)

    def pass_time(self, now_us: int) -> bool:
        """Time goes by: where it was, and what the estimator last said, grows old. Whether something grew too old."""
        self.now_us = now_us
        if now_us - self.made_us.get("GLOBAL_POSITION_INT", now_us) <= STALE_US:
            return self.estimator.is_stale(now_us) and self._doubt(now_us)
        was = self.located or self.levelled or self.speed is not None
        self.located, self.levelled, self.speed = False, False, None
        return was

    def _doubt(self, now_us: int) -> bool:
        """Where it was holds no longer than the estimator vouches for it. Whether it holds no longer."""
        was = self.located, self.levelled
        self.located = self.located and self.estimator.position(now_us)
        self.levelled = self.levelled and self.estimator.height(now_us)
        return was != (self.located, self.levelled)

    def say(self, severity: int, text: str) -> None:
        """Keep what it said: the gravest text since `hush`, and the last that says why it would not arm."""
        if severity <= self.text_severity:
            self.text, self.text_severity = text, severity
        if text.startswith(_REASONS):
            self.prearm_text = text

    def amsl(self, height: int) -> int:
        """The altitude above mean sea level of a height above home, both in mm. Raises NoDatum where home's own is not
        known.

        Everything of ours is in mm above home; PX4's commands take altitudes above mean sea level, whatever frame they
        name. A mistake between the two has crashed real vehicles: they are made of each other here and in `_place`.
        """
        if self.home_amsl is None:
            raise NoDatum("the vehicle has not reported the altitude of its home, so no altitude can be commanded")
        return self.home_amsl + height

    def hush(self) -> None:
        """What it says from now on may be about something new."""
        self.text, self.text_severity = "", _DEBUG

    @property
    def airborne(self) -> bool:
        """In the air, as far as it says; an armed vehicle that does not say counts as in the air."""
        return self.landed_state in _IN_AIR or (self.landed_state == 0 and self.armed)

    @property
    def landing(self) -> bool:
        """Coming down to land, as it says itself."""
        return self.landed_state == enums.MAV_LANDED_STATE_LANDING

    @property
    def down(self) -> bool:
        """Seen on the ground with its motors off."""
        return self.landed_state == enums.MAV_LANDED_STATE_ON_GROUND and not self.armed

    @property
    def comes_to_rest(self) -> bool:
        """On the ground with its motors off, also while only one report says that they are."""
        return self.landed_state == enums.MAV_LANDED_STATE_ON_GROUND and (self.disarms or not self.armed)

    @property
    def may_rest(self) -> bool:
        """It comes to rest, as far as is known: its motors are said to be off, that it flies was said long before."""
        if self.comes_to_rest:
            return True
        said_us = self.made_us.get("EXTENDED_SYS_STATE")
        stale = said_us is not None and (self.heartbeat_us or 0) - said_us > STALE_US
        return stale and (self.disarms or not self.armed)

    @property
    def rests(self) -> bool:
        """Down, and seen to lie there: what is disarmed in the air says at once that it is on the ground, and falls."""
        if not self.down:
            return False
        is_silent = (self.heartbeat_us or 0) - max(self.placed_us, self.down_us) >= STALE_US
        if abs(self.descent) > STOPPED:
            return is_silent  # nothing reports how fast it moves any more
        return self.placed_us >= self.down_us + SETTLES_US or is_silent

    @property
    def unready(self) -> str | None:
        """What stands against arming, in words; None: nothing that it tells of."""
        if self.heartbeat_us is None:
            return "no heartbeat of an autopilot"
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
        """Whether its own checks are all that stands against arming."""
        return not self.prearm and self.located and self.levelled and self.estimator.missing(self.now_us) is None

    def _reasons(self) -> str:
        """In its own words, which are untrusted, or by the sensors that it says are not well."""
        if self.prearm_text:
            return f": {self.prearm_text}"
        return f": {', '.join(self.unwell)} not healthy" if self.unwell else ""

    def _count_motors(self, *, armed: bool) -> None:
        """Motors that stop end a flight, so one report of it is not enough; nor are several while two speak."""
        if armed or not self.armed:
            self.armed, self.disarms = armed, False
        elif not self.disarms:
            self.disarms, self._disarms_us = True, self.up_us
        elif not self.disputed or self.up_us - self._disarms_us >= UNBROKEN_US:
            self.armed = self.disarms = False

    def _judge(self, status: int) -> None:
        """A failsafe need not change the mode: a low battery on the way home does not."""
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
        known = estimator.vouches_for("GLOBAL_POSITION_INT", "vx", now_us)
        # from cm/s; without a speed that the estimator knows, it does not count as still
        self.speed = round(10 * hypot(message.vx, message.vy, message.vz)) if known else None
        if known:
            self.speed_us = self.up_us - (now_us - at_us)
        self.descent, self.placed_us = 10 * message.vz, now_us


def _tilt(roll: float, pitch: float) -> int:
    """Degrees between the vehicle's own vertical axis and the world's, of ATTITUDE's radians."""
    if not (isfinite(roll) and isfinite(pitch)):
        return 0
    return round(degrees(acos(max(-1.0, min(1.0, cos(roll) * cos(pitch))))))


def _unwell(message: Any) -> tuple[str, ...]:
    """The sensors that are there and in use, and not healthy."""
    used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    ill = used & ~message.onboard_control_sensors_health
    return tuple([name for bit, name in _SENSORS.items() if ill & bit])
