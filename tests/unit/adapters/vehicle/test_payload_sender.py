"""Commands to payload are sent as their contract says, repeated, followed until they had their effect, and ended."""

from collections.abc import Callable
from math import isnan
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from reference import payload_case as case
from rtshcua.mavlink.parameters import NAN, nearest_bits
from rtshcua.model.flat.contract import Addressee, Emission, EmissionMoment, EmissionSuccess, MotionKind
from rtshcua.onboard.enforcement.payload_gate import payload_of
from rtshcua.onboard.ports import Command, CommandFailed, PayloadOutcome, Succeeded
from virtual.copying import copied
from virtual.flyer import Flyer, climbed
from virtual.payload_stand_in import AUTOPILOT, CAMERA, GIMBAL, PayloadStandIn
from virtual.policy import POLICY, geo

START, STOP, PITCHYAW, CONFIGURE, DIST, VIDEO = 2_000, 2_001, 1_000, 1_001, 206, 2_500
ONE, DOWN = nearest_bits(1, 1), nearest_bits(-90, 1)
PATH = ((0, 30_000), (20_000, 30_000), (20_000, 0))


def picture(moment: EmissionMoment, amount: int = 0, **fields: Any) -> Emission:
    made = case.emission(START, 0, 0, ONE, 0, 0, 0, NAN, moment=moment, amount=amount)
    return replace(made, success=EmissionSuccess.IMAGE, **fields)


def look_down(**fields: Any) -> Emission:
    made = case.emission(PITCHYAW, DOWN, NAN, NAN, NAN, to=Addressee.GIMBAL)
    return replace(made, success=EmissionSuccess.ATTITUDE, bound=20_000_000, **fields)


class Carrier:
    """A vehicle aloft with a camera and a gimbal: of their own beside PX4, of the autopilot in ArduCopter."""

    def __init__(self, flavour: str) -> None:
        self.flyer: Flyer = copied(climbed(flavour, 20_000))
        self.apart = flavour == "px4"
        self.payload = PayloadStandIn(self.flyer.vehicle, apart=self.apart)
        self.flyer.wait(1.5)
        self.camera, self.gimbal = (CAMERA, GIMBAL) if self.apart else (AUTOPILOT, AUTOPILOT)

    def begin(self, *emits: Emission, kind: MotionKind = MotionKind.COVER, **fields: Any) -> int:
        """Start a survey of PATH, or another motion, with these commands to payload."""
        points = PATH if kind is MotionKind.COVER else PATH[:1] if kind is MotionKind.FLY else ()
        flyer, path = self.flyer, tuple(part for point in points for part in point)
        flyer.token += 1
        payload = payload_of(case.contract(emits), case.ARGUMENTS, len(points), POLICY)
        command = Command(flyer.token, "look", kind, path, geo(*points), 20_000, 5_000, **fields)
        flyer.vehicle.begin(replace(command, payload=payload), flyer.now_us)
        return flyer.token

    def end(self) -> Any:
        return self.flyer.until((Succeeded, CommandFailed), 120)

    @property
    def told(self) -> list[tuple[str, str]]:
        return [(each.what, each.text) for each in self.flyer.events if isinstance(each, PayloadOutcome)]


@pytest.fixture
def carrier(flavour: str) -> Callable[[], Carrier]:
    return lambda: Carrier(flavour)


def test_a_survey_points_the_gimbal_takes_pictures_by_distance_and_gives_control_back(
    carrier: Callable[[], Carrier],
) -> None:
    one = carrier()
    one.begin(look_down(required=1), picture(EmissionMoment.DISTANCE, 10_000))
    assert isinstance(one.end(), Succeeded)
    taken, given = one.payload.said(CONFIGURE)
    assert taken[:4] == (one.payload.system, 191, -1, -1)
    assert given[:4] == (-3, -3, -1, -1)
    (pointed,) = one.payload.said(PITCHYAW)
    assert pointed[0] == -90
    assert all(map(isnan, pointed[1:4]))
    assert 5 <= len(one.payload.said(START)) <= 6, "50 m of path, from its first point on"
    commands = [(number, component) for number, component, again, _ in one.payload.heard if not again]
    assert commands[:2] == [(CONFIGURE, one.gimbal), (PITCHYAW, one.gimbal)]
    assert commands[-1] == (CONFIGURE, one.gimbal)
    assert {component for number, component in commands if number == START} == {one.camera}
    outcomes = [what for what, _ in one.told]
    assert outcomes.count("sent") == outcomes.count("done") == len(commands)
    assert f"{PITCHYAW} to {one.gimbal}, 1: off by 0.0 deg" in [text for _, text in one.told]


