"""The images of a flight, as its log records them, and the names of their files."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.image_records import (
    IMAGE,
    IMAGES_MISSING,
    PAYLOAD_FAILED,
    ImageDetail,
    MissingDetail,
    read_image,
    read_missing,
)
from rtshcua.evidence.records import Effect
from rtshcua.ground.flight.flown import Flight

#: us: how far the time of a file may be from that of its image: EXIF counts whole seconds, or fractions too
WHOLE_US: Final = 1_000_000
FRACTION_US: Final = 300_000
_NUMBERS: Final = re.compile(r"(\d+)")
_PLAIN: Final = re.compile(r"(?!#)[^\s\x00-\x1f\x7f\ud800-\udfff]+")


class FlightImage(NamedTuple):
    """An image in a record: its number, its time since the first record, and what the camera reported."""

    seq: int
    t_us: int
    detail: ImageDetail

    @property
    def is_placed(self) -> bool:
        """Whether its place and its height above the sea are known."""
        detail = self.detail
        return None not in (detail.latitude, detail.longitude, detail.above_sea_mm)


class FlightImages(NamedTuple):
    """The images of a flight: those that were taken, in the order of camera, series and index; pictures that failed;
    the last list of missing ones for each camera and series; and how many commands to payload failed.
    """

    taken: tuple[FlightImage, ...]
    failed: tuple[FlightImage, ...]
    missing: tuple[MissingDetail, ...]
    commands_failed: int

    @property
    def lost(self) -> int:
        """How many images are missing."""
        return sum(each.missing for each in self.missing)


class NamedImage(NamedTuple):
    """An image with the name of its file."""

    name: str
    image: FlightImage


def images_of(flight: Flight) -> FlightImages:
    """The images in the records of a flight; records that make no sense are left out."""
    taken, failed = list[FlightImage](), list[FlightImage]()
    missing: dict[tuple[int, int], MissingDetail] = {}
    commands_failed = 0
    for record in flight.records:
        if not isinstance(record, Effect):
            continue
        if record.event == IMAGE and (detail := read_image(record.detail)) is not None:
            found = FlightImage(record.seq, flight.since_begun(record), detail)
            (failed if detail.index is None else taken).append(found)
        elif record.event == IMAGES_MISSING and (told := read_missing(record.detail)) is not None:
            missing[told.camera, told.series] = told
        elif record.event == PAYLOAD_FAILED:
            commands_failed += 1
    return FlightImages(tuple(sorted(taken, key=_order)), tuple(failed), tuple(missing.values()), commands_failed)


def _order(image: FlightImage) -> tuple[int, int, int]:
    return image.detail.camera, image.detail.series, image.detail.index or 0


def natural(name: str) -> tuple[object, ...]:
    """A key that sorts `IMG_9` before `IMG_10`."""
    return tuple((1, int(part), "") if part.isdecimal() else (0, 0, part) for part in _NUMBERS.split(name))


def named(
    images: Sequence[FlightImage], files: Sequence[str] | None, times_us: Mapping[str, int]
) -> tuple[tuple[NamedImage, ...], str] | Refusal:
    """Each image with its file, and how they were matched, in words. `files` are the names in the folder, None without
    one; `times_us` are their times where known, by a clock that may be any other.

    A file belongs to the image that has its name in the record; where names are not recorded, to the one at the same
    place in the order, if there are as many; else to that of the same time, if only one offset between the clocks fits.
    """
    told = [each.detail.file for each in images]
    unique = all(told) and len(set(told)) == len(told)
    if unique and (files is None or not set(told).isdisjoint(files)):
        kept = [each for each in images if files is None or each.detail.file in files]
        return _checked([(each.detail.file, each) for each in kept], "by their recorded names")
    if files is None:
        return _UNNAMED
    if len({each.detail.camera for each in images}) > 1:
        text = "the log has images of several cameras, without their file names"
        return Refusal("no-match", text, _ADD, ExitCode.INPUT)
    present = sorted(files, key=natural)
    if len(present) == len(images):
        return _checked(list(zip(present, images, strict=True)), "by their order")
    matched = _by_time(images, present, times_us)
    if matched is not None:
        return _checked(matched, "by their times")
    count = f"the folder has {_many(present)} and the log {_many(images)}"
    return Refusal("no-match", f"{count}, and neither names nor times tell which belong together", _ADD, ExitCode.INPUT)


def _many(images: Sequence[object]) -> str:
    return f"{len(images)} image{'' if len(images) == 1 else 's'}"


_UNNAMED: Final = Refusal(
    "no-file-names",
    "the log does not name the files of its images",
    "name their folder with `--images`",
    ExitCode.INPUT,
)
_ADD: Final = "copy all images of the flight into the folder, and no others"


def _checked(pairs: Sequence[tuple[str, FlightImage]], how: str) -> tuple[tuple[NamedImage, ...], str] | Refusal:
    odd = next((name for name, _ in pairs if not _PLAIN.fullmatch(name)), None)
    if odd is not None:
        text = f"`{odd}` has a space, begins with `#`, or is not UTF-8: readers would misread it"
        return Refusal("odd-name", text, "rename it", ExitCode.INPUT)
    return tuple(NamedImage(name, image) for name, image in pairs), how


def _by_time(
    images: Sequence[FlightImage], present: Sequence[str], times_us: Mapping[str, int]
) -> list[tuple[str, FlightImage]] | None:  # fmt: skip
    """Match by time, with one unknown offset between the clocks; None if none fits, or several do."""
    dated = sorted((each for each in images if each.detail.utc_us), key=lambda each: each.detail.utc_us or 0)
    if not dated or not present or not set(present) <= set(times_us):
        return None
    files = sorted(present, key=lambda name: (times_us[name], natural(name)))
    within_us = FRACTION_US if any(times_us[name] % WHOLE_US for name in files) else WHOLE_US
    best = dict[int, list[tuple[str, FlightImage]]]()
    for image in dated:
        offset = times_us[files[0]] - (image.detail.utc_us or 0)
        best[offset] = list(_pairs(dated, files, times_us, offset, within_us))
    most = max(map(len, best.values()))
    fitting = [offset for offset, pairs in best.items() if len(pairs) == most]
    return best[fitting[0]] if len(fitting) == 1 and most == len(files) else None


def _pairs(
    dated: Sequence[FlightImage], files: Sequence[str], times_us: Mapping[str, int], offset: int, within_us: int
) -> Iterator[tuple[str, FlightImage]]:
    at = 0
    for name in files:
        while at < len(dated) and (dated[at].detail.utc_us or 0) + offset < times_us[name] - within_us:
            at += 1
        if at < len(dated) and abs((dated[at].detail.utc_us or 0) + offset - times_us[name]) <= within_us:
            yield name, dated[at]
            at += 1
