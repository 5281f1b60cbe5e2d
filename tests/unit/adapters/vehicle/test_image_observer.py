"""Reports of cameras become images: indices are compared and not arrivals, gaps are requested again, and whatever a
hostile sender reports, memory, records and requests stay bounded.
"""

from math import inf, nan
from random import Random
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from reference import flat_case as flat
from reference import payload_case
from rtshcua.adapters.vehicle import image_observer as images
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.image_observer import ImageObserver
from rtshcua.codec.frames import Codec
from rtshcua.evidence.image_records import ImageDetail, ImageLedger, read_image
from rtshcua.mavlink import enums
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command, ImageReported, ImagesExpected, PayloadFrame

S, UTC = 1_000_000, 1_700_000_000_000_000
HOME = 488_000


class Watched:
    """An observer with its clock; each message comes a second after the last one."""

    def __init__(self, **fields: Any) -> None:
        self.observer = ImageObserver()
        self.now_us = 10 * S
        for name, value in fields.items():
            setattr(self.observer, name, value)

    def hear(self, message: Any, component: int = 100, after_us: int = S) -> list[ImageDetail]:
        self.now_us += after_us
        events = self.observer.take(message.get_type(), message, component, self.now_us, HOME)
        assert all(isinstance(each, ImageReported) for each in events)
        return [msgspec.json.decode(each.detail, type=ImageDetail) for each in events]

    def asks(self, *, triggers: bool = False, after_us: int = S) -> list[tuple[int, int, float]]:
        """The requests that are due: component, message, parameter 2."""
        self.now_us += after_us
        due = self.observer.due(1, self.now_us, triggers=triggers)
        return [(each.target_component, round(each.param1), each.param2) for each in due]

    def again(self) -> list[float]:
        """The indices that are requested."""
        return [index for _, number, index in self.asks() if number == 263]

    def expected(self) -> list[tuple[int, int, int, int]]:
        found = self.observer.expected_images(self.now_us)
        return [(e.camera, e.series, e.first, e.last) for e in found if isinstance(e, ImagesExpected)]


def captured(index: int, **changed: Any) -> Any:
    at = changed.pop("at", index)
    fields = dict[str, Any](
        time_boot_ms=10_000 + 1_000 * at, time_utc=UTC + S * at, camera_id=0, lat=473_977_400, lon=85_455_900,
        alt=508_000, relative_alt=20_000, q=[1, 0, 0, 0], image_index=index, capture_result=1,
        file_url=b"mftp:/DCIM/IMG_0001.JPG",
    )  # fmt: skip
    return m.MAVLink_camera_image_captured_message(**(fields | changed))


def status(count: int, boot_ms: int = 9_000) -> Any:
    return m.MAVLink_camera_capture_status_message(boot_ms, 0, 0, 0, 0, 1_000, count)


def fed_back(index: int, at: int | None = None, **changed: Any) -> Any:
    at = index if at is None else at
    fields = dict[str, Any](
        time_usec=UTC + S * at if at else 0, target_system=0, cam_idx=0, img_idx=index, lat=473_977_400,
        lng=85_455_900, alt_msl=508.0, alt_rel=20.0, roll=1.5, pitch=-2.25, yaw=350.0, foc_len=0, flags=0,
        completed_captures=index,
    )  # fmt: skip
    return m.MAVLink_camera_feedback_message(**(fields | changed))


def refused(result: int = 2) -> Any:
    return m.MAVLink_command_ack_message(512, result, 0, 0, 1, 191)


