"""Overrides of a step only tighten its contract, are part of the bundle, and do not change the policy."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from rtshcua.decision.checks.contracts import tightens
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.render import render
from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import policy_payload

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

POLICY = """
policy p version 1 {
  permit takeoff by role operator through agent when altitude <= 40 m
  permit hover, return_home, emergency_land by any
  permit goto by role operator through agent when target inside grow(city, -20 m) and altitude <= 40 m
  contingency hover for 10 s, return_home, emergency_land
}
"""


def mission(block: str) -> str:
    return (
        POLICY
        + f"""
zone mine = circle(47.398 N, 8.546 E, 10 m)
mission m under p@1 on surveyor {{
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 10 m) }}
  phase inspection {{ hover(5 s) on inadmissible skip {block} }}
  phase recovery {{ return_home() }}
}}
"""
    )


ALL = """{
  deadline 2 s  valid for 10 min during inspection  lasts at most 12 s  grace 500 ms  energy at most 6 %
  require battery > 30 % and gps.fix >= fix_3d  assume wind.speed < 7 m/s
  maintain height <= 30 m and position inside grow(city, -20 m)  record effect
}"""


def test_override_changes_the_step_and_not_the_policy(compile_text: Compile, site: str) -> None:
    plain, own = compile_text(site + mission("")), compile_text(site + mission(ALL))
    assert own.diagnostics == (), render(own.diagnostics, own.sources)
    assert plain.mission is not None
    assert own.mission is not None
    before, after = plain.mission.invocations[1].contract, own.mission.invocations[1].contract
    assert (after.deadline_us, after.validity_us, after.duration_us, after.grace_us, after.energy) == (
        2_000_000, 600_000_000, 12_000_000, 500_000, 600,
    )  # fmt: skip
    assert after.phases == ("inspection",)
    for words, texts in (
        ("require", ["battery > 30 %", "gps.fix >= fix_3d"]),
        ("assume", ["wind.speed < 7 m/s"]),
        ("maintain", ["height <= 30 m", "position inside grow(city, -20 m)"]),
    ):
        skills, mine = getattr(before, words), getattr(after, words)
        assert mine[: len(skills)] == skills
        assert [clause.text for clause in mine[len(skills) :]] == texts
    assert set(before.record) <= set(after.record)
    assert plain.policy is not None
    assert own.policy is not None
    assert plain.policy.contracts == own.policy.contracts
    assert plain.policy.zones == own.policy.zones
    assert list(tightens(after, own.policy.contracts[own.mission.invocations[1].skill])) == []
    prepared = prepare(own.policy)
    assert not isinstance(prepared, Refusal)
    assert not isinstance(prepare_mission(bind(own.mission, b"x" * 32), prepared), Refusal)


def test_policy_bytes_do_not_depend_on_the_mission(compile_text: Compile) -> None:
    payloads = set()
    for block in ("", "{ maintain height <= 30 m }", "{ require battery > 50 % deadline 1 s }"):
        text = (
            'import "lib:policies/training_field.rts"\n'
            "mission m under training_field@2 on surveyor {\n  proposed by agent openclaw for role operator\n"
            "  phase departure { takeoff(altitude = 10 m) }\n"
            f"  phase inspection {{ hover(5 s) {block} return_home() }}\n}}\n"
        )
        compiled = compile_text(text)
        assert compiled.policy is not None, render(compiled.diagnostics, compiled.sources)
        payloads.add(policy_payload(compiled.policy))
    assert len(payloads) == 1


def test_clause_span_names_policy_files_then_mission_files(compile_text: Compile) -> None:
    text = (
        'import "lib:policies/training_field.rts"\n'
        "mission m under training_field@2 on surveyor {\n  proposed by agent openclaw for role operator\n"
        "  phase departure { takeoff(altitude = 10 m) { maintain height <= 30 m }  return_home() }\n}\n"
    )
    compiled = compile_text(text)
    assert compiled.policy is not None, render(compiled.diagnostics, compiled.sources)
    assert compiled.mission is not None
    clause = compiled.mission.invocations[0].contract.maintain[-1]
    sources = (*compiled.policy.sources, *compiled.mission.sources)
    assert sources[clause.source].endswith("x.rts")
    assert text[clause.start : clause.end] == clause.text == "height <= 30 m"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "codes"),
    [
        ("{ deadline 5 s }", []),
        ("{ deadline 5001 ms }", ["E0617"]),
        ("{ valid for 41 min }", ["E0617"]),
        ("{ lasts at most 36 s }", ["E0617"]),
        ("{ grace 5001 ms }", ["E0617"]),
        ("{ energy at most 3.99 % }", ["E0617"]),
        ("{ energy at most 4 % }", []),
        ("{ energy at most 101 % }", ["E0614"]),
        ("{ deadline 5 m }", ["E0310"]),
        ("{ valid for 5 m }", ["E0310"]),
        ("{ lasts at most 5 m }", ["E0310"]),
        ("{ grace 5 m }", ["E0310"]),
        ("{ grace 0 s }", []),
        ("{ energy at most 5 m }", ["E0310"]),
        ("{ deadline 0 s }", ["E0319"]),
        ("{ record everything }", ["E0610"]),
        ("{ record effect, synced }", []),
        ("{ record synced_first }", []),
        ("{ record written }", ["E0617"]),
        ("{ record buffered }", ["E0617"]),
        ("{ record synced, synced_first }", ["E1205"]),
        ("{ require battery > 20 m }", ["E0310"]),
        ("{ require batery > 20 % }", ["E0201"]),
        ("{ valid for 10 min during departure }", ["E0803"]),
        ("{ valid for 10 min during nothing }", ["E0802"]),
        # reads what the policy reads: numbers need no tables, sets and zones are those that the policy has
        ("{ require height > 1 m and wind.speed < 8 m/s }", []),
        ("{ require gps.fix >= fix_3d }", []),
        ("{ require gps.fix == fix_2d }", ["E0622"]),
        ("{ maintain position inside city }", []),
        ("{ maintain position inside grow(city, -20 m) }", []),
        ("{ maintain position inside grow(city, -21 m) }", ["E0622"]),
        ("{ maintain position outside mine }", []),
        ("{ maintain battery > 20 % for the last 3 s }", ["E0622"]),
        ("{ require gps.satellites >= 6 }", ["E0622"]),
        (
            "{ maintain height < 9 m and position inside grow(city, 1 m)  require battery > 20 % }",
            ["E0622"],
        ),
    ],
)
def test_invalid_override_is_refused(check_text: Check, site: str, block: str, codes: list[str]) -> None:
    sats = "signal gps.satellites : count = GPS_RAW_INT.satellites_visible unknown at 255 stale after 2 s\n"
    text = site + (sats if "satellites" in block else "") + mission(block)
    errors = [each for each in check_text(text).diagnostics if each.code.severity.value == "error"]
    assert [each.code.id for each in errors] == codes


def test_looser_override_shows_the_contract_value(check_text: Check, site: str) -> None:
    found = check_text(site + mission("{ deadline 20 s }")).diagnostics[0]
    assert "`deadline 20 s`" in found.message
    assert "5 s" in found.message
    assert [fix.replacement for fix in found.fixes] == ["5 s"]


def test_override_cannot_read_a_zone_of_the_mission(compile_text: Compile) -> None:
    text = (
        'import "lib:policies/training_field.rts"\nzone mine = circle(47.398 N, 8.546 E, 10 m)\n'
        "mission m under training_field@2 on surveyor {\n  proposed by agent openclaw for role operator\n"
        "  phase departure { takeoff(altitude = 10 m) { maintain position outside mine }  return_home() }\n}\n"
    )
    assert [each.code.id for each in compile_text(text).diagnostics] == ["E0207"]


def test_missing_duration_is_looser_than_any_on_board(compile_text: Compile, site: str) -> None:
    compiled = compile_text(site + mission("{ lasts at most 12 s }"))
    assert compiled.mission is not None
    contract = compiled.mission.invocations[1].contract
    endless = replace(contract, duration_us=0)
    assert list(tightens(endless, contract)) == ["`duration` is looser than in the policy"]
    assert list(tightens(contract, endless)) == []
    assert list(tightens(endless, endless)) == []
