"""Lint rules about the decisions of a policy: their findings, and cases without a finding."""

import pytest

from reference.linted import HEAD, decided
from virtual.rows import rows

SKILLS = HEAD + "".join(f'import "lib:skills/{name}.rts"\n' for name in ("takeoff", "hover", "goto", "inspect_area"))
SAFE = "permit hover, return_home, emergency_land by any contingency return_home, emergency_land"


def codes(rules: str, declarations: str = "") -> list[str]:
    found = decided(f"{SKILLS}{declarations}\nrole supervisor, trainee policy p version 1 {{ {rules} {SAFE} }}")
    return sorted(code for code, _ in found if code not in ("E1301", "E1305"))


# ---------------------------------------------------------------------------------------------------- E1306

WORLD = """
vehicle equipped {
  identity "quad-08"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  brakes from 12 m/s in 6 s after 500 ms  return at 30 m  reserve 15 %
  clock utc +02:00
}
zone wide = polygon(46.7 N, 7.5 E, 46.7 N, 9.5 E, 48.0 N, 9.5 E, 48.0 N, 7.5 E)
zone world = circle(47.3977 N, 8.5456 E, 100 km) ceiling 2 km above home
zone near = circle(47.3977 N, 8.5456 E, 12 km)
"""
ALL = "permit takeoff by any when altitude <= 40 m permit takeoff by any when altitude > 30 m"


@pytest.mark.slow
@rows(
    ("rules", "gates"),
    [
        (ALL, False),
        ("permit takeoff by any when altitude <= 40 m", True),
        (ALL.replace("by any when altitude > 30 m", "by any when altitude > 50 m"), True),
        (ALL.replace("takeoff by any when altitude > 30 m", "takeoff by role operator when altitude > 30 m"), True),
        (ALL.replace("by any when altitude > 30 m", "by any through agent when altitude > 30 m"), True),
        (f"{ALL} airspace inside city", True),
        (f"{ALL} forbid takeoff by any when wind.speed > 9 m/s", True),
        (f"{ALL} confirm takeoff when altitude > 20 m by role supervisor within 30 s", True),
        (f"{ALL} degrade any when battery < 25 % to return_home", True),
        ("permit takeoff by any when wind.speed < 9 m/s permit takeoff by any when wind.speed >= 9 m/s", False),
        (f"{ALL} permit goto by role operator when altitude <= 30 m", True),  # another skill is restricted
        ("", True),  # no moving skill is permitted
        ("permit takeoff by any when altitude >= 0 m and altitude <= 60 m", False),
        ("permit takeoff by any when altitude > 3 m", True),  # 3 m is the least possible value
        ("permit goto by any when target inside wide", False),
        ("permit goto by any when target inside world and height < 9 km", False),
        ("permit goto by any when target inside wide or target inside city", False),
        ("permit goto by any when target inside city", True),
        ("permit goto by any when not target inside world", True),
        ("permit goto by any when position inside wide", False),
        ("permit goto by any when position inside world", True),  # the vehicle climbs at most 3.2 km
        ("permit goto by any when position inside near", True),
        ("permit takeoff by any when wind.speed >= 0 m/s", False),
        ("permit takeoff by any when wind.speed > 0 m/s", True),
        ("permit takeoff by any when height <= 100 km", False),
        ("permit takeoff by any when height <= 1 km", True),
        ("permit takeoff by any when local time in 00:00 .. 23:59", False),
        ("permit takeoff by any when local time in 00:01 .. 23:59", True),
        ("permit takeoff by any when local time on monday .. sunday", False),
        ("permit takeoff by any when local time in 00:00 .. 23:59 on monday .. saturday", True),
        ("permit takeoff by any when local time on monday .. friday or local time on saturday, sunday", False),
        ("permit takeoff by any when battery > 0 %", False),
        ("permit takeoff by any when battery > 15 %", True),
        ("permit takeoff by any when battery > 0 % degrade any when battery < 5 % to return_home", True),
        ("permit takeoff by any when battery > 0 % degrade any when battery < 0 % to return_home", False),
        ("permit takeoff by any when battery > 0 % forbid takeoff by any when height > 90 km", False),
        ("permit takeoff by any when battery > 0 % for the last 5 s", True),
        ("permit takeoff by any when phase is departure", True),
        ("permit takeoff by any when gps.fix >= fix_3d", False),  # lower fix types count as unknown
        ("permit takeoff by any when gps.fix >= rtk_fixed", True),
        (f"{ALL} airspace inside wide", False),
        (f"{ALL} airspace inside wide outside school", True),
        (f"{ALL} airspace inside near", True),
    ],
)
def test_policy_that_restricts_nothing_is_reported(rules: str, gates: bool) -> None:
    found = codes(rules, WORLD)
    assert ("E1306" not in found) == gates, found


