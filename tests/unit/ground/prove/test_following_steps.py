"""Proofs that follow the vehicle from step to step, by its place and by its charge (E0619 to E0621)."""

import pytest

from reference.sources import found, mission, policy, program, skill
from virtual.rows import rows

UP = "takeoff(altitude = 20 m)"
HOME = "return_home()"
GOTO = "goto(47.39799 N, 8.54559 E, altitude = 20 m)"
SKIP = " on inadmissible skip"


def codes(*steps: str, skills: str = "") -> list[str]:
    return [code for code, _ in found(program(skills, policy(), mission(*steps)))]


@rows(
    ("steps", "expected"),
    [
        ((UP, HOME), []),
        ((UP, GOTO, HOME), []),
        ((UP, "emergency_land()"), []),
        ((HOME,), []),  # a return on the ground does nothing
        ((GOTO, HOME), ["E0619"]),
        (("hover()", UP, HOME), ["E0619"]),
        ((UP, HOME, GOTO, HOME), ["E0619"]),
        ((UP, HOME, UP, HOME), []),  # landed in between
        ((UP, UP, HOME), ["E0619"]),  # `takeoff` requires to be on the ground
        ((UP, GOTO), ["E0621"]),
        ((UP, HOME + SKIP), ["E0621"]),
        ((UP + SKIP, HOME), []),
        ((UP + SKIP, GOTO, HOME), ["E0619"]),
        ((UP, HOME + SKIP, UP, HOME), ["E0619"]),
    ],
)
def test_step_must_be_able_to_begin_where_the_previous_one_ends(steps: tuple[str, ...], expected: list[str]) -> None:
    assert codes(*steps) == expected


@rows(
    ("clause", "expected"),
    [
        ("height >= 20 m", []),
        ("height > 20 m", ["E0619"]),
        ("position inside meadow", []),
        ("position inside school", ["E0619"]),
        ("position inside school or battery > 50 %", []),  # the battery may be above 50 %
        ("landed == in_air", []),
        ("landed in {on_ground, landing}", ["E0619"]),
    ],
)
@rows("kind", ["require", "assume"])
def test_clause_must_be_able_to_hold_at_the_start_of_the_step(clause: str, expected: list[str], kind: str) -> None:
    assert codes(UP, "probe()", HOME, skills=skill("probe()", **{kind: clause})) == expected


@rows(
    ("clause", "where"),
    [
        ("position outside school", ": it fails near 47.39746 N, 8.54690 E"),  # 64 m from its middle, on the way
        ("position inside city and position outside school", ": it fails near 47.39746 N, 8.54690 E"),
        ("position inside school", ": it fails near 47.39774 N, 8.54559 E"),  # where it begins
        ("height < 15 m", ""),  # it fails wherever the vehicle is
    ],
)
def test_message_names_the_place_where_a_clause_fails(clause: str, where: str) -> None:
    top = "top: altitude in 5 m .. 30 m"
    over = skill(f"over(aim: position, {top})", motion="fly to aim at top", maintain=clause, lasts="at most 3 min")
    [(code, message), *_] = found(program(over, policy(), mission(UP, "over(47.39729 N, 8.54771 E, 20 m)", HOME)))
    assert code == "E0616"
    assert message.partition("during the whole step")[2] == where


def test_message_names_a_step_that_may_be_skipped() -> None:
    higher = f"goto(47.39799 N, 8.54559 E, 30 m){SKIP}"
    probe = skill("probe()", require="height > 25 m")
    [(code, message)] = found(program(policy(), probe, mission(UP, higher, "probe()", HOME)))
    assert code == "E0619"
    assert message == "it needs `height > 25 m`, but when this step begins the vehicle may be 20 m up, at home"


def test_skippable_step_must_be_possible_at_one_place() -> None:
    higher = f"goto(47.39799 N, 8.54559 E, 30 m){SKIP}"
    probe = skill("probe()", require="height > 25 m")
    assert codes(UP, higher, "probe()" + SKIP, HOME, skills=probe) == []
    assert codes(UP, "probe()" + SKIP, HOME, skills=probe) == ["E0619"]
    assert codes(UP + SKIP, GOTO + SKIP, HOME) == ["E0619"]  # on board nothing refuses this flight from the ground


