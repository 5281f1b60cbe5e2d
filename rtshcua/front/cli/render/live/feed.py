"""The flying process's end of the view: starts it, and writes to it without ever waiting."""

import os
import subprocess
import sys
from collections import deque
from contextlib import suppress
from types import TracebackType
from typing import Self

import msgspec

from rtshcua.app.fly.story import Message

_MODULE = "rtshcua.front.cli.render.live"
_MOST = 10_000  # messages kept for a view that does not keep up

_encode = msgspec.json.Encoder().encode


class Feed:
    """A view of one `style` (`screen`, `lines` or `json`), in a session of its own: Ctrl-C is not for it.

    What is posted is written at once as far as the pipe takes it; the rest waits here, but for snapshots.
    A view that died, or whose reader went away, is written to no more.
    """

    def __init__(self, style: str) -> None:
        self._waiting: deque[bytes] = deque()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _MODULE, style], stdin=subprocess.PIPE, start_new_session=True
        )
        assert self._process.stdin is not None
        self._handle = self._process.stdin.fileno()
        os.set_blocking(self._handle, False)
        self._broken = False
        self.shown = False

    def post(self, message: Message, *, keep: bool = True) -> None:
        """Tell the view something; unless `keep`, only if it can be told now."""
        if self._broken:
            return
        self.flush()
        if self._waiting and (not keep or len(self._waiting) >= _MOST):
            return
        self._waiting.append(_encode(message) + b"\n")
        self.flush()

    def flush(self) -> None:
        """Write what waits, as far as the pipe takes it now."""
        while self._waiting and not self._broken:
            line = self._waiting[0]
            try:
                written = os.write(self._handle, line)
            except BlockingIOError:
                return
            except OSError:
                self._broken = True
                return
            if written == len(line):
                self._waiting.popleft()
            else:
                self._waiting[0] = line[written:]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the rest, now waiting for it, and let the view end; `shown` is then whether all of it was shown."""
        process = self._process
        try:
            with suppress(OSError):
                os.set_blocking(self._handle, True)
                self.flush()
            process.communicate()
            self.shown = process.returncode == 0 and not self._broken
        except KeyboardInterrupt:
            process.kill()
            process.wait()
