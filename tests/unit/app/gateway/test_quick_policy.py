"""The one-minute policy: it is the policy that its options say, compiles, is formatted, and refuses everything else."""

from pathlib import Path
from typing import Any

import pytest

from rtshcua.app.gateway.quick_policy import QuickRules, allowed_skills, policy_text, start_inside
from rtshcua.app.programs import examine, read_text
from rtshcua.app.propose import Missions
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.geojson import GeoPolygon
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.ground.format.format_text import format_text
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart, StartPlace

HOME = GeoPoint(473_977_400, 85_455_900)
FIELD = GeoPolygon(
    ((85_440_000, 473_967_000), (85_470_000, 473_967_000), (85_470_000, 473_987_000), (85_440_000, 473_987_000)), ()
)
#: with a hole of 30 m beside home
HOLED = GeoPolygon(
    FIELD.outer,
    (((85_460_000, 473_975_000), (85_464_000, 473_975_000), (85_464_000, 473_978_000), (85_460_000, 473_978_000)),),
)
LARGE = GeoPolygon(
    ((85_300_000, 473_900_000), (85_600_000, 473_900_000), (85_600_000, 474_050_000), (85_300_000, 474_050_000)), ()
)
AREAS = {"none": (), "field": (FIELD,), "hole": (HOLED,), "large": (LARGE,)}
ALL = ("takeoff", "goto", "emergency_land")
ALOFT = MissionStart(StartPlace(0, 0, 10_000, aloft=True))


def rules(below_m: int = 30, area: str = "field", allow: tuple[str, ...] = ALL) -> QuickRules:
    return QuickRules(allow, below_m * 1_000, AREAS[area], "gateway-01")


def text_of(of: QuickRules, home: GeoPoint = HOME, return_m: int = 5) -> str:
    text = policy_text(of, home, return_m * 1_000, 7)
    assert isinstance(text, str)
    return text


def missions(folder: Path, of: QuickRules) -> Missions:
    source = folder / "policy.rts"
    source.write_text(text_of(of))
    return Missions([source])


def asked(under: Missions, skill: str, start: MissionStart = FROM_HOME, **arguments: str) -> list[str]:
    """The codes of the findings on one step."""
    specification: dict[str, Any] = {
        "format": "rtshcua/mission-spec",
        "version": 1,
        "name": "asked",
        "policy": {"name": under.policy.name, "version": under.policy.version},
        "vehicle": "copter",
        "proposed_by": {"source": "agent", "name": "test", "role": "operator"},
        "phases": [{"name": "departure", "steps": [{"skill": skill, "arguments": arguments}]}],
    }
    return [each["code"] for each in under.check(specification, 1_780_000_000_000_000, start).rejections]


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("below_m", [5, 30, 120])
def test_each_policy_has_no_finding_and_is_formatted(area: str, below_m: int) -> None:
    text = text_of(rules(below_m, area))
    assert list(examine(read_text("policy.rts", text)).diagnostics) == []
    assert format_text(text) == text


def test_it_permits_what_its_options_say(tmp_path: Path) -> None:
    under = missions(tmp_path, rules())
    assert under.policy.version == 7
    assert asked(under, "takeoff", altitude="30 m") == []
    assert asked(under, "takeoff", altitude="30.1 m") == ["E0605"]
    assert asked(under, "goto", ALOFT, target="47.3977 N, 8.5465 E", altitude="30 m") == []
    assert asked(under, "goto", ALOFT, target="47.3977 N, 8.5465 E", altitude="31 m") == ["E0605"]
    assert asked(under, "goto", ALOFT, target="47.3977 N, 8.5475 E", altitude="20 m") == ["E0703"]
    assert asked(under, "emergency_land", ALOFT) == asked(under, "return_home", ALOFT) == []


def test_a_hole_is_no_part_of_the_area(tmp_path: Path) -> None:
    under = missions(tmp_path, rules(area="hole"))
    assert asked(under, "goto", ALOFT, target="47.3976500 N, 8.5462 E", altitude="20 m") == ["E0703"]
    # behind the hole: the straight way leads through it
    assert asked(under, "goto", ALOFT, target="47.3976500 N, 8.5467 E", altitude="20 m") == ["E0508"]


def test_what_is_not_allowed_is_refused(tmp_path: Path) -> None:
    under = missions(tmp_path, rules(allow=("takeoff",)))
    assert asked(under, "takeoff", altitude="20 m") == []
    assert asked(under, "goto", ALOFT, target="47.3977 N, 8.5465 E", altitude="20 m") != []


def test_legs_of_a_large_area_are_limited(tmp_path: Path) -> None:
    under = missions(tmp_path, rules(120, "large"))
    half = MissionStart(StartPlace(0, 0, 50_000, aloft=True), charge=7_500)
    assert asked(under, "goto", half, target="47.4020 N, 8.5500 E", altitude="50 m") == []
    assert asked(under, "goto", half, target="47.4045 N, 8.5310 E", altitude="50 m", speed="2 m/s") != []


def test_a_vehicle_outside_is_refused_with_its_distance() -> None:
    found = policy_text(rules(), GeoPoint(473_977_400, 85_480_000), 5_000)
    assert isinstance(found, Refusal)
    assert "outside the area: 75" in found.text
    near = policy_text(rules(), GeoPoint(473_977_400, 85_469_600), 5_000)
    assert isinstance(near, Refusal)
    assert "too near to the edge of the area: 3" in near.text
    assert "at least 6 m" in (near.help or "")
    assert isinstance(policy_text(rules(area="hole"), GeoPoint(473_976_500, 85_462_000), 5_000), Refusal)


def test_the_simulated_vehicle_starts_inside() -> None:
    for area in ("field", "hole", "large"):
        assert isinstance(policy_text(rules(area=area), start_inside(AREAS[area]), 5_000), str)


def test_skills_have_other_words() -> None:
    assert allowed_skills("land,goto,take-off") == ("takeoff", "goto", "emergency_land")
    assert allowed_skills("takeoff, RTL, hold") == ("takeoff", "hover", "return_home")
    told = allowed_skills("takeof")
    assert isinstance(told, Refusal)
    assert "did you mean `takeoff`?" in (told.help or "")
    for text in ("", "takeoff,,goto", "orbit", "goto,land"):
        assert isinstance(allowed_skills(text), Refusal)
