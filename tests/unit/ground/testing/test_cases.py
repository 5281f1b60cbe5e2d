"""The cases of a test: their names and places, shared data, and the finding on an unmet expectation."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.deciding import IMPORT, NOMINAL, WHEN, made, program, ran
from rtshcua.diagnostics.render import render
from rtshcua.ground.language.load import load
from rtshcua.ground.lint.unused import mentioned_by
from rtshcua.ground.pipeline.program import compile_program, examine_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case_lowering import REMAINING_US
from rtshcua.ground.testing.case_result import CaseResult, run_case
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Invocation
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US
from rtshcua.wire.bundle import policy_digest, policy_payload
from virtual.rows import rows

TABLE = f"""test "charge and wind" {{
  {WHEN}
  table battery, wind.speed {{
    80 %,    3 m/s  expect allow
    30 %,    3 m/s  expect fallback hover because state/violated at "battery > 35 %"
    unknown, 3 m/s  expect defer because state/unknown
    80 %,    3 m/s  expect allow
  }}
}}
test "again" {{ {WHEN} expect allow }}
"""
MISSION = """mission survey under bridge_inspection@7 on quad {
  intent "Look." proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) goto(bridge_a.entry, altitude = 20 m) }
  phase inspection { inspect_area(bridge_a, altitude = 20 m) }
  phase recovery { return_home() }
}
"""
CHECKOUT = Path(__file__).resolve().parents[4]


def test_each_row_is_a_case_with_its_own_name_and_place() -> None:
    cases = made(TABLE).cases
    assert [(case.name, case.row) for case in cases] == [
        ("charge and wind [80 %, 3 m/s]", 0),
        ("charge and wind [30 %, 3 m/s]", 1),
        ("charge and wind [unknown, 3 m/s]", 2),
        ("charge and wind [80 %, 3 m/s] #2", 3),
        ("again", None),
    ]
    text = IMPORT + NOMINAL + TABLE
    assert text[cases[1].span.start : cases[1].span.end].startswith("30 %,    3 m/s  expect fallback")
    assert text[cases[4].span.start : cases[4].span.end] == '"again"'


def test_cases_share_the_policy_and_the_request() -> None:
    results = ran(TABLE)
    assert all(each.met and each.finding is None for each in results)
    assert len({id(each.case.policy) for each in results}) == 1
    assert len({id(each.case.invocation) for each in results}) == 1


def test_request_is_the_same_as_in_a_mission() -> None:
    text = IMPORT + NOMINAL + TABLE
    compiled = compile_program(program(IMPORT + MISSION), dialect.load(), mission=None, issued_at_us=0)
    assert compiled.mission is not None
    assert compiled.policy is not None
    (asked, *_) = suite(program(text), dialect.load()).cases

    def plain(each: Invocation) -> Invocation:
        said = {"file": 0, "start": 0, "end": 0, "text": "", "step": 0, "issued_at_us": 0}
        return replace(each, invocation_id=b"", binding=b"", **said)

    assert plain(asked.invocation.invocation) == plain(compiled.mission.invocations[2])
    assert asked.policy.lowered.policy == compiled.policy


def test_request_is_bound_to_the_policy() -> None:
    (case, *_) = made(TABLE).cases
    flat = case.invocation.invocation
    assert len(flat.invocation_id) == 16
    assert case.context.binding == flat.binding
    assert len(flat.binding) == 32
    assert flat.issued_at_us == case.now.utc_us


def test_dispatch_time_is_the_one_assumed_on_board() -> None:
    assert REMAINING_US == CONSERVATIVE_US


def test_tests_do_not_change_what_is_signed() -> None:
    """Except the digest of the file's text, which also changes with a comment."""
    with_tests = program('import "lib:policies/bridge_inspection.rts"\n' + MISSION + NOMINAL + TABLE)
    without = program('import "lib:policies/bridge_inspection.rts"\n' + MISSION)
    digests, missions = [], []
    for each in (with_tests, without):
        compiled = compile_program(each, dialect.load(), mission=None, issued_at_us=1)
        assert compiled.policy is not None
        assert compiled.mission is not None
        digests.append(policy_digest(policy_payload(compiled.policy)))
        missions.append(replace(compiled.mission, source_digests=()))
    assert digests[0] == digests[1]
    assert missions[0] == missions[1]


def test_import_used_by_a_test_only_is_not_unused() -> None:
    (unit, *_) = program(IMPORT + NOMINAL + TABLE).units
    assert {"bridge_inspection", "quad", "inspect_area", "bridge_a", "battery", "wind.speed"} <= mentioned_by(unit)


def unmet(expectation: str, *given: str) -> CaseResult:
    """A test whose expectation is not met."""
    suite_of = made(f'test "it" {{ {" ".join(given)} {WHEN} {expectation} }}')
    assert suite_of.diagnostics == ()
    (one,) = (run_case(case) for case in suite_of.cases)
    assert not one.met
    return one


