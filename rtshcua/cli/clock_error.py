"""How far UTC may be off, as an operator writes it on a command line."""

import re
from decimal import ROUND_CEILING, Decimal

import typer

_TIME = re.compile(r"(?P<number>[0-9]{1,9}(?:\.[0-9]{1,6})?) ?(?P<unit>ms|s|min)", re.ASCII)
_US = {"ms": 1_000, "s": 1_000_000, "min": 60_000_000}


def utc_error_text(text: str | None) -> str | None:
    """The option's value, checked."""
    if text is not None and not _TIME.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is no time, such as 500ms or 2s")
    return text


def duration_us(text: str | None) -> int | None:
    """`500ms`, `1.5s` or `2min` in us, rounded up; None for no text. It was checked before."""
    found = None if text is None else _TIME.fullmatch(text)
    if found is None:
        return None
    return int((Decimal(found["number"]) * _US[found["unit"]]).to_integral_value(ROUND_CEILING))
