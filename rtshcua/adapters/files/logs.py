"""Reading a log without trusting it: whatever the file holds, no more than one line of bounded length is in memory."""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from rtshcua.adapters.store.reading import read_regular
from rtshcua.evidence.reading import LONGEST

#: what the first line of every log begins with
START: Final = b'{"_prev":"'


def begins_as_log(path: Path, root: Path | None = None) -> bool:
    """Whether a file begins as every log does. Raises OSError, also as `open_regular`."""
    return read_regular(path, len(START), root).startswith(START)


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of a log, newline included; one that is too long comes in pieces, the first longer than `LONGEST`."""
    return iter(lambda: file.readline(LONGEST + 1), b"")
