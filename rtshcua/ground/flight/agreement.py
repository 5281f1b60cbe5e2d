"""Compare the track that the telemetry has of a flight with the track in the autopilot's own log.

At each point of ours the other track is interpolated linearly in the policy's local plane, and the nearest place counts
at which it was within 100 ms of the same time since the autopilot's boot. Horizontally and vertically on their own, the
point agrees if that is at most 1 m away. All numbers are integers.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.ground.flight.autopilot_log import AutopilotPoint
from rtshcua.ground.flight.flown import TrackPoint
from rtshcua.model.flat.zone import Projection, project

#: what agrees: the greatest distance, horizontal and vertical, in mm, and the greatest difference in time, in us
AGREES_MM: Final = 1_000
AGREES_US: Final = 100_000
#: over a longer gap of the autopilot's track nothing is interpolated, us; PX4 records it five times a second
GAP_US: Final = 1_000_000


class TrackDeviation(NamedTuple):
    """A time of the flight in which no point agrees: from and to in us since the log's first record, the number of
    points, and the largest horizontal and vertical deviation in mm.
    """

    from_us: int
    to_us: int
    points: int
    horizontal: int
    vertical: int


class TrackAgreement(NamedTuple):
    """The result: the points of the flight's track, those that could be compared, and those that agree; the largest
    deviations of all compared ones, in mm; the times without agreement. Of `flown_us`, from the first point to the
    last, the autopilot's log has `covered_us`.
    """

    points: int
    compared: int
    agreed: int
    horizontal: int
    vertical: int
    deviations: tuple[TrackDeviation, ...]
    flown_us: int
    covered_us: int


class _Local(NamedTuple):
    """A point of the autopilot's track in the local plane: mm east and north of home, and above sea."""

    boot_us: int
    x: int
    y: int
    z: int


def agreement(
    track: Sequence[TrackPoint], boot_us: Sequence[int | None], log: Sequence[AutopilotPoint], plane: Projection
) -> TrackAgreement:
    """Compare each point of `track`, whose times since the boot are `boot_us`, with the track of the autopilot's log.

    A point without a time, or where the autopilot's track has a gap, is not compared.
    """
    found = _distances(track, boot_us, log, plane)
    compared = [each for each in found if each is not None]
    agreed = sum(_agrees(each) for each in compared)
    steps = [(b.t_us - a.t_us, i) for i, (a, b) in enumerate(pairwise(track))]
    return TrackAgreement(
        points=len(track),
        compared=len(compared),
        agreed=agreed,
        horizontal=max((each[1] for each in compared), default=0),
        vertical=max((each[2] for each in compared), default=0),
        deviations=tuple(_deviations(found)),
        flown_us=sum(step for step, _ in steps),
        covered_us=sum(step for step, i in steps if found[i] is not None and found[i + 1] is not None),
    )


def _distances(
    track: Sequence[TrackPoint], boot_us: Sequence[int | None], log: Sequence[AutopilotPoint], plane: Projection
) -> list[tuple[int, int, int] | None]:
    """The time of each point, and its horizontal and vertical distance; None for one that cannot be compared."""
    other = [_Local(each.boot_us, *project(plane, each.latitude, each.longitude), each.above_sea) for each in log]
    times = [each.boot_us for each in other]
    found: list[tuple[int, int, int] | None] = []
    for point, at_us in zip(track, boot_us, strict=True):
        span = None if at_us is None else _around(other, times, at_us)
        if span is None:
            found.append(None)
            continue
        x, y = project(plane, point.latitude, point.longitude)
        found.append((point.t_us, _horizontal(span, x, y), _vertical(span, point.above_sea)))
    return found


def _agrees(each: tuple[int, int, int]) -> bool:
    return each[1] <= AGREES_MM and each[2] <= AGREES_MM


def _deviations(found: Iterable[tuple[int, int, int] | None]) -> Iterable[TrackDeviation]:
    """The runs of points that do not agree; one that could not be compared ends a run."""
    run: list[tuple[int, int, int]] = []
    for each in (*found, None):
        if each is not None and not _agrees(each):
            run.append(each)
        elif run:
            yield TrackDeviation(
                run[0][0], run[-1][0], len(run), max(one[1] for one in run), max(one[2] for one in run)
            )
            run = []


def _around(other: list[_Local], times: list[int], at_us: int) -> list[_Local] | None:
    """The places within `AGREES_US` of a time, interpolated at the ends; None in a gap and beyond the track."""
    after = bisect_left(times, at_us)
    if after == len(times) or (times[after] != at_us and (not after or times[after] - times[after - 1] > GAP_US)):
        return None
    first, last = at_us - AGREES_US, at_us + AGREES_US
    inside = other[bisect_right(times, first) : bisect_left(times, last)]
    begin, end = _place(other, times, first), _place(other, times, last)
    return [*([begin] if begin else []), *inside, *([end] if end else [])]


def _place(other: list[_Local], times: list[int], at_us: int) -> _Local | None:
    """The interpolated place, to the nearest mm; None beyond the ends and in gaps."""
    after = bisect_left(times, at_us)
    if after == len(times):
        return None
    b = other[after]
    if b.boot_us == at_us:
        return b
    if not after or b.boot_us - (a := other[after - 1]).boot_us > GAP_US:
        return None
    part, whole = at_us - a.boot_us, b.boot_us - a.boot_us
    return _Local(at_us, *(c + ((d - c) * part * 2 + whole) // (2 * whole) for c, d in zip(a[1:], b[1:], strict=True)))


def _horizontal(span: list[_Local], x: int, y: int) -> int:
    """The distance from a place to the nearest one of a span, in mm, rounded down."""
    return isqrt(min(_square(a, b, x, y) for a, b in zip(span, span[1:] or span, strict=False)))


def _square(a: _Local, b: _Local, x: int, y: int) -> int:
    """The square of the distance from a place to a straight piece, rounded down."""
    dx, dy, px, py = b.x - a.x, b.y - a.y, x - a.x, y - a.y
    along, length = dx * px + dy * py, dx * dx + dy * dy
    if along <= 0:
        return px * px + py * py
    if along >= length:
        return (x - b.x) ** 2 + (y - b.y) ** 2
    return (dx * py - dy * px) ** 2 // length


def _vertical(span: list[_Local], z: int) -> int:
    """The distance from a height to the nearest one of a span, in mm."""
    lowest, highest = min(each.z for each in span), max(each.z for each in span)
    return max(lowest - z, z - highest, 0)
