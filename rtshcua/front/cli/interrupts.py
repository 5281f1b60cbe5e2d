"""Requests to stop (Ctrl-C, SIGTERM) for commands that check for them between two pieces of work."""

import signal
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import Self

from rtshcua.app.fly.stop_wishes import breakable as breakable


class Stopped(Exception):
    """A stop was requested; raised only by `StopRequest.look`."""


class StopRequest:
    """A context in which SIGINT and SIGTERM set a flag, which `look` checks; only in the main thread.

    Ignored signals stay ignored: a shell ignores SIGINT for background processes.
    """

    def __init__(self) -> None:
        self.asked = False
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if current_thread() is main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def look(self) -> None:
        """Raise Stopped if a signal was received."""
        if self.asked:
            raise Stopped

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