def test_an_image_has_its_place_heights_attitude_accuracy_and_time() -> None:
    w = Watched()
    w.hear(status(0))
    gps = m.MAVLink_gps_raw_int_message(0, 3, 0, 0, 0, 0, 0, 0, 0, 10, 0, 900, 1_780, 0)
    assert w.hear(gps, 1) == []
    (image,) = w.hear(captured(0, q=[0.5, 0.5, 0.5, -0.5]))
    assert image == ImageDetail(
        above_home_mm=20_000, above_sea_mm=508_000, asked=0, attitude="camera", camera=100, file="IMG_0001.JPG",
        horizontal_mm=900, index=0, latitude=473_977_400, longitude=85_455_900, pitch_cd=9_000, result=1, roll_cd=0,
        series=0, unit=0, utc_us=UTC, vertical_mm=1_780, yaw_cd=-9_000,
    )  # fmt: skip
    (later,) = w.hear(captured(1), after_us=5 * S)
    assert (later.horizontal_mm, later.vertical_mm) == (None, None), "the accuracy is old"


def test_heights_of_camera_feedback_are_above_sea_and_home() -> None:
    w = Watched()
    (image,) = w.hear(fed_back(1), 1)
    assert (image.above_sea_mm, image.above_home_mm) == (508_000, 20_000)
    assert (image.roll_cd, image.pitch_cd, image.yaw_cd, image.attitude) == (150, -225, 35_000, "vehicle")


@pytest.mark.parametrize(
    ("changed", "unknown"),
    [
        ({"lat": 0, "lon": 0}, {"latitude", "longitude", "above_sea_mm", "above_home_mm"}),
        ({"lat": 900_000_001}, {"latitude", "longitude", "above_sea_mm", "above_home_mm"}),
        ({"lon": -(2**31)}, {"latitude", "longitude", "above_sea_mm", "above_home_mm"}),
        ({"q": [0, 0, 0, 0]}, {"roll_cd", "pitch_cd", "yaw_cd"}),
        ({"q": [nan, 0, 0, 0]}, {"roll_cd", "pitch_cd", "yaw_cd"}),
        ({"q": [1e38, 1e38, 1e38, 1e38]}, {"roll_cd", "pitch_cd", "yaw_cd"}),
        ({"q": [inf, 0, 0, 1]}, {"roll_cd", "pitch_cd", "yaw_cd"}),
        ({"time_utc": 0}, {"utc_us"}),
        ({"time_utc": 2**64 - 1}, {"utc_us"}),
    ],
)
def test_what_makes_no_sense_is_unknown(changed: dict[str, Any], unknown: set[str]) -> None:
    (image,) = Watched().hear(captured(0, **changed))
    always = {"horizontal_mm", "vertical_mm"}
    assert {name for name in image.__struct_fields__ if getattr(image, name) is None} == unknown | always


@pytest.mark.parametrize("url", [b"", b"../", b"a b.jpg", b"x" * 65, b"a\x1b[31m", "ä.jpg".encode(), b"http://h/?q=1"])
def test_a_file_name_that_is_not_plain_is_left_out(url: bytes) -> None:
    (image,) = Watched().hear(captured(0, file_url=url))
    assert image.file == ""


def test_a_report_that_comes_again_is_no_new_image() -> None:
    w = Watched()
    w.hear(status(0))
    assert [len(w.hear(captured(index))) for index in (0, 1, 1, 0, 2, 2, 1)] == [1, 1, 0, 0, 1, 0, 0]
    assert w.expected() == [(100, 0, 0, 2)]


def test_camera_feedback_that_is_repeated_at_a_rate_is_one_picture() -> None:
    w = Watched(expected=True)
    assert (1, 180, 0.0) in w.asks(triggers=True)
    assert w.hear(fed_back(0, 0), 1) == []
    found = [w.hear(fed_back(index, at), 1) for index, at in ((1, 0), (1, 5), (1, 5), (2, 5), (2, 6), (2, 6))]
    assert [each[0].index for each in found if each] == [1, 2], "an index without its time is only a trigger"
    assert w.hear(fed_back(1, 5), 1) == [], "overtaken"
    assert w.expected() == [(1, 0, 1, 2)]


