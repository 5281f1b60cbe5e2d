"""Whether what would end a flight of ours is shown by more than one frame.

On a link without a key anybody can put in a frame, and a component with the vehicle's ids does so without meaning to.
So a report that would end what we do (another mode, a landing, a failsafe, another target, motors that stop) counts
when the next report of its kind shows the same. Until then no frame that moves the vehicle leaves, and the vehicle is
asked: that is one round trip. Where the next report says otherwise, two speak as the vehicle; that is noted, and what
the vehicle does goes on being watched. While reports go back and forth, nobody knows whose the vehicle is: no frame
that moves it leaves, and what then fails, or waits for 5 s, ends as taken over.

A frame of ours that is on its way may undo what a pilot chose, which then shows for a moment: near such a frame a
single report counts (docs/adr/0034).
"""

from collections import deque
from typing import Final

#: us: how long after a frame of ours left, besides the round trip, what it undid may show
CROSSED_US: Final = 300_000
#: us: reports that contradict each other so often within this time are of two
WITHIN_US: Final = 4_000_000
OFTEN: Final = 3
#: us of link time: while two speak, what one of them shows counts if the other showed nothing else for so long
UNBROKEN_US: Final = 2_500_000


class Contradictions:
    """Values of a report that go back to what they were before, again and again: two report. Times in us."""

    def __init__(self) -> None:
        self._last: object = None
        self._before: object = None
        self._returns: deque[int] = deque(maxlen=OFTEN)

    def report(self, value: object, now_us: int) -> None:
        """One report."""
        if value == self._last:
            return
        if value == self._before:
            self._returns.append(now_us)
        self._before, self._last = self._last, value

    def stand(self, now_us: int) -> bool:
        """Whether two report now."""
        return len(self._returns) == OFTEN and now_us - self._returns[0] <= WITHIN_US


class Suspicion:
    """What was reported once, and not confirmed yet. Times in us of link time."""

    def __init__(self) -> None:
        self._kind: str | None = None
        self._how = ""
        self._reports = 0
        self._since_us = 0
        #: what was reported and then contradicted, to be told
        self.refuted: str | None = None

    @property
    def stands(self) -> bool:
        """Whether something waits to be confirmed."""
        return self._kind is not None

    @property
    def how(self) -> str:
        """What was reported last of what may be a takeover, confirmed or not."""
        return self._how

    @property
    def kind(self) -> str | None:
        """The kind of what waits to be confirmed."""
        return self._kind

    def judge(self, found: tuple[str, str, int] | None, up_us: int, *, disputed: bool, at_once: bool) -> str | None:
        """What is sure, of what was found: its kind, what it is, and how many reports of its kind there were.

        `disputed`: two speak as the vehicle. `at_once`: a single report counts.
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
