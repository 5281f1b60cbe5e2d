"""The agreement of two tracks: a table of deviations by hand, gaps, ends, and a naive oracle in steps of 1 ms."""

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.ground.flight.agreement import AGREES_MM, AGREES_US, GAP_US, TrackAgreement, TrackDeviation, agreement
from rtshcua.ground.flight.autopilot_log import AutopilotPoint
from rtshcua.ground.flight.flown import TrackPoint
from rtshcua.model.flat.zone import SHIFT, Projection

#: 10 mm per unit each way, so that places are exact
PLANE = Projection(470_000_000, 80_000_000, 10 << SHIFT, 10 << SHIFT)
MS = 1_000
S = 1_000_000
#: of the autopilot's boot before the log's first record
OFFSET = 40 * S


def ours(t_us: int, x: int, y: int, z: int) -> TrackPoint:
    return TrackPoint(t_us, PLANE.latitude + y // 10, PLANE.longitude + x // 10, z, 0, None, 0, 0, 0, None)


def theirs(t_us: int, x: int, y: int, z: int) -> AutopilotPoint:
    return AutopilotPoint(t_us + OFFSET, PLANE.latitude + y // 10, PLANE.longitude + x // 10, z)


def leg(speed: int, seconds: int = 20) -> list[TrackPoint]:
    """A leg to the east at `speed` mm/s, ten points a second."""
    return [ours(100 * MS * n, speed * n // 10, 0, 50_000) for n in range(10 * seconds + 1)]


def logged(speed: int, seconds: int = 20, late_us: int = 0) -> list[AutopilotPoint]:
    """The same leg five times a second, the autopilot's times later by `late_us`."""
    return [theirs(200 * MS * n + late_us, speed * n // 5, 0, 50_000) for n in range(-5, 5 * seconds + 6)]


def compared(track: list[TrackPoint], log: list[AutopilotPoint]) -> TrackAgreement:
    return agreement(track, [point.t_us + OFFSET for point in track], log, PLANE)


def moved(track: list[TrackPoint], first: int, end: int, across: int = 0, up: int = 0) -> list[TrackPoint]:
    """The track with some points moved to the north and up, in mm."""
    return [
        point._replace(latitude=point.latitude + across // 10, above_sea=point.above_sea + up)
        if first <= number < end
        else point
        for number, point in enumerate(track)
    ]


def test_same_tracks_agree() -> None:
    found = compared(leg(6_000), logged(6_000))
    assert found == TrackAgreement(201, 201, 201, 0, 0, (), 20 * S, 20 * S)


@pytest.mark.parametrize(
    ("across", "up", "apart"),
    [(500, 0, False), (1_000, 0, False), (1_500, 0, True), (0, 500, False), (0, -1_000, False), (0, 1_001, True),
     (0, -1_500, True), (900, 900, False)],
)  # fmt: skip
def test_deviations_in_place(across: int, up: int, apart: bool) -> None:
    """Three seconds of a leg, 31 points, away from the autopilot's track."""
    found = compared(moved(leg(6_000), 50, 81, across, up), logged(6_000))
    assert (found.horizontal, found.vertical) == (across, abs(up))
    assert found.agreed == 201 - 31 * apart
    one = TrackDeviation(5 * S, 8 * S, 31, across, abs(up))
    assert found.deviations == ((one,) if apart else ())


@pytest.mark.parametrize(
    ("speed", "late_us", "horizontal"),
    [(15_000, 80 * MS, 0), (15_000, -80 * MS, 0), (15_000, 100 * MS, 0), (15_000, 250 * MS, 2_250),
     (15_000, -250 * MS, 2_250), (2_000, 250 * MS, 300)],
)  # fmt: skip
def test_deviations_in_time(speed: int, late_us: int, horizontal: int) -> None:
    """80 ms agree on the fastest leg; 250 ms agree only on a slow one."""
    found = compared(leg(speed), logged(speed, late_us=late_us))
    assert found.horizontal == horizontal
    assert (found.agreed == found.compared) == (horizontal <= AGREES_MM)
    assert found.compared == 201


def test_two_deviations_are_told_apart() -> None:
    track = moved(moved(leg(6_000), 20, 30, across=3_000), 25, 60, up=2_000)
    track = moved(track, 100, 101, across=-5_000)
    found = compared(track, logged(6_000))
    assert found.deviations == (
        TrackDeviation(2 * S, 5_900 * MS, 40, 3_000, 2_000), TrackDeviation(10 * S, 10 * S, 1, 5_000, 0),
    )  # fmt: skip


def test_gaps_and_ends_are_not_compared() -> None:
    log = [point for point in logged(6_000) if not OFFSET + 5 * S < point.boot_us < OFFSET + 7 * S]
    found = compared(leg(6_000), log)
    assert (found.points, found.compared) == (201, 201 - 19)
    assert found.covered_us == 18 * S
    assert found.flown_us == 20 * S
    half = compared(leg(6_000), [point for point in log if point.boot_us <= OFFSET + 4 * S])
    assert (half.compared, half.agreed, half.covered_us) == (41, 41, 4 * S)
    assert not half.deviations
    nothing = agreement(leg(6_000), [None] * 201, log, PLANE)
    assert (nothing.points, nothing.compared, nothing.horizontal, nothing.covered_us) == (201, 0, 0, 0)


def test_uncompared_point_ends_a_deviation() -> None:
    track = moved(leg(6_000), 20, 30, across=3_000)
    times: list[int | None] = [point.t_us + OFFSET for point in track]
    times[24] = None
    found = agreement(track, times, logged(6_000), PLANE)
    assert [(each.from_us, each.to_us) for each in found.deviations] == [
        (2 * S, 2_300 * MS), (2_500 * MS, 2_900 * MS),
    ]  # fmt: skip


LOGS = st.lists(
    st.tuples(
        st.integers(20, 1_300), st.integers(-900, 900), st.integers(-900, 900), st.integers(-20_000, 20_000)
    ),
    min_size=2, max_size=12,
)  # fmt: skip


@settings(max_examples=settings().max_examples * 4)
@given(LOGS, st.integers(-500, 9_000), st.integers(-900, 900), st.integers(-900, 900), st.integers(-20_000, 20_000))
def test_one_point_against_a_naive_oracle(
    steps: list[tuple[int, int, int, int]], at_ms: int, x: int, y: int, z: int
) -> None:
    log, now = [], 0
    for step_ms, east, north, up in steps:
        now += step_ms
        log.append(theirs(now * MS, 10 * east, 10 * north, up))
    found = agreement([ours(at_ms * MS, 10 * x, 10 * y, z)], [at_ms * MS + OFFSET], log, PLANE)
    near = list(filter(None, (naive(log, at_ms * MS + OFFSET + off) for off in range(-AGREES_US, AGREES_US + 1, MS))))
    if naive(log, at_ms * MS + OFFSET) is None:
        assert found.compared == 0
        return
    assert found.compared == 1
    across = min(hypot(east - 10 * x, north - 10 * y) for east, north, _ in near)
    height = min(abs(up - z) for _, _, up in near)
    # a step of 1 ms is at most 1,300 mm long here, across its nearest end
    assert across - 1_300 <= found.horizontal <= across + 2
    assert height - 2_100 <= found.vertical <= height + 2


def naive(log: list[AutopilotPoint], at_us: int) -> tuple[float, float, float] | None:
    """The interpolated place at one moment."""
    for a, b in pairwise(log):
        if a.boot_us <= at_us <= b.boot_us:
            if at_us not in (a.boot_us, b.boot_us) and b.boot_us - a.boot_us > GAP_US:
                return None
            part = (at_us - a.boot_us) / (b.boot_us - a.boot_us)
            place = [c + (d - c) * part for c, d in zip(a[1:], b[1:], strict=True)]
            return 10 * (place[1] - PLANE.longitude), 10 * (place[0] - PLANE.latitude), place[2]
    return None
