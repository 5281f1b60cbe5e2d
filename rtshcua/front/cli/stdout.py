"""The standard output of commands: whatever they print there passes one of these, and is harmless when it leaves.

Names of files, of missions and of policies, texts of vehicles: others wrote them, and a terminal would obey them.
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

#: lines that wait for whoever reads them; of more the oldest are left out
MOST_LINES: Final = 1_000
#: what a pipe that can be written to takes at once (pipe(7), PIPE_BUF)
_ROOM: Final = 4_096


def out(*lines: str, flush: bool = False) -> None:
    """Prints each as one line, whatever is in it, or as several where it is longer than a terminal is wide."""
    for line in lines:
        for each in fitted(visible(line)):
            print(each)
    if flush:
        sys.stdout.flush()


def out_json(text: str, *, end: str = "\n", flush: bool = False) -> None:
    """Prints JSON: it says what it said, and what a terminal would obey, or nobody sees, is written as an escape."""
    print(escaped(text), end=end, flush=flush)


def out_rendered(text: str, *, end: str = "\n") -> None:
    """Prints what is harmless already (made by `visible`, or of our own), and may be coloured by us."""
    print(text, end=end)


def out_source(text: str) -> None:
    """Prints a source as it stands, but for what no source may hold, for it hides or reorders what a person reads."""
    while (at := hiding(text)) is not None:
        text = f"{text[:at]}{visible(text[at])}{text[at + 1 :]}"
    print(text, end="")


class NewestLines:
    """An output that is never waited for: of what it does not take the newest lines are kept."""

    def __init__(self, descriptor: int, left_out: Callable[[int], str]) -> None:
        self._note = left_out
        self._descriptor = descriptor
        self._encoding = sys.stdout.encoding or "utf-8"
        self._lines: deque[bytes] = deque()
        self._begun = b""
        self._left_out = 0

    def fileno(self) -> int:
        """What to wait for."""
        return self._descriptor

    @property
    def waiting(self) -> bool:
        """Whether something waits to be written."""
        return bool(self._begun or self._lines)

    def tell(self, line: str) -> None:
        """A line more; it is harmless already (made by `visible` or `escaped`)."""
        if len(self._lines) >= MOST_LINES:
            self._lines.popleft()
            self._left_out += 1
        self._lines.append(self._encoded(line))

    def _encoded(self, line: str) -> bytes:
        return line.encode(self._encoding, "backslashreplace") + b"\n"

    def write(self) -> None:
        """Write what is taken now. Raises OSError where nobody reads any more."""
        while self.waiting and select.select([], [self], [], 0)[1]:
            if not self._begun:
                self._begun = self._lines.popleft()
                if self._left_out:
                    self._begun = self._encoded(self._note(self._left_out)) + self._begun
                    self._left_out = 0
            written = os.write(self._descriptor, self._begun[:_ROOM])
            self._begun = self._begun[written:]

    def drain(self, seconds: float) -> None:
        """Write what waits, for so long at most."""
        until_s = time.monotonic() + seconds
        while self.waiting and (left_s := until_s - time.monotonic()) > 0:
            select.select([], [self], [], left_s)
            self.write()
