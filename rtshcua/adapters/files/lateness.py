"""Whether lines come on the disk within the time that is promised for their class."""

from typing import Final

from rtshcua.evidence.durability import SYNC_US, SYNCED

#: A line that was to be on the disk within `SYNC_US` and is not is told; when it is not after this time, in seconds,
#: the disk counts as failed: it hangs.
STUCK_S: Final = 5.0


class Lateness:
    """Watches over the sync of lines, one at a time: the next is the last that was given when the one before came true.

    Times are in seconds of the caller's clock, which never goes back.
    """

    def __init__(self, late_s: float = SYNC_US / 1e6, stuck_s: float = STUCK_S) -> None:
        self._late_s, self._stuck_s = late_s, stuck_s
        self._promised = 0  # the last line that is to be synced,
        self._watched = 0  # the one that is watched,
        self._since_s = 0.0  # since when,
        self._told_s = 0.0  # and after how long it was told to be late

    def given(self, number: int, durability: int) -> None:
        """Line `number`, counted from 1, was given to the disk."""
        if durability >= SYNCED:
            self._promised = number

    def kept(self, synced: int) -> bool:
        """Whether all that was promised came true: then neither `late` nor `stuck` has anything to say."""
        return self._promised <= synced

    def late(self, synced: int, now_s: float) -> str | None:
        """That a line is late, once for each time that the disk falls behind; `synced` lines are on it."""
        if self._told_s or self._waited_s(synced, now_s) <= self._late_s:
            return None
        self._told_s = self._late_s
        return f"what was to be on the disk within {SYNC_US // 1_000} ms is not"

    def stuck(self, synced: int, now_s: float) -> str | None:
        """That the disk hangs, once for each time that it does."""
        if self._waited_s(synced, now_s) <= self._stuck_s or self._told_s >= self._stuck_s:
            return None
        self._told_s = self._stuck_s
        return f"the disk has not answered for {self._stuck_s:g} s"

    def _waited_s(self, synced: int, now_s: float) -> float:
        if self._promised <= synced:
            return 0.0
        if self._watched <= synced:
            self._watched, self._since_s, self._told_s = self._promised, now_s, 0.0
        return now_s - self._since_s
