"""Reading a log without trusting it: whatever the file holds, no more than one line of bounded length is in memory."""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.reading import LONGEST

#: what the first line of every log begins with
START: Final = b'{"_prev":"'


def begins_as_log(path: Path) -> bool:
    """Whether a file begins as every log does. Raises OSError, also where it is no regular one."""
    with open_regular(path) as file:
        return file.read(len(START)) == START


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a log, newline included; one that is too long comes in pieces, the first longer than `LONGEST`."""
    return iter(lambda: file.readline(LONGEST + 1), b"")
