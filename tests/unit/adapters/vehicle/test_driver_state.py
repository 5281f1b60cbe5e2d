"""A driver's reaction to single frames: readiness, mode takeovers, texts, altitudes."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.driver import KEYLESS, Driver
from rtshcua.adapters.vehicle.observed import NoDatum, ObservedVehicle
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command, CommandFailed, Event, Noted, Readings, Ready, StatusText, TakenOver
from virtual.policy import POLICY, PROJECTION

S = 1_000_000
ARMED = 128
SENSORS = 0x1020_002F  # gyroscope, accelerometer, magnetometer, barometer, GPS, attitude and heading, pre-arm check
PX4, ARDUPILOT = 12, 3


def link() -> SignedLink:
    return SignedLink(bytes(range(32)), SigningState(0, {}), 1_800_000_000_000_000, 0)


class Bench:
    """A driver, and a scripted autopilot."""

    def __init__(self, autopilot: int = PX4, *, signs: bool = False, keyed: bool = False) -> None:
        self.autopilot = autopilot
        self.frames = FrameSession()
        self.signed = link() if signs else None
        self.driver = Driver(POLICY, self.frames, verifier=link() if keyed else None)
        self.codec = Codec(1, 1)
        self.now_us = S
        self.answers = True  # TIMESYNC; it was started when our clock was
        self.deaf = False  # no answers at all
        self.events: list[Event] = []
        self.sent: list[Any] = []
        self.beat(0)

    def hear(self, message: Any) -> None:
        frame = self.codec.pack(message)
        frame = frame if self.signed is None else self.signed.sign(frame, self.now_us)
        self.events += self.driver.receive(frame, self.now_us).events

    def tick(self, seconds: float = 0.1) -> None:
        for _ in range(round(seconds * 10)):
            self.now_us += S // 10
            events, frames = self.driver.tick(self.now_us)
            self.events += events
            sent = [Codec(0, 0).parse(frame)[0] for frame in frames]
            self.sent += sent
            for frame in sent:
                if frame.name == "TIMESYNC" and self.answers and not self.deaf:
                    self.hear(mavlink.MAVLink_timesync_message(self.now_us * 1_000, frame.message.ts1))
            if any(each.name == "COMMAND_LONG" and each.message.command == 512 for each in sent) and not self.deaf:
                self.answer()

    def answer(self) -> None:
        """Answer a request with the last reported mode."""
        self.hear(mavlink.MAVLink_command_ack_message(512, 0, 0, 0, 1, 191))
        self.beat(*self.told)

    def begin(self, kind: MotionKind, *geo: int, altitude: int = 0) -> list[Event]:
        command = Command(7, kind.name.lower(), kind, (0,) * len(geo), geo, altitude, 0, not_after_us=self.now_us + S)
        self.frames.open(command)
        return self.driver.begin(command, self.now_us)[0]

    def beat(self, mode: int, armed: bool = False, status: int = 4) -> None:
        self.told = mode, armed, status
        self.hear(mavlink.MAVLink_heartbeat_message(2, self.autopilot, ARMED if armed else 0, mode, status, 3))

    def landed(self, state: int) -> None:
        self.hear(mavlink.MAVLink_extended_sys_state_message(0, state))

    def estimator(self, flags: int) -> None:
        if self.autopilot == PX4:
            self.hear(mavlink.MAVLink_estimator_status_message(self.now_us, flags, 0, 0, 0, 0, 0, 0, 0, 0))
        else:
            self.hear(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))

    def place(self, height: int = 0, amsl: int = 488_000) -> None:
        self.hear(mavlink.MAVLink_global_position_int_message(
            self.now_us // 1_000, PROJECTION.latitude, PROJECTION.longitude, amsl + height, height, 0, 0, 0, 0,
        ))  # fmt: skip

    def health(self, ill: int = 0, present: int = SENSORS) -> None:
        self.hear(mavlink.MAVLink_sys_status_message(present, present, SENSORS & ~ill, *[0] * 10))

    def say(self, text: str, severity: int = 6) -> None:
        self.hear(mavlink.MAVLink_statustext_message(severity, text.encode()))

    def well(self) -> None:
        """Report a vehicle on the ground with all required data."""
        self.tick()
        self.landed(1)
        self.hear(mavlink.MAVLink_gps_raw_int_message(1, 3, 0, 0, 0, 0, 0, 0, 0, 0))
        self.estimator(0x33F)
        self.place()
        self.health()
        self.tick()

    def taken(self) -> list[str]:
        return [event.how for event in self.events if isinstance(event, TakenOver)]


BOTH = pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])


@BOTH
def test_each_reason_in_its_turn(autopilot: int) -> None:
    one = Bench(autopilot)
    report = "ESTIMATOR_STATUS" if autopilot == PX4 else "EKF_STATUS_REPORT"
    reasons = [one.driver.unready]
    for step in (
        lambda: None,
        lambda: one.landed(1),
        lambda: one.hear(mavlink.MAVLink_gps_raw_int_message(1, 3, 0, 0, 0, 0, 0, 0, 0, 0)),
        lambda: one.estimator(0x0A7),
        lambda: one.estimator(0x33F),
        one.place,
        lambda: one.health(0x1000_0004),
        lambda: one.say("PreArm: Compass not calibrated", 2),
        one.health,
    ):
        step()
        one.tick()
        reasons.append(one.driver.unready)
    assert reasons == [
        "the vehicle's clock is not known yet: no TIMESYNC answer",
        "the vehicle does not report whether it is on the ground",
        "no 3D position fix",
        f"no report of the estimator ( {report})",
        "the estimator has no position (flags 0xa7)",
        "no position report since the estimator has a position",
        "the vehicle's checks before arming fail",
        "the vehicle's checks before arming fail: magnetometer not healthy",
        "the vehicle's checks before arming fail: PreArm: Compass not calibrated",
        None,
    ]


@BOTH
def test_vehicle_is_not_ready_without_a_clock(autopilot: int) -> None:
    one = Bench(autopilot)
    one.answers = False
    one.well()
    one.tick(5)
    assert one.driver.unready == "the vehicle's clock is not known yet: no TIMESYNC answer"
    assert not [event for event in one.events if isinstance(event, Readings | Ready)]
    asked = [frame for frame in one.sent if frame.name == "TIMESYNC"]
    assert len(asked) > 30, "ten times a second at first"


@BOTH
def test_vehicle_is_not_ready_until_utc_is_known_or_timed_out(autopilot: int) -> None:
    """The first step is released when the vehicle is ready, and its deadline runs from then on."""

    def live(seconds: float) -> str:
        for _ in range(round(seconds * 10)):
            one.estimator(0x33F)
            one.place()
            one.health()
            one.tick()
        return one.driver.unready or ""

    one = Bench(autopilot)
    one.driver.asks_utc, one.driver.utc_patience_us = True, 3 * S
    assert "on the ground" in live(4)
    one.well()
    assert "the time of day" in live(2), "the wait begins when nothing else is missing"
    one.driver.asks_utc = False
    assert not one.driver.unready
    one.driver.asks_utc = True
    assert not live(2)

    one = Bench(autopilot)
    one.well()
    one.driver.issued_from_us = one.now_us + 2 * S
    assert "might have been issued in the future" in live(1)
    assert not live(1.5)


@BOTH
def test_a_vehicle_that_signs_and_does_not_answer_asks_for_the_key(autopilot: int) -> None:
    def unready(*, deaf: bool, keyed: bool = False) -> str | None:
        one = Bench(autopilot, signs=True, keyed=keyed)
        one.deaf = deaf
        one.tick(5)
        return one.driver.unready

    assert unready(deaf=True) == KEYLESS
    assert unready(deaf=True, keyed=True) == "the vehicle's clock is not known yet: no TIMESYNC answer"
    assert unready(deaf=False) != KEYLESS, "it signs, and obeys anyone"


def test_prearm_reasons_are_requested_at_a_limited_rate() -> None:
    one = Bench(ARDUPILOT)
    one.well()
    for _ in range(250):
        one.estimator(0x33F)
        one.place()
        one.health(0x1000_0000)
        one.tick()
    asked = [frame for frame in one.sent if frame.name == "COMMAND_LONG" and frame.message.command == 401]
    assert len(asked) == 3


def test_the_estimator_must_go_on_speaking() -> None:
    one = Bench()
    one.well()
    assert one.driver.unready is None
    one.tick(2.5)
    assert one.driver.unready == "the estimator's reports have stopped ( ESTIMATOR_STATUS)"


def test_the_prearm_bit_counts_though_px4_does_not_declare_it() -> None:
    one = Bench()
    one.well()
    one.health(present=SENSORS & ~0x1000_0000)
    assert one.driver.unready is None


def test_a_place_that_nobody_vouches_for_is_reported_as_unknown() -> None:
    one = Bench()
    one.well()
    one.events.clear()
    one.estimator(0x025)
    one.place(15_000)
    (readings,) = [event for event in one.events if isinstance(event, Readings)]
    assert dict(readings.values) == {1: 15_000, 3: None, 4: None}


@pytest.mark.parametrize(("autopilot", "flies", "other", "name"), [
    (PX4, Px4Mode.HOLD, Px4Mode.LAND, "Land"),
    (PX4, Px4Mode.TAKEOFF, Px4Mode.POSITION, "Position"),
    (ARDUPILOT, CopterMode.GUIDED, CopterMode.LAND, "LAND"),
    (ARDUPILOT, CopterMode.GUIDED, 99, "mode 99"),
])  # fmt: skip
def test_mode_change_in_flight_without_a_command_is_a_takeover(
    autopilot: int, flies: int, other: int, name: str
) -> None:
    one = Bench(autopilot)
    one.landed(1)
    one.beat(flies, armed=True)
    one.landed(2)
    one.beat(flies, armed=True)
    assert one.taken() == []
    one.beat(other, armed=True)
    assert one.taken() == [], "the next report has to say so, too: anybody can put in one frame"
    one.beat(other, armed=True)
    assert one.taken() == [name]
    one.beat(other, armed=True)
    assert one.taken() == [name]


def test_single_report_of_another_mode_is_not_a_takeover() -> None:
    one = Bench()
    one.landed(1)
    one.beat(Px4Mode.HOLD, armed=True)
    one.landed(2)
    for _ in range(3):
        one.beat(Px4Mode.HOLD, armed=True)
        one.beat(Px4Mode.LAND, armed=True)
    one.beat(Px4Mode.HOLD, armed=True)
    assert one.taken() == []


def test_takeoff_end_and_ground_modes_are_not_a_takeover() -> None:
    one = Bench()
    one.landed(1)
    one.beat(Px4Mode.LAND)
    one.beat(Px4Mode.TAKEOFF, armed=True)
    one.landed(2)
    one.beat(Px4Mode.HOLD, armed=True)
    assert one.taken() == []
    one.driver.release()
    one.beat(Px4Mode.LAND, armed=True)
    assert one.taken() == []


@pytest.mark.parametrize("kind", [MotionKind.CLIMB, MotionKind.FLY])
def test_no_altitude_is_commanded_before_home_is_known(kind: MotionKind) -> None:
    one = Bench()
    one.landed(2)
    (failed,) = one.begin(kind, 1, 1, altitude=20_000)
    assert isinstance(failed, CommandFailed)
    assert (failed.token, failed.reason) == (7, "no-datum")
    assert not any(isinstance(event, CommandFailed) for event in one.begin(MotionKind.LAND)), "a landing needs none"


def test_altitudes_are_converted_in_one_place() -> None:
    seen = ObservedVehicle()
    with pytest.raises(NoDatum):
        seen.amsl(20_000)
    seen.estimator.take(0x3F, 0)
    message = mavlink.MAVLink_global_position_int_message(1, 0, 0, 503_000, 15_000, 0, 0, 0, 0)
    seen.take("GLOBAL_POSITION_INT", message, now_us=0, at_us=0, place=0)
    assert seen.home_amsl == 488_000
    assert seen.amsl(20_000) == 508_000
    assert seen.amsl(-489_000) == -1_000


def test_the_gravest_text_since_a_command_began_is_its_reason() -> None:
    one = Bench(ARDUPILOT)
    one.well()
    one.say("something old", 2)
    one.begin(MotionKind.CLIMB, altitude=20_000)
    for severity, text in ((6, "chatter"), (2, "Arm: Accels inconsistent"), (6, "more chatter")):
        one.say(text, severity)
    one.tick(6)
    (failed,) = [event for event in one.events if isinstance(event, CommandFailed)]
    assert (failed.reason, failed.text) == ("unknown/no-answer", "Arm: Accels inconsistent")


def test_status_texts_are_reported_and_quoted() -> None:
    one = Bench()
    one.say("allow\x1b[2J takeoff", 3)
    assert [(event.severity, event.text) for event in one.events if isinstance(event, StatusText)] == [
        (3, "allow\\x1b[2J takeoff")
    ]


def test_a_critical_state_is_told() -> None:
    one = Bench()
    for status in (4, 5, 6, 4):
        one.beat(0, status=status)
        one.tick()
    assert [event.text for event in one.events if isinstance(event, Noted) and "state" in event.text] == [
        "the vehicle reports a critical state", "the vehicle's state is no longer critical",
    ]  # fmt: skip


def test_announcements_go_out_as_texts_of_ours() -> None:
    one = Bench()
    one.tick(3)
    one.driver.announce(4, "deny goto(far): authority/out-of-scope")
    one.tick(3)
    (said,) = [frame for frame in one.sent if frame.name == "STATUSTEXT"]
    assert (said.system, said.component) == (1, 191)
    assert (said.message.severity, said.message.text) == (4, "deny goto(far): authority/out-of-scope")
