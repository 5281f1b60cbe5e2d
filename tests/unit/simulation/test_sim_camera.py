"""The simulated camera and gimbal: pictures as effects with their true place and attitude, reports by MAVLink, and
faults.
"""

import itertools
from collections.abc import Callable
from math import asin, atan2, degrees, hypot, nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model import faults
from rtshcua.model.faults import CameraCounter
from rtshcua.simulation.gimbal import Angles, angles, product

S = 1_000_000
CAMERA, GIMBAL = 100, 154


def fitted(pilot: Callable[..., Any], flavour: str, **more: Any) -> Any:
    return pilot(flavour, camera=True, gimbal=True, **more).ready()


def captured(p: Any) -> list[Any]:
    return [frame.message for frame in p.seen if frame.name == "CAMERA_IMAGE_CAPTURED"]


def feedback(p: Any) -> list[Any]:
    return [frame.message for frame in p.seen if frame.name == "CAMERA_FEEDBACK"]


def shoot(p: Any, sequence: int = 0) -> list[int]:
    found: list[int] = p.long(2000, 0, 0, 1, sequence, component=CAMERA)
    return found


def inject(p: Any, kind: Callable[..., Any], *values: Any) -> None:
    p.simulation.inject(kind(p.simulation.now_us, *values))
    p.wait(0.04)


def test_px4s_camera_and_gimbal_are_components_with_heartbeats_of_their_own(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "px4")
    p.wait(5)
    beats = [(frame.component, frame.message.type) for frame in p.seen if frame.name == "HEARTBEAT"]
    assert beats.count((CAMERA, mavlink.MAV_TYPE_CAMERA)) == beats.count((GIMBAL, mavlink.MAV_TYPE_GIMBAL)) >= 5
    q = fitted(pilot, "ardupilot")
    q.wait(5)
    assert {frame.component for frame in q.seen if frame.system == 1} == {1}
    r = pilot("px4").ready()
    assert {frame.component for frame in r.seen if frame.system == 1} == {1}


@pytest.mark.parametrize(
    ("component", "number", "name"),
    [
        (CAMERA, 259, "CAMERA_INFORMATION"), (CAMERA, 260, "CAMERA_SETTINGS"), (CAMERA, 261, "STORAGE_INFORMATION"),
        (CAMERA, 262, "CAMERA_CAPTURE_STATUS"), (GIMBAL, 280, "GIMBAL_MANAGER_INFORMATION"),
        (GIMBAL, 281, "GIMBAL_MANAGER_STATUS"), (GIMBAL, 285, "GIMBAL_DEVICE_ATTITUDE_STATUS"),
    ],
)  # fmt: skip
def test_components_answer_requests_for_their_messages(
    pilot: Callable[..., Any], component: int, number: int, name: str
) -> None:
    p = fitted(pilot, "px4")
    p.seen.clear()
    assert p.long(512, number, component=component) == [0]
    assert [frame.component for frame in p.seen if frame.name == name][-1] == component
    assert p.long(512, 33, component=component) == [2], "it has no position of its own"
    assert p.long(400, 1, component=component) == [3], "nor motors"
    assert not p.truth.armed
    assert p.long(511, number, 100_000, component=component) == [0]
    p.seen.clear()
    p.wait(1)
    assert 9 <= sum(frame.name == name for frame in p.seen) <= 11


def test_a_picture_is_an_effect_and_is_reported_with_its_place_height_attitude_and_time(
    pilot: Callable[..., Any],
) -> None:
    p = fitted(pilot, "px4", utc_us=1_700_000_000_000_000)
    p.take_off(20)
    p.long(1001, -2, 0, component=GIMBAL)
    assert p.long(1000, -30, 90, nan, nan, 16, component=GIMBAL) == [0]
    p.go_to(60, 0, 20)
    p.wait(5)
    assert shoot(p, 7) == [0]
    p.wait(1)
    (report,), (shot,) = captured(p), p.simulation.shots
    assert (shot.number, shot.sequence, shot.image, shot.stored) == (1, 7, 0, True)
    assert (report.image_index, report.capture_result) == (0, 1)
    north, east = p.config.home.local(report.lat, report.lon)
    assert hypot(north * 1000 - shot.north_mm, east * 1000 - shot.east_mm) < 50
    assert abs(report.relative_alt - shot.up_mm) < 50
    assert report.alt - report.relative_alt == p.config.home.amsl_mm
    assert report.time_utc == shot.utc_us == 1_700_000_000_000_000 + shot.at_us
    w, x, y, z = report.q
    assert abs(degrees(asin(2 * (w * y - z * x))) + 30) < 0.5
    assert abs(degrees(atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))) - 90) < 0.5
    assert (shot.pitch_cd, shot.yaw_cd) == pytest.approx((-3000, 9000), abs=50)