def test_pictures_of_before_are_not_this_flights() -> None:
    w = Watched(expected=True)
    w.asks(triggers=True)
    assert w.hear(fed_back(7), 1) == []
    assert [each.index for each in w.hear(fed_back(8), 1)] == [8]
    assert w.expected() == [(1, 0, 8, 8)]
    c = Watched()
    c.hear(status(5))
    assert c.hear(captured(2)) == [], "requested by somebody else"
    assert [each.index for each in c.hear(captured(5))] == [5]
    assert c.expected() == [(100, 0, 5, 5)]


def test_triggers_that_are_faster_than_the_shutters_feedback_are_two_pictures() -> None:
    w = Watched(expected=True)
    w.asks(triggers=True)
    w.hear(fed_back(0, 0), 1)
    found = [
        *w.hear(fed_back(1, 1, completed_captures=1), 1),
        *w.hear(fed_back(3, 2, completed_captures=2), 1),
        *w.hear(fed_back(3, 3, completed_captures=3), 1),
    ]
    assert [each.index for each in found] == [1, 3, 2]
    assert w.hear(fed_back(3, 4, completed_captures=4), 1) == [], "no index is left for it"


def test_failed_pictures_are_counted_and_have_no_index() -> None:
    w = Watched()
    w.hear(status(0))
    found = [w.hear(captured(-1, at=at, capture_result=0)) for at in (1, 1, 2)]
    assert [len(each) for each in found] == [1, 0, 1]
    assert (found[0][0].index, found[0][0].result) == (None, 0)
    (odd,) = w.hear(captured(3, at=5, capture_result=7))
    assert (odd.index, odd.result) == (None, 0)


def test_gaps_are_requested_again_one_by_one() -> None:
    w = Watched()
    w.hear(status(0))
    w.hear(captured(0))
    w.hear(captured(3))
    assert w.again() == [1]
    (image,) = w.hear(captured(1))
    assert (image.index, image.asked) == (1, 1)
    assert w.again() == [2]
    assert w.again() == [2]
    (image,) = w.hear(captured(2))
    assert image.asked == 2
    assert w.again() == []


def test_requests_wait_for_their_answer_and_end() -> None:
    w = Watched()
    w.hear(status(0))
    w.hear(captured(2))
    assert [w.again() for _ in range(8)] == [[0], [0], [0], [1], [1], [1], [], []]
    w = Watched()
    w.hear(status(0))
    w.hear(captured(2))
    asked = [w.asks(after_us=100_000) for _ in range(5)]
    assert sum((100, 263, 0.0) in each for each in asked) == 1, "one answer is awaited"
    assert w.hear(refused()) == []
    assert w.again() == [1], "a refused one is not repeated"
    w.hear(refused(0))
    assert w.again() == [1]


def test_images_at_the_end_are_missed_by_their_number() -> None:
    w = Watched()
    w.hear(status(0))
    w.hear(captured(0))
    w.hear(status(3, 20_000))
    assert [w.again(), w.hear(captured(1))[0].index, w.again()] == [[1], 1, [2]]
    assert w.expected() == [(100, 0, 0, 2)]


def test_a_camera_that_was_heard_is_asked_for_its_number_now_and_then() -> None:
    w = Watched()
    assert w.asks() == []
    w.hear(m.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3))
    assert [w.asks() for _ in range(7)] == [[(100, 262, 0.0)]] * 5 + [[], []], "it does not answer"
    w.hear(status(0))
    assert sum((100, 262, 0.0) in w.asks() for _ in range(20)) in (0, 4)


def test_an_index_that_starts_again_begins_a_new_series() -> None:
    w = Watched()
    w.hear(status(0))
    for index in (0, 1, 2):
        w.hear(captured(index))
    (image,) = w.hear(captured(0, at=9, time_boot_ms=500))
    assert (image.series, image.index) == (1, 0)
    (image,) = w.hear(captured(2, at=11, time_boot_ms=2_500))
    assert (image.series, image.index) == (1, 2)
    assert w.expected() == [(100, 1, 0, 2)]
    assert w.again() == [1]
    assert w.observer.notes == ["camera 100 counts its images anew"]


