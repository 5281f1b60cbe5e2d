"""The descriptions of the survey patterns agree with the planner."""

import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import hypot
from pathlib import Path

import pytest

from reference.mapping import PROGRAM
from rtshcua.ground.checker.checks.contracts import PATTERNS as KNOWN
from rtshcua.ground.geometry.shapes import RoundArea, SimplePolygon
from rtshcua.ground.geometry.survey import survey
from rtshcua.ground.report.html_page import page, pattern_picture
from rtshcua.ground.report.html_page import pattern as drawn
from rtshcua.ground.report.policy_report import ReportPart, policy_report
from rtshcua.ground.report.prose.rules_and_skills import PATTERNS
from rtshcua.ground.report.report_model import PolicyReport

M = 1_000
DOCS = Path(__file__).resolve().parents[4] / "docs"
HOUSE = SimplePolygon(((0, 0), (120 * M, 0), (150 * M, 55 * M), (120 * M, 90 * M), (0, 90 * M)))
ROUND = RoundArea((0, 0), 50 * M)


def turned(points: tuple[tuple[int, int], ...]) -> int:
    """Twice the area that a closed path encloses, positive if counter-clockwise."""
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairwise(points))


def test_pictures_of_a_survey_are_described_with_the_skill_and_the_step(
    tmp_path: Path, part: Callable[[Path], ReportPart]
) -> None:
    (tmp_path / "map.rts").write_text(PROGRAM, encoding="utf-8")
    text = page(policy_report([part(tmp_path / "map.rts")], made_at_us=0, made_by="rtshcua")).replace("\u00a0", " ")
    assert "Pictures by mapper, grid: 13.707 mm per pixel, pictures of 75 m by 50 m, overlap 84 % forward, " in text
    assert "It takes pictures with the camera <code>mapper</code> every 8 m; proved before the flight: a pixel " in text
    assert "no further apart than the overlap of the pictures allows" in text
    assert "<code>mapper</code>: a sensor of 13.2 mm by 8.8 mm, 5472 by 3648 pixels, 8.8 mm behind the lens" in text


def test_each_pattern_has_a_description_and_a_drawing() -> None:
    assert set(PATTERNS) == set(KNOWN)
    assert [name for name in KNOWN if len(drawn(name).arrows) <= 3] == ["face"], "which is one leg"
    assert [name for name in KNOWN if drawn(name).structure] == ["corridor", "face", "around"]


@pytest.mark.parametrize("name", KNOWN)
def test_picture_of_the_documentation_is_drawn_from_the_real_path(name: str) -> None:
    """`UPDATE_GOLDENS=1` draws them anew: look at the difference."""
    file = DOCS / "patterns" / f"{name}.svg"
    found = pattern_picture(name)
    if os.environ.get("UPDATE_GOLDENS"):
        file.write_text(found, encoding="utf-8")
    assert found == file.read_text(encoding="utf-8")
    assert f"patterns/{name}.svg" in (DOCS / "survey.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("height", "apart"), [(20 * M, 20 * M), (3 * M, 5 * M)])
def test_spacing_of_a_grid_is_at_most_its_altitude(height: int, apart: int) -> None:
    way = survey(HOUSE, "grid", height, 3 * M, (0, 0))
    other = survey(HOUSE, "grid", height, 3 * M, (150 * M, 90 * M))
    assert way is not None
    assert other == way[::-1]
    lines = sorted({y for (_, y), (_, then) in pairwise(way) if y == then})
    spaces = {b - a for a, b in pairwise(lines)}
    assert max(spaces) <= apart
    assert max(spaces) - min(spaces) <= 1
    assert abs(lines[0] - 3 * M - max(spaces) / 2) < 10


def test_grid_line_through_a_corner_is_flown_like_any_other() -> None:
    pointed = SimplePolygon(((0, 0), (120 * M, 0), (150 * M, 45 * M), (120 * M, 90 * M), (0, 90 * M)))
    way = survey(pointed, "grid", 20 * M, 3 * M, (0, 0))
    assert way is not None
    lines = [(a, b) for (a, y), (b, then) in pairwise(way) if y == then]
    assert len(way) == 10
    assert len(lines) == 5
    assert min(abs(b - a) for a, b in lines) > 110 * M


def test_perimeter_goes_counter_clockwise_from_the_west() -> None:
    way = survey(HOUSE, "perimeter", 20 * M, 3 * M, (150 * M, 45 * M))
    assert way is not None
    assert way[0] == way[-1] == min(way)
    assert turned(way) > 0
    around = survey(ROUND, "perimeter", 20 * M, 3 * M, None)
    assert around is not None
    assert len(around) == 17
    assert around[0] == max(around)
    assert turned(around) > 0


def test_orbit_is_the_largest_circle_in_the_area() -> None:
    way = survey(HOUSE, "orbit", 20 * M, 3 * M, (0, 0))
    assert way is not None
    assert len(way) == 17
    assert way[0] == way[-1] == max(way)
    assert turned(way) > 0
    x0, y0 = (way[0][0] + way[8][0]) // 2, way[0][1]
    assert all(abs(hypot(x - x0, y - y0) - (way[0][0] - x0)) < 10 for x, y in way)
    # it touches the inset edge in the south or north, and never crosses it
    assert min(y for _, y in way) >= 3 * M
    assert min(min(y for _, y in way) - 3 * M, 87 * M - max(y for _, y in way)) < 10


def test_page_draws_only_the_patterns_of_surveys(everything: PolicyReport) -> None:
    text = page(everything)
    surveys = [skill for chapter in everything.chapters for skill in chapter.skills if skill.patterns]
    assert surveys
    assert text.count('<figure class="pattern">') == sum(len(skill.patterns) for skill in surveys)
    assert all("survey path" in skill.motion for skill in surveys)
    bare = replace(everything.chapters[0], skills=tuple(replace(s, patterns=()) for s in everything.chapters[0].skills))
    assert '<figure class="pattern">' not in page(replace(everything, chapters=(bare,)))
