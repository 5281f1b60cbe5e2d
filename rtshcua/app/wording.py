"""Parse times, and format times and counts for people."""

from datetime import UTC, datetime

from rtshcua.model.flat.situation import UTC_UNKNOWN_US
from rtshcua.model.quantity import Dimension, display


def moment(text: str) -> int | None:
    """Parse an ISO 8601 time with an offset to UTC in us since the epoch; None if it is malformed."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        return None
    if found.tzinfo is None:
        return None
    since = found.astimezone(UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds


_LAST_US = 253_402_300_799_999_999  # the end of the year 9999


def utc(us: int) -> str:
    """Format a UTC time in us since the Unix epoch, to the second."""
    if not 0 <= us <= _LAST_US:
        return f"{us} us"
    return datetime.fromtimestamp(us // 1_000_000, UTC).strftime("%Y-%m-%d %H:%M:%SZ")


def true_to(error_us: int) -> str:
    """The bound on the error of a UTC time, as text."""
    if error_us >= UTC_UNKNOWN_US:
        return "with an unknown error"
    return f"true to {display(error_us, Dimension.DURATION)}"


def many(count: int, what: str) -> str:
    """Format a count with its noun."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def shorten(text: str, width: int) -> str:
    """Cut a text to `width` characters, with an ellipsis if it was longer."""
    return text if len(text) <= width else text[: width - 1] + "…"


def seconds(us: int) -> str:
    """A time in seconds, to a tenth."""
    return f"{us / 1_000_000:.1f} s"
