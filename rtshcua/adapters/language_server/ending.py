"""The server ends with its editor, also one that dies without a word."""

import os
from threading import Timer
from typing import BinaryIO

GRACE = 5.0
"""Seconds from the end of the editor's stream until the process ends, whatever still runs in it."""


class Watched:
    """What comes from the editor. Where that ends, the process does too, by itself or by force: a check that cannot be
    interrupted, or a process that is just being started, holds up nobody's end.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def readline(self) -> bytes:
        """One line; a part of one, or nothing, at the end."""
        data = self._stream.readline()
        return self._seen(data, ended=not data.endswith(b"\n"))

    def read(self, size: int) -> bytes:
        """So many bytes; fewer at the end."""
        data = self._stream.read(size)
        return self._seen(data, ended=len(data) < size)

    def _seen(self, data: bytes, *, ended: bool) -> bytes:
        # Told by what is cut off, too: whoever cannot answer it, for nobody listens any more, reads no further.
        if ended:
            forced = Timer(GRACE, os._exit, (0,))
            forced.daemon = True
            forced.start()
        return data
