"""Require more than one frame for evidence that would end a flight of ours.

On a link without a key anybody can insert a frame, and a component with the vehicle's ids does so unintentionally. So a
report that would end a command (another mode, a landing, a failsafe, another target, stopped motors) counts when the
next report of its kind confirms it. Until then no frame that moves the vehicle leaves, and the vehicle is asked: that
takes one round trip. If the next report contradicts it, two senders use the vehicle's ids; that is noted, and the
vehicle's behaviour is watched further. While reports keep contradicting each other, it is unknown who controls the
vehicle: no frame that moves it leaves, and a command that then fails, or waits for 5 s, ends as taken over.

A frame of ours in transit may undo a pilot's choice, which then shows only for a moment: near such a frame a single
report counts (docs/adr/0034).
"""

from collections import deque
from typing import Final

#: us: how long after a frame of ours left, plus the round trip, the state that it undid may show
CROSSED_US: Final = 300_000
#: us: this many contradictions within this time come from two senders
WITHIN_US: Final = 4_000_000
OFTEN: Final = 3
#: us of link time: while two senders contradict each other, an observation counts if none contradicted it for this long
UNBROKEN_US: Final = 2_500_000


class Contradictions:
    """Detects values that repeatedly return to an earlier value: two senders report. Times in us."""

    def __init__(self) -> None:
        self._last: object = None
        self._before: object = None
        self._returns: deque[int] = deque(maxlen=OFTEN)

    def report(self, value: object, now_us: int) -> None:
        """Take in one report."""
        if value == self._last:
            return
        if value == self._before:
            self._returns.append(now_us)
        self._before, self._last = self._last, value

    def stand(self, now_us: int) -> bool:
        """Whether two senders report now."""
        return len(self._returns) == OFTEN and now_us - self._returns[0] <= WITHIN_US


class Suspicion:
    """An observation in one report that is not confirmed yet. Times in us of link time."""

    def __init__(self) -> None:
        self._kind: str | None = None
        self._how = ""
        self._reports = 0
        self._since_us = 0
        #: an observation that was contradicted, to be reported
        self.refuted: str | None = None

    @property
    def stands(self) -> bool:
        """Whether an observation waits for confirmation."""
        return self._kind is not None

    @property
    def how(self) -> str:
        """The last observation that may be a takeover, confirmed or not."""
        return self._how

    @property
    def kind(self) -> str | None:
        """The kind of the unconfirmed observation."""
        return self._kind

    def judge(self, found: tuple[str, str, int] | None, up_us: int, *, disputed: bool, at_once: bool) -> str | None:
        """The confirmed part of an observation: its kind, its name, and the number of reports of its kind. `disputed`:
        two senders use the vehicle's ids. `at_once`: a single report counts.
        """
        if found is None:
            if self._kind is not None:
                self.refuted, self._kind = self._how, None
            return None
        kind, how, reports = found
        if at_once and not disputed:
            self._kind = None
            return how
        if kind != self._kind:
            self._kind, self._how, self._reports, self._since_us = kind, how, reports, up_us
            return None
        if reports == self._reports or (disputed and up_us - self._since_us < UNBROKEN_US):
            return None
        self._kind = None
        return how
