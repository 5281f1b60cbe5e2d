"""E0705: a link must be permitted in every phase in which a step may need it, and only there."""

import pytest

from reference.sources import found, program, skill
from virtual.rows import rows

BASE = """
  permit return_home, emergency_land by any
  contingency return_home, emergency_land
"""


def refused(*rules: str, valid: str = "for 40 min", base: str = BASE) -> list[str]:
    """Return the findings about links for a policy in which `search` falls back to `listen`."""
    listen = skill("listen()")
    search = skill("search(at: altitude in 5 m .. 50 m)", fallback="listen, return_home, emergency_land", valid=valid)
    lines = "\n".join(f"  {rule}" for rule in rules)
    text = program(listen, search, f"policy rules version 1 {{\n{lines}{base}}}\n")
    return [message for code, message in found(text) if code == "E0705"]


SEARCH = "permit search by role rescuer when {}"
LISTEN = "permit listen by role rescuer when {}"
ALWAYS = "the link `listen` is not always permitted to `rescuer` through `operator`"


@rows(
    ("search", "listen", "expected"),
    [
        ("phase == search", "phase == search", []),
        ("phase == search and battery > 30 %", "phase == search", []),
        ("phase == search", "phase in {search, departure}", []),
        ("phase in {search, departure}", "phase == search", [f"{ALWAYS} in `departure`"]),
        ("battery > 30 %", "phase == search", [f"{ALWAYS} in phases other than `search`"]),
        ("phase != search", "phase == search", [ALWAYS]),
        ("phase != search", "phase != search", []),
        ("phase == search", "phase != search", [ALWAYS]),
        ("phase == search", "phase == search and battery > 30 %", [ALWAYS]),
        ("phase == search and at <= 20 m or phase == departure and at > 60 m", "phase == search", []),
        ("phase == search", "phase == departure or phase == search", []),
    ],
)
def test_link_must_be_permitted_in_the_phases_of_its_step(search: str, listen: str, expected: list[str]) -> None:
    assert refused(SEARCH.format(search), LISTEN.format(listen)) == expected


@pytest.mark.parametrize(
    ("valid", "expected"),
    [
        ("for 40 min during search", []),
        ("for 40 min during search, departure", [f"{ALWAYS} in phases other than `search`"]),
        ("for 40 min during departure", [ALWAYS]),
    ],
)
def test_only_phases_for_which_the_skill_is_valid_count(valid: str, expected: list[str]) -> None:
    assert refused("permit search by role rescuer", LISTEN.format("phase == search"), valid=valid) == expected


def test_forbid_counts_only_in_its_phase() -> None:
    both = "permit search, listen by role rescuer when phase == search"
    assert refused(both, "forbid listen by any when phase == departure") == []
    assert refused(both, "forbid listen by any when phase == search") == [ALWAYS]


def test_degrade_target_must_be_permitted_where_the_rule_applies() -> None:
    both = "permit search, listen by role rescuer when phase == search"
    land = "permit takeoff by role rescuer"
    degrade = "degrade takeoff when battery < 30 % and phase == {} to listen"
    assert refused(both, land, degrade.format("search")) == []
    assert refused(both, land, degrade.format("departure")) == [f"{ALWAYS}"]


def test_contingency_must_be_permitted_in_every_phase() -> None:
    base = "permit return_home, emergency_land by any when phase != search\ncontingency return_home, emergency_land\n"
    assert [message.endswith("in `search`") for message in refused(base=base)] == [True, True]
