"""Every declaration of the language, and the IR that it becomes. Spans, conditions, policies and missions have their
own tests.
"""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


@pytest.mark.parametrize(
    ("plainly", "comma"),
    [
        ("zone z = circle(1 N, 2 E, 5 m)", "zone z = circle(1 N, 2 E, 5 m,)"),
        ("zone z = corridor(1 N, 2 E, 1 N, 3 E, width 5 m)", "zone z = corridor(1 N, 2 E, 1 N, 3 E, width 5 m,)"),
        ("skill s() { require a in {b, c} }", "skill s() { require a in {b, c,} }"),
        ("skill s() { require phase in {b} }", "skill s() { require phase in {b, } }"),
        ("skill s() { require position inside grow(z, 5 m) }", "skill s() { require position inside grow(z, 5 m,) }"),
        ("skill s() { require max(a, b) < 5 m }", "skill s() { require max(a, b,) < 5 m }"),
    ],
)
def test_lists_in_brackets_may_have_a_trailing_comma(plain: Plain, unit: Read, plainly: str, comma: str) -> None:
    assert plain(unit(comma)) == plain(unit(plainly))


def test_empty_text(plain: Plain, unit: Read) -> None:
    assert plain(unit("")) == {"file": "x.rts"}
    assert plain(unit(" // nothing\n/* nor * here **/ \t\r\n")) == {"file": "x.rts"}


def test_import(plain: Plain, unit: Read) -> None:
    assert plain(unit('import "lib:skills/goto.rts" import "a \\"b\\" \\\\c.rts"').imports) == [
        {"path": "lib:skills/goto.rts"},
        {"path": 'a "b" \\c.rts'},
    ]


def test_enum(plain: Plain, unit: Read) -> None:
    assert plain(unit("enum e = E_TYPE { a = 0, b = 2, } enum f { c = 1 } enum g { }").enums) == [
        {
            "name": "e",
            "dialect": "E_TYPE",
            "members": [{"name": "a", "value": 0}, {"name": "b", "value": 2}],
        },
        {"name": "f", "members": [{"name": "c", "value": 1}]},
        {"name": "g"},
    ]


def test_signal(plain: Plain, unit: Read) -> None:
    text = """
    signal gps.fix : gps_fix = GPS_RAW_INT.fix_type unknown at -1, no_fix, 255 stale after 2 s
    signal wind.speed : speed = WIND_COV.wind_x, WIND_COV.wind_y or WIND.speed stale after 10 s
    """
    assert plain(unit(text).signals) == [
        {
            "name": "gps.fix",
            "type": "gps_fix",
            "sources": [{"message": "GPS_RAW_INT", "fields": ["fix_type"]}],
            "unknown_at": ["-1", "no_fix", "255"],
            "stale_after": (2_000_000, "duration"),
        },
        {
            "name": "wind.speed",
            "type": "speed",
            "sources": [
                {"message": "WIND_COV", "fields": ["wind_x", "wind_y"]},
                {"message": "WIND", "fields": ["speed"]},
            ],
            "stale_after": (10_000_000, "duration"),
        },
    ]


def test_zone(plain: Plain, unit: Read) -> None:
    text = """
    zone a = circle(47.5 N, 8.25 E, 120 m)
    zone b = polygon(1 N, 2 E, 1 S, 2 W, 0 N, 0.0000001 E,) entry 1 N, 1 E ceiling 60 m above home floor 0 m
    """
    assert plain(unit(text).zones) == [
        {"name": "a", "shape": {"kind": "circle", "center": (475_000_000, 82_500_000), "radius": (120_000, "length")}},
        {
            "name": "b",
            "shape": {
                "kind": "polygon",
                "corners": [(10_000_000, 20_000_000), (-10_000_000, -20_000_000), (0, 1)],
            },
            "floor": (0, "length"),
            "ceiling": (60_000, "altitude", "home"),
            "entry": (10_000_000, 10_000_000),
        },
    ]


