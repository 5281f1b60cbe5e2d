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
        """One line; nothing at the end."""
        return self._seen(self._stream.readline())

    def read(self, size: int) -> bytes:
        """So many bytes; fewer at the end."""
        return self._seen(self._stream.read(size))

    def _seen(self, data: bytes) -> bytes:
        if not data:
            forced = Timer(GRACE, os._exit, (0,))
            forced.daemon = True
            forced.start()
        return data
