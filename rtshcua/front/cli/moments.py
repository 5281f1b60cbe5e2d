"""Times on a command line."""

from datetime import UTC, datetime


def moment(text: str) -> int | None:
    """UTC in us since the epoch, of an ISO 8601 text with an offset; None for a text that is no such time."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        return None
    if found.tzinfo is None:
        return None
    since = found.astimezone(UTC) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds
