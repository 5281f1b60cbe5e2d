"""Standard streams that were closed before we began (`>&-`): what is written to them fails, as on a closed pipe."""

import io
import os
import sys
from typing import IO, cast


class _Closed(io.BufferedIOBase):
    """Takes nothing: whoever wanted to read is not there."""

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return 1  # where nothing can be written

    def write(self, data: object) -> int:
        raise BrokenPipeError


def mend_streams() -> None:
    """Occupy the standard descriptors that are closed, and let output that has nowhere to go fail rather than vanish.

    Else the next file that is opened, an evidence log perhaps, would be what this process or a library of it takes for
    its standard output. A child is given none of them.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)  # the lowest that is free, which is this one
    if sys.stdout is None:
        sys.stdout = cast("IO[str]", io.TextIOWrapper(_Closed(), encoding="utf-8", write_through=True))