def test_a_restart_shows_in_the_number_of_images_too() -> None:
    w = Watched()
    w.hear(status(0))
    for index in range(5):
        w.hear(captured(index))
    w.hear(status(2, 1_000))
    assert w.expected() == [(100, 1, 0, 1)]
    w = Watched()
    w.hear(status(0))
    for index in range(5):
        w.hear(captured(index))
    w.hear(status(7, 1_000))
    assert w.expected() == [(100, 0, 0, 6)], "it restarted and counts on"
    w.hear(status(3, 500))
    assert w.expected() == [(100, 0, 0, 6)], "overtaken"


def test_arducopters_index_restarts_with_it() -> None:
    w = Watched()
    for index in (1, 2, 3):
        w.hear(fed_back(index), 1)
    assert w.hear(fed_back(0, 0), 1) == []
    (image,) = w.hear(fed_back(2, 9, completed_captures=1), 1)
    assert (image.series, image.index) == (1, 2)
    assert w.expected() == [(1, 1, 1, 2)]
    w = Watched()
    for index in (1, 2, 3):
        w.hear(fed_back(index), 1)
    (image,) = w.hear(fed_back(1, 9), 1)
    assert (image.series, image.index) == (1, 1), "without a report in between"


def test_reports_that_overtake_each_other_are_no_restart() -> None:
    w = Watched()
    w.hear(status(0))
    found = [w.hear(captured(index)) for index in (0, 2, 1, 4, 3)]
    assert [each[0].series for each in found] == [0] * 5
    assert w.observer.notes == []


# ---------------------------------------------------------------- hostile senders


def test_a_flood_of_reports_is_left_out_and_noted_once() -> None:
    w = Watched()
    w.hear(status(0))
    taken = sum(len(w.hear(captured(index), after_us=1)) for index in range(10_000))
    assert images.BURST <= taken <= images.BURST + 10_000 // images.EARNED_US + 1
    assert len(w.observer.notes) == 1
    assert w.hear(captured(20_000))[0].index == 20_000, "later ones count again"


def test_a_huge_index_costs_a_bounded_number_of_requests() -> None:
    w = Watched()
    w.hear(status(0))
    w.hear(captured(2**31 - 1, at=1))
    requests = 0
    for _ in range(4 * images.MOST_REQUESTS):
        requests += len(w.again())
        w.hear(refused(), after_us=0)
    assert requests == images.MOST_REQUESTS


def test_endless_restarts_end_with_a_note() -> None:
    w = Watched()
    for at in range(1, 300):
        w.hear(captured(0, at=at))
        w.hear(captured(1, at=at, time_utc=UTC + S * at + 1))
    assert len(w.observer.notes) == images.MOST_SERIES
    assert "left out" in w.observer.notes[-1]
    assert w.hear(captured(0, at=999)) == []


@pytest.mark.parametrize("repeated", [(status(1_000, 1_000_000), status(0, 0)), (fed_back(1_000, 0), fed_back(1, 0))])
def test_restarts_without_an_image_in_between_end_with_a_note_too(repeated: tuple[Any, Any]) -> None:
    w = Watched()
    for number in range(1_000):
        w.hear(repeated[number % 2], 1 if repeated[0].get_type() == images.FEEDBACK else 100, after_us=1)
    assert len(w.observer.notes) == images.MOST_SERIES
    assert "left out" in w.observer.notes[-1]


def test_an_index_of_0_is_taken_once() -> None:
    w = Watched()
    w.hear(fed_back(0, 1, completed_captures=1), 1)
    assert w.hear(fed_back(0, 2, completed_captures=2), 1) == []


