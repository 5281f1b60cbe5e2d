"""Findings on nominals and tests have the same wording as findings elsewhere."""

from reference.deciding import IMPORT, NOMINAL, WHEN, found
from virtual.rows import rows

WRONG = [
    ("given batery = 20 %", "E0201", "`batery` is not declared", "did you mean `battery`?"),
    ("given city = 20 %", "E0204", "`city` is a zone, not a value", None),
    ("given battery = 20 m", "E0310", "expected a ratio; `20 m` is a length", None),
    (
        "given height = 20 m above sea",
        "E0311",
        "`20 m above sea` is above sea; expected an altitude above home",
        None,
    ),
    ("given gps.fix = fix_4d", "E0313", "`fix_4d` is not a value of `gps_fix`", None),
    ("given position = city", "E0312", "", None),
    ("given battery = link.quality", "E0318", "`link.quality` is not known before the flight", None),
    ("given battery = 20 % measured 3 m ago", "E0310", "expected a duration; `3 m` is a length", None),
    ("given battery = 20 %, battery = 30 %", "E1406", "`battery` is given twice", "keep one of them"),
    (
        "given (battery < 30 %) = true",
        "E0312",
        "expected a temporal condition; `battery < 30 %` reads current values only",
        None,
    ),
    (
        "given (battery < 30 % for the last 5 s) = 5 %",
        "E0312",
        "`5 %` is not a truth value",
        "write `true`, `false` or `unknown`",
    ),
    ("given (battery < 30 m for the last 5 s) = true", "E0310", "expected a ratio; `30 m` is a length", None),
    (
        "given (battery < 30 % for the last 5 s) = tru",
        "E0312",
        "`tru` is not a truth value",
        "did you mean `true`?",
    ),
    (
        "given (battery < 30 % for the last 5 s) = true",
        "E1409",
        "`bridge_inspection` does not observe `battery < 30 % for the last 5 s`, so its value has no effect",
        None,
    ),
    (
        "given (battery < 30 % for the last 5 s) = true measured 2 s ago",
        "E1409",
        "the value of a temporal condition has no age",
        "leave `measured ... ago` out",
    ),
    (
        "given gps.accuracy = 3 m",
        "E1409",
        "`bridge_inspection` does not read `gps.accuracy`, so its value has no effect",
        None,
    ),
    (
        "approved by supervisr",
        "E1409",
        "no `confirm` of `bridge_inspection` waits for the role `supervisr`",
        "did you mean `supervisor`?",
    ),
    ("released 3 m ago", "E0310", "expected a duration; `3 m` is a length", None),
    ("released -3 s ago", "E0319", "`-3 s` must not be negative", None),
    ("phase inspektion", "E0201", "`inspektion` is not a phase of the mission", "did you mean `inspection`?"),
    ("phase a of a, b, a", "E0202", "the phase `a` is named twice", None),
    (
        "phase a of a, b",
        "E0802",
        "`inspect_area` is valid only during `inspection`, and the test has no such phase",
        "name the phases in order, as in `phase a of a, inspection`",
    ),
]


@rows(("part", "code", "message", "help"), WRONG, ids=[each[0] for each in WRONG])
def test_wrong_premise_is_found(part: str, code: str, message: str, help: str | None) -> None:
    findings = found(f'test "it" {{ {WHEN} {part} expect allow }}')
    assert {each[0] for each in findings} == {code}
    assert not message or (message in [each[1] for each in findings])
    assert help is None or help in [each[2] for each in findings]


ASKED = [
    ("inspect_aria(bridge_a)", "E0201", "`inspect_aria` is not declared; expected a skill"),
    ("inspect_area(bridge_a)", "E0603", "`inspect_area` lacks `altitude`"),
    ("inspect_area(bridge_a, hight = 3 m)", "E0601", "`inspect_area` has no parameter `hight`"),
    ("inspect_area(bridge_a, 3 s)", "E0310", "expected an altitude above home; `3 s` is a duration"),
    ("inspect_area(bridge_a, 3 m, zigzag)", "E0313", "`zigzag` is not a value of `pattern`"),
    ("inspect_area(bridge_a, 3 m) through ajent", "E0709", "unknown source of requests `ajent`"),
    ("inspect_area(bridge_a, 3 m) by operater", "E0702", "no rule of `bridge_inspection` names the role `operater`"),
    ("spin()", "E0702", "no rule of `bridge_inspection` names the skill `spin`"),
    ("inspect_area(own, 20 m)", "E0207", "the policy `bridge_inspection` does not import the zone `own`"),
]

