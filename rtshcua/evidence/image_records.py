"""The images of a flight as records: effects `image`, one for each image that a camera reported, and `images-missing`,
the gaps among their indices at that time (docs/log-format.md, section 4).

The detail of both is canonical JSON (RFC 8785) of integers, null and short texts. It states what the camera reported,
which nothing on board can verify: what an auditor can check is that no image is counted twice and that each list of
gaps agrees with the records before it.
"""

from bisect import bisect_right
from collections.abc import Iterator
from typing import Annotated, Final, Literal

import msgspec

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Count, Effect, Integer, Recover

#: the event of an effect whose detail is an `ImageDetail`
IMAGE: Final = "image"
#: the event of an effect whose detail is a `MissingDetail`
IMAGES_MISSING: Final = "images-missing"
#: the event of an effect of a command to payload that failed
PAYLOAD_FAILED: Final = "payload.failed"
#: how many gaps are listed
MOST_GAPS: Final = 32

_FileName = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9._-]{0,64}\Z")]


class ImageDetail(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One picture as the camera reported it; null where it reported nothing that makes sense.

    `camera` is the MAVLink component, `unit` its number of the camera, `series` counts the restarts of its index from
    0, `index` is null for a picture that failed (`result` 0). `above_sea_mm` is as reported, `above_home_mm` is that
    less the height of home above the sea by the autopilot. Angles are from north and the horizon in 1/100 degree, of
    the camera or, as `attitude` says, of the vehicle. `horizontal_mm` and `vertical_mm` are the accuracy of the last
    GPS report. `asked` says how often the report had to be requested. `utc_us` is by the camera's clock.
    """

    above_home_mm: Integer | None
    above_sea_mm: Integer | None
    asked: Count
    attitude: Literal["camera", "vehicle"]
    camera: Count
    file: _FileName
    horizontal_mm: Count | None
    index: Count | None
    latitude: Integer | None
    longitude: Integer | None
    pitch_cd: Integer | None
    result: Literal[0, 1]
    roll_cd: Integer | None
    series: Count
    unit: Count
    utc_us: Count | None
    vertical_mm: Count | None
    yaw_cd: Integer | None


class MissingDetail(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The images of one series of a camera so far: indices are expected from `first` to `last`; `lost` are the first
    gaps, each with its first and last index, `missing` the number of all missing ones. `taken` are recorded, `failed`
    were reported as failed.
    """

    camera: Count
    failed: Count
    first: Integer
    last: Integer
    lost: tuple[tuple[Integer, Integer], ...]
    missing: Count
    series: Count
    taken: Count


_encoder = msgspec.json.Encoder()
_image = msgspec.json.Decoder(ImageDetail)
_missing = msgspec.json.Decoder(MissingDetail)


def encoded(detail: ImageDetail | MissingDetail) -> str:
    """The text of a detail. Fields are defined in the order of their names."""
    return _encoder.encode(detail).decode()


def read_image(text: str) -> ImageDetail | None:
    """The detail of an `image`; None unless it is canonical."""
    try:
        found = _image.decode(text)
    except msgspec.MsgspecError:
        return None
    consistent = (found.index is None) == (found.result == 0)
    return found if consistent and encoded(found) == text else None


def read_missing(text: str) -> MissingDetail | None:
    """The detail of an `images-missing`; None unless it is canonical."""
    try:
        found = _missing.decode(text)
    except msgspec.MsgspecError:
        return None
    return found if encoded(found) == text else None


class IndexSet:
    """A set of integers in little memory: ranges, of which neighbours are joined."""

    def __init__(self) -> None:
        self._ranges: list[list[int]] = []  # [first, last], ascending and apart
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def __contains__(self, index: int) -> bool:
        at = self._before(index)
        return at >= 0 and index <= self._ranges[at][1]

    def add(self, index: int) -> bool:
        """Add an integer; return whether it is new."""
        if index in self:
            return False
        self._count += 1
        at, ranges = self._before(index), self._ranges
        after = at + 1
        joins_before = at >= 0 and ranges[at][1] == index - 1
        joins_after = after < len(ranges) and ranges[after][0] == index + 1
        if joins_before and joins_after:
            ranges[at][1] = ranges.pop(after)[1]
        elif joins_before:
            ranges[at][1] = index
        elif joins_after:
            ranges[after][0] = index
        else:
            ranges.insert(after, [index, index])
        return True

    @property
    def lowest(self) -> int | None:
        """The smallest one; None if it is empty."""
        return self._ranges[0][0] if self._ranges else None

    @property
    def highest(self) -> int | None:
        """The largest one; None if it is empty."""
        return self._ranges[-1][1] if self._ranges else None

    def gaps(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        """Yield the ranges from `first` to `last` that are not in it."""
        at = first
        for low, high in self._ranges:
            if low > last:
                break
            if low > at:
                yield at, low - 1
            at = max(at, high + 1)
        if at <= last:
            yield at, last

    def last_missing(self, first: int, last: int) -> int | None:
        """The largest integer from `first` to `last` that is not in it; None if all are."""
        at = self._before(last)
        if at >= 0 and last <= self._ranges[at][1]:
            last = self._ranges[at][0] - 1  # neighbours are joined
        return last if last >= first else None

    def _before(self, index: int) -> int:
        """The place of the last range that begins at or before an integer; -1 for none."""
        return bisect_right(self._ranges, index, key=lambda each: each[0]) - 1


def missing_of(camera: int, series: int, seen: IndexSet, first: int, last: int, failed: int) -> MissingDetail:
    """The list of gaps among the images `seen` of a series."""
    gaps = list(seen.gaps(first, last))
    number = sum(high - low + 1 for low, high in gaps)
    return MissingDetail(camera, failed, first, last, tuple(gaps[:MOST_GAPS]), number, series, len(seen))


class _RecordedSeries:
    def __init__(self) -> None:
        self.seen = IndexSet()
        self.failed = 0


class ImageLedger:
    """Checks the records about images of one log, in order."""

    def __init__(self) -> None:
        self._series: dict[tuple[int, int], _RecordedSeries] = {}
        self._latest: dict[int, int] = {}
        self._told: dict[tuple[int, int], MissingDetail] = {}
        #: the number of recorded images, and of pictures that failed
        self.taken = self.failed = 0

    def check(self, record: Effect | Recover) -> Flaw | None:
        """Return a flaw in an effect about images, None for any other record. After a crash another run continues the
        log, and counts anew.
        """
        if isinstance(record, Recover):
            self._series.clear()
            self._latest.clear()
            self._told.clear()
            return None
        if record.event == IMAGE:
            return self.add(record.detail)
        return self._gaps(record.detail) if record.event == IMAGES_MISSING else None

    def missing(self, camera: int, series: int, first: int, last: int) -> MissingDetail:
        """The list of gaps among the recorded images, if indices are expected from `first` to `last`."""
        recorded = self._series.get((camera, series)) or _RecordedSeries()
        seen = recorded.seen
        first = first if seen.lowest is None else min(first, seen.lowest)
        last = last if seen.highest is None else max(last, seen.highest)
        return missing_of(camera, series, seen, first, last, recorded.failed)

    def add(self, text: str) -> Flaw | None:
        """Add the detail of an `image`, unless there is a flaw in it."""
        image = read_image(text)
        if image is None:
            return Flaw("image/malformed", "the record of an image is malformed", text)
        latest = self._latest.get(image.camera, -1)
        if not latest <= image.series <= latest + 1 or image.series < 0:
            expected = f"{max(latest, 0)} or {latest + 1}"
            return Flaw("image/series", "the index of a camera restarted out of turn", str(image.series), expected)
        self._latest[image.camera] = image.series
        series = self._series.setdefault((image.camera, image.series), _RecordedSeries())
        if image.index is None:
            series.failed += 1
            self.failed += 1
        elif not series.seen.add(image.index):
            return Flaw("image/twice", "an image was recorded twice", str(image.index))
        else:
            self.taken += 1
        return None

    def _gaps(self, text: str) -> Flaw | None:
        told = read_missing(text)
        if told is None:
            return Flaw("image/malformed", "the list of missing images is malformed", text)
        series = self._series.get((told.camera, told.series)) or _RecordedSeries()
        seen = series.seen
        beyond = len(seen) and not (told.first <= (seen.lowest or 0) and (seen.highest or 0) <= told.last)
        expected = encoded(missing_of(told.camera, told.series, seen, told.first, told.last, series.failed))
        if beyond or expected != text:
            return Flaw("image/missing", "the list of missing images contradicts the recorded images", text, expected)
        self._told[told.camera, told.series] = told
        return None

    def incomplete(self) -> Flaw | None:
        """Return the flaw in the success of a step that requires all images, unless the last lists are up to date, and
        list no image that is missing or has failed.
        """
        told = self._told
        listed = bool(told) and all(
            key in told and (told[key].taken, told[key].failed) == (len(series.seen), series.failed)
            for key, series in self._series.items()
        )
        if listed and not any(each.missing or each.failed for each in told.values()):
            return None
        text = "; ".join(encoded(each) for each in told.values()) or "no list of images"
        return Flaw("image/incomplete", "a step that requires all images succeeded without them", text)
