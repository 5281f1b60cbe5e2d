"""Units and datum are types: a table of conditions, and what the checker says of each."""

from pathlib import Path

import pytest

from rtshcua.ground.compiler.program import check_program
from rtshcua.ground.language.load import load
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]

SOURCE = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/emergency_land.rts"

signal above.sea : altitude = GLOBAL_POSITION_INT.alt  stale after 2 s
signal satellites : count = GPS_RAW_INT.satellites_visible  stale after 2 s
signal heading : angle = GLOBAL_POSITION_INT.hdg  stale after 2 s

skill probe(
  up:   altitude in 5 m .. 100 m,
  pace: speed in 1 m/s .. 8 m/s,
  aim:  position,
  area: zone,
  look: one of near, far,
  wait: duration in 1 s .. 1 min,
) {
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  maintain CONDITION
  fallback emergency_land
  energy   at most 5 %
}
"""

GOOD = [
    "height <= 30 m",
    "height <= 30 m above home",
    "above.sea <= 500 m above sea",
    "height <= up + 5 m",
    "height <= 5 m + up",
    "height - up < 10 m",
    "above.sea - above.sea < 10 m",
    "obstacle.distance > 2 * 3 m",
    "obstacle.distance > (5 m - 2 m) * 2",
    "30 m >= height",
    "wind.speed < pace",
    "wind.speed < 36 km/h",
    "battery > 30 %",
    "battery in 30 % .. 100 %",
    "satellites >= 6",
    "heading in 10 deg .. 20 deg",
    "wait <= 30 s",
    "gps.fix >= fix_3d",
    "fix_3d <= gps.fix",
    "gps.fix in fix_3d .. ppp",
    "gps.fix in { fix_3d, dgps }",
    "gps.fix != fix_2d",
    "look == near",
    "look in { near, far }",
    "local time in 08:00 .. 18:00",
    "local time in 22:00 .. 06:00",
    "position inside city",
    "position outside grow(school, 20 m)",
    "position inside area",
    "position inside grow(area, 15 m)",
    "area inside city",
    "area outside school",
    "aim inside grow(city, -10 m)",
    "aim outside school",
    "not (battery < 20 % or height > 10 m) and position inside city",
]

BAD = [
    ("height <= 30 s", "E0310"),
    ("height <= 30", "E0310"),
    ("height <= 30 m above sea", "E0311"),
    ("above.sea <= 30 m", "E0311"),
    ("above.sea <= height", "E0311"),
    ("height <= above.sea", "E0311"),
    ("above.sea - height < 10 m", "E0311"),
    ("height + up < 10 m", "E0310"),
    ("height < obstacle.distance", "E0310"),
    ("obstacle.distance < height", "E0310"),
    ("obstacle.distance - height < 3 m", "E0310"),
    ("obstacle.distance < 30 m above home", "E0310"),
    ("battery > 30 m", "E0310"),
    ("battery > 30", "E0310"),
    ("battery in 30 m .. 40 m", "E0310"),
    ("battery in 40 % .. 30 %", "E0316"),
    ("wind.speed < 5 m", "E0310"),
    ("wind.speed < battery", "E0310"),
    ("height * up < 5 m", "E0315"),
    ("gps.fix + 1 < 5", "E0315"),
    ("look + 1 < 5", "E0315"),
    ("gps.fix >= fix_9d", "E0313"),
    ("gps.fix >= near", "E0313"),
    ("gps.fix >= 3", "E0312"),
    ("gps.fix == gps.fix", "E0314"),
    ("gps.fix in { fix_9d }", "E0313"),
    ("gps.fix in 1 .. 3", "E0312"),
    ("look < far", "E0314"),
    ("look in near .. far", "E0314"),
    ("look == grid", "E0313"),
    ("fix_3d == fix_2d", "E0204"),
    ("battery in { near }", "E0314"),
    ("local time < 08:00", "E0314"),
    ("local time in 8 s .. 9 s", "E0312"),
    ("height in 08:00 .. 09:00", "E0312"),
    ("height inside city", "E0317"),
    ("up inside city", "E0317"),
    ("city inside school", "E0317"),
    ("aim inside area", "E0317"),
    ("area inside grow(area, 5 m)", "E0317"),
    ("position inside height", "E0312"),
    ("position inside nowhere", "E0201"),
    ("position inside grow(city, 5 s)", "E0310"),
    ("position < 5 m", "E0314"),
    ("area == city", "E0314"),
    ("city.entry inside city", "E0205"),
    ("bridge_a.entry inside city", "E0317"),
    ("quad > 5 m", "E0204"),
    ("probe > 5 m", "E0204"),
    ("batery > 5 %", "E0201"),
]


def findings(condition: str) -> list[str]:
    def read(path: str) -> bytes:
        return SOURCE.replace("CONDITION", condition).encode() if path == "x.rts" else Path(path).read_bytes()

    return [found.code.id for found in check_program(load(["x.rts"], read, str(CHECKOUT)), dialect.load())]


@pytest.mark.parametrize("condition", GOOD)
def test_it_has_a_meaning(condition: str) -> None:
    assert findings(condition) == []


@pytest.mark.parametrize(("condition", "code"), BAD)
def test_it_has_none_and_a_finding_says_why(condition: str, code: str) -> None:
    assert set(findings(condition)) == {code}
