"""Proofs about zones that exist only at times, with and without a time of issue."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.sources import LIBRARY, mission, policy, program
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

MINUTE = 60_000_000
DAY = 1_440 * MINUTE
#: 2026-06-01, midnight UTC: 02:00 at the vehicle
MIDNIGHT = 20_605 * DAY
#: 08:00 at the vehicle
EIGHT = MIDNIGHT + 6 * 60 * MINUTE
#: 100 m north of home, and 100 m further
TO, BEYOND = "47.39864 N, 8.54559 E", "47.39954 N, 8.54559 E"
FLIGHT = mission("takeoff(20 m)", f"goto({TO}, 20 m)", "return_home()")


def zone(at: str = TO, radius: int = 30, name: str = "works", active: str = "") -> str:
    return f"zone {name} = circle({at}, {radius} m) {active}\n"


def codes(text: str, issued_at_us: int = 0) -> list[str]:
    """Return the codes found by compiling for a time of issue, or by checking without one."""

    def read(path: str) -> bytes:
        return text.encode() if path == "probe.rts" else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    if not issued_at_us:
        found = check_program(loaded, dialect.load())
    else:
        found = compile_program(loaded, dialect.load(), mission=None, issued_at_us=issued_at_us).diagnostics
    return [each.code.id for each in found]


def under(airspace: str, *zones: str, rules: Sequence[str] = (), flight: str = FLIGHT) -> str:
    return program(*zones, policy(*rules, f"airspace {airspace}"), flight)


ALL_DATES = 'active "2020-01-01T00:00Z" .. "2040-01-01T00:00Z"'
OLD_DATES = 'active "2020-01-01T00:00Z" .. "2021-01-01T00:00Z"'


@rows(
    ("active", "issued", "expected"),
    [
        ("", 0, ["E0508"]),
        (ALL_DATES, EIGHT, ["E0508"]),
        (OLD_DATES, EIGHT, []),
        (ALL_DATES, 0, []),  # dates are not considered without a time of issue
        ("active 08:00 .. 16:00", EIGHT, ["E0508"]),
        ("active 08:06 .. 16:00", EIGHT, ["E0508"]),  # it begins before the goto must have ended
        ("active 17:00 .. 07:00", EIGHT, []),
        ("active 17:00 .. 07:59", EIGHT, []),
        ("active 08:00 .. 16:00", 0, []),  # another time of issue suits
        ("active 08:05 .. 08:01", 0, ["E0718"]),  # the window is too short for any time of issue
    ],
)
def test_outside_zone_counts_whenever_it_may_exist(active: str, issued: int, expected: list[str]) -> None:
    assert codes(under("inside city outside works", zone(active=active)), issued) == expected


@rows(
    ("active", "issued", "expected"),
    [
        (ALL_DATES, EIGHT, []),
        (OLD_DATES, EIGHT, ["E0508"]),
        (OLD_DATES, 0, []),
        ("active 07:00 .. 16:00", EIGHT, []),
        ("active 07:00 .. 08:07", EIGHT, ["E0514", "E0508"]),
        ("active 09:00 .. 16:00", EIGHT, ["E0508"]),
        ("active 09:00 .. 16:00", 0, []),
        ("active 09:00 .. 09:05", 0, ["E0718"]),
    ],
)
def test_inside_zone_is_missing_whenever_it_may_not_exist(active: str, issued: int, expected: list[str]) -> None:
    assert codes(under("inside works", zone(radius=300, active=active)), issued) == expected


@rows("active", [ALL_DATES, "active 08:00 .. 16:00", "active 08:12 .. 16:00"])
def test_timed_zone_counts_for_the_way_home(active: str) -> None:
    # the steps fly around the zone, but the straight way home from the second place crosses it
    around = mission(
        "takeoff(20 m)",
        "goto(47.39864 N, 8.54659 E, 20 m)",
        f"goto({BEYOND}, 20 m)",
        "goto(47.39864 N, 8.54459 E, 20 m)",
        "return_home()",
    )
    text = under("inside city outside works", zone(radius=20, active=active), flight=around)
    assert codes(text, EIGHT) == ["E0514"]
    assert codes(under("inside city outside works", zone(radius=20, active=OLD_DATES), flight=around), EIGHT) == []


@rows(
    ("rule", "active", "issued", "expected"),
    [
        ("permit goto by any when target outside works", ALL_DATES, EIGHT, ["E0703"]),
        ("permit goto by any when target outside works", OLD_DATES, EIGHT, []),
        ("permit goto by any when target inside works", ALL_DATES, EIGHT, []),
        ("permit goto by any when target inside works", OLD_DATES, EIGHT, ["E0703"]),
        ("permit goto by any when target inside works", OLD_DATES, 0, []),
        ("permit goto by any when target inside works", "active 07:00 .. 16:00", EIGHT, []),
        ("permit goto by any when target inside works", "active 09:00 .. 16:00", EIGHT, ["E0718"]),
        # dates of an unrelated zone do not affect the hours of another
        ("permit goto by any when target inside works and local time in 08:00 .. 08:02", ALL_DATES, 0, ["E0718"]),
    ],
)
def test_permit_about_a_timed_zone_depends_on_the_time_of_issue(
    rule: str, active: str, issued: int, expected: list[str]
) -> None:
    permits = f"permit takeoff, hover, return_home, emergency_land by any\n  {rule}"
    rules = f"policy rules version 1 {{\n  {permits}\n  contingency return_home, emergency_land\n}}\n"
    assert codes(program(zone(active=active), rules, FLIGHT), issued) == expected


def ranging(*steps: str) -> str:
    """Return a mission with a height from 5 m to 40 m."""
    return mission(*steps).replace("mission flight", "mission flight(height: altitude in 5 m .. 40 m = 5 m)")


@rows(
    ("airspace", "active", "expected"),
    [
        # at night all heights are permitted, by day not those between; the airspace requires one of the two
        ("inside works", "active 18:00 .. 08:00", []),
        ("inside works", "active 08:00 .. 18:00", ["E0718"]),
        ("inside city outside works", "active 08:00 .. 18:00", []),
        ("inside city outside works", "active 18:00 .. 08:00", ["E0718"]),
        ("inside works", ALL_DATES, []),
    ],
)
def test_parameter_range_and_airspace_need_a_common_time_of_issue(
    airspace: str, active: str, expected: list[str]
) -> None:
    rules = f"""policy rules version 1 {{
  permit takeoff by any when altitude < 15 m or altitude > 25 m or local time in 19:00 .. 07:00
  permit goto, hover, return_home, emergency_land by any
  contingency return_home, emergency_land
  airspace {airspace}
}}
"""
    flight = ranging("takeoff(height)", f"goto({TO}, 20 m)", "return_home()")
    assert codes(program(zone(radius=300, active=active), rules, flight)) == expected


@rows(
    ("active", "expected"),
    [
        (ALL_DATES, []),
        (OLD_DATES, []),  # dates are not considered without a time of issue
        ("active 07:00 .. 16:00", []),
        ("active 08:00 .. 08:02", ["E0718"]),
    ],
)
def test_zone_times_apply_to_values_between_instances(active: str, expected: list[str]) -> None:
    rules = """policy rules version 1 {
  permit takeoff, hover, return_home, emergency_land by any
  permit goto by any when altitude < 15 m or altitude > 25 m or target inside works
  contingency return_home, emergency_land
}
"""
    flight = ranging("takeoff(20 m)", f"goto({TO}, height)", "return_home()")
    assert codes(program(zone(active=active), rules, flight)) == expected


@rows("band", ["ceiling 25 m", "floor 30 m ceiling 60 m"])
@rows("hours", ["19:00 .. 07:00", "09:00 .. 17:00"])
def test_zone_on_the_path_of_one_value_applies_to_values_between(band: str, hours: str) -> None:
    # only the lowest or the greatest height is in the zone; the heights between need the night or the day
    rules = f"""policy rules version 1 {{
  permit takeoff, hover, return_home, emergency_land by any
  permit goto by any when altitude < 6 m or altitude > 39 m or local time in {hours}
  contingency return_home, emergency_land
  airspace outside works
}}
"""
    flight = ranging("takeoff(height)", f"goto({TO}, height)", "return_home()")
    found = codes(program(zone(active=f"{band} active 08:00 .. 18:00"), rules, flight))
    assert found == ([] if hours.startswith("19") else ["E0718"])


PROBE = """
skill probe(over: zone, up: altitude in 5 m .. 50 m) {
  motion   climb to up
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  maintain position inside over and height <= 30 m
  fallback return_home, emergency_land
  energy   at most 5 %
}
"""


@rows("active", ["", "active 08:00 .. 16:00", ALL_DATES])
@rows("issued", [0, EIGHT])
def test_unrelated_zone_hides_no_finding(active: str, issued: int) -> None:
    flight = mission("probe(yard, 40 m)", "return_home()")
    yard, elsewhere = zone(radius=200, name="yard"), zone("47.3999 N, 8.5500 E", 20, "elsewhere", active)
    assert codes(program(yard, elsewhere, PROBE, policy(), flight), issued) == ["E0616"]
    ground = mission("probe(elsewhere, 20 m)", "return_home()")
    assert codes(program(yard, elsewhere, PROBE, policy(), ground), issued) == ["E0616"]


def test_maintain_clause_uses_the_times_of_its_own_zone() -> None:
    flight = mission("probe(yard, 20 m)", "return_home()")

    def of(active: str, issued: int) -> list[str]:
        return codes(program(zone(radius=200, name="yard", active=active), PROBE, policy(), flight), issued)

    assert of("active 07:00 .. 16:00", EIGHT) == of("active 07:00 .. 16:00", 0) == of(ALL_DATES, EIGHT) == []
    assert of("active 08:00 .. 08:04", EIGHT) == of("active 09:00 .. 16:00", EIGHT) == of(OLD_DATES, EIGHT) == ["E0616"]
    assert of("active 08:00 .. 08:04", 0) == ["E0718"]
    assert of(OLD_DATES, 0) == []


def test_signal_in_a_condition_does_not_hide_a_known_place() -> None:
    """The signal is assumed to favour the step, but the place of the path is known."""
    skill = PROBE.replace("position inside over and height <= 30 m", "position inside over or battery > 99 %")
    flight = mission("probe(yard, 20 m)", "return_home()")
    assert codes(program(zone(radius=20, name="yard"), skill, policy(), flight)) == []
    hidden = PROBE.replace("position inside over and", "not (position outside over or battery < 5 %) and")
    assert codes(program(zone(radius=20, name="yard"), hidden, policy(), flight)) == ["E0616"]


# ---------------------------------------------------------------------------------------------------- properties

CLOCK = st.tuples(st.integers(0, 23), st.integers(0, 59)).map(lambda at: f"{at[0]:02}:{at[1]:02}")
ACTIVE = st.one_of(
    st.tuples(CLOCK, CLOCK).filter(lambda both: both[0] != both[1]).map(lambda both: f"active {both[0]} .. {both[1]}"),
    st.sampled_from([ALL_DATES, OLD_DATES, 'active "2026-06-01T06:10Z" .. "2026-06-01T07:00Z"']),
)
PLACES = st.tuples(st.integers(-12, 12), st.integers(-12, 12)).map(
    lambda at: f"{47.39774 + at[1] * 1e-4:.5f} N, {8.54559 + at[0] * 1.5e-4:.5f} E"
)
FLIGHTS = st.lists(PLACES, min_size=1, max_size=3).map(
    lambda places: mission("takeoff(20 m)", *(f"goto({each}, 20 m)" for each in places), "return_home()")
)
ISSUED = st.sampled_from([0, EIGHT, MIDNIGHT])


@pytest.mark.hypothesis
@settings(deadline=None, max_examples=8)
@given(FLIGHTS, PLACES, st.integers(10, 90), ACTIVE, ISSUED)
def test_times_of_an_outside_zone_hide_no_finding(flight: str, at: str, radius: int, active: str, issued: int) -> None:
    without = codes(under("inside city outside school", flight=flight), issued)
    timed = codes(under("inside city outside school, works", zone(at, radius, active=active), flight=flight), issued)
    always = codes(under("inside city outside school, works", zone(at, radius), flight=flight), issued)
    assert bool(timed) >= bool(without)
    assert bool(always) >= bool(timed)


@pytest.mark.hypothesis
@settings(deadline=None, max_examples=8)
@given(FLIGHTS, PLACES, st.integers(60, 400), ACTIVE, ISSUED)
def test_times_of_an_inside_zone_hide_no_finding(flight: str, at: str, radius: int, active: str, issued: int) -> None:
    without = codes(under("inside city", flight=flight), issued)
    timed = codes(under("inside city, works", zone(at, radius, active=active), flight=flight), issued)
    always = codes(under("inside city, works", zone(at, radius), flight=flight), issued)
    assert bool(timed) >= bool(without)
    assert bool(timed) >= bool(always)