@rows(
    ("expectation", "given", "message", "help"),
    [
        (
            "expect allow",
            "given battery = 30 %",
            "expected `allow`; the decision is `fallback hover because state/violated`",
            "it would have passed with `battery = 35.01 %`",
        ),
        (
            "expect fallback return_home",
            "given battery = 30 %",
            "expected `return_home` to fly; `hover` flies",
            "it would have passed with `battery = 35.01 %`",
        ),
        (
            'expect fallback hover because timing/no-slack at "battery > 35 %"',
            "given wind.speed = 11 m/s",
            "expected the reason `timing/no-slack`; it is `state/violated`; "
            "expected `battery > 35 %` to decide; `wind.speed < 10 m/s` decided",
            "it would have passed with `wind.speed = 9.999 m/s`",
        ),
        (
            "expect allow",
            "given gps.fix = unknown, battery = 80 %",
            "expected `allow`; the decision is `defer because state/unknown`",
            "`gps.fix` is unknown",
        ),
        (
            "expect allow",
            "given battery = 80 % measured 6 s ago",
            "expected `allow`; the decision is `defer because state/unknown`",
            "`battery` is stale",
        ),
        (
            "expect deny",
            "",
            "expected `deny`; the decision is `allow because admitted`",
            "`permit inspect_area by role operator through agent, operator when (area inside bridge_a or area inside "
            "bridge_b) and altitude <= 30 m` allows it: make it narrower, or add a rule or clause that prevents the "
            "request",
        ),
    ],
)
def test_unmet_expectation_is_described(expectation: str, given: str, message: str, help: str) -> None:
    finding = unmet(expectation, given).finding
    assert finding is not None
    assert (finding.code.id, finding.message, finding.help) == ("E1411", message, help)


def test_finding_points_at_the_expectation_and_the_deciding_clause() -> None:
    one = unmet("expect allow", "given battery = 30 %")
    assert one.finding is not None
    sources = made(TABLE).sources | {"probe.rts": one.case.policy.lowered.files._report.sources["probe.rts"]}
    text = render([one.finding], sources)
    assert "expect allow" in text
    assert "skills/inspect_area.rts:20:34" in text
    late = unmet("expect allow", "released 1 min ago").finding
    assert late is not None
    assert [label.text for label in late.labels] == ["step 5, timing, decided by the request itself, not by a clause"]


def test_finding_points_at_the_permits_that_allowed_or_did_not() -> None:
    wide = "permit hover by any"
    rules = (
        "policy own version 1 { permit takeoff by role operator when altitude <= 9 m "
        "permit takeoff by role operator when altitude >= 90 m permit hover by role operator when battery > 9 % "
        f"{wide} permit return_home, emergency_land by any contingency return_home, emergency_land }}\n"
    )
    skills = "".join(f'import "lib:skills/{each}.rts"\n' for each in ("takeoff", "hover", "return_home"))
    before = 'import "lib:policies/site.rts"\n' + skills + rules + NOMINAL.replace("bridge_inspection", "own").replace(
        " through agent", ""
    )  # fmt: skip

    def labels(request: str, expected: str) -> list[tuple[str, str]]:
        text = f'{before}test "it" {{ when {request} expect {expected} }}'
        (one,) = (run_case(case) for case in made(text, "").cases)
        assert one.finding is not None
        return [(text[each.span.start : each.span.end], each.text) for each in one.finding.labels]

    narrow = "permit hover by role operator when battery > 9 %"
    assert labels("hover()", "deny because authority/not-permitted") == [
        (narrow, "this permit allowed it"), (wide, "this permit allowed it"),
    ]  # fmt: skip
    decided, other = labels("takeoff(altitude = 20 m)", "allow")
    assert decided[1] == "this decided: `deny because authority/out-of-scope`"
    assert other == ("permit takeoff by role operator when altitude >= 90 m", "this permit does not allow it either")


def test_check_reports_wrong_tests_without_running_any() -> None:
    wrong = IMPORT + NOMINAL + f'test "it" {{ {WHEN} expect deny }} test "b" {{ {WHEN} expect allow at "x" }}'
    assert [each.code.id for each in examine_program(program(wrong), dialect.load()).diagnostics] == ["E1410"]


@pytest.mark.parametrize("path", sorted((CHECKOUT / "policies").glob("*_test.rts")), ids=lambda path: path.stem)
def test_shipped_tests_pass(path: Path) -> None:
    loaded = load([str(path)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    cases = suite(loaded, dialect.load())
    assert cases.diagnostics == ()
    assert len(cases.cases) >= 4
    assert [run_case(case).finding for case in cases.cases if not run_case(case).met] == []


def test_examples_of_the_reference_pass() -> None:
    page = (CHECKOUT / "docs" / "language.md").read_text(encoding="utf-8")
    section = page.partition("\n## Tests\n")[2].partition("\n## Scenarios\n")[0]
    blocks = [block.partition("```")[0] for block in section.split("```rts\n")[1:]]
    assert len(blocks) == 2
    for block in blocks:

        def read(path: str, text: str = block) -> bytes:
            return text.encode() if path == "page.rts" else Path(path).read_bytes()

        cases = suite(load(["page.rts"], read, str(CHECKOUT)), dialect.load())
        assert cases.diagnostics == ()
        assert [run_case(case).finding for case in cases.cases if not run_case(case).met] == []
