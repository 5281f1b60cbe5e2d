"""Ctrl-C and other requests to stop a command that looks for them between two pieces of work."""

import signal
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import Self

from rtshcua.app.fly.stop_wishes import breakable as breakable


class Stopped(Exception):
    """Somebody asked for the end; raised by `StopRequest.look` alone, never amid other work."""


class StopRequest:
    """While entered, in the main thread, SIGINT and SIGTERM set a flag, which `look` reads between two pieces of work.

    A signal that is ignored stays so: a shell ignores SIGINT for what it starts in the background.
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
        """Raises Stopped once a signal came."""
        if self.asked:
            raise Stopped

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