def test_vehicle(plain: Plain, unit: Read) -> None:
    text = """vehicle quad {
      identity "quad-07" home 47.39774 N, 8.54559 E within 50 m speed at most 12 m/s climb at most 3 m/s
      position error 3 m energy 100 % = 18 min hover reserve 15 % clock utc -03:30
    }"""
    assert plain(unit(text).vehicles) == [
        {
            "name": "quad",
            "identity": "quad-07",
            "home": (473_977_400, 85_455_900),
            "within": (50_000, "length"),
            "speed": (12_000, "speed"),
            "climb": (3_000, "speed"),
            "position_error": (3_000, "length"),
            "endurance": (1_080_000_000, "duration"),
            "reserve": (1_500, "ratio"),
            "utc_offset": (-12_600_000_000, "duration"),
        }
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("elevation 408 m above sea", {"elevation": (408_000, "altitude", "sea")}),
        (
            "elevation 408.5 m above sea within 5 m",
            {"elevation": (408_500, "altitude", "sea"), "elevation_within": (5_000, "length")},
        ),
    ],
)
def test_elevation(plain: Plain, unit: Read, text: str, expected: dict[str, Any]) -> None:
    source = f"""vehicle v {{ identity "a" home 1 N, 2 E within 3 m speed at most 1 m/s climb at most 1 m/s {text}
      position error 1 m energy 100 % = 1 min hover reserve 1 % }}"""
    vehicle = plain(unit(source).vehicles[0])
    assert {name: value for name, value in vehicle.items() if name.startswith("elevation")} == expected


def test_parameters(plain: Plain, unit: Read) -> None:
    text = """skill s(
      area: zone, altitude: altitude in 5 m .. 60 m = 20 m, pattern: one of grid, perimeter, orbit = grid,
      mode: one of slow, fast, again: one of x, speed: speed,
    ) { }"""
    assert plain(unit(text).skills[0].parameters) == [
        {"name": "area", "type": "zone"},
        {
            "name": "altitude",
            "type": "altitude",
            "range": {"kind": "range", "low": (5_000, "length"), "high": (60_000, "length")},
            "default": (20_000, "length"),
        },
        {"name": "pattern", "type": "choice", "choices": ["grid", "perimeter", "orbit"], "default": "&grid"},
        {"name": "mode", "type": "choice", "choices": ["slow", "fast"]},
        {"name": "again", "type": "choice", "choices": ["x"]},
        {"name": "speed", "type": "speed"},
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("climb to a", {"kind": "climb", "altitude": "a"}),
        ("fly to t at a", {"kind": "fly", "target": "t", "altitude": "a"}),
        ("fly to t at a speed s", {"kind": "fly", "target": "t", "altitude": "a", "speed": "s"}),
        ("cover t at a", {"kind": "cover", "target": "t", "altitude": "a"}),
        (
            "cover t at a pattern p speed s",
            {"kind": "cover", "target": "t", "altitude": "a", "pattern": "p", "speed": "s"},
        ),
        ("home", {"kind": "home"}),
        ("hold", {"kind": "hold"}),
        ("hold for t", {"kind": "hold", "time": "t"}),
        ("land", {"kind": "land"}),
    ],
)
def test_motion(plain: Plain, unit: Read, text: str, expected: dict[str, str]) -> None:
    assert plain(unit(f"skill s() {{ motion {text} }}").skills[0].motion) == expected


def test_skill(plain: Plain, unit: Read) -> None:
    text = """skill s() {
      record intent, decision  energy at most 18 %
      fallback hover for 20 s, goto(home_entry, altitude = 20 m), land()
      class tactical deadline 2 s valid for 10 min during a, b lasts at most 5 min grace 500 ms
      require a > 1 and b > 2 and (c > 3 or d > 4)
      assume not e == f
      maintain (g < 1 and h < 2)
    }"""
    skill = plain(unit(text).skills[0])
    assert {name: skill[name] for name in skill if name not in ("require", "assume", "maintain")} == {
        "name": "s",
        "timing_class": "tactical",
        "deadline": (2_000_000, "duration"),
        "validity": (600_000_000, "duration"),
        "phases": ["a", "b"],
        "duration": (300_000_000, "duration"),
        "grace": (500_000, "duration"),
        "energy": (1_800, "ratio"),
        "record": ["intent", "decision"],
        "fallback": [
            {"skill": "hover", "limit": (20_000_000, "duration")},
            {
                "skill": "goto",
                "arguments": [{"value": "&home_entry"}, {"name": "altitude", "value": (20_000, "length")}],
            },
            {"skill": "land"},
        ],
    }
    assert [len(skill[name]) for name in ("require", "assume", "maintain")] == [3, 1, 2]
