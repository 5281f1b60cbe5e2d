"""All forms of zones, and their IR."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.diagnostics.codes import BAD_PERIOD, WRITTEN_TWICE
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]

CIRCLE = {"kind": "circle", "center": (10_000_000, 20_000_000), "radius": (3_000, "length")}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("= circle(1 N, 2 E, 3 m)", CIRCLE),
        (
            "= polygon(1 N, 2 E, 3 S, 4 W,) hole (5 N, 6 E) hole(7 N, 8 E, 9 N, 10 E,)",
            {
                "kind": "polygon",
                "corners": [(10_000_000, 20_000_000), (-30_000_000, -40_000_000)],
                "holes": [[(50_000_000, 60_000_000)], [(70_000_000, 80_000_000), (90_000_000, 100_000_000)]],
            },
        ),
        (
            "= corridor(1 N, 2 E, 3 N, 4 E, width 40 m)",
            {
                "kind": "corridor",
                "points": [(10_000_000, 20_000_000), (30_000_000, 40_000_000)],
                "width": (40_000, "length"),
            },
        ),
        (
            "= corridor(1 N, 2 E, width 40 m,)",
            {"kind": "corridor", "points": [(10_000_000, 20_000_000)], "width": (40_000, "length")},
        ),
        (
            "= union(circle(1 N, 2 E, 3 m), other, difference(circle(1 N, 2 E, 3 m), school), union(a),)",
            {
                "kind": "combination",
                "operator": "union",
                "shapes": [
                    CIRCLE,
                    "&other",
                    {"kind": "combination", "operator": "difference", "shapes": [CIRCLE, "&school"]},
                    {"kind": "combination", "operator": "union", "shapes": ["&a"]},
                ],
            },
        ),
        ('from "a/b.geojson"', {"kind": "geojson", "path": "a/b.geojson"}),
        ('from "lib:b" feature "of \\"it\\""', {"kind": "geojson", "path": "lib:b", "feature": 'of "it"'}),
    ],
)
def test_shape(plain: Plain, unit: Read, text: str, expected: dict[str, Any]) -> None:
    assert plain(unit(f"zone z {text} zone after = circle(1 N, 2 E, 3 m)").zones[0].shape) == expected


def test_names_of_shapes_are_keywords_only_before_a_bracket(plain: Plain, unit: Read) -> None:
    text = "zone z = union(circle, polygon , corridor, union, difference, circle (1 N, 2 E, 3 m), circle)"
    assert plain(unit(text).zones[0].shape)["shapes"] == [
        "&circle", "&polygon", "&corridor", "&union", "&difference", CIRCLE, "&circle",
    ]  # fmt: skip


def test_times(plain: Plain, unit: Read) -> None:
    text = '''zone z = circle(1 N, 2 E, 3 m) active 22:00 .. 06:00
      active "1970-01-01T00:00Z" .. "1970-01-01T01:00:00.5+00:30"'''
    assert plain(unit(text).zones[0]) == {
        "name": "z",
        "shape": CIRCLE,
        "daily": {"start": "1320 min", "end": "360 min"},
        "dates": {"start_us": 0, "end_us": 1_800_500_000},
    }


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("08:00 .. 08:00", BAD_PERIOD, "the active period of the zone is empty"),
        ('"2026-05-02T08:00Z" .. "2026-05-02T10:00+02:00"', BAD_PERIOD, "the active period ends before it begins"),
        (
            '"2026-02-29T08:00Z" .. "2026-05-02T18:00Z"',
            BAD_PERIOD,
            "`2026-02-29T08:00Z` is not a moment: the day does not exist",
        ),
        ("08:00 .. 09:00 active 10:00 .. 11:00", WRITTEN_TWICE, "`active (times of day)` is repeated in zone `z`"),
        (
            '"2026-05-01T08:00Z" .. "2026-05-02T08:00Z" active "2027-05-01T08:00Z" .. "2027-05-02T08:00Z"',
            WRITTEN_TWICE,
            "`active (dates)` is repeated in zone `z`",
        ),
    ],
)
def test_invalid_times_are_reported(text: str, code: object, message: str) -> None:
    (found,) = parse(Source("x", f"zone z = circle(1 N, 2 E, 3 m) active {text}")).diagnostics
    assert (found.code, found.message) == (code, message)
