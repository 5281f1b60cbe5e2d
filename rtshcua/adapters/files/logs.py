"""Reading a log without trusting it: whatever the file holds, no more than one line of bounded length is in memory."""

from collections.abc import Iterator
from typing import BinaryIO

from rtshcua.evidence.reading import LONGEST


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a log, newline included; one that is too long comes in pieces, the first longer than `LONGEST`."""
    return iter(lambda: file.readline(LONGEST + 1), b"")
