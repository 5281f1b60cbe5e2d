"""A second check of the records about images, written from section 4 of docs/log-format.md alone, with plain sets."""

import json
import re

_WHOLE = (
    "above_home_mm", "above_sea_mm", "horizontal_mm", "index", "latitude", "longitude", "pitch_cd", "roll_cd",
    "utc_us", "vertical_mm", "yaw_cd",
)  # fmt: skip
_COUNTS = ("asked", "camera", "series", "unit")
_IMAGE = {*_WHOLE, *_COUNTS, "attitude", "file", "result"}
_LIST = {"camera", "failed", "first", "last", "lost", "missing", "series", "taken"}
_LARGEST = 2**53 - 1
_NOT_NEGATIVE = {"horizontal_mm", "vertical_mm", "index", "utc_us", *_COUNTS}


class Contradicted(Exception):
    """The records about images contradict each other or section 4."""


def _is_whole(value: object, least: int = -_LARGEST) -> bool:
    return type(value) is int and least <= value <= _LARGEST


def _canonical(text: str, keys: set[str]) -> dict:
    try:
        found = json.loads(text)
    except ValueError:
        raise Contradicted("not JSON") from None
    if type(found) is not dict or set(found) != keys:
        raise Contradicted("other fields")
    if json.dumps(found, separators=(",", ":"), sort_keys=True) != text:
        raise Contradicted("not canonical")
    return found


class Images:
    """Reads the records of one log in order."""

    def __init__(self) -> None:
        self.taken: dict[tuple[int, int], set[int]] = {}
        self.failed: dict[tuple[int, int], int] = {}

    def line(self, record: dict) -> None:
        """Read the next record. Raises `Contradicted`."""
        if record["type"] == "recover":
            self.__init__()
        if record["type"] == "effect" and record["event"] == "image":
            self._image(_canonical(record["detail"], _IMAGE))
        if record["type"] == "effect" and record["event"] == "images-missing":
            self._missing(_canonical(record["detail"], _LIST))

    def _image(self, image: dict) -> None:
        for name in _WHOLE:
            if image[name] is not None and not _is_whole(image[name], 0 if name in _NOT_NEGATIVE else -_LARGEST):
                raise Contradicted(name)
        if not all(_is_whole(image[name], 0) for name in _COUNTS):
            raise Contradicted("a count")
        if image["attitude"] not in ("camera", "vehicle") or type(image["attitude"]) is not str:
            raise Contradicted("attitude")
        if type(image["file"]) is not str or re.fullmatch(r"[A-Za-z0-9._-]{0,64}", image["file"]) is None:
            raise Contradicted("file")
        if type(image["result"]) is not int or image["result"] != (0 if image["index"] is None else 1):
            raise Contradicted("result")
        camera, series = image["camera"], image["series"]
        known = [number for one, number in (*self.taken, *self.failed) if one == camera]
        if series not in ({0} if not known else {max(known), max(known) + 1}):
            raise Contradicted("series")
        key = camera, series
        if image["index"] is None:
            self.failed[key] = self.failed.get(key, 0) + 1
        elif image["index"] in self.taken.setdefault(key, set()):
            raise Contradicted("twice")
        else:
            self.taken[key].add(image["index"])

    def _missing(self, told: dict) -> None:
        if not all(_is_whole(told[name], 0) for name in ("camera", "failed", "missing", "series", "taken")):
            raise Contradicted("a count")
        if not _is_whole(told["first"]) or not _is_whole(told["last"]):
            raise Contradicted("an index")
        key, first, last = (told["camera"], told["series"]), told["first"], told["last"]
        taken = self.taken.get(key, set())
        if told["taken"] != len(taken) or told["failed"] != self.failed.get(key, 0):
            raise Contradicted("taken, failed")
        if taken and (min(taken) < first or max(taken) > last):
            raise Contradicted("beyond")
        gaps, at = [], first
        for index in [*sorted(taken), last + 1]:
            if index > at:
                gaps.append([at, index - 1])
            at = max(at, index + 1)
        if told["lost"] != gaps[:32] or told["missing"] != sum(high - low + 1 for low, high in gaps):
            raise Contradicted("lost, missing")