def test_last_minute_of_the_day_is_ignored() -> None:
    world = WORLD.replace("clock utc +02:00", 'clock "Europe/Zurich"')
    for times, gates in (("in 00:00 .. 23:59", False), ("in 00:01 .. 23:59", True), ("on monday .. sunday", False)):
        assert ("E1306" not in codes(f"permit takeoff by any when local time {times}", world)) == gates, times


# ---------------------------------------------------------------------------------------------------- E1307

FAR, NEAR = "circle(47.5990 N, 8.5456 E, 100 m)", "circle(47.4090 N, 8.5456 E, 100 m)"
BOX = "polygon(47.599 N, 8.545 E, 47.599 N, 8.546 E, 47.598 N, 8.546 E, 47.598 N, 8.545 E)"
WIDE = "polygon(46.7 N, 7.5 E, 46.7 N, 9.5 E, 48.0 N, 9.5 E, 48.0 N, 7.5 E)"


@pytest.mark.slow
@rows(
    ("zone", "airspace", "idle"),
    [
        (FAR, "inside city outside far", True),
        (BOX, "inside city outside far", True),
        (NEAR, "outside far", False),
        (BOX.replace("47.59", "47.49"), "outside far", False),  # 11 km away, of 13 within reach
        ("circle(47.3977 N, 8.5456 E, 20 km)", "inside far", True),
        ("circle(47.3977 N, 8.5456 E, 20 km) ceiling 50 m", "inside far", False),
        ("circle(47.3977 N, 8.5456 E, 20 km) active 08:00 .. 18:00", "inside far", False),
        ("circle(47.3977 N, 8.5456 E, 12 km)", "inside far", False),
        ("circle(47.5990 N, 8.5456 E, 22 km)", "inside city outside far", False),
        (WIDE, "inside far", True),
        (WIDE.replace("48.0", "47.5"), "inside far", False),  # 11 km to the north, of 13 within reach
        (f"{WIDE} ceiling 10 km above home", "inside far", True),
        (f"{WIDE} ceiling 3 km above home", "inside far", False),
        (f"{WIDE} floor -20 km above home", "inside far", True),
        (f"{WIDE} floor -100 m above home", "inside far", False),
        ("union(wide, home)", "inside far", True),
        ("difference(wide, home)", "inside far", False),
        (f"{NEAR} floor 5 km above home", "inside city outside far", True),
        (f"{NEAR} floor 3 km above home", "inside city outside far", True),  # the city ends at 120 m
        (f"{NEAR} floor 3 km above home", "outside far", False),
        (NEAR, "inside city outside far", True),  # within reach, and north of the city
        ("circle(47.3977 N, 8.5800 E, 300 m)", "inside city outside far", True),  # within reach, 2 km from the city
        ("circle(47.3977 N, 8.5800 E, 300 m)", "outside far", False),
        ("circle(47.3977 N, 8.5800 E, 300 m) active 08:00 .. 18:00", "inside city outside far", True),
        ("circle(47.3977 N, 8.5530 E, 300 m)", "inside city outside far", False),  # it reaches into the city
        ("circle(47.3977 N, 8.5456 E, 100 m) floor 119 m above home", "inside city outside far", False),
        ("circle(47.3977 N, 8.5456 E, 100 m) floor 120 m above home", "inside city outside far", True),
        ("difference(wide, city)", "inside city outside far", True),
    ],
)
def test_airspace_zones_without_effect_are_reported(zone: str, airspace: str, idle: bool) -> None:
    others = f"zone wide = {WIDE} zone home = circle(47.3977 N, 8.5456 E, 1 km)"
    found = codes(f"permit takeoff by role operator airspace {airspace}", f"{others} zone far = {zone}")
    assert ("E1307" in found) == idle, found


