"""The error of distances in the local plane against the ellipsoid: the bound of docs/adr/0011-zones.md.

The oracle is the chord between two places in earth-centred coordinates. A geodesic of length s whose curvature is
nowhere above k has a chord of at least 2 / k * sin(s k / 2), hence `chord <= s <= chord * (1 + chord^2 k^2 / 23)` for
the lengths here; no normal section of WGS 84 is curved more than at the equator along the meridian, 1 / 6335 km.
"""

import math

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.geometry.projection import projection_at
from rtshcua.model.flat.zone import project, unproject
from virtual.rows import rows

A, F = 6_378_137_000.0, 1 / 298.257223563  # mm
E2 = F * (2 - F)
LEAST_RADIUS = A * (1 - E2)  # of curvature, 6335 km: along the meridian at the equator
KM = 1_000_000


def bound(latitude: float, reach: float) -> float:
    """Return the largest relative error of a distance within `reach` mm of home."""
    turn = reach / LEAST_RADIUS
    return (math.tan(math.radians(abs(latitude))) + 0.011) * turn + 2 / math.cos(math.radians(latitude)) ** 2 * turn**2


def centred(latitude: int, longitude: int) -> tuple[float, float, float]:
    phi, lam = math.radians(latitude / 1e7), math.radians(longitude / 1e7)
    vertical = A / math.sqrt(1 - E2 * math.sin(phi) ** 2)
    flat = vertical * math.cos(phi)
    return flat * math.cos(lam), flat * math.sin(lam), vertical * (1 - E2) * math.sin(phi)


def geodesic(one: tuple[int, int], other: tuple[int, int]) -> tuple[float, float]:
    """Return a lower and an upper bound of the length of the geodesic in mm."""
    chord = math.dist(centred(*one), centred(*other))
    return chord, chord * (1 + chord**2 / LEAST_RADIUS**2 / 23)


def deviation(latitude: int, longitude: int, a: tuple[int, int], b: tuple[int, int]) -> tuple[float, float, float]:
    """Return the plane distance of two places minus the two bounds of the true one, and the upper bound."""
    plane = projection_at(latitude, longitude)
    least, most = geodesic(unproject(plane, *a), unproject(plane, *b))
    flat = math.dist(project(plane, *unproject(plane, *a)), project(plane, *unproject(plane, *b)))
    return flat - most, flat - least, most


@given(
    st.integers(-70 * 10**7, 70 * 10**7),
    st.integers(-179 * 10**7, 179 * 10**7),
    st.sampled_from([KM // 2, 2 * KM, 5 * KM, 10 * KM, 50 * KM]),
    st.floats(0, 1),
    st.floats(0, 1),
    st.floats(0, 2 * math.pi),
    st.floats(0, 2 * math.pi),
)
def test_distances_in_the_plane_are_within_the_stated_bound(
    latitude: int, longitude: int, reach: int, r: float, s: float, t: float, u: float
) -> None:
    a, b = ((round(reach * f * math.cos(w)), round(reach * f * math.sin(w))) for f, w in ((r, t), (s, u)))
    low, high, length = deviation(latitude, min(max(longitude, -1_780_000_000), 1_780_000_000), a, b)
    allowed = bound(latitude / 1e7, reach) * length + 3  # 3 mm: both ends are rounded down in x and in y
    assert -allowed <= high
    assert low <= allowed


@rows(
    ("latitude", "km", "stated"),
    [(0, 0.5, 1), (0, 5, 1), (47.4, 0.5, 9), (47.4, 2, 35), (47.4, 5, 87), (47.4, 10, 175), (60, 5, 139), (70, 5, 221)],
)
def test_table_of_the_decision_record_matches_the_measurement(latitude: float, km: float, stated: int) -> None:
    """The largest error, in parts in 100,000, within some km of home: measured, and close to the bound."""
    reach = round(km * KM)
    home = (round(latitude * 10**7), 0)
    worst = 0.0
    for way in range(0, 360, 5):
        at = (round(reach * math.cos(math.radians(way))), round(reach * math.sin(math.radians(way))))
        for step in ((100_000, 0), (0, 100_000), (70_000, 70_000)):
            low, high, length = deviation(*home, at, (at[0] + step[0], at[1] + step[1]))
            worst = max(worst, abs(low) / length, abs(high) / length)
    worst -= 3 / 100_000  # the effect of rounding to millimetres over the measured 100 m
    assert worst <= bound(latitude, reach)
    assert worst * 1e5 <= stated
    assert bound(latitude, reach) * 1e5 <= stated + 1
