"""Units and datums are types: a table of conditions with their findings."""

from pathlib import Path

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]

SOURCE = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/emergency_land.rts"

signal above.sea : altitude = GLOBAL_POSITION_INT.alt  stale after 2 s
signal satellites : count = GPS_RAW_INT.satellites_visible  stale after 2 s
signal other.place : position = GPS_RAW_INT.lat, GPS_RAW_INT.lon  stale after 2 s
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
    "local time >= 19:00 or local time < 06:00 for the last 3 s",
    "08:00 <= local time and 18:00 > local time",
    "position inside city",
    "position outside grow(school, 20 m)",
    "position inside area",
    "position inside grow(area, 15 m)",
    "area inside city",
    "area outside school",
    "aim inside grow(city, -10 m)",
    "aim outside school",
    "not (battery < 20 % or height > 10 m) and position inside city",
    "obstacle.distance > wind.speed * 3 s",
    "obstacle.distance > 1500 ms * wind.speed",
    "obstacle.distance > pace * (3 * 2 s)",
    "obstacle.distance / 2 m/s > wait",
    "obstacle.distance / 4 s < wind.speed",
    "obstacle.distance / (2 * 3 m) > 1 / 3",
    "wait < 40 m / 4 m/s",
    "wait < 3 * 2 s",
    "height < up * 50 %",
    "height <= 2 * up + 5 m / 3",
    "battery * 2 > 50 %",
    "battery / 2 > 20 % / 3",
    "battery / 20 % > 3 / 2",
    "battery * 25 % < 10 %",
    "height / 3 < 10 m",
    "height / 50 % < 10 m",
    "satellites * 2 >= 12 / 1",
    "satellites / 50 % > 12",
    "abs(height - up) < 5 m",
    "max(height, 20 m) < up",
    "max(20 m, height, up) < 30 m",
    "min(obstacle.distance, 4 m) * 2 > 3 m",
    "abs(wind.speed - pace) in 0 m/s .. 3 m/s / 2",
    "above.sea <= max(500 m above sea, above.sea)",
    "height in 10 m / 3 .. up",
    "max(3, 4) * height < 30 m",
    "position inside grow(city, 3 m * 2)",
    "position inside grow(area, 40 m / 4)",
    "phase == inspection",
    "phase != height",
    "phase in {departure, quad}",
    "not phase == x and battery > 5 %",
    "battery > 30 % for the last 3 s",
    "wind.speed < 5 m/s within the last 10 min",
    "landed == in_air within 5 s of battery > 5 %",
    "rising battery < 30 % or falling gps.fix >= fix_3d within the last 5 s",
    "position outside grow(school, 20 m) for the last 3 s",
    "(battery > 5 % for the last 1 s) within the last 5 s and up < 10 m",
    "local time in 08:00 .. 18:00 for the last 3 s and phase == a",
    "rising position inside city",
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
    ("local time == 08:00", "E0314"),
    ("08:00 != local time", "E0314"),
    ("local time < local time", "E0314"),
    ("07:00 < 08:00", "E0314"),
    ("local time < 8 s", "E0314"),
    ("local time + 8 s < 08:00", "E0315"),
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
    ("wind.speed * pace < 3 m", "E0315"),
    ("obstacle.distance > wind.speed * wait", "E0315"),
    ("obstacle.distance * 3 s > 5 m", "E0315"),
    ("wind.speed * 3 s < 5 m/s", "E0310"),
    ("height < wind.speed * 3 s", "E0310"),
    ("height / 3 m/s < 3 s", "E0315"),
    ("height / 3 m < 3", "E0315"),
    ("battery / 3 m/s < 3", "E0315"),
    ("obstacle.distance / wind.speed < 3 s", "E0322"),
    ("obstacle.distance / 0 < 3 m", "E0322"),
    ("obstacle.distance / (2 s - 2 s) < 3 m/s", "E0322"),
    ("wait < 3 s / 0 %", "E0322"),
    ("satellites * height > 3 m", "E0315"),
    ("min(height, 3 s) < 5 m", "E0310"),
    ("min(height, above.sea) < 5 m", "E0311"),
    ("max(height, obstacle.distance) < 5 m", "E0310"),
    ("abs(gps.fix) < 5", "E0315"),
    ("max(look, far) < 5", "E0201"),
    ("min(position, 3 m) < 5 m", "E0315"),
    ("position inside grow(city, up - up)", "E0318"),
    ("position inside grow(city, obstacle.distance)", "E0318"),
    ("position inside grow(city, 10 m / 3)", "E0302"),
    ("position inside grow(city, 1000 km)", "E1003"),
    ("position inside grow(city, nothing)", "E0201"),
    ("phase == 3 s", "E0323"),
    ("phase == phase", "E0323"),
    ("phase == bridge_a.entry", "E0323"),
    ("inspection == phase", "E0201"),
    ("height == phase", "E0323"),
    ("phase < inspection", "E0323"),
    ("phase in a .. b", "E0323"),
    ("phase + 1 < 3", "E0315"),
    ("height in phase .. 3 m", "E0312"),
    ("phase inside city", "E0317"),
    ("up < 10 m for the last 3 s", "E0320"),
    ("rising (battery > 5 % and not up < 10 m)", "E0320"),
    ("position inside area within the last 3 s", "E0320"),
    ("area inside city for the last 3 s", "E0320"),
    ("phase == inspection for the last 3 s", "E0320"),
    ("battery > 5 % within 3 s of phase in {a, b}", "E0320"),
    ("rising position inside grow(city, 3 m)", "E0320"),
    ("(falling position outside grow(city, 3 m)) within the last 5 s", "E0320"),
    ("battery > 5 % for the last 0 s", "E0321"),
    ("battery > 5 % within the last 601 s", "E0321"),
    ("battery > 5 % within 11 min of landed == in_air", "E0321"),
    ("battery > 5 % for the last 3 m", "E0310"),
    ("battery > 5 m for the last 3 s", "E0310"),
]


