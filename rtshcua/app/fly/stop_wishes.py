"""Ctrl-C and other requests to stop a flight. They do not end the program: the vehicle falls back and lands first."""

import signal
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum, auto
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import Self

#: two more requests within this time, in seconds, end the watch at once
LEAVE_S = 3.0

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def breakable() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in the main thread, so that open resources are closed. Outside of this context
    the signal ends the command (`entry_point`).
    """
    if current_thread() is not main_thread() or signal.getsignal(signal.SIGINT) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


class Wish(Enum):
    """The meaning of a request to stop."""

    LAND = auto()  # the first: fall back, come down, close the log
    KNOW = auto()  # another: show the state
    LEAVE = auto()  # one more soon after: do not wait for the landing


class Interrupts:
    """Collects SIGINT, SIGTERM and SIGHUP as requests for `wish`, while entered."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()
        self._landing = False
        self._requested_s: float | None = None

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._note) for number in _SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def wish(self) -> Wish | None:
        """The next request; None if there is none."""
        if not self._times:
            return None
        at_s = self._times.popleft()
        if not self._landing:
            self._landing = True
            return Wish.LAND
        if self._requested_s is not None and at_s - self._requested_s <= LEAVE_S:
            return Wish.LEAVE
        self._requested_s = at_s
        return Wish.KNOW

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._times.append(time.monotonic())
