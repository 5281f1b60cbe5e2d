"""Observe the images of a flight: reports of cameras become events, gaps among their indices are requested again.

CAMERA_IMAGE_CAPTURED comes from a camera that is a component of its own (or from the autopilot for one), with the index
of the stored image; CAMERA_FEEDBACK from ArduPilot, with the index of the trigger. Arrivals prove nothing: both are
repeated, on request or at a rate, so indices are compared, and for CAMERA_FEEDBACK the time too, because its index
counts a trigger before the shutter has opened. An index that starts again means that the camera (or the autopilot)
restarted: a new series begins.

Everything here is the world's claim: whoever is on the link can make up images. So all memory and all requests are
bounded, a flood of reports is left out, and nothing is decided by an image.
"""

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import asin, atan2, degrees, isfinite, pi
from re import compile
from typing import Any, Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.evidence.image_records import ImageDetail, IndexSet, encoded
from rtshcua.mavlink.enums import MAV_CMD_REQUEST_MESSAGE
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.quantise import quantise
from rtshcua.onboard.enforcement.allow_list import CAMERAS
from rtshcua.onboard.ports import Event, ImageReported, ImagesExpected

CAPTURED: Final = "CAMERA_IMAGE_CAPTURED"
FEEDBACK: Final = "CAMERA_FEEDBACK"
STATUS: Final = "CAMERA_CAPTURE_STATUS"
#: the messages of the autopilot that matter here, and those of a camera
OF_AUTOPILOT: Final = frozenset({CAPTURED, FEEDBACK, STATUS, "GPS_RAW_INT"})
OF_CAMERA: Final = frozenset({CAPTURED, STATUS, "HEARTBEAT", "COMMAND_ACK"})

#: how many cameras are observed: all that there can be, so that made-up ones keep no real one out
MOST_CAMERAS: Final = len(CAMERAS) + 1
#: how many restarts of an index are followed; later reports of that camera are left out
MOST_SERIES: Final = 100
#: how many images of a series are recognised by their time when they are reported again
MOST_KNOWN: Final = 20_000
#: how many reports are taken at once, and how often one more is
BURST: Final = 40
EARNED_US: Final = 50_000
#: how often one image is requested again, how many requests a series may need, and how long one waits for its answer
TRIES: Final = 3
MOST_REQUESTS: Final = 2_000
ANSWER_US: Final = 700_000
#: how often an image of any camera is requested
REQUEST_US: Final = 200_000
#: how often a camera is asked how many images it has taken, and at first
EACH_US: Final = 5_000_000
FIRST_US: Final = 1_000_000
#: and how often at most, if it does not answer
MOST_UNANSWERED: Final = 5
#: ms: a report that is older by less may have been overtaken
REORDERED_MS: Final = 2_000
#: a GPS accuracy older than this is not that of an image
ACCURACY_US: Final = 2_000_000

_MOST_E7: Final = (900_000_000, 1_800_000_000)
_MOST_UTC_US: Final = 1 << 53
_NAME: Final = compile(r"[A-Za-z0-9._-]{1,64}")
_MOST_METRES: Final = 1_000_000
_UNIT: Final = 1e-2  # the greatest error of the length of a quaternion
_UPRIGHT: Final = 1e-4

_Time = tuple[int, int]  # of an image: since the camera's boot in ms, and UTC in us; 0 where unknown


@dataclass(slots=True)
class _Series:
    """The images between two restarts of an index."""

    number: int
    first: int | None = None  # the first expected index, None before anything is known
    last: int = -1
    seen: IndexSet = field(default_factory=IndexSet)
    ended: IndexSet = field(default_factory=IndexSet)  # seen, or not requested any more
    known: OrderedDict[int, _Time] = field(default_factory=OrderedDict)
    failures: OrderedDict[_Time, None] = field(default_factory=OrderedDict)
    failed: int = 0
    newest_us: int = 0  # UTC of the newest image
    requests: int = 0