def test_points_of_the_path_the_begin_and_the_end_have_their_commands(carrier: Callable[[], Carrier]) -> None:
    one = carrier()
    mode, zoom, focus = (
        case.emission(number, 0, ONE, moment=moment)
        for number, moment in ((530, EmissionMoment.BEGIN), (531, EmissionMoment.TURN), (532, EmissionMoment.END))
    )
    one.begin(mode, zoom, focus, picture(EmissionMoment.WAYPOINT))
    assert isinstance(one.end(), Succeeded)
    order = [number for number, _, again, _ in one.payload.heard if not again]
    assert order in ([530, START, 531, START, START, 532], [530, START, START, 531, START, 532])


def test_what_nobody_answers_is_repeated_and_then_failed(carrier: Callable[[], Carrier]) -> None:
    one = carrier()
    one.payload.answers = lambda command: None if command.confirmation < 2 else 0
    one.begin(picture(EmissionMoment.BEGIN), kind=MotionKind.HOLD, hold_us=4_000_000)
    assert isinstance(one.end(), Succeeded)
    assert [again for number, _, again, _ in one.payload.heard if number == START] == [0, 1, 2]
    assert one.told[-1] == ("done", f"{START} to {one.camera}, 1: image 1")
    silent = carrier()
    silent.payload.answers = lambda command: None
    silent.begin(picture(EmissionMoment.BEGIN), kind=MotionKind.HOLD, hold_us=1_000_000)
    assert isinstance(silent.end(), Succeeded), "a failure of payload does not stop the flight"
    assert silent.told[-1] == ("failed", f"{START} to {silent.camera}, 1: no answer")


def test_a_camera_that_is_busy_is_asked_again(carrier: Callable[[], Carrier]) -> None:
    for busy, outcome in ((2, "done"), (9, "failed")):
        one = carrier()
        one.payload.answers = lambda command, busy=busy: 1 if command.confirmation < busy else 0  # type: ignore[misc]
        one.begin(picture(EmissionMoment.BEGIN), kind=MotionKind.HOLD, hold_us=4_000_000)
        assert isinstance(one.end(), Succeeded)
        assert one.told[-1][0] == outcome, one.told


def test_an_acknowledgement_is_no_picture(carrier: Callable[[], Carrier]) -> None:
    one = carrier()
    one.payload.captures = lambda number: number != 2
    one.begin(picture(EmissionMoment.TIME, 1_000_000), kind=MotionKind.HOLD, hold_us=3_500_000)
    assert isinstance(one.end(), Succeeded)
    outcomes = [what for what, _ in one.told]
    assert outcomes.count("sent") == 4
    assert outcomes.count("failed") == 1
    (failed,) = [text for what, text in one.told if what == "failed"]
    assert failed.endswith("4: no image" if one.apart else "2: no image"), "ArduPilot's index counts what was lost"


@pytest.mark.parametrize(("result", "why"), [(None, "no answer"), (2, "denied")])
def test_payload_that_is_required_fails_its_step(carrier: Callable[[], Carrier], result: int | None, why: str) -> None:
    one = carrier()
    one.payload.answers = lambda command: result if command.command == PITCHYAW else 0
    token = one.begin(look_down(required=1), picture(EmissionMoment.DISTANCE, 10_000))
    failed = one.end()
    assert (failed.token, failed.reason) == (token, "payload")
    assert failed.text == f"{PITCHYAW} to {one.gimbal}, 1: {why}"
    one.begin(kind=MotionKind.HOLD, hold_us=1_000_000)
    one.end()
    assert one.payload.said(CONFIGURE)[-1][0] == -3, "control is given back"