# ---------------------------------------------------------------------------------------------------- E1308


@pytest.mark.slow
@rows(
    ("rules", "bounded"),
    [
        ("permit goto by role operator", False),
        ("permit inspect_area by role operator airspace outside school", False),
        ("permit goto by role operator airspace inside city", True),
        ("permit goto by role operator when target inside city", True),
        ("permit goto by role operator when battery > 50 %", True),  # any bound is accepted
        ("permit goto by role operator forbid goto by any when target inside school", True),
        ("permit goto by role operator forbid any by any when battery < 40 %", True),
        ("permit takeoff by role operator", True),  # it has no place argument
        ("permit goto by role operator airspace inside wide", False),
        ("permit goto by role operator airspace inside wide, city", True),
        ("permit goto by role operator when altitude >= 0 m", False),
        ("permit goto by role operator through agent, operator when battery > 0 %", False),
        ("permit goto by role operator when target inside wide", False),
        ("permit goto by role operator when altitude <= 30 m", False),
        ("permit goto by role operator when altitude <= 30 m airspace outside school", False),
        ("permit goto by role operator when altitude <= 30 m and height < 20 m airspace outside school", False),
        ("permit goto by role operator when altitude <= 30 m airspace inside city outside school", True),
        ("permit goto by role operator when altitude <= 30 m and target inside city airspace outside school", True),
        ("permit goto by role operator when altitude <= 30 m forbid goto by any when target outside city", True),
        ("permit goto by role operator when altitude <= 30 m and battery > 50 % airspace outside school", True),
        ("permit inspect_area by role operator when altitude <= 30 m airspace outside school", False),
        (
            "permit goto by role operator when altitude <= 30 m permit goto by role supervisor when target inside city",
            False,
        ),
        ("permit goto by role operator when altitude >= 0 m forbid goto by any when altitude < 0 m", False),
        ("permit goto by role operator when altitude >= 0 m forbid goto by any when altitude < 6 m", False),
        ("permit goto, inspect_area by role operator when altitude <= 60 m", False),
    ],
)
def test_permit_without_a_bound_on_the_place_is_reported(rules: str, bounded: bool) -> None:
    found = codes(rules, WORLD)
    assert ("E1308" not in found) == bounded, found


# ---------------------------------------------------------------------------------------------------- E1312

SITTING = "skill sit() { motion land class tactical deadline 9 s valid for 9 min lasts at most 9 s energy at most 1 % }"


@rows(
    ("rules", "how_many"),
    [
        ("degrade any when battery < 25 % to return_home", 1),
        ("degrade any when battery < 25 % to hover", 1),
        ("degrade any when battery < 25 % to emergency_land", 0),
        ("degrade any when battery < 25 % to sit", 0),
        ("degrade takeoff, hover when battery < 25 % to return_home", 0),
        ("degrade sit, emergency_land, hover when battery < 25 % to return_home", 2),
        ("degrade emergency_land when battery < 25 % to sit", 0),
        ("degrade any when wind.speed > 9 m/s to hover degrade any when battery < 25 % to return_home", 2),
    ],
)
def test_degrade_that_replaces_a_landing_is_reported(rules: str, how_many: int) -> None:
    assert codes(f"permit sit by any {rules}", SITTING).count("E1312") == how_many


# ---------------------------------------------------------------------------------------------------- E1303


@rows(
    ("rules", "broad"),
    [
        ("permit takeoff by role operator through agent, operator", False),
        ("permit takeoff by role operator through agent, operator, onboard", True),
        ("permit takeoff by role operator through agent, onboard when altitude < 20 m", False),
        ("permit takeoff by role operator through agent, onboard when altitude < 90 m", True),
        ("permit takeoff by any when altitude >= 0 m", True),
        ("permit takeoff by any when altitude >= 5 m", False),
        ("permit goto by any when target inside wide permit takeoff by role operator when altitude <= 30 m", True),
        ("permit goto by any when target inside near", False),
        ("permit hover by role operator through agent, operator, onboard", False),
        ("permit takeoff by role operator delegate any by role operator to role trainee", True),
        ("permit takeoff by role operator delegate takeoff by role operator to role trainee", False),
        ("permit takeoff by role operator delegate any by role operator to role trainee when battery > 50 %", False),
    ],
)
def test_broad_permit_is_reported_with_lowered_policies(rules: str, broad: bool) -> None:
    assert ("E1303" in codes(f"{rules} airspace inside city", WORLD)) == broad