def test_arducopter_reports_a_picture_by_camera_feedback_alone(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "ardupilot", utc_us=1_700_000_000_000_000)
    p.take_off(20)
    assert p.long(511, 180, 200_000) == [0]
    p.seen.clear()
    p.wait(3)
    assert 14 <= len(feedback(p)) <= 16
    assert {m.img_idx for m in feedback(p)} == {0}
    p.seen.clear()
    assert p.long(2000, 0, 0, 1, 5) == [0]
    p.wait(3)
    assert 15 <= len(feedback(p)) <= 17
    assert not captured(p)
    m, (shot,) = feedback(p)[-1], p.simulation.shots
    assert (m.img_idx, m.completed_captures, m.time_usec) == (1, 1, shot.utc_us)
    assert abs(m.alt_rel * 1000 - shot.up_mm) < 50
    assert abs(m.alt_msl - m.alt_rel - 488) < 0.01
    assert feedback(p)[0].time_usec == 0, "the index counts triggers before the shutter opens"


def test_a_sequence_number_that_comes_again_is_a_duplicate_for_a_camera_but_not_for_arducopter(
    pilot: Callable[..., Any], flavour: str
) -> None:
    p = fitted(pilot, flavour)
    for sequence in (1, 1, 2, 2):
        assert shoot(p, sequence) == [0]
        p.wait(1)
    assert [shot.sequence for shot in p.simulation.shots] == ([1, 2] if p.px4 else [1, 1, 2, 2])


def test_a_camera_is_busy_until_a_picture_is_stored(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "px4")
    assert [shoot(p, 1), shoot(p, 2)] == [[0], [1]]
    p.wait(1)
    assert shoot(p, 2) == [0], "a refused sequence number was not taken"
    p.wait(1)
    assert len(captured(p)) == 2


def test_a_series_takes_its_pictures_at_its_interval_and_can_be_stopped(
    pilot: Callable[..., Any], flavour: str
) -> None:
    p = fitted(pilot, flavour)
    assert p.long(2000, 0, 1, 3, 0, component=CAMERA) == [0]
    p.wait(6)
    times = [shot.at_us for shot in p.simulation.shots]
    assert len(times) == 3
    assert [b - a for a, b in itertools.pairwise(times)] == [S, S]
    assert p.long(2000, 0, 1, 0, 0, component=CAMERA) == [0]
    p.wait(3.5)
    assert p.long(2001, component=CAMERA) == [0]
    p.wait(3)
    assert len(p.simulation.shots) == 7
    assert p.long(2000, 0, 0, 3, 0, component=CAMERA) == [2 if p.px4 else 4]
    assert p.long(2000, 0, nan, 0, 0, component=CAMERA) == [2 if p.px4 else 4]


def test_an_image_is_reported_again_by_its_index(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "px4")
    for sequence in (1, 2):
        shoot(p, sequence)
        p.wait(1)
    before = [m.to_dict() for m in captured(p)]
    p.seen.clear()
    assert [p.long(512, 263, index, component=CAMERA) for index in (1, 0, 2, nan)] == [[0], [0], [2], [2]]
    assert [m.to_dict() for m in captured(p)] == [before[1], before[0]]


