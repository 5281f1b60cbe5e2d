"""Ctrl-C and other requests to stop a flight, taken as wishes instead of obeyed at once: it falls back first."""

import signal
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum, auto
from threading import current_thread, main_thread
from types import FrameType, TracebackType
from typing import Self

#: Two more requests within this time, in seconds, mean it.
LEAVE_S = 3.0

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def breakable() -> Iterator[None]:
    """Within this, in the main thread, Ctrl-C raises KeyboardInterrupt, as Python has it: what is under way is put in
    order. Elsewhere it ends a command by the signal itself (`entry_point`).
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
    """What a request to stop asks for."""

    LAND = auto()  # the first: fall back, come down, close the log
    KNOW = auto()  # another: how it stands
    LEAVE = auto()  # one more soon after: do not wait for the landing


class Interrupts:
    """While entered, SIGINT, SIGTERM and SIGHUP are kept until `wish` asks for them."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()
        self._landing = False
        self._asked_s: float | None = None

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._note) for number in _SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def wish(self) -> Wish | None:
        """What the next request asks for, each once; None when there is none."""
        if not self._times:
            return None
        at_s = self._times.popleft()
        if not self._landing:
            self._landing = True
            return Wish.LAND
        if self._asked_s is not None and at_s - self._asked_s <= LEAVE_S:
            return Wish.LEAVE
        self._asked_s = at_s
        return Wish.KNOW

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._times.append(time.monotonic())