# ---------------------------------------------------------------------------------------------------- E1313

ON = "vehicle equipped"  # tuned to estimate the wind


@pytest.mark.slow
@rows(
    ("rules", "grounded"),
    [
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s", True),
        ("permit takeoff, goto by role operator forbid takeoff, goto by any when wind.speed > 8 m/s", True),
        ("permit takeoff by role operator forbid takeoff by any when not wind.speed <= 8 m/s", True),
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s or battery < 30 %", True),
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s and height > 10 m", False),
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s and altitude > 30 m", False),
        ("permit takeoff by role operator forbid goto by any when wind.speed > 8 m/s", False),
        ("permit takeoff by role operator forbid takeoff by any when battery < 50 %", False),
        ("permit takeoff by role operator forbid takeoff by any", False),  # it never flies, by another rule
        ("permit takeoff by role operator degrade takeoff when wind.speed > 8 m/s to return_home", True),
        ("permit takeoff by role operator degrade takeoff when wind.speed > 8 m/s to return_home where fitted", True),
        ("permit goto by role operator degrade goto when wind.speed > 8 m/s to return_home", False),
        (
            "permit takeoff by role operator confirm takeoff when wind.speed > 8 m/s by role supervisor within 30 s",
            True,
        ),
        ("permit takeoff by role operator when wind.speed < 8 m/s", True),
        ("permit takeoff by role operator when wind.speed < 8 m/s permit takeoff by role supervisor", False),
        ("permit takeoff by role operator when wind.speed < 8 m/s or battery > 50 %", False),
        ("permit goto by role operator when wind.speed < 8 m/s", False),
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s for the last 5 s", True),
        ("permit takeoff by role operator forbid takeoff by any when wind.speed > 8 m/s within the last 5 s", True),
        ("permit takeoff by role operator when not wind.speed > 8 m/s within the last 5 s", True),
        ("permit takeoff by role operator when rising wind.speed > 8 m/s", True),
        ("permit takeoff by role operator forbid takeoff by any when falling wind.speed > 8 m/s", True),
        (
            "permit takeoff by role operator "
            "forbid takeoff by any when (wind.speed > 8 m/s for the last 5 s) within the last 20 s",
            True,
        ),
        ("permit takeoff by role operator forbid takeoff by any when battery < 50 % for the last 5 s", False),
        (
            "permit takeoff by role operator "
            "forbid takeoff by any when wind.speed > 8 m/s and height > 10 m for the last 5 s",
            False,
        ),
        (
            "permit takeoff by role operator "
            "forbid takeoff by any when (wind.speed > 8 m/s and height > 10 m) for the last 5 s",
            False,
        ),
        (
            "permit takeoff by role operator forbid takeoff by any when rising (wind.speed > 8 m/s and height > 10 m)",
            False,
        ),
    ],
)
def test_rule_that_prevents_every_take_off_is_reported(rules: str, grounded: bool) -> None:
    found = codes(rules, WORLD)
    assert ("E1313" in found) == grounded, found


@rows(
    ("clause", "grounded"),
    [
        ("require wind.speed < 8 m/s where fitted", True),
        ("assume wind.speed < 8 m/s where fitted", True),
        ("require battery > 40 %", False),
        ("require wind.speed < 8 m/s or height < 5 m where fitted", False),
    ],
)
def test_contract_that_prevents_every_take_off_is_reported(clause: str, grounded: bool) -> None:
    rise = (
        "skill rise(top: altitude in 5 m .. 50 m) { motion climb to top class tactical deadline 5 s valid for 40 min "
        f"lasts at most 1 min {clause} fallback return_home, emergency_land energy at most 5 % }}"
    )
    found = codes("permit rise by role operator", WORLD + rise)
    assert ("E1313" in found) == grounded, found
