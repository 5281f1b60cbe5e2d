"""Sizes: a contract with sizes equals one with written numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from reference.sources import IMPORTS, found, policy
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Checked, examine_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import Contract
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
PROBE = """
skill probe(
  altitude: altitude in 5 m .. highest,
  time:     duration in 1 s .. longest - 5 s = 10 s,
) sizes (
  highest: altitude in 10 m .. 200 m = 50 m,
  longest: duration in 30 s .. 5 min = 1 min,
  share: ratio in 1 % .. 50 % = 9 %,
) {
  motion   climb to altitude
  class    tactical
  deadline 5 s
  valid    for longest during departure
  lasts    at most longest
  grace    1 s
  maintain height <= highest + 5 m
  fallback return_home, emergency_land
  energy   at most share
}
"""
GIVEN = {"highest": "120 m", "longest": "2 min", "share": "20 %"}
RULES = policy().replace("permit any by any", "permit probe, return_home, emergency_land by any")
ON_WHICH = """
mission m under rules@1 on quad {
  proposed by operator ada for role operator
  phase departure { probe(20 m) }
  phase back      { return_home() }
}
"""


def examined(files: Mapping[str, str], first: str) -> Checked:
    def read(path: str) -> bytes:
        return files[path].encode() if path in files else Path(path).read_bytes()

    return examine_program(load([first], read, str(CHECKOUT)), dialect.load())


def contract(text: str, name: str = "probe") -> Contract:
    checked = examined({"probe.rts": text}, "probe.rts")
    assert not has_errors(checked.diagnostics), checked.diagnostics
    return next(each for each in checked.policies[0].policy.contracts if each.name == name)


def numbers(one: Contract) -> Any:
    """A contract without spans and texts."""
    clauses = [[each.code for each in part] for part in (one.require, one.assume, one.maintain)]
    return clauses, one.parameters, one.deadline_us, one.validity_us, one.duration_us, one.grace_us, one.energy


@pytest.mark.parametrize("given", [{}, GIVEN])
def test_sized_contract_equals_one_with_written_numbers(given: dict[str, str]) -> None:
    values = {"highest": "50 m", "longest": "1 min", "share": "9 %"} | given
    plain, _, rest = PROBE.partition(" sizes (")
    plain += rest[rest.index(") {") + 1 :]
    for name, value in values.items():
        plain = plain.replace(name, value)
    sizes = f"sizes probe({', '.join(f'{name} = {value}' for name, value in given.items())})\n" if given else ""
    assert numbers(contract(IMPORTS + PROBE + sizes + RULES)) == numbers(contract(IMPORTS + plain + RULES))


def test_library_limits_are_unchanged() -> None:
    checked = examined({}, str(CHECKOUT / "policies" / "bridge_inspection.rts"))
    found = {each.name: each for each in checked.policies[0].policy.contracts}
    tops = {found[name].parameters[at].high for name, at in (("takeoff", 0), ("goto", 1), ("inspect_area", 1))}
    assert tops == {60_000}
    assert [found[name].parameters[-1].high for name in ("goto", "inspect_area", "hover")] == [8_000, 8_000, 30_000_000]
    second = 1_000_000
    limits = {
        name: (each.duration_us // second, each.energy // 100, each.validity_us // second // 60)
        for name, each in found.items()
    }
    assert limits == {
        "takeoff": (60, 4, 20),
        "goto": (120, 7, 40),
        "inspect_area": (120, 13, 40),
        "hover": (35, 4, 40),
        "return_home": (240, 17, 60),
        "emergency_land": (120, 8, 60),
    }  # fmt: skip


@rows(
    ("before", "after", "code", "says"),
    [
        ("= 50 m,", ",", "E0607", "has no default"),
        ("= 50 m,", "= 5 m + 5 m,", "E0607", "is not a number"),
        ("= 50 m,", "= 500 m,", "E0605", "outside the range of `highest`"),
        ("= 50 m,", "= 50 s,", "E0310", ""),
        ("highest: altitude in 10 m .. 200 m = 50 m,", "highest: altitude = 50 m,", "E0607", "has no range"),
        ("highest: altitude in 10 m .. 200 m = 50 m,", "highest: zone,", "E0607", "`highest` is not a number"),
        ("share: ratio", "longest: ratio", "E0202", "`longest` is declared twice"),
        ("share: ratio", "altitude: ratio", "E0202", "`altitude` is declared twice"),
        ("share: ratio", "battery: ratio", "E0203", "the size `battery` has the name of a signal"),
        ("at most share", "at most shar", "E0201", "`shar` is not a size of `probe`"),
        ("lasts    at most longest", "lasts    at most share", "E0310", ""),
    ],
)
def test_invalid_size_is_reported(before: str, after: str, code: str, says: str) -> None:
    text = PROBE.replace(before, after, 1)
    assert text != PROBE
    assert [(one, says in message) for one, message in found(IMPORTS + text) if one == code][:1] == [(code, True)]


@rows(
    ("given", "code"),
    [
        ("sizes probe(highest = 120 m, share = 20 %)", None),
        ("sizes probe(highest = 201 m)", "E0605"),
        ("sizes probe(highest = 120 s)", "E0310"),
        ("sizes probe(hihgest = 120 m)", "E0601"),
        ("sizes probe(highest = 120 m, highest = 90 m)", "E0602"),
        ("sizes prob(highest = 120 m)", "E0201"),
        ("sizes battery(highest = 120 m)", "E0204"),
        ("sizes probe(share = 20 %) sizes probe(highest = 120 m)", "E0202"),
        ("sizes probe(highest = longest)", "E0101"),
    ],
)
def test_invalid_given_size_is_reported(given: str, code: str | None) -> None:
    assert [one for one, _ in found(IMPORTS + PROBE + given)] == ([] if code is None else [code])


def test_mission_cannot_set_sizes_of_its_policy() -> None:
    files = {
        "/w/rules.rts": IMPORTS + PROBE + RULES,
        "/w/sizes.rts": 'import "rules.rts"\nsizes probe(highest = 90 m)\n',
    }
    files["/w/own.rts"] = 'import "rules.rts"\nimport "sizes.rts"\n' + ON_WHICH
    checked = examined(files, "/w/own.rts")
    assert [(each.code.id, each.span.file) for each in checked.diagnostics if each.span] == [("E0207", "/w/sizes.rts")]


def test_argument_outside_a_size_names_the_size_to_change() -> None:
    checked = examined({"/w/m.rts": IMPORTS + PROBE + RULES + ON_WHICH.replace("20 m", "70 m")}, "/w/m.rts")
    assert [each.help for each in checked.diagnostics] == [
        "the nearest accepted value is `50 m`; `sizes probe(highest = 70 m)` extends the range"
    ]
