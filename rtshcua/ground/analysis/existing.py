"""Whether a zone exists at the moments of a box."""

from collections.abc import Iterator

from rtshcua.decision.times import Times, timed, windows_of
from rtshcua.decision.values import TRUE, Truth
from rtshcua.ground.analysis.box import Box
from rtshcua.ground.analysis.moments import moments_split
from rtshcua.ground.analysis.space import Space


class Existing:
    """The times of one zone."""

    def __init__(self, zone: int, space: Space) -> None:
        flat = space.plane.zone(zone)
        self._timed = timed(flat)
        self._times = Times(flat, space.tables.local)
        self._windows = windows_of(flat, space.tables.local)
        self._dates = (flat.dates[0], flat.dates[1] + 1) if flat.dates else ()
        self._error = space.error

    def truth(self, box: Box) -> Truth:
        """Whether the zone exists."""
        return self._times.truth(box.utc, self._error, 0) if self._timed else TRUE

    def split(self, box: Box) -> list[Box]:
        """The box in pieces, where its moments do not decide; else none."""
        truth = self.truth(box)
        return moments_split(box, self._cuts) if truth & (truth - 1) else []

    def _cuts(self, low: int, high: int) -> Iterator[int]:
        yield from (date for date in self._dates if low < date <= high)
        for window in self._windows:
            yield from window.changes(low, high)