def findings(condition: str) -> list[str]:
    def read(path: str) -> bytes:
        return SOURCE.replace("CONDITION", condition).encode() if path == "x.rts" else Path(path).read_bytes()

    return [found.code.id for found in check_program(load(["x.rts"], read, str(CHECKOUT)), dialect.load())]


@rows("condition", GOOD)
def test_valid_condition_has_no_finding(condition: str) -> None:
    assert findings(condition) == []


@rows(("condition", "code"), BAD)
def test_invalid_condition_has_its_finding(condition: str, code: str) -> None:
    assert set(findings(condition)) == {code}


HELPS = [
    ("1.5 * wind.speed < 8 m/s", "a number without a unit must be whole; in a product, write `(3/2)`, or `150 %`"),
    (
        "-/* minus */1.000001 * wind.speed < 8 m/s",
        "a number without a unit must be whole; in a product, write `(1000001/1000000)`",
    ),
    (
        "local time == 08:00",
        "a window, such as `local time in 08:00 .. 08:10`, or a comparison, such as `local time >=",
    ),
    ("local time < 8 s", "compare a time of day with `local time`, as in `local time >= 19:00`"),
    ("area inside area", "write a declared zone instead of `area`, or move the rule into a template"),
    ("aim inside grow(area, 5 m)", "write a declared zone instead of `area`, or move the rule into a template"),
    ("other.place inside city", "rename the signal to `position`"),
    ("height inside city", "use `position`, or an argument that is a position or a zone"),
]


@rows(("condition", "help"), HELPS)
def test_help_names_an_accepted_form(condition: str, help: str) -> None:
    def read(path: str) -> bytes:
        return SOURCE.replace("CONDITION", condition).encode() if path == "x.rts" else Path(path).read_bytes()

    (found,) = check_program(load(["x.rts"], read, str(CHECKOUT)), dialect.load())
    assert help in (found.help or "")


CALLED_PHASE = [
    "signal phase : ratio = BATTERY_STATUS.battery_remaining  stale after 5 s",
    "zone phase = circle(47 N, 8 E, 5 m)",
    "enum modes { phase = 1, other = 2 }",
    "skill s(phase: zone) { motion hold }",
    "skill s(mode: one of phase, other) { motion hold }",
    "template t(phase: zone) { forbid any by any when position inside phase }",
]


@rows("declaration", CALLED_PHASE)
def test_phase_is_a_reserved_name_of_values(declaration: str) -> None:
    def read(path: str) -> bytes:
        return (
            f'import "lib:skills/signals.rts"\n{declaration}'.encode() if path == "x.rts" else Path(path).read_bytes()
        )

    found = check_program(load(["x.rts"], read, str(CHECKOUT)), dialect.load())
    assert any(each.code.id == "E0203" and "`phase` is reserved" in each.message for each in found)