def test_skippable_step_may_leave_the_airspace_from_one_of_several_places() -> None:
    around = [f"goto({place}, altitude = 20 m){SKIP}" for place in ("47.39840 N, 8.54820 E", "47.39860 N, 8.54970 E")]
    rules = policy("airspace inside city outside school", contingency="emergency_land")
    east = skill(
        "east(up: altitude in 5 m .. 30 m, aim: position)",
        motion="fly to aim at up",
        fallback="emergency_land",
        lasts="at most 3 min",
        energy="at most 12 %",
    )
    beyond = "east(20 m, 47.39740 N, 8.55000 E)"
    last = "emergency_land()"
    assert [code for code, _ in found(program(east, rules, mission(UP, *around, beyond + SKIP, last)))] == []
    assert [code for code, _ in found(program(east, rules, mission(UP, *around, beyond, last)))] == ["E0508"]


def test_path_from_the_start_of_a_skipped_step_is_proved() -> None:
    around = [f"goto({place}, altitude = 20 m)" for place in ("47.39840 N, 8.54820 E", "47.39860 N, 8.54970 E")]
    city = policy("airspace inside city outside school")
    south = "goto(47.39700 N, 8.54980 E, altitude = 20 m)"
    assert [code for code, _ in found(program(city, mission(UP, *around, HOME)))] == []
    [(code, message), *_] = found(program(city, mission(UP, around[0] + SKIP, around[1] + SKIP, south, HOME)))
    assert (code, message.split(",")[1].strip()) == ("E0508", "which may begin at home")


@pytest.mark.parametrize(("energy", "times", "expected"), [(10, 5, []), (10, 9, ["E0620"]), (1, 40, [])])
def test_charge_is_consumed_step_by_step(energy: int, times: int, expected: list[str]) -> None:
    skills = skill("probe()", energy=f"at most {energy} %", lasts="at most 1 s", deadline="1 s", grace="100 ms")
    assert codes(UP, *["probe()"] * times, HOME, skills=skills) == expected


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("degrade any when battery < 25 % to return_home", []),
        ("degrade any when battery < 27 % to return_home", ["E0620"]),
        ("degrade any when battery < 27 % and wind.speed > 5 m/s to return_home", []),  # the wind may be calm
        ("forbid hover by any when battery < 27 %", ["E0620"]),
        ("forbid hover by any when battery > 99 %", []),  # not for lack of charge
    ],
)
def test_rules_about_the_battery_are_evaluated_with_the_remaining_charge(rule: str, expected: list[str]) -> None:
    text = program(
        policy(rule), skill("probe()", energy="at most 70 %"), mission(UP, "probe()", "hover(1 s)", HOME)
    )  # fmt: skip
    assert [code for code, _ in found(text) if code == "E0620"] == expected


def test_step_without_a_permit_at_the_remaining_charge_is_refused() -> None:
    rules = """policy rules version 1 {
  permit any by any through agent, operator, onboard, reflex when battery > 50 %
  permit return_home, emergency_land by any
  contingency return_home, emergency_land
}
"""
    text = program(rules, skill("probe()", energy="at most 50 %"), mission(UP, "probe()", "hover(1 s)", HOME))
    assert [each for each in found(text) if each[0] == "E0620"] == [
        ("E0620", "only 46 % of the charge may be left when this step begins, and no rule then permits it")
    ]


def test_skippable_step_counts_as_flown_but_is_not_refused() -> None:
    skills = skill("probe()", energy="at most 50 %") + skill("late()", require="battery > 50 %")
    assert codes(UP, "probe()" + SKIP, "late()", HOME, skills=skills) == ["E0620"]
    assert codes(UP, "probe()", "late()" + SKIP, HOME, skills=skills) == []
    assert codes(UP, "probe()", "late() on inadmissible hold", HOME, skills=skills) == ["E0620"]


def test_skippable_step_counts_for_the_energy_of_the_mission() -> None:
    """The step alone has enough charge, but with the chain after it the mission may need more than a full charge."""
    skills = skill("probe()", energy="at most 70 %")
    assert codes(UP, "probe()", GOTO + SKIP, HOME, skills=skills) == ["E0812"]


def test_too_many_start_places_are_reported_as_undecided() -> None:
    gotos = [f"goto(47.397{number} N, 8.54559 E, altitude = 20 m){SKIP}" for number in range(60, 80)]
    assert codes(UP, *gotos[:10], HOME) == []
    assert "E1103" in codes(UP, *gotos, HOME)
