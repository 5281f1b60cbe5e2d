"""What the reading process reports: lines of JSON."""

import msgspec

# why a log cannot be read
NO_TRACK = "no-track"
NO_LIBRARY = "no-library"
UNREADABLE = "unreadable"


class ReadSoFar(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="progress"):
    """The number of octets that were read."""

    octets: int


class ReadFailed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="failed"):
    """Why a log cannot be read: one of the slugs above, and a text."""

    slug: str
    text: str


class ReadLog(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="log"):
    """The content of a log: its condition, the message of the track, the points (time since the boot in us, latitude
    and longitude in 1e-7 degree, mm above sea) and pairs of a time since the boot and its UTC in us.
    """

    condition: str
    source: str
    track: list[tuple[int, int, int, int]]
    utc: list[tuple[int, int]]


Report = ReadSoFar | ReadFailed | ReadLog