@dataclass(slots=True)
class _Camera:
    """One camera. `answers`: whether an image can be requested by its index."""

    component: int
    answers: bool
    series: _Series
    due_us: int
    asked: int | None = None  # the index of the open request
    tries: int = 0  # how often that was sent,
    until_us: int = 0  # and how long its answer is awaited
    boot_ms: int = 0  # the latest time on its clock
    completed: int = 0  # how many pictures ArduPilot has counted
    unanswered: int = 0  # how often it was asked before anything was known
    restarts: int = 0
    deaf: bool = False  # it has restarted too often
    lost: int = 0  # images of earlier series that are missing, and those that failed
    failed: int = 0
    counted_us: int | None = None  # when it last told how many images it has taken
    baseline: bool = False  # the next CAMERA_FEEDBACK may be of a picture from before


class ImageObserver:
    """The images of one flight. Without `expected` nothing is sent before a camera was heard.

    `notes` collects texts for the operator.
    """

    def __init__(self, slack: int = 1) -> None:
        self._cameras: dict[int, _Camera] = {}
        self._slack = slack
        self.notes: list[str] = []
        #: the mission takes pictures: ask an autopilot for the state of its camera before the flight
        self.expected = False
        self._accuracy: tuple[int, int | None, int | None] | None = None
        self._next_us = 0  # when an image may be requested again
        self._left = BURST
        self._paid_us: int | None = None
        self._dropped = 0

    @property
    def watches(self) -> bool:
        """Whether there is, or may be, a camera."""
        return self.expected or bool(self._cameras)

    # ------------------------------------------------------------------------------------------ heard

    def take(
        self, name: str, message: Message, component: int, now_us: int, home_amsl: int | None
    ) -> Sequence[Event]:  # fmt: skip
        """Take in a message of a camera or of the autopilot. `home_amsl` is the height of home above the sea in mm, if
        known.
        """
        match name:
            case "GPS_RAW_INT":
                if self._cameras or self.expected:
                    self._accuracy = now_us, _accuracy(message, "h_acc"), _accuracy(message, "v_acc")
            case "HEARTBEAT":
                self._camera(component, now_us)
            case "COMMAND_ACK":
                self._answered(component, message)
            case "CAMERA_CAPTURE_STATUS":
                self._status(component, message, now_us)
            case "CAMERA_IMAGE_CAPTURED":
                return self._captured(component, message, now_us, home_amsl)
            case "CAMERA_FEEDBACK":
                return self._fed_back(component, message, now_us)
        return ()

    def _camera(self, component: int, now_us: int) -> _Camera | None:
        found = self._cameras.get(component)
        if found is None and len(self._cameras) < MOST_CAMERAS:
            found = _Camera(component, component in CAMERAS, _Series(0), now_us)
            self._cameras[component] = found
        return found

    def _answered(self, component: int, message: Message) -> None:
        """Take in an answer: a refused request is not repeated."""
        camera = self._cameras.get(component)
        if camera is None or message.command != MAV_CMD_REQUEST_MESSAGE or message.result == 0:
            return
        if camera.asked is not None:
            camera.series.ended.add(camera.asked)
            camera.asked, camera.tries = None, 0

    def _status(self, component: int, message: Message, now_us: int) -> None:
        """Take in how many images a camera has taken. The count of ArduPilot, which triggers its camera itself, comes
        with CAMERA_FEEDBACK.
        """
        camera = self._camera(component, now_us) if component in CAMERAS else None
        count, boot_ms = message.image_count, message.time_boot_ms
        if camera is None or camera.deaf or count < 0:
            return
        camera.counted_us = now_us
        series = camera.series
        restarted = boot_ms < camera.boot_ms - REORDERED_MS
        camera.boot_ms = boot_ms if restarted else max(camera.boot_ms, boot_ms)
        if restarted and count - 1 < series.last:
            series = self._restart(camera, 0)
        if series.first is None:
            series.first = count
        series.last = max(series.last, count - 1)

    def _captured(self, component: int, message: Message, now_us: int, home_amsl: int | None) -> list[Event]:
        camera = self._camera(component, now_us)
        if camera is None or camera.deaf or not self._pays(now_us):
            return []
        camera.answers = True
        made = (message.time_boot_ms, _utc(message.time_utc) or 0)
        index = message.image_index if message.capture_result == 1 and message.image_index >= 0 else None
        asked = camera.tries if index is not None and index == camera.asked else 0
        if not self._is_new(camera, index, made):
            return []
        roll, pitch, yaw = _angles(message.q)
        latitude, longitude = _place(message.lat, message.lon)
        above_sea = None if latitude is None else message.alt
        detail = ImageDetail(
            above_home_mm=None if above_sea is None or home_amsl is None else above_sea - home_amsl,
            above_sea_mm=above_sea, asked=asked, attitude="camera", camera=component,
            file=_file(message.file_url), index=index, latitude=latitude, longitude=longitude, pitch_cd=pitch,
            result=0 if index is None else 1, roll_cd=roll, series=camera.series.number, unit=message.camera_id,
            utc_us=made[1] or None, yaw_cd=yaw, **self._accurate(now_us),
        )  # fmt: skip
        return [ImageReported(now_us, component, index, encoded(detail))]

    def _fed_back(self, component: int, message: Message, now_us: int) -> list[Event]:
        """Take in CAMERA_FEEDBACK: it is a picture if its time is new, whatever its index."""
        camera = self._camera(component, now_us)
        if camera is None or camera.deaf:
            return []
        camera.answers, camera.counted_us = False, now_us
        series, index, utc_us = camera.series, message.img_idx, _utc(message.time_usec)
        baseline, camera.baseline = camera.baseline and series.first is None, False
        if baseline or utc_us is None or utc_us <= series.newest_us:
            self._count(camera, index, utc_us)
            return []
        if not self._pays(now_us):
            return []
        index = self._told_index(camera, index, message.completed_captures)
        series, camera.completed = camera.series, message.completed_captures
        if index is None or camera.deaf:
            return []
        self._see(series, index, (0, utc_us))
        latitude, longitude = _place(message.lat, message.lng)
        above_sea = None if latitude is None else _height(message.alt_msl)
        detail = ImageDetail(
            above_home_mm=None if above_sea is None else _height(message.alt_rel),
            above_sea_mm=above_sea, asked=0, attitude="vehicle", camera=component, file="", index=index,
            latitude=latitude, longitude=longitude, pitch_cd=_centidegrees(message.pitch), result=1,
            roll_cd=_centidegrees(message.roll), series=series.number, unit=message.cam_idx, utc_us=utc_us,
            yaw_cd=_centidegrees(message.yaw), **self._accurate(now_us),
        )  # fmt: skip
        return [ImageReported(now_us, component, index, encoded(detail))]

    def _told_index(self, camera: _Camera, index: int, completed: int) -> int | None:
        """The index of a new picture by CAMERA_FEEDBACK; None if it cannot be told. An index that is not above all
        before means a restart, or that triggers were faster than the shutter's feedback.
        """
        series = camera.series
        highest = series.seen.highest
        if highest is None or index > highest:
            return index
        if completed <= camera.completed:
            self._restart(camera, 1)
            return index
        return series.seen.last_missing(series.first or 0, index)

    def _count(self, camera: _Camera, index: int, utc_us: int | None) -> None:
        """Follow ArduPilot's count of triggers, which is ahead of the pictures. Without any picture since its start it
        reports no time.
        """
        series = camera.series
        if series.first is None:
            series.first, series.newest_us = index + 1, utc_us or 0
        elif utc_us is None and index < series.last:
            series = self._restart(camera, 1)
        series.last = max(series.last, index)

    def _is_new(self, camera: _Camera, index: int | None, made: _Time) -> bool:
        """Take in an image; return whether it is a new one, not one that was reported before."""
        series = camera.series
        if index is None:
            return _fails(series, made)
        newer = made[1] > series.newest_us > 0
        if index in series.seen:
            if _is_known(series, index, made, newer=newer):
                return False
            series = self._restart(camera, 0)
        elif newer and index < max(series.seen.highest or 0, series.first or 0):
            series = self._restart(camera, 0)
        elif series.first is not None and index < series.first:
            return False  # from before, requested by somebody else
        if camera.deaf:
            return False
        camera.boot_ms = max(camera.boot_ms, made[0])
        if camera.asked == index:
            camera.asked, camera.tries = None, 0
        self._see(series, index, made)
        return True

    @staticmethod
    def _see(series: _Series, index: int, made: _Time) -> None:
        series.first = index if series.first is None else series.first
        series.last = max(series.last, index)
        series.newest_us = max(series.newest_us, made[1])
        series.seen.add(index)
        series.ended.add(index)
        series.known[index] = made
        _bound(series.known)

    def _restart(self, camera: _Camera, first: int) -> _Series:
        """Begin a new series, whose index counts from `first`."""
        series = camera.series
        number = series.number + (1 if series.seen or series.failed else 0)
        camera.restarts += 1  # also those without an image in between, which begin no series
        camera.deaf = camera.restarts >= MOST_SERIES
        ends = "; its further reports are left out" if camera.deaf else ""
        self.notes.append(f"camera {camera.component} counts its images anew{ends}")
        camera.lost += sum(b - a + 1 for a, b in series.seen.gaps(series.first or 0, series.last))
        camera.failed += series.failed
        camera.series = _Series(min(number, MOST_SERIES - 1), first, first - 1, newest_us=series.newest_us)
        camera.asked, camera.tries, camera.boot_ms, camera.completed = None, 0, 0, 0
        return camera.series

    def _pays(self, now_us: int) -> bool:
        """Whether one more report is taken; a flood of them is left out."""
        if self._paid_us is None:
            self._paid_us = now_us
        earned = (now_us - self._paid_us) // EARNED_US
        self._left = min(BURST, self._left + earned)
        self._paid_us += earned * EARNED_US
        if self._left:
            self._left -= 1
            return True
        self._dropped += 1
        if self._dropped == 1:
            self.notes.append("more images are reported than a camera can take: some reports are left out")
        return False

    def _accurate(self, now_us: int) -> dict[str, int | None]:
        """The accuracy of the last GPS report, if it is recent."""
        at_us, horizontal, vertical = self._accuracy or (0, None, None)
        recent = self._accuracy is not None and now_us - at_us <= ACCURACY_US * self._slack
        return {"horizontal_mm": horizontal if recent else None, "vertical_mm": vertical if recent else None}

    # ------------------------------------------------------------------------------------------ asked

    def due(self, system: int, now_us: int, *, triggers: bool) -> Iterator[Message]:
        """Yield the requests to send now: for missing images, and for the number of images. `triggers`: the autopilot
        may have a camera of its own.
        """
        if triggers and self.expected and AUTOPILOT not in self._cameras:
            camera = self._camera(AUTOPILOT, now_us)
            if camera is not None:
                camera.baseline = True
        for camera in sorted(self._cameras.values(), key=lambda each: each.until_us):  # each in its turn
            if now_us >= camera.due_us:
                unsettled = camera.series.first is None
                camera.unanswered += unsettled
                camera.due_us = now_us + (FIRST_US if unsettled else EACH_US) * self._slack
                if camera.unanswered <= MOST_UNANSWERED:
                    yield self._question(system, camera)
            idle = camera.asked is None or now_us >= camera.until_us
            if camera.answers and idle and now_us >= self._next_us:
                yield from self._again(system, camera, now_us)

    def ask_all(self, system: int) -> Iterator[Message]:
        """Yield a request for the number of images to each camera."""
        for camera in self._cameras.values():
            yield self._question(system, camera)

    @staticmethod
    def _question(system: int, camera: _Camera) -> Message:
        if camera.component in CAMERAS:
            return messages.request_of(system, camera.component, STATUS)
        return messages.request(system, FEEDBACK)

    def _again(self, system: int, camera: _Camera, now_us: int) -> Iterator[Message]:
        """Yield the request for a missing image, if one is due."""
        series = camera.series
        if series.first is None:
            return
        if camera.asked is not None and (camera.tries >= TRIES or camera.asked in series.ended):
            series.ended.add(camera.asked)
            camera.asked, camera.tries = None, 0
        if camera.asked is None:
            gap = next(series.ended.gaps(series.first, series.last), None)
            if gap is None or series.requests >= MOST_REQUESTS:
                return
            camera.asked = gap[0]
        camera.tries += 1
        series.requests += 1
        camera.until_us, self._next_us = now_us + ANSWER_US * self._slack, now_us + REQUEST_US
        yield messages.request_of(system, camera.component, CAPTURED, camera.asked)

    def hurry(self, now_us: int) -> None:
        """Ask each camera every second how many images it has taken, and not only now and then."""
        for camera in self._cameras.values():
            camera.due_us = min(camera.due_us, now_us + FIRST_US * self._slack)

    # ------------------------------------------------------------------------------------------ missing

    def lacking(self, since_us: int) -> str:
        """What is missing of the images, in words; empty if each camera has told since a time how many it took, and all
        of these were reported, and none failed.
        """
        if not self._cameras:
            return "no camera was heard"
        if not any(camera.series.seen or camera.series.number for camera in self._cameras.values()):
            return "no image was reported"
        for camera in self._cameras.values():
            series, of = camera.series, f"of camera {camera.component}"
            missing = sum(b - a + 1 for a, b in series.seen.gaps(series.first or 0, series.last))
            missing += camera.lost
            failed = series.failed + camera.failed
            if camera.counted_us is None or camera.counted_us < since_us:
                return f"the number of images {of} is unknown"
            if missing or failed:
                return f"{missing} images {of} missing, {failed} failed"
        return ""

    def expected_images(self, now_us: int) -> list[Event]:
        """Return the expected indices of each camera, for the list of those that are missing."""
        found = [(each.component, each.series) for each in self._cameras.values()]
        return [
            ImagesExpected(now_us, component, series.number, series.first, series.last)
            for component, series in found
            if series.first is not None
        ]


