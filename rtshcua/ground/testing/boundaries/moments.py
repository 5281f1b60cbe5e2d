"""Where a condition turns in the course of time: windows of the day or the week, and zones that exist at times."""

from collections.abc import Iterator
from itertools import pairwise

from rtshcua.decision import tree
from rtshcua.decision.times import time_of_week
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.ground.testing.boundaries.limits import Limit, tried
from rtshcua.ground.testing.boundaries.parts import Part, atoms, truth
from rtshcua.ground.testing.boundaries.places import zones_of
from rtshcua.ground.testing.boundaries.scene import TIME, Scene
from rtshcua.model.flat.limits import DAY, WEEK


def moments(question: Part, part: Part, scene: Scene) -> Iterator[tuple[str, Limit]]:
    """Each moment, to the microsecond, between which and the next a part turns: in the scene's day, and at the dates of
    zones. What is looked for is where the question turns, what counts whether the part does.
    """
    times = sorted(set(_times(question, scene)))
    samples = sorted({scene.now.utc_us, *times, *((one + other) // 2 for one, other in pairwise(times))})
    known = [(moment, truth(question, scene.put(TIME, moment))) for moment in samples if moment >= 0]
    for (one, before), (other, after) in pairwise(known):
        if {before, after} == {TRUE, FALSE}:
            low, high = one, other
            while high - low > 1:
                half = (low + high) // 2
                low, high = (half, high) if truth(question, scene.put(TIME, half)) == before else (low, half)
            found = tried(part, scene, TIME, low, high)
            if found is not None:
                yield _words(question, scene, low, opens=after == TRUE), found


def in_time(question: Part, scene: Scene) -> Iterator[str]:
    """The limits that a question should have in the course of time, in words."""
    windows = isinstance(question.node, tree.InWindow | tree.InWeek) or any(
        len(set(zone.daily)) == 2 or zone.weekly for zone in zones_of(question, scene.invocation)
    )
    if windows:
        yield from ("the start of its hours", "the end of its hours")
    if any(zone.dates for zone in zones_of(question, scene.invocation)):
        yield from ("its first moment", "its last moment")


def _words(question: Part, scene: Scene, moment: int, *, opens: bool) -> str:
    """What turns at a moment: what lasts a while turns as much before it."""
    early = scene.invocation.lasts_us + 2
    outside = question.airspace is not None and not question.airspace.inside
    dates = [date for zone in zones_of(question, scene.invocation) for date in zone.dates]
    if any(abs(moment - date) <= early for date in dates):
        return "its first moment" if opens != outside else "its last moment"
    return "the start of its hours" if opens != outside else "the end of its hours"


def _times(part: Part, scene: Scene) -> Iterator[int]:
    """Moments between which nothing turns but for what a step takes: those are found between two of these."""
    local = scene.now.utc_us + scene.invocation.policy.tables.local.offset(scene.now.utc_us)
    midnight, monday = scene.now.utc_us - local % DAY, scene.now.utc_us - time_of_week(local)
    daily: list[int] = []
    weekly: list[int] = []
    for atom in () if part.node is None else atoms(part.node):
        if isinstance(atom, tree.InWindow):
            daily += (atom.start, atom.end)
        elif isinstance(atom, tree.InWeek):
            weekly += atom.windows
    for zone in zones_of(part, scene.invocation):
        daily += zone.daily
        weekly += zone.weekly
        yield from (date + late for date in zone.dates for late in (-DAY // 2, -1, 0, 1, DAY // 2))
    if daily:
        yield from (midnight + time + late for time in (0, *daily, DAY - 1) for late in (-1, 0, 1))
    if weekly:
        yield from (monday + time + late for time in (0, *weekly, WEEK - 1) for late in (-1, 0, 1))
