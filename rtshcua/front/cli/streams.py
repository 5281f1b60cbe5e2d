"""Handle closed standard streams (`>&-`): writing to them fails, as on a closed pipe."""

import io
import os
import sys
from typing import IO, cast


class _Closed(io.BufferedIOBase):
    """An output without a reader."""

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return 1  # opened read-only by `mend_streams`

    def write(self, data: object) -> int:
        raise BrokenPipeError


def mend_streams() -> None:
    """Occupy closed standard descriptors, and make writing to a closed standard output fail.

    Otherwise the next opened file, such as an evidence log, would get the descriptor of standard output. Children do
    not inherit these descriptors.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)  # gets the lowest free number, which is this one
    if sys.stdout is None:
        sys.stdout = cast("IO[str]", io.TextIOWrapper(_Closed(), encoding="utf-8", write_through=True))
