"""What a camera sees, against a ray through each corner of the sensor in floats, and at the limits of each demand."""

import math

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.geometry.cameras import SurveyCamera, apart, overlap, passed_in, time_for
from virtual.rows import rows

FULL = 10_000

#: sensor along and across in um, pixels, focal length in um, with known figures: cm per pixel at 100 m
KNOWN = {
    "1 inch, 20 MP": (SurveyCamera(8_800, 13_200, 3_648, 5_472, 8_800, 700_000, 1_000), 2.74),
    "4/3, 20 MP": (SurveyCamera(13_000, 17_300, 3_956, 5_280, 12_290, 700_000, 500), 2.67),
    "full frame, 61 MP, 35 mm": (SurveyCamera(24_000, 35_700, 6_336, 9_504, 35_000, 500_000, 500), 1.08),
    "1/2 inch, 48 MP, narrow": (SurveyCamera(4_800, 6_400, 6_000, 8_000, 6_700, 700_000, 500), 1.19),
}

CAMERAS = st.builds(
    SurveyCamera,
    *(st.integers(1_000, 60_000),) * 2,
    *(st.integers(500, 12_000),) * 2,
    st.integers(1_000, 400_000),
    st.integers(1, 5_000_000),
    st.integers(1, 50_000),
)
AWAY = st.integers(1, 500_000)
SPEEDS = st.integers(1, 30_000)


def half_view(extent: int, focal: int) -> float:
    """Half of the angle of view."""
    return math.atan(extent / 2 / focal)


def seen(extent: int, focal: int, away: int) -> float:
    """How much of a wall at a distance lies between the rays through both ends of the sensor."""
    return 2 * away * math.tan(half_view(extent, focal))


@rows("name", KNOWN)
def test_sample_distance_is_that_of_data_sheets(name: str) -> None:
    camera, known = KNOWN[name]
    assert abs(float(camera.sample_distance(100_000)) / 10 - known) <= 0.02 * known


@given(CAMERAS, AWAY)
def test_footprint_and_pixel_are_those_of_rays(camera: SurveyCamera, away: int) -> None:
    along, across = (seen(extent, camera.focal, away) for extent in (camera.along, camera.across))
    assert math.isclose(camera.shows_along(away), along, rel_tol=1e-9)
    assert math.isclose(camera.shows_across(away), across, rel_tol=1e-9)
    pixel = max(along / camera.pixels_along, across / camera.pixels_across)
    assert math.isclose(camera.sample_distance(away), pixel, rel_tol=1e-9)


@given(CAMERAS, st.integers(1, 100_000))
def test_farthest_distance_is_the_last_that_keeps_a_resolution(camera: SurveyCamera, resolution_um: int) -> None:
    farthest = camera.farthest(resolution_um)
    assert camera.sample_distance(farthest) * 1_000 <= resolution_um < camera.sample_distance(farthest + 1) * 1_000


@given(CAMERAS, AWAY, st.integers(1, FULL - 1))
def test_greatest_spacing_is_the_last_that_keeps_an_overlap(camera: SurveyCamera, away: int, share: int) -> None:
    extent = camera.shows_along(away)
    spacing = apart(extent, share)
    assert overlap(extent, spacing) >= share
    assert 1 - (spacing + 1) / extent < share / FULL
    assert overlap(extent, extent * 2) == 0


@given(CAMERAS, AWAY, st.integers(1, 100 * FULL))
def test_greatest_speed_is_the_last_that_keeps_a_blur(camera: SurveyCamera, away: int, blur: int) -> None:
    fastest = camera.fastest(blur, away)
    assert camera.blur(fastest, away) <= blur < camera.blur(fastest + 1, away) or fastest == 0
    smeared = fastest / 1e6 * camera.exposure_us / (seen(camera.along, camera.focal, away) / camera.pixels_along)
    assert smeared * FULL <= blur * (1 + 1e-9)


@given(SPEEDS, st.integers(1, 100_000))
def test_time_for_a_way_never_exceeds_it(speed: int, way: int) -> None:
    time_us = time_for(way, speed)
    assert passed_in(speed, time_us) <= way < passed_in(speed, time_us + 1)


def test_pictures_of_nothing_overlap_not_at_all_and_smear_wholly() -> None:
    camera = KNOWN["1 inch, 20 MP"][0]
    assert overlap(camera.shows_along(0), 1) == 0
    assert camera.blur(1, 0) == FULL * FULL
