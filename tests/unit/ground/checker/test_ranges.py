"""Values outside the range of a signal's fields are reported."""

from reference.sources import findings, policy, program
from rtshcua.diagnostics.diagnostic import Diagnostic
from virtual.rows import rows

SIGNALS = """
signal above : length  = DISTANCE_SENSOR.current_distance where orientation = 25  stale after 2 s  // uint16, cm
signal volts : voltage = SYS_STATUS.voltage_battery  stale after 2 s  // uint16, mV
signal load  : ratio   = SYS_STATUS.load  stale after 2 s  // uint16, d%
signal wind  : speed   = WIND_COV.wind_x, WIND_COV.wind_y  stale after 2 s
signal east  : speed   = GLOBAL_POSITION_INT.vx  stale after 2 s  // int16, cm/s
signal air   : speed   = VFR_HUD.airspeed  stale after 2 s  // float
signal seen  : count   = GPS_RAW_INT.satellites_visible  stale after 2 s  // uint8
"""


def beyond(when: str) -> list[Diagnostic]:
    """The findings on values outside a signal's range in a rule's condition."""
    found = findings(program(SIGNALS, policy(f"degrade takeoff when {when} to return_home")))
    return [each for each in found if each.code.id == "E0325"]


@rows(
    ("when", "written"),
    [
        ("battery < 150 %", ["150 %"]),
        ("150 % > battery", ["150 %"]),
        ("battery <= 100 %", []),
        ("battery >= 0 %", []),
        ("battery > -1 %", ["-1 %"]),
        ("battery in 20 % .. 101 %", ["101 %"]),
        ("battery in -5 % .. 101 %", ["-5 %", "101 %"]),
        ("not (height > 10 m and battery != 120 %) for the last 2 s", ["120 %"]),
        ("battery < 150 % for the last 2 s", ["150 %"]),
        ("load <= 100.1 %", ["100.1 %"]),  # the field may say so, and a ratio is at most all
        ("above < 655.35 m", []),
        ("above < 656 m", ["656 m"]),
        ("volts / 4 < 16 V", []),
        ("volts / 4 < 17 V", ["17 V"]),
        ("2 * volts > 131.1 V", ["131.1 V"]),
        ("volts * 50 % < 40 V", ["40 V"]),
        ("-1 * volts > 1 V", ["1 V"]),
        ("volts - 10 V > 56 V", ["56 V"]),
        ("10 V - volts < -56 V", ["-56 V"]),
        ("east < -327.68 m/s", []),
        ("east < -328 m/s", ["-328 m/s"]),
        ("abs(east) < 328 m/s", ["328 m/s"]),
        ("abs(east) > -1 m/s", ["-1 m/s"]),
        ("abs(wind) > -1 m/s", ["-1 m/s"]),
        ("abs(air) > -1 m/s", ["-1 m/s"]),
        ("wind > -1 m/s", ["-1 m/s"]),
        ("wind + air > -1 m/s", []),
        ("wind < 9999 m/s", []),
        ("air > -9999 m/s", []),
        ("min(wind, east) < -328 m/s", ["-328 m/s"]),
        ("min(wind, east) > 328 m/s", ["328 m/s"]),
        ("max(wind, air) > -1 m/s", ["-1 m/s"]),
        ("max(wind, east) > 328 m/s", []),
        ("min(air, wind) > -1 m/s", []),
        ("above / 2 s < 328 m/s", ["328 m/s"]),
        ("above / 300 m < 3", ["3"]),
        ("east * 2 s < 656 m", ["656 m"]),
        ("seen > 256", ["256"]),
        ("seen > 255", []),
        ("wind < east + 5 m/s", []),
        ("gps.fix >= fix_3d", []),
    ],
)
def test_value_outside_a_signal_range_is_reported(when: str, written: list[str]) -> None:
    text = program(SIGNALS, policy(f"degrade takeoff when {when} to return_home"))
    assert [text[each.span.start : each.span.end] for each in beyond(when) if each.span] == written


def test_finding_names_the_range_and_the_nearest_value() -> None:
    (high,), (low,) = beyond("battery < 150 %"), beyond("wind > -1 m/s")
    assert high.message == "`150 %` is above the range of `battery`"
    assert high.help == "its values are from `0 %` to `100 %`; the nearest is `100 %`"
    assert low.message == "`-1 m/s` is below the range of `wind`"
    assert low.help == "its values are from `0 m/s`; the nearest is `0 m/s`"


TESTED = """
nominal base {{
  under rules on quad
  given battery = {}
}}
test "climbs" from base {{
  given battery = {}, gps.fix = fix_2d
  when  takeoff(altitude = 10 m) by role operator
  expect defer because state/unknown
}}
"""


def test_test_premise_must_be_in_the_range_of_its_signal() -> None:
    text = program(policy(), TESTED.format("150 %", "-1 %"))
    found = [(each.code.id, text[each.span.start : each.span.end]) for each in findings(text) if each.span]
    assert [each for each in found if each[0] == "E0325"] == [("E0325", "150 %"), ("E0325", "-1 %")]


def test_template_argument_must_be_in_the_range_of_the_signal() -> None:
    template = "template low(most: ratio in 0 % .. 200 %) { degrade takeoff when battery < most to return_home }\n"
    (found,) = findings(program(template, policy("use low(most = 150 %)")))
    assert found.code.id == "E0325"
    assert found.message == "`150 %` is above the range of `battery`"
