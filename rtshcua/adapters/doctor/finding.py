"""What the doctor has to say: one finding a question."""

from enum import StrEnum

import msgspec


class Verdict(StrEnum):
    """How a finding bears on a mission."""

    OK = "ok"
    WARN = "warn"  # it would fly, but somebody should know
    STOP = "stop"  # a mission would not fly, or not to its end
    UNKNOWN = "unknown"  # the vehicle did not say


class Finding(msgspec.Struct, frozen=True):
    """A stable slug, what was found, and where something is wrong what is needed and what to do about it."""

    slug: str
    verdict: Verdict
    found: str
    needed: str = ""
    advice: str = ""
