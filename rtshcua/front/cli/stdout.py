"""Standard output of commands: all output passes these functions, which escape control characters.

Names of files, missions and policies, and texts of vehicles are untrusted, and a terminal would obey them.
"""

import os
import select
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from rtshcua.diagnostics.excerpt import escaped, hiding, visible
from rtshcua.front.cli.width import fitted

#: maximum number of waiting lines; the oldest are dropped
MOST_LINES: Final = 1_000
#: bytes that a writable pipe accepts at once (pipe(7), PIPE_BUF)
_ROOM: Final = 4_096


def out(*lines: str, flush: bool = False) -> None:
    """Print each text as a line, escaped and wrapped at the terminal's width."""
    for line in lines:
        for each in fitted(visible(line)):
            print(each)
    if flush:
        sys.stdout.flush()


def out_json(text: str, *, end: str = "\n", flush: bool = False) -> None:
    """Print JSON, with control and invisible characters written as JSON escapes."""
    print(escaped(text), end=end, flush=flush)


def out_rendered(text: str, *, end: str = "\n") -> None:
    """Print an already escaped text; it may contain our colours."""
    print(text, end=end)


def out_source(text: str) -> None:
    """Print a source unchanged, except for characters that hide or reorder text, which are escaped."""
    while (at := hiding(text)) is not None:
        text = f"{text[:at]}{visible(text[at])}{text[at + 1 :]}"
    print(text, end="")


def out_bytes(data: bytes) -> None:
    """Write a file to standard output, unchanged; its texts are escaped already, and a terminal gets no binary one."""
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.flush()


class NewestLines:
    """A non-blocking output that keeps the newest lines if the reader is slow."""

    def __init__(self, descriptor: int, left_out: Callable[[int], str]) -> None:
        self._note = left_out
        self._descriptor = descriptor
        self._encoding = sys.stdout.encoding or "utf-8"
        self._lines: deque[bytes] = deque()
        self._begun = b""
        self._left_out = 0

    def fileno(self) -> int:
        """The descriptor to wait for."""
        return self._descriptor

    @property
    def waiting(self) -> bool:
        """Whether data waits to be written."""
        return bool(self._begun or self._lines)

    def tell(self, line: str) -> None:
        """Add a line, which is already escaped (by `visible` or `escaped`)."""
        if len(self._lines) >= MOST_LINES:
            self._lines.popleft()
            self._left_out += 1
        self._lines.append(self._encoded(line))

    def _encoded(self, line: str) -> bytes:
        return line.encode(self._encoding, "backslashreplace") + b"\n"

    def write(self) -> None:
        """Write as much as the pipe accepts now. Raises OSError if the reader is gone."""
        while self.waiting and select.select([], [self], [], 0)[1]:
            if not self._begun:
                self._begun = self._lines.popleft()
                if self._left_out:
                    self._begun = self._encoded(self._note(self._left_out)) + self._begun
                    self._left_out = 0
            written = os.write(self._descriptor, self._begun[:_ROOM])
            self._begun = self._begun[written:]

    def drain(self, seconds: float) -> None:
        """Write the waiting data, for at most `seconds`."""
        until_s = time.monotonic() + seconds
        while self.waiting and (left_s := until_s - time.monotonic()) > 0:
            select.select([], [self], [], left_s)
            self.write()