def test_a_gimbal_obeys_only_whoever_is_in_primary_control(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "px4")
    turn = (-45, 20, nan, nan, 0)
    assert p.long(1000, *turn, component=GIMBAL) == [2]
    assert p.long(1001, 1, 191, component=GIMBAL) == [0], "control is given to another"
    assert p.long(1000, *turn, component=GIMBAL) == [2]
    assert p.long(1001, 255, 190, -1, -1, component=GIMBAL) == [0]
    assert p.long(1000, *turn, component=GIMBAL) == [0]
    p.wait(2)
    assert (p.last("GIMBAL_MANAGER_STATUS").primary_control_sysid,) == (255,)
    assert angles(tuple(p.last("GIMBAL_DEVICE_ATTITUDE_STATUS").q)) == pytest.approx((0, -0.7854, 0.349), abs=0.001)
    assert p.long(1000, -170, nan, nan, nan, component=GIMBAL) == [0]
    p.wait(3)
    assert degrees(p.simulation._autopilot.gimbal.pitch) == pytest.approx(-120), "limited to its range"
    assert p.long(1001, -3, 0, component=GIMBAL) == [0]
    assert p.long(1000, *turn, component=GIMBAL) == [2]


def test_arducopter_turns_its_gimbal_for_anybody(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "ardupilot")
    assert p.long(1000, -120, 0, nan, nan) == [0]
    p.wait(3)
    assert degrees(p.simulation._autopilot.gimbal.pitch) == pytest.approx(-120)


def test_a_locked_yaw_stays_while_the_vehicle_turns(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "ardupilot")
    p.take_off(20)
    p.long(1000, -10, 45, nan, nan, 16)
    p.go_to(-80, 10, 20)
    p.wait(8)
    assert degrees(angles(p.simulation._autopilot.camera.attitude).yaw) == pytest.approx(45, abs=1)


def test_lost_pictures_are_told_by_the_camera_and_skipped_in_arducopters_index(
    pilot: Callable[..., Any], flavour: str
) -> None:
    p = fitted(pilot, flavour)
    inject(p, faults.CameraLoss, 3_000)
    assert p.long(2000, 0, 1, 40, 0, component=CAMERA) == [0]
    p.wait(45)
    shots = p.simulation.shots
    lost = sum(not shot.stored for shot in shots)
    assert len(shots) == 40
    assert 5 <= lost <= 20
    if p.px4:
        assert [m.image_index for m in captured(p) if m.capture_result] == list(range(40 - lost))
        assert sum(m.capture_result == 0 and m.image_index == -1 for m in captured(p)) == lost
    else:
        assert [m.img_idx for m in feedback(p)] == [n for n, shot in enumerate(shots, 1) if shot.stored]


def test_the_same_seed_loses_the_same_pictures(pilot: Callable[..., Any]) -> None:
    def lost(seed: int) -> list[bool]:
        p = fitted(pilot, "px4", seed=seed)
        inject(p, faults.CameraLoss, 5_000)
        p.long(2000, 0, 1, 30, 0, component=CAMERA)
        p.wait(32)
        return [shot.stored for shot in p.simulation.shots]

    assert lost(1) == lost(1) != lost(2)


def test_a_slow_camera_takes_fewer_pictures_of_a_series(pilot: Callable[..., Any], flavour: str) -> None:
    p = fitted(pilot, flavour)
    inject(p, faults.CameraSlow, 2 * S)
    p.long(2000, 0, 1, 10, 0, component=CAMERA)
    p.wait(13)
    assert len(p.simulation.shots) == 4
    if not p.px4:
        assert [m.img_idx for m in feedback(p)] == [3, 6, 9, 10], "triggers count on until the shutter's feedback"


def test_a_full_camera_refuses_single_pictures_and_ends_no_series(pilot: Callable[..., Any], flavour: str) -> None:
    p = fitted(pilot, flavour)
    shoot(p, 1)
    p.wait(1)
    inject(p, faults.CameraFull)
    assert shoot(p, 2) == [2 if p.px4 else 0]
    p.wait(1)
    assert sum(shot.stored for shot in p.simulation.shots) == 1
    p.long(512, 262, component=CAMERA)
    assert p.last("CAMERA_CAPTURE_STATUS").available_capacity == 0