@pytest.mark.parametrize("field", ["alt_msl", "alt_rel"])
@pytest.mark.parametrize("metres", [3e38, -3e38, inf, nan])
def test_a_height_that_no_record_can_have_is_unknown(field: str, metres: float) -> None:
    (image,) = Watched().hear(fed_back(1, **{field: metres}), 1)
    assert image.above_home_mm is None
    assert (image.above_sea_mm is None) == (field == "alt_msl")
    assert ImageLedger().add(msgspec.json.encode(image).decode()) is None


def test_known_images_are_forgotten_in_the_end() -> None:
    w = Watched()
    w.hear(status(0))
    for index in range(images.MOST_KNOWN + 50):
        w.hear(captured(index))
    (camera,) = w.observer._cameras.values()
    assert len(camera.series.known) == images.MOST_KNOWN
    assert w.hear(captured(3)) == [], "an old one is no restart"


def test_made_up_cameras_keep_no_real_one_out() -> None:
    """Every camera that can be is followed, and each is asked in its turn, whatever the others lack."""
    w = Watched()
    for component in range(105, 99, -1):
        w.hear(status(0), component, after_us=1)
        assert len(w.hear(captured(1_000, at=1), component, after_us=1)) == 1
    assert [len(w.hear(fed_back(1), 1))] == [1]
    assert len(w.observer._cameras) == images.MOST_CAMERAS
    asked = [to for _ in range(60) for to, number, _ in w.asks(after_us=images.REQUEST_US) if number == 263]
    assert {asked.count(component) for component in range(100, 106)} == {10}


@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_reported_the_records_agree_with_each_other(seed: int) -> None:
    chance, w, ledger = Random(seed), Watched(), ImageLedger()
    boots, odd = [0, 500, 9_000, 20_000, 2**32 - 1], [0, 1, 2, 3, 5, 40, 2**31 - 1]
    for _ in range(1_500):
        component = chance.choice((1, 100, 101))
        index, at = chance.choice(odd), chance.randrange(40)
        message = chance.choice(
            (
                captured(chance.choice((index, -1)), at=at, time_boot_ms=chance.choice(boots)),
                captured(index, at=at, capture_result=chance.choice((1, 1, 0)), time_utc=chance.choice((0, UTC + at))),
                fed_back(
                    index % 65_536, at, completed_captures=chance.randrange(4), alt_msl=chance.choice((nan, inf, 5))
                ),
                status(chance.choice((*odd, -5)), chance.choice(boots)),
                refused(chance.randrange(4)),
            )
        )
        for detail in w.hear(message, component, chance.choice((0, 10_000, S))):
            text = msgspec.json.encode(detail).decode()
            assert read_image(text) == detail
            assert ledger.add(text) is None
        if chance.random() < 0.3:
            assert len(w.asks(triggers=chance.random() < 0.5)) <= 8
        for camera, series, first, last in w.expected():
            told = ledger.missing(camera, series, first, last)
            assert told.first <= told.last + 1
    assert ledger.taken > 20


def test_images_are_expected_if_a_step_or_what_replaced_one_takes_pictures() -> None:
    step = flat.MISSION.invocations[0]
    for command, taken in (
        (enums.MAV_CMD_IMAGE_START_CAPTURE, True),
        (enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST, True),
        (enums.MAV_CMD_SET_CAMERA_ZOOM, False),
    ):
        looks = replace(step, contract=replace(step.contract, emits=(payload_case.emission(command),)))
        assert Driver(flat.POLICY, FrameSession(), steps=(step, looks)).images.expected is taken
        driver = Driver(flat.POLICY, FrameSession(), steps=(step,))
        assert driver.images.expected is False
        driver.receive(Codec(1, 1).pack(m.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), S)
        sent = PayloadFrame(command, 1, (0,) * 7, None, 0, 0, 1, 0, 0, 0, S, False)
        driver.begin(Command(7, "look", MotionKind.HOLD, (), (), 0, 0, payload=(sent,)), S)
        assert driver.images.expected is taken
