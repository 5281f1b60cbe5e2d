"""What the vehicle was seen to do: the only ground on which a command counts as done."""

from dataclasses import dataclass, field
from math import acos, cos, degrees, hypot, isfinite
from typing import Any

from rtshcua.adapters.vehicle import datum, health
from rtshcua.adapters.vehicle.estimator import STALE_US, Estimator
from rtshcua.mavlink import enums

_IN_AIR = (enums.MAV_LANDED_STATE_IN_AIR, enums.MAV_LANDED_STATE_TAKEOFF, enums.MAV_LANDED_STATE_LANDING)
_FIX_3D = 3
_CRITICAL = (5, 6)  # MAV_STATE: CRITICAL, EMERGENCY
_DEBUG = 7  # MAV_SEVERITY
_ABOVE_SEA = (enums.MAV_FRAME_GLOBAL, enums.MAV_FRAME_GLOBAL_INT)
_HEEDED = (
    "HEARTBEAT", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "POSITION_TARGET_GLOBAL_INT", "GPS_RAW_INT", "SYS_STATUS",
    "ATTITUDE",
)  # fmt: skip
_REASONS = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied")


@dataclass(slots=True)
class Observed:
    """The last reports, None or 0 before the first. Angles 1e-7 degree, lengths mm, speeds mm/s, times us.

    Place, height and speed are those that the estimator last vouched for; `located` and `levelled` say whether it does
    so now, of a position that is not old. `target` is where the autopilot says that it flies to: latitude, longitude,
    mm above mean sea level. `descent` is how fast it sinks and `tilt` how many degrees it leans (`tilt_us`: told then),
    whoever vouches for that. `beats` counts heartbeats; `up_us` is link time, see `LinkWatch`.
    `notes` collects what an operator should know.
    """

    estimator: Estimator = field(default_factory=Estimator)
    mode: int | None = None
    armed: bool = False
    landed_state: int = 0
    latitude: int = 0
    longitude: int = 0
    located: bool = False
    height: int = 0
    levelled: bool = False
    home_amsl: int | None = None
    speed: int | None = None
    descent: int = 0
    tilt: int = 0
    tilt_us: int = 0
    target: tuple[int, int, int] | None = None
    fix: int = 0
    prearm: bool = False
    unwell: tuple[str, ...] = ()
    heartbeat_us: int | None = None
    beats: int = 0
    made_us: dict[str, int] = field(default_factory=dict)  # when the last of each message was made
    now_us: int = 0
    up_us: int = 0
    critical: bool = False
    notes: list[str] = field(default_factory=list)
    text: str = ""
    text_severity: int = _DEBUG
    prearm_text: str = ""

    @property
    def heeded(self) -> tuple[str, ...]:
        """The messages that `take` looks at."""
        return (*_HEEDED, self.estimator.report)

    def take(self, name: str, message: Any, now_us: int, at_us: int | None) -> None:
        """Take in one message of the autopilot's component that was made at `at_us` (None: nobody knows), but for one
        that is older than the last of its name.
        """
        if at_us is not None:
            if at_us < self.made_us.get(name, at_us):
                return
            self.made_us[name] = at_us
        match name:
            case "HEARTBEAT":
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED)
                self.heartbeat_us = now_us
                self.beats += 1
                self._judge(message.system_status)
            case "EXTENDED_SYS_STATE":
                self.landed_state = message.landed_state
            case "GLOBAL_POSITION_INT" if at_us is not None and now_us - at_us <= STALE_US:
                self._place(message, now_us)
            case "POSITION_TARGET_GLOBAL_INT":
                if message.coordinate_frame in _ABOVE_SEA and isfinite(message.alt):
                    self.target = message.lat_int, message.lon_int, round(message.alt * 1_000)
            case "ATTITUDE":
                self.tilt, self.tilt_us = _tilt(message.roll, message.pitch), now_us
            case "GPS_RAW_INT":
                self.fix = message.fix_type
            case "SYS_STATUS":
                self.prearm = health.would_arm(message)
                self.unwell = health.unwell(message)
            case self.estimator.report if at_us is not None:
                self.estimator.take(message.flags, at_us)
                self.located = self.located and self.estimator.position(now_us)
                self.levelled = self.levelled and self.estimator.height(now_us)

    def pass_time(self, now_us: int) -> None:
        """Time goes by: where it was, and what the estimator last said, grows old."""
        self.now_us = now_us
        if now_us - self.made_us.get("GLOBAL_POSITION_INT", now_us) > STALE_US:
            self.located, self.levelled, self.speed = False, False, None
        elif self.located or self.levelled:
            self.located = self.located and self.estimator.position(now_us)
            self.levelled = self.levelled and self.estimator.height(now_us)

    def say(self, severity: int, text: str) -> None:
        """Keep what it said: the gravest text since `hush`, and the last that says why it would not arm."""
        if severity <= self.text_severity:
            self.text, self.text_severity = text, severity
        if text.startswith(_REASONS):
            self.prearm_text = text

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
    def ready(self) -> bool:
        """It has a position and would arm, or it flies already."""
        return self.airborne or self.unready is None

    @property
    def unready(self) -> str | None:
        """What stands against arming, in words; None: nothing that it tells of."""
        if self.heartbeat_us is None:
            return "no heartbeat of an autopilot"
        if self.landed_state == 0:
            return "it does not say whether it is on the ground"
        if self.fix < _FIX_3D:
            return "no 3D position fix"
        astray = self.estimator.missing(self.now_us)
        if astray is not None:
            return astray
        if not (self.located and self.levelled):
            return "no position report since its estimator has one"
        return None if self.prearm else f"its own checks before arming fail{self._reasons()}"

    @property
    def prearm_fails(self) -> bool:
        """Whether its own checks are all that stands against arming."""
        return not self.prearm and self.located and self.levelled and self.estimator.missing(self.now_us) is None

    def _reasons(self) -> str:
        """In its own words, which are untrusted, or by the sensors that it says are not well."""
        if self.prearm_text:
            return f": {self.prearm_text}"
        return f": {', '.join(self.unwell)} not healthy" if self.unwell else ""

    def _judge(self, status: int) -> None:
        """A failsafe need not change the mode: a low battery on the way home does not."""
        critical = status in _CRITICAL
        if critical != self.critical:
            self.notes.append(
                "it says that its state is critical" if critical else "its state is not critical any more"
            )
        self.critical = critical

    def _place(self, message: Any, now_us: int) -> None:
        estimator = self.estimator
        self.located, self.levelled = estimator.position(now_us), estimator.height(now_us)
        if self.located:
            self.latitude, self.longitude = message.lat, message.lon
        if self.levelled:
            self.height = message.relative_alt
            if self.located:
                self.home_amsl = datum.home_amsl_mm(message.alt, message.relative_alt)
        known = estimator.vouches_for("GLOBAL_POSITION_INT", "vx", now_us)
        # from cm/s; without a speed that the estimator knows, it does not count as still
        self.speed = round(10 * hypot(message.vx, message.vy, message.vz)) if known else None
        self.descent = 10 * message.vz


def _tilt(roll: float, pitch: float) -> int:
    """Degrees between the vehicle's own vertical axis and the world's, of ATTITUDE's radians."""
    if not (isfinite(roll) and isfinite(pitch)):
        return 0
    return round(degrees(acos(max(-1.0, min(1.0, cos(roll) * cos(pitch))))))