SPIN = """skill spin() {
  motion hold  class tactical  deadline 5 s  valid for 40 min  lasts at most 1 min
  fallback return_home, emergency_land  energy at most 5 %
}
zone own = circle(47.39850 N, 8.54600 E, 30 m)
"""


@rows(("request_", "code", "message"), ASKED)
def test_wrong_request_is_found(request_: str, code: str, message: str) -> None:
    findings = found(f'{SPIN}test "it" {{ when {request_} expect allow }}')
    assert [each[:2] for each in findings] == [(code, message)]


TABLES = [
    ("wind { 3 m/s expect allow }", "E0201", "`wind` is neither a signal nor a parameter of `inspect_area`"),
    ("city { 3 m/s expect allow }", "E0204", "`city` is a zone, not a value"),
    ("battery, battery { 3 %, 3 % expect allow }", "E1406", "`battery` is given twice"),
    ("altitude { 3 m expect allow }", "E0602", "`altitude` is given twice"),
    ("speed { unknown expect allow }", "E0312", "an argument cannot be unknown"),
    ("speed { 3 m/s measured 2 s ago expect allow }", "E0312", "an argument has no age"),
    ("speed { 3 m expect allow }", "E0310", "expected a speed; `3 m` is a length"),
    ("battery { 3 m expect allow }", "E0310", "expected a ratio; `3 m` is a length"),
    ("battery { 3 %, 4 % expect allow }", "E1405", "the row has 2 cells, but the table has 1 column"),
    ("battery { }", "E1402", "the table of the test has no row"),
    (
        "battery { 3 % expect deny because state/violated }",
        "E1404",
        "`state/violated` is a reason for `fallback`, not for `deny`",
    ),
]


@rows(("table", "code", "message"), TABLES)
def test_wrong_table_is_found(table: str, code: str, message: str) -> None:
    findings = found(f'test "it" {{ {WHEN} table {table} }}')
    assert (code, message) in [each[:2] for each in findings]
    assert {each[0] for each in findings} == {code}


def test_test_without_request_or_expectation_is_found() -> None:
    both = found(f'test "it" {{ {WHEN} expect allow table battery {{ 80 % expect allow }} }}')
    neither = found('test "it" { }')
    assert [each[1] for each in both] == ["the test has both `expect` and a `table`"]
    assert [each[1] for each in neither] == [
        "the test has no request",
        "the test has no expected outcome",
    ]


def test_role_time_and_phase_have_no_defaults() -> None:
    bare = IMPORT + "nominal bare { under bridge_inspection on quad }\n"
    findings = found(f'test "it" {{ {WHEN} expect allow }}', bare)
    assert [each[1] for each in findings] == [
        "neither the test nor its nominal gives the requester",
        "neither the test nor its nominal gives the time",
        "neither the test nor its nominal gives the phase of the mission",
    ]


def test_nominal_without_policy_or_vehicle_is_found() -> None:
    findings = found('test "it" { expect allow }', IMPORT + "nominal bare { }\n")
    assert findings[0] == ("E0107", "nominal `bare` lacks `under`, `on`", "add `under`, `on`")
    findings = found("", IMPORT + NOMINAL.replace("on quad", "on quat").replace("under bridge", "under brid"))
    assert [each[:2] for each in findings] == [
        ("E0201", "`brid_inspection` is not declared; expected a policy"),
        ("E0201", "`quat` is not declared; expected a vehicle"),
    ]