@pytest.mark.parametrize("taken_over", [False, True])
def test_what_was_begun_is_ended_whoever_flies_then(carrier: Callable[[], Carrier], taken_over: bool) -> None:
    one = carrier()
    series = case.emission(START, 0, nearest_bits(2, 1), 0, 0, 0, 0, NAN)
    one.begin(look_down(), series, picture(EmissionMoment.TIME, 1_000_000))
    one.flyer.wait(3)
    before = len(one.payload.said(START))
    assert before >= 1
    if taken_over:
        one.flyer.vehicle.release()
    else:
        one.begin(kind=MotionKind.HOLD)
    one.flyer.vehicle.frames.close()  # type: ignore[union-attr]
    one.flyer.wait(4)
    assert len(one.payload.said(START)) == before
    assert [numbers[0] for numbers in one.payload.said(CONFIGURE)][1:] == [-3]
    assert len(one.payload.said(STOP)) == 1
    assert ("done", f"{STOP} to {one.camera}, 1: acknowledged") in one.told


def test_what_was_begun_is_ended_where_it_was_begun() -> None:
    """Whoever sends the heartbeats of a camera in a flight cannot keep ours running."""
    one = Carrier("ardupilot")
    videos = [case.emission(VIDEO, nearest_bits(stream, 1), to=Addressee.CAMERA) for stream in (1, 2)]
    one.begin(look_down(), *videos)
    one.flyer.wait(2)
    for component, kind in ((CAMERA, 30), (GIMBAL, 26)):
        one.payload._send(component, m.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))
    one.flyer.wait(0.5)
    one.begin(kind=MotionKind.HOLD)
    one.flyer.wait(3)
    assert [numbers[0] for numbers in one.payload.said(VIDEO + 1)] == [1, 2]
    assert one.payload.said(CONFIGURE)[-1][0] == -3
    ended = {text.split(",")[0] for what, text in one.told if what == "done"}
    assert {f"{VIDEO + 1} to {AUTOPILOT}", f"{CONFIGURE} to {AUTOPILOT}"} <= ended


def test_a_count_of_triggers_tells_which_command_took_no_picture(carrier: Callable[[], Carrier]) -> None:
    one = carrier()
    one.payload.captures = lambda number: False
    one.begin(picture(EmissionMoment.TIME, 300_000), kind=MotionKind.HOLD, hold_us=900_000)
    for index in (7, 9):
        one.flyer.wait(0.6)
        one.payload._send(one.camera, m.MAVLink_camera_feedback_message(0, 0, 0, index, *[0] * 9))
    one.flyer.wait(0.2)
    ended = [(what, text.partition(", ")[2]) for what, text in one.told if what != "sent"]
    assert ended[:3] == [("done", "1: image 7"), ("failed", "2: no image"), ("done", "3: image 9")]


def test_a_camera_that_reports_the_same_picture_again_took_one(carrier: Callable[[], Carrier]) -> None:
    one = carrier()
    one.payload.captures = lambda number: False
    one.begin(picture(EmissionMoment.BEGIN), kind=MotionKind.HOLD, hold_us=1_000_000)
    one.payload._send(one.camera, m.MAVLink_camera_feedback_message(0, 0, 0, 7, *[0] * 9))
    one.flyer.wait(0.2)
    assert one.told[-1] == ("done", f"{START} to {one.camera}, 1: image 7")
    one.end()
    one.begin(picture(EmissionMoment.BEGIN), kind=MotionKind.HOLD, hold_us=1_000_000)
    for _ in range(5):
        one.payload._send(one.camera, m.MAVLink_camera_feedback_message(0, 0, 0, 7, *[0] * 9))
        one.flyer.wait(0.2)
    one.end()
    assert one.told[-1][0] == "failed"
