"""Whole programs: the shipped sources compile without findings and reproducibly, and no source raises an exception."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.render import render
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.program import Compiled, check_program, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.policy import RuleKind
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import mission_payload, policy_digest, policy_payload
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
MISSIONS = sorted(path.stem for path in (CHECKOUT / "missions").glob("*.rts"))
SHIPPED = {
    f"lib:{folder}/{path.name}": path.read_text(encoding="utf-8")
    for folder in ("skills", "policies", "missions")
    for path in sorted((CHECKOUT / folder).glob("*.rts"))
}
AT = 1_700_000_000_000_000


def program_of(path: str, files: Mapping[str, str] | None = None) -> Program:
    """A program with files from memory or else from disk; `lib:` is the shipped library."""
    inside = {str(CHECKOUT / name.removeprefix("lib:")): text for name, text in (files or {}).items()}

    def read(name: str) -> bytes:
        key = str((CHECKOUT / name).resolve())
        return inside[key].encode("utf-8", "surrogatepass") if key in inside else Path(name).read_bytes()

    return load([str(CHECKOUT / path)], read, str(CHECKOUT))


def compiled(path: str, files: Mapping[str, str] | None = None, mission: str | None = None, at: int = AT) -> Compiled:
    return compile_program(program_of(path, files), dialect.load(), mission=mission, issued_at_us=at)


def payloads(found: Compiled) -> tuple[bytes, bytes]:
    assert found.policy is not None
    assert found.mission is not None
    policy = policy_payload(found.policy)
    return policy, mission_payload(bind(found.mission, policy_digest(policy)))


def ids(found: tuple[Diagnostic, ...]) -> list[str]:
    return [diagnostic.code.id for diagnostic in found]


@pytest.mark.parametrize("name", MISSIONS)
def test_shipped_mission_compiles_without_findings_and_loads_on_board(name: str) -> None:
    found = compiled(f"missions/{name}.rts")
    assert found.diagnostics == ()
    assert found.policy is not None
    assert found.mission is not None
    prepared = prepare(found.policy)
    assert not isinstance(prepared, Refusal), prepared
    steps = prepare_mission(bind(found.mission, b"x" * 32), prepared)
    assert not isinstance(steps, Refusal), steps


@rows("name", [path for path in SHIPPED if "/skills/" not in path])
def test_shipped_sources_check_without_findings(name: str) -> None:
    assert check_program(program_of(name.removeprefix("lib:")), dialect.load()) == ()


def test_same_sources_and_time_give_the_same_bytes() -> None:
    assert payloads(compiled("missions/standard.rts")) == payloads(compiled("missions/standard.rts"))
    other = payloads(compiled("missions/standard.rts", at=AT + 1))
    assert payloads(compiled("missions/standard.rts"))[0] == other[0]
    assert payloads(compiled("missions/standard.rts"))[1] != other[1]


def test_policy_is_the_same_for_every_mission_under_it() -> None:
    assert compiled("missions/standard.rts").policy == compiled("missions/extended.rts").policy


def test_policy_does_not_depend_on_the_folder_of_its_missions() -> None:
    mission = SHIPPED["lib:missions/standard.rts"]
    text = SHIPPED["lib:policies/bridge_inspection.rts"].replace("lib:policies/site.rts", "site.rts")
    files = {
        "a/policies/p.rts": text,
        "a/policies/site.rts": SHIPPED["lib:policies/site.rts"],
        "a/m.rts": mission.replace("lib:policies/bridge_inspection.rts", "policies/p.rts"),
        "a/b/c/m.rts": mission.replace("lib:policies/bridge_inspection.rts", "../../policies/p.rts"),
    }

    def policy_of(path: str) -> bytes:
        def read(name: str) -> bytes:
            inside = {f"/nowhere/{key}": value for key, value in files.items()}
            return inside[name].encode() if name in inside else Path(name).read_bytes()

        found = compile_program(load([path], read, str(CHECKOUT)), dialect.load(), mission=None, issued_at_us=AT)
        assert found.policy is not None, found.diagnostics
        assert "site.rts" in found.policy.sources
        return policy_payload(found.policy)

    assert policy_of("/nowhere/a/m.rts") == policy_of("/nowhere/a/b/c/m.rts")


def test_bundle_contains_no_paths_of_the_machine() -> None:
    found = compiled("missions/standard.rts")
    assert str(CHECKOUT).encode() not in b"".join(payloads(found))
    assert found.policy is not None
    assert all(source.startswith("lib:") for source in found.policy.sources)


def test_permit_defaults_to_the_operator_and_forbid_to_every_source() -> None:
    text = SHIPPED["lib:policies/bridge_inspection.rts"].replace(
        "contingency hover",
        "permit goto by role pilot when altitude <= 5 m\n  forbid goto by role trainee\n  contingency hover",
    )
    text += "role pilot, trainee\n"
    found = compiled("missions/standard.rts", {"lib:policies/bridge_inspection.rts": text})
    assert found.policy is not None, found.diagnostics
    rules = {rule.text.split(" when")[0]: rule for rule in found.policy.rules}
    assert rules["permit goto by role pilot"].sources == (int(SourceKind.OPERATOR),)
    forbid = rules["forbid goto by role trainee"]
    assert (forbid.kind, forbid.sources) == (int(RuleKind.FORBID), ())
    assert rules["permit hover, return_home, emergency_land by any"].sources == ()


def test_rule_is_split_for_skills_with_arguments_in_different_cells() -> None:
    text = SHIPPED["lib:policies/bridge_inspection.rts"].replace(
        "contingency hover", "forbid takeoff, goto by any when altitude > 50 m\n  contingency hover"
    )
    found = compiled("missions/standard.rts", {"lib:policies/bridge_inspection.rts": text})
    assert found.policy is not None, found.diagnostics
    made = [rule for rule in found.policy.rules if rule.text.startswith("forbid takeoff, goto")]
    assert [[found.policy.contracts[skill].name for skill in rule.skills] for rule in made] == [["takeoff"], ["goto"]]
    assert {rule.when.code[1] for rule in made if rule.when is not None} == {0, 2}


def test_defaults_are_lowered_into_the_mission() -> None:
    text = (
        SHIPPED["lib:skills/hover.rts"]
        .replace("grace    5 s", "")
        .replace("record   intent, decision, state, authorization, effect", "")
    )
    found = compiled("missions/short.rts", {"lib:skills/hover.rts": text})
    assert found.mission is not None, found.diagnostics
    hover = next(step for step in found.mission.invocations if step.contract.name == "hover")
    assert hover.contract.grace_us == 500_000
    assert hover.contract.record == ("intent", "decision", "state", "authorization", "effect")
    assert hover.on_inadmissible == 0


def test_enumeration_has_every_value_of_the_dialect() -> None:
    text = SHIPPED["lib:skills/signals.rts"].replace("  ppp       = 8,\n", "")
    found = compiled("missions/short.rts", {"lib:skills/signals.rts": text})
    assert found.policy is not None, found.diagnostics
    fix = next(signal for signal in found.policy.signals if signal.name == "gps.fix")
    assert dict(fix.labels)[8] == "gps_fix_type_ppp"
    assert any(8 in members for members in found.policy.sets)


def test_missing_import_is_the_only_finding() -> None:
    text = SHIPPED["lib:missions/standard.rts"].replace("bridge_inspection.rts", "bridge_inspektion.rts")
    assert ids(compiled("missions/standard.rts", {"lib:missions/standard.rts": text}).diagnostics) == ["E0108"]


def test_declaration_with_a_syntax_error_is_not_reported_as_unknown() -> None:
    text = SHIPPED["lib:skills/hover.rts"].replace("motion   hold", "motion   hoold")
    found = compiled("missions/standard.rts", {"lib:skills/hover.rts": text}).diagnostics
    assert {diagnostic.code.id for diagnostic in found} == {"E0101"}


def test_mission_is_chosen_by_name_or_as_the_only_one() -> None:
    two = SHIPPED["lib:missions/short.rts"] + SHIPPED["lib:missions/short.rts"].split("\n", 2)[2].replace(
        "mission short", "mission other"
    )
    files = {"lib:missions/short.rts": two}
    assert ids(compiled("missions/short.rts", files).diagnostics) == ["E0206"]
    found = compiled("missions/short.rts", files, mission="other")
    assert found.mission is not None
    assert found.mission.name == "other"
    assert ids(compiled("missions/short.rts", files, mission="oter").diagnostics) == ["E0201"]
    nothing = compiled("policies/bridge_inspection.rts")
    assert ids(nothing.diagnostics) == ["E0206"]
    assert check_program(program_of("policies/bridge_inspection.rts"), dialect.load()) == ()


def test_signal_of_a_mission_never_replaces_one_of_the_policy() -> None:
    mission = SHIPPED["lib:missions/standard.rts"]
    signals = SHIPPED["lib:skills/signals.rts"]
    line = next(line for line in signals.splitlines() if line.startswith("signal battery"))
    found = compiled(
        "missions/standard.rts",
        {"lib:skills/signals.rts": signals.replace(line, ""), "lib:missions/standard.rts": f"{mission}\n{line}\n"},
    )
    assert set(ids(found.diagnostics)) <= {"E0207", "E0410"}
    assert found.policy is None


TOKENS = [
    "permit",
    "by",
    "any",
    "}",
    "{",
    "(",
    ")",
    "0",
    "-5 m",
    "1e9",
    "bridge_a",
    "area",
    "battery",
    "not",
    "in",
    "..",
    "fix_3d",
    "99999999999 m",
    "=",
    ",",
    "when",
    "5 s",
    "altitude",
    "grow(area, -90 m)",
    "hover",
    "\u0000",
    "é",
    '"',
    "08:00",
]


@st.composite
def mutations(draw: st.DrawFn) -> tuple[str, str]:
    """A shipped file with a few words removed, repeated or replaced."""
    name = draw(st.sampled_from(sorted(SHIPPED)))
    words = SHIPPED[name].split(" ")
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(words) - 1))
        match draw(st.integers(0, 3)):
            case 0:
                del words[at : at + 1]
            case 1:
                words.insert(at, draw(st.sampled_from(TOKENS)))
            case 2:
                words[at] = draw(st.sampled_from(TOKENS))
            case _:
                words[at] = words[draw(st.integers(0, len(words) - 1))]
        words = words or [""]
    return name, " ".join(words)


@given(mutations())
@example(("lib:policies/site.rts", ""))
def test_mutated_source_compiles_or_has_errors(mutation: tuple[str, str]) -> None:
    name, text = mutation
    program = program_of("missions/extended.rts", {name: text})
    found = compile_program(program, dialect.load(), mission=None, issued_at_us=AT)
    assert (found.mission is None) == has_errors(found.diagnostics)
    render(found.diagnostics, program.sources)
    assert codes.REFUSED_ON_BOARD not in {diagnostic.code for diagnostic in found.diagnostics}
    if found.mission is not None and found.policy is not None:
        prepared = prepare(found.policy)
        assert not isinstance(prepared, Refusal), prepared
        steps = prepare_mission(bind(found.mission, b"x" * 32), prepared)
        assert not isinstance(steps, Refusal), steps
        payloads(found)


def test_diagnostic_is_reported_once_for_each_place() -> None:
    text = SHIPPED["lib:missions/standard.rts"].replace("altitude = 20 m", "altitude = 20 s")
    found = compiled("missions/standard.rts", {"lib:missions/standard.rts": text}).diagnostics
    assert len(found) == len(set(found)) == 3


def long_policy(rules: str) -> str:
    return SHIPPED["lib:policies/bridge_inspection.rts"].replace("contingency hover", f"{rules}\n  contingency hover")


TOO_LARGE = [
    ("lib:policies/bridge_inspection.rts", long_policy("permit hover by role operator\n" * 17_000), "E1001"),
    (
        "lib:policies/bridge_inspection.rts",
        long_policy("".join(f"permit hover by role r{n}\n" for n in range(70)))
        + f"role {', '.join(f'r{n}' for n in range(70))}\n",
        "E1001",
    ),
    ("lib:policies/site.rts", SHIPPED["lib:policies/site.rts"].replace("12 m/s", "2000 m/s"), "E1003"),
    ("lib:policies/site.rts", SHIPPED["lib:policies/site.rts"].replace("ceiling 120 m", "ceiling 2000 km"), "E1003"),
    ("lib:policies/site.rts", SHIPPED["lib:policies/site.rts"].replace("error 3 m", "error 2 km"), "E1003"),
    (
        "lib:skills/hover.rts",
        SHIPPED["lib:skills/hover.rts"].replace("valid    for lifetime", "valid    for 1500 h"),
        "E1003",
    ),
    ("lib:skills/hover.rts", SHIPPED["lib:skills/hover.rts"].replace("longest - 5 s =", "1500 h ="), "E1003"),
    (
        "lib:skills/signals.rts",
        SHIPPED["lib:skills/signals.rts"].replace("stale after 10 s", "stale after 2 h"),
        "E1003",
    ),
    (
        "lib:skills/inspect_area.rts",
        SHIPPED["lib:skills/inspect_area.rts"].replace("area, margin", "area, 900 km"),
        "E1003",
    ),
    (
        "lib:skills/inspect_area.rts",
        SHIPPED["lib:skills/inspect_area.rts"].replace("height <= altitude", f"height * {1 << 52} <= altitude * 9000"),
        "E1003",
    ),
    (
        "lib:skills/hover.rts",
        SHIPPED["lib:skills/hover.rts"].replace("require  ", "require " + "battery > 3 % and " * 70),
        "E1001",
    ),
]


@pytest.mark.parametrize(("name", "text", "code"), TOO_LARGE)
def test_program_too_large_for_the_vehicle_is_refused(name: str, text: str, code: str) -> None:
    assert text != SHIPPED[name]
    found = compiled("missions/standard.rts", {name: text})
    assert set(ids(found.diagnostics)) == {code}, [d.message for d in found.diagnostics]


def test_version_too_large_for_a_log_is_refused() -> None:
    text = long_policy("").replace("version 7", f"version {1 << 60}")
    found = compiled("missions/standard.rts", {"lib:policies/bridge_inspection.rts": text})
    assert set(ids(found.diagnostics)) == {"E0701", "E1003"}