def test_nominal_of_a_test_is_named_or_the_only_one() -> None:
    test = f'test "it" FROM {{ {WHEN} expect allow }}'
    beside = {"good": IMPORT + NOMINAL, "other": IMPORT + NOMINAL.replace("morning", "noon")}
    imports = 'import "good.rts"\nimport "other.rts"\n'
    assert found(test.replace("FROM", ""), 'import "good.rts"\n', **beside) == []
    assert found(test.replace("FROM", "from noon"), imports, **beside) == []
    (ambiguous,) = found(test.replace("FROM", ""), imports, **beside)
    assert ambiguous[:2] == ("E1401", "the test does not say which of 2 nominals it starts from")
    (none,) = found(test.replace("FROM", ""), IMPORT)
    assert none[:2] == ("E1401", "the test has no nominal")
    (unknown,) = found(test.replace("FROM", "from mornin"))
    assert unknown == ("E0201", "`mornin` is not declared; expected a nominal", "did you mean `morning`?")
    own = NOMINAL.replace("morning", "own")
    assert found(test.replace("FROM", ""), imports + own, **beside) == []


def test_signal_without_a_value_is_a_warning() -> None:
    without = NOMINAL.replace(", wind.speed = 3 m/s", "")
    (told,) = found(f'test "it" {{ {WHEN} expect allow }}', IMPORT + without)
    assert told[:2] == (
        "E1408",
        "a decision on `inspect_area` reads `wind.speed`, which has no value: it is unknown",
    )
    assert found(f'test "it" {{ {WHEN} given wind.speed = unknown expect allow }}', IMPORT + without) == []
    assert found('test "it" { when return_home() expect allow }', IMPORT + without) == []


def test_clause_is_quoted_in_full_or_up_to_dots() -> None:
    def quoting(clause: str) -> list[tuple[str, str, str | None]]:
        return found(f'test "it" {{ {WHEN} expect fallback at "{clause}" }}')

    assert quoting("battery > 35 %") == quoting("battery  >  35 %") == quoting("permit inspect_area ...") == []
    assert quoting("airspace inside city outside school") == quoting("degrade any ...") == []
    (wrong,) = quoting("battery > 34 %")
    assert wrong == (
        "E1410",
        "no clause `battery > 34 %` can decide on `inspect_area` here",
        "did you mean `battery > 35 %`?",
    )
    for clause, meant in (
        ("permit inspct_area ...", "permit inspect_area ..."),
        ("permit inspect_area", "permit inspect_area ..."),
        ("permit inspect_area by agent", None),
        ("airspace inside citty ...", "airspace inside city ..."),
    ):
        (told,) = quoting(clause)
        whole = "permit inspect_area by role operator through agent, operator when "
        help = told[2] or ""
        assert help.startswith(f"did you mean `{meant or whole}")
        if meant is not None:
            assert quoting(meant) == []
    (other,) = quoting("forbid anything ...")
    assert other[0] == "E1410"
    assert (other[2] or "").startswith("possible clauses: `")
    (likely,) = quoting("degrade nothing when wind")
    assert (likely[2] or "").startswith("possible clauses: `degrade "), "the most alike first"


def test_table_over_the_limit_of_cases_is_refused() -> None:
    rows = "80 % expect allow\n" * 5_000
    (many,) = found(f'test "it" {{ {WHEN} table battery {{ {rows} }} }}')
    assert many[:2] == ("E1001", "with this test the file has more than 4096 cases, the limit of a file")
    columns = ", ".join(f"c{number}" for number in range(65))
    (wide,) = found(f'test "it" {{ {WHEN} table {columns} {{ }} }}')
    assert wide[:2] == ("E1001", "the table has 65 columns; the limit is 64")
    phases = ", ".join(f"p{number}" for number in range(65))
    assert "E1001" in {each[0] for each in found(f'test "it" {{ {WHEN} phase p1 of {phases} expect allow }}')}


def test_tests_of_an_imported_file_are_ignored() -> None:
    beside = {"good": IMPORT + NOMINAL + 'test "wrong" { when nothing() expect deny because x }'}
    assert found(f'test "it" {{ {WHEN} expect allow }}', 'import "good.rts"\n', **beside) == []
