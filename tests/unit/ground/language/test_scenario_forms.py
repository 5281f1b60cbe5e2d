"""Scenarios: their IR, and the findings on invalid ones."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.program import Unit
from virtual.rows import rows

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


def test_scenario(unit: Read, plain: Plain) -> None:
    (scenario,) = unit("""
scenario "a dropout over the bridge" {
  flies  standard
  aboard px4, ardupilot
  seeds  1 .. 20
  start  battery = 80 %, wind(speed = 3 m/s, from = 270 deg)
  at 30 s .. 40 s link_silence(for = 5 s, way = up)
  2 s after goto 2 gps_loss()
  when height > 10 m kill()
  2 s .. 4 s after when height > 10 kill()
  after flies kill()
}
""").scenarios
    found = plain(scenario)
    assert {key: found[key] for key in ("name", "mission", "flavours", "seeds", "start")} == {
        "name": {"text": "a dropout over the bridge"},
        "mission": "standard",
        "flavours": ["px4", "ardupilot"],
        "seeds": {"first": (1, "count"), "last": (20, "count")},
        "start": [
            {"kind": "charge", "name": "battery", "value": (8000, "ratio")},
            {
                "kind": "fault",
                "name": "wind",
                "arguments": [
                    {"name": "speed", "value": (3000, "speed")},
                    {"name": "from", "value": (2_700_000_000, "angle")},
                ],
            },
        ],
    }
    s = 1_000_000
    assert [each["moment"].get("delay") for each in found["incidents"]] == [
        {"low": (30 * s, "duration"), "high": (40 * s, "duration")},
        {"low": (2 * s, "duration"), "high": (2 * s, "duration")},
        None,
        {"low": (2 * s, "duration"), "high": (4 * s, "duration")},
        None,
    ]
    assert [each["moment"]["kind"] for each in found["incidents"]] == [
        "at-time",
        "after-step",
        "on-condition",
        "on-condition",
        "after-step",
    ]
    assert found["incidents"][1]["moment"]["number"] == (2, "count")
    assert found["incidents"][3]["moment"]["condition"]["right"] == (10, "count")  # no `kill` is a unit
    assert [each["fault"]["name"] for each in found["incidents"]] == ["link_silence", "gps_loss", *["kill"] * 3]


def test_scenario_expectations(unit: Read, plain: Plain) -> None:
    (scenario,) = unit("""
scenario "it" {
  flies  standard
  expect ends completed, stood_down
  expect fallback return_home because state/violated at "battery > 35 %"
  expect deny
  expect flies hover
  expect never never
  expect reaction <= 200 ms
  expect distance to school >= 20 m
  expect lands in city
  expect fallback at 2 s kill()
}
""").scenarios
    assert plain(scenario)["demands"] == [
        {"kind": "ends", "endings": ["completed", "stood_down"]},
        {
            "kind": "decides",
            "decision": {
                "outcome": "fallback",
                "target": "return_home",
                "reason": "state/violated",
                "clause": {"text": "battery > 35 %"},
            },
        },
        {"kind": "decides", "decision": {"outcome": "deny"}},
        {"kind": "flies", "skill": "hover", "never": False},
        {"kind": "flies", "skill": "never", "never": True},
        {"kind": "reacts", "most": (200_000, "duration")},
        {"kind": "keeps", "place": "school", "least": (20_000, "length")},
        {"kind": "lands", "zone": "city"},
        {"kind": "decides", "decision": {"outcome": "fallback"}},
    ]


def test_single_seed_is_a_range_of_one(unit: Read, plain: Plain) -> None:
    (scenario,) = unit('scenario "it" { flies m seeds 7 }').scenarios
    assert plain(scenario.seeds) == {"first": (7, "count"), "last": (7, "count")}


WRONG = [
    ("flies m flies n", "`flies` is repeated in scenario `it`"),
    ("flies m seeds 1 seeds 2", "`seeds` is repeated in scenario `it`"),
    ("flies m at 20 s kill", "found `kill`, expected a fault, `..` or `above`"),
    ("flies m expect reaction < 20 ms", "found `<`, expected `<=`: a reaction time has an upper bound"),
    ("flies m expect distance to z <= 20 m", "found `<=`, expected `>=`: a distance has a lower bound"),
    ("flies m at 20 s wind(speed = )", None),
    ("flies m seeds 1.5", "`1.5` is not a whole number"),
]


@rows(("body", "message"), WRONG)
def test_invalid_scenario_part_is_reported(body: str, message: str | None) -> None:
    parsed = parse(Source("x.rts", f'scenario "it" {{ {body} }}'))
    assert len(parsed.diagnostics) == 1
    assert message in (None, parsed.diagnostics[0].message)
    assert parsed.unit.scenarios == ()


def test_scenario_must_name_a_mission() -> None:
    parsed = parse(Source("x.rts", 'scenario "it" { at 20 s kill() }\nscenario "next" { flies m }'))
    assert [each.message for each in parsed.diagnostics] == ["scenario `it` lacks `flies`"]
    assert [each.name.text for each in parsed.unit.scenarios] == ["next"]


@pytest.mark.parametrize(
    ("text", "help", "fixed"),
    [
        ('scenario "it" { flies m at 2 s kill }', "a fault needs parentheses, as in `kill(...)`", "kill()"),
        ("scenario it { }", 'a scenario has a quoted name, as in `scenario "gust at the bridge" { ... }`', None),
        ('scenario "it" { flies m expect reaction < 20 ms }', "write `<=`", "<="),
    ],
)
def test_probable_correction_is_offered(text: str, help: str, fixed: str | None) -> None:
    (found,) = parse(Source("x.rts", text)).diagnostics
    assert found.help == help
    if fixed is None:
        assert found.fixes == ()
    else:
        (fix,) = found.fixes
        changed = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
        assert fixed in changed
        assert parse(Source("x.rts", changed)).diagnostics == ()


def test_parsing_continues_after_an_invalid_part() -> None:
    parsed = parse(Source("x.rts", 'scenario "it" {\n  flies m\n  at at at\n  seeds  1\n  expect lands on z\n}\n'))
    assert [each.span.start for each in parsed.diagnostics if each.span] == [31, 63]
    unclosed = parse(Source("x.rts", 'scenario "it" {\n  flies m\nscenario "next" { flies m }'))
    assert [each.name.text for each in unclosed.unit.scenarios] == ["next"]


def test_keywords_of_scenarios_are_names_elsewhere(unit: Read) -> None:
    words = ["scenario", "flies", "aboard", "seeds", "start", "ends", "never", "reaction", "distance", "lands"]
    made = unit("".join(f"zone {word} = circle(47 N, 8 E, 20 m)\n" for word in words))
    assert [zone.name.text for zone in made.zones] == words