def _fails(series: _Series, made: _Time) -> bool:
    """Count a picture that failed; return whether it was not reported before."""
    if made in series.failures:
        return False
    series.failures[made] = None
    series.failed += 1
    _bound(series.failures)
    return True


def _is_known(series: _Series, index: int, made: _Time, *, newer: bool) -> bool:
    """Whether an index that was seen before is of the same image, and not of one after a restart."""
    known = series.known.get(index)
    return known == made or (not newer and (made[1] > 0 or known is None))


def _bound(known: OrderedDict[Any, Any]) -> None:
    while len(known) > MOST_KNOWN:
        known.popitem(last=False)


def _accuracy(message: Message, name: str) -> int | None:
    """An accuracy in mm; None for 0, which is unknown."""
    return getattr(message, name, 0) or None


def _utc(us: int) -> int | None:
    return us if 0 < us < _MOST_UTC_US else None


def _place(latitude: int, longitude: int) -> tuple[int | None, int | None]:
    """A place; None for one that does not exist, and for 0 N 0 E, which means unknown."""
    inside = abs(latitude) <= _MOST_E7[0] and abs(longitude) <= _MOST_E7[1]
    return (latitude, longitude) if inside and (latitude, longitude) != (0, 0) else (None, None)


def _height(metres: float) -> int | None:
    """A height in mm; None for one that no vehicle has."""
    return quantise(float(metres), 1_000, 1) if isfinite(metres) and abs(metres) <= _MOST_METRES else None


def _file(url: str | bytes) -> str:
    """The last part of a file's address, if it is a plain name."""
    text = url.decode("latin-1") if isinstance(url, bytes) else url
    name = text.rsplit("/", 1)[-1]
    return name if _NAME.fullmatch(name) else ""


def _centidegrees(angle: float) -> int | None:
    return quantise(float(angle), 100, 1) if isfinite(angle) and abs(angle) <= 720 else None


def _angles(q: list[float]) -> tuple[int | None, int | None, int | None]:
    """Roll, pitch and yaw of a rotation in 1/100 degree; None if it is none. Straight up or down, roll is 0: it cannot
    be told from yaw.
    """
    w, x, y, z = q
    if not all(map(isfinite, q)) or abs(w * w + x * x + y * y + z * z - 1) > _UNIT:
        return None, None, None
    pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    if abs(abs(pitch) - pi / 2) < _UPRIGHT:
        roll, yaw = 0.0, 2 * atan2(z, w)
    else:
        roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        yaw = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return (
        round(degrees(roll) * 100),
        round(degrees(pitch) * 100),
        (round(degrees(yaw) * 100) + 18_000) % 36_000 - 18_000,
    )
