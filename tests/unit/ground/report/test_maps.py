"""Maps show the signed outlines, and their labels do not overlap."""

import re
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.drawing.canvas import Canvas, LabelBox, canvas, contains, extent_of, hatching, path
from rtshcua.ground.drawing.drawn_site import ZoneOutline, ZoneView
from rtshcua.ground.drawing.profile import profiles
from rtshcua.ground.drawing.zone_map import ZoneMap, mission_map, zone_maps
from rtshcua.ground.geometry.polygons import contained
from rtshcua.ground.report.report_model import Chapter, PolicyReport

NUMBER = r"-?\d+"


def drawn(d: str, x: int, y: int) -> bool:
    """Whether a place of the map, y to the south, is inside a path, by its winding number."""
    arc = re.fullmatch(rf"M({NUMBER}) ({NUMBER})(A(\d+) \4 0 1 0 ({NUMBER}) ({NUMBER}))(A\4 \4 0 1 0 \1 \2)Z", d)
    if arc is not None:
        west, south, r, east = int(arc[1]), int(arc[2]), int(arc[4]), int(arc[5])
        assert south == int(arc[6])
        assert east - west == 2 * r
        return (2 * x - west - east) ** 2 + (2 * y - 2 * south) ** 2 < (2 * r) ** 2
    around = 0
    for ring in re.findall(r"M([^Z]*)Z", d):
        corners = [tuple(map(int, corner.split(" "))) for corner in ring.split("L")]
        for (ax, ay), (bx, by) in zip(corners, (*corners[1:], corners[0]), strict=True):
            side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if ay <= y < by and side > 0:
                around += 1
            if by <= y < ay and side < 0:
                around -= 1
    return around != 0


def signed(ground: ZoneOutline, x: int, y: int) -> bool:
    """The exact predicate: strictly inside."""
    if ground.centre is not None:
        return (x - ground.centre[0]) ** 2 + (y - ground.centre[1]) ** 2 < ground.radius_squared
    return contained(ground.rings, (x, y))


@given(data=st.data())
def test_place_inside_a_zone_is_inside_its_drawing(everything: PolicyReport, data: st.DataObject) -> None:
    zone = data.draw(st.sampled_from([zone.ground for zone in everything.chapters[0].zones]))
    extent = extent_of(zone)
    x = data.draw(st.integers(extent.west - 1000, extent.east + 1000))
    y = data.draw(st.integers(extent.south - 1000, extent.north + 1000))
    if signed(zone, x, y):
        assert drawn(path(zone), x, -y)
        assert contains(zone, x, y)
    elif not signed(zone, x, y) and not touches(zone, x, y):
        assert not drawn(path(zone), x, -y)
        assert not contains(zone, x, y)


def touches(zone: ZoneOutline, x: int, y: int) -> bool:
    """Whether a place is on the boundary, where the drawing may differ."""
    if zone.centre is not None:
        return (x - zone.centre[0]) ** 2 + (y - zone.centre[1]) ** 2 == zone.radius_squared
    for ring in zone.rings:
        for (ax, ay), (bx, by) in zip(ring, (*ring[1:], ring[0]), strict=True):
            flat = (bx - ax) * (y - ay) == (by - ay) * (x - ax)
            if flat and min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by):
                return True
    return False


def maps(book: PolicyReport) -> list[ZoneMap]:
    found = [plan for chapter in book.chapters for plan in zone_maps(chapter.site)]
    return found + [mission_map(chapter.site, mission.way) for chapter in book.chapters for mission in chapter.missions]


def test_labels_are_on_the_map_and_do_not_overlap(everything: PolicyReport, standard: PolicyReport) -> None:
    for plan in (*maps(everything), *maps(standard)):
        boxes = [label.box for label in plan.labels]
        assert len(boxes) > 3
        assert not [pair for pair in combinations(boxes, 2) if pair[0].meets_any(pair[1:])]
        for box in boxes:
            assert box.x > 0
            assert box.y > 0
            assert box.x + box.width < plan.width
            assert box.y + box.height < plan.height
        assert plan.unlabelled == ()


def crowded(chapter: Chapter, count: int) -> Chapter:
    """A chapter with many zones, some of them overlapping."""
    one = ZoneView("", "", "", "", "", "", ZoneOutline(), None, None, (), "", changed=False)
    zones = tuple(
        replace(
            one,
            name=f"zone_with_a_name_{number}",
            use=("allowed", "forbidden", "")[number % 3],
            ground=ZoneOutline(centre=((number % 7) * 9_000, (number // 14) * 9_000), radius_squared=5_000**2),
        )
        for number in range(count)
    )
    return replace(chapter, zones=zones)


def test_labels_without_room_are_listed(everything: PolicyReport) -> None:
    for plan in zone_maps(crowded(everything.chapters[0], 120).site):
        boxes = [label.box for label in plan.labels]
        assert not [pair for pair in combinations(boxes, 2) if pair[0].meets_any(pair[1:])]
        assert len(boxes) + len(plan.unlabelled) >= 121


def test_columns_of_a_profile_are_side_by_side_above_their_names(everything: PolicyReport) -> None:
    for profile in profiles(crowded(everything.chapters[0], 40).site):
        for one, other in zip(profile.columns, profile.columns[1:], strict=False):
            assert one.x + one.width < other.x
        assert all(7.3 * len(line) <= column.width + 16 for column in profile.columns for line in column.lines)
        assert all("".join(column.lines) in column.title for column in profile.columns)


@pytest.mark.parametrize(("floor", "ceiling"), [(None, 60_000), (20_000, None), (92_000, 192_000), (None, None)])
def test_column_reaches_from_floor_to_ceiling(everything: PolicyReport, floor: int | None, ceiling: int | None) -> None:
    (chapter,) = everything.chapters
    zone = replace(chapter.zones[0], floor=floor, ceiling=ceiling)
    (profile,) = profiles(replace(chapter, zones=(zone, replace(zone, name="next", floor=0, ceiling=200_000))).site)
    column, scale = profile.columns[0], (profile.columns[1].bottom - profile.columns[1].top) / 200_000
    assert column.open_above == (ceiling is None)
    assert column.bottom == pytest.approx(profile.ground - (floor or 0) * scale)
    if ceiling is not None:
        assert column.top == pytest.approx(profile.ground - ceiling * scale)


@given(x=st.integers(-400_000, 400_000), y=st.integers(-400_000, 400_000))
def test_point_on_the_page_converts_back_to_its_place(everything: PolicyReport, x: int, y: int) -> None:
    on: Canvas = canvas(extent_of(everything.chapters[0].zones[0].ground))
    back = on.place(*on.at(x, y))
    assert abs(back[0] - x) <= 1
    assert abs(back[1] - y) <= 1


def test_hatching_covers_exactly_its_box() -> None:
    lines = re.findall(r"M(\S+) (\S+)L(\S+) ([^M]+)", hatching(LabelBox(10, 20, 50, 30), 1000, 1000))
    assert 5 <= len(lines) <= 10
    for line in lines:
        x0, y0, x1, y1 = map(float, line)
        assert 10 <= x0 < x1 <= 60
        assert 20 <= y1 < y0 <= 50
        assert x0 + y0 == pytest.approx(x1 + y1)
    assert hatching(LabelBox(-50, -50, 20, 20), 1000, 1000) == ""