@pytest.mark.parametrize("counter", list(CameraCounter))
def test_a_camera_that_restarts_is_silent_loses_its_picture_and_forgets_what_it_reported(
    pilot: Callable[..., Any], counter: CameraCounter
) -> None:
    p = fitted(pilot, "px4")
    shoot(p, 1)
    p.wait(1)
    shoot(p, 2)
    p.wait(0.2)
    inject(p, faults.CameraReboot, 3 * S, counter)
    p.seen.clear()
    assert shoot(p, 3) == []
    p.wait(2.5)
    assert not any(frame.component == CAMERA for frame in p.seen)
    p.wait(1)
    assert any(frame.component == CAMERA for frame in p.seen)
    assert p.long(512, 263, 0, component=CAMERA) == [2]
    assert shoot(p, 2) == [0], "sequence numbers are forgotten"
    p.wait(1)
    (report,) = captured(p)
    assert report.image_index == (0 if counter is CameraCounter.RESTARTS else 2)
    assert report.time_boot_ms < 2_000
    assert [shot.stored for shot in p.simulation.shots] == [True, False, True]


def test_arducopters_index_restarts_with_the_autopilot_and_not_with_the_camera(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "ardupilot")
    for kind in (faults.CameraReboot, faults.Reboot):
        shoot(p)
        p.wait(1)
        inject(p, kind)
        p.wait(6)
    shoot(p)
    p.wait(1)
    assert [m.img_idx for m in feedback(p)] == [1, 2, 1]


def test_a_stuck_gimbal_acknowledges_and_does_not_move(pilot: Callable[..., Any], flavour: str) -> None:
    p = fitted(pilot, flavour)
    inject(p, faults.GimbalStuck, 5 * S)
    p.long(1001, 255, 190, component=GIMBAL)
    assert p.long(1000, -45, 0, nan, nan, component=GIMBAL) == [0]
    p.wait(3)
    assert p.simulation._autopilot.gimbal.pitch == 0
    p.wait(4)
    assert degrees(p.simulation._autopilot.gimbal.pitch) == pytest.approx(-45)


def test_payload_faults_do_nothing_without_a_payload(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()
    for kind, values in (
        (faults.CameraLoss, (5_000,)), (faults.CameraSlow, (S,)), (faults.CameraFull, ()),
        (faults.CameraReboot, ()), (faults.GimbalStuck, ()),
    ):  # fmt: skip
        inject(p, kind, *values)
    p.wait(6)
    assert p.simulation.shots == ()


def test_arducopter_takes_pictures_by_distance(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "ardupilot")
    p.take_off(20)
    assert p.long(206, 10, 0, 1) == [0]
    p.go_to(65, 0, 20)
    p.wait(25)
    north = [shot.north_mm for shot in p.simulation.shots]
    assert len(north) == 7
    assert all(9_000 < b - a < 11_500 for a, b in itertools.pairwise(north))
    assert p.long(206, 0) == [0]


def test_components_are_behind_the_autopilots_link_and_sign_with_its_key(pilot: Callable[..., Any]) -> None:
    p = fitted(pilot, "px4", signing_key=bytes(31) + b"1")
    p.wait(1)
    frames = [frame for frame in p.seen if frame.component == CAMERA]
    assert frames
    assert all(frame.signed for frame in frames)
    assert shoot(p, 1) == [], "unsigned"
    q = fitted(pilot, "px4")
    inject(q, faults.Stall, 2 * S)
    q.seen.clear()
    assert shoot(q, 1) == []
    q.wait(1.5)
    assert not [frame for frame in q.seen if frame.component == CAMERA]


@pytest.mark.parametrize("pitch", [-1.5707963, -1.2, 0.0, 0.7, 1.5707963])
def test_angles_and_quaternions_agree(pitch: float) -> None:
    for roll in (0.0,) if abs(pitch) > 1.5 else (-0.4, 0.0, 0.3):
        for yaw in (-3.0, -0.5, 0.0, 2.5):
            given = Angles(roll, pitch, yaw)
            assert angles(given.quaternion) == pytest.approx(given, abs=1e-3)
    east, down = Angles(0, 0, 1.5707963).quaternion, Angles(0, -1.5707963, 0).quaternion
    assert angles(product(east, down)) == pytest.approx((0, -1.5707963, 1.5707963), abs=1e-3)
