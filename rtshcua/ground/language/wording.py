"""How found text is shown in a message."""

SHOWN = 40  # characters


def short(text: str) -> str:
    """`text` on one line, printable, and cut where it is long."""
    text = text[: SHOWN + 1]
    plain = text if text.isprintable() else text.encode("unicode_escape").decode()
    return plain if len(plain) <= SHOWN else plain[: SHOWN - 3] + "..."
