"""Nominals and tests: their IR, and keywords that stay names elsewhere."""

from collections.abc import Callable
from typing import Any

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]

NOMINAL = """nominal morning {
  under bridge_inspection on quad
  by role operator through agent
  at "2026-06-01T08:00:00Z" within 2 s
  phase inspection of departure, inspection
  given battery = 80 %, gps.fix = unknown
  given (battery < 30 % for the last 5 s) = true, wind = 3 m/s measured 2 s ago
  approved by supervisor 3 s ago  refused by role chief
  released 3 s ago  issued in 5 s  version 8 in force  identity "x"  replayed  tampered
}"""


def test_nominal(unit: Read, plain: Plain) -> None:
    (nominal,) = unit(NOMINAL).nominals
    found = plain(nominal)
    assert {key: found[key] for key in ("name", "policy", "vehicle", "asker")} == {
        "name": "morning",
        "policy": "bridge_inspection",
        "vehicle": "quad",
        "asker": {"role": "operator", "source": "agent"},
    }
    premises = found["premises"]
    assert premises["instant"] == {"utc_us": 1_780_300_800_000_000, "within": (2_000_000, "duration")}
    assert premises["phase"] == {"phase": "inspection", "order": ["departure", "inspection"]}
    assert [each["cell"] for each in premises["given"]] == [
        {"value": (8000, "ratio")},
        {},
        {"value": "&true"},
        {"value": (3000, "speed"), "measured": (2_000_000, "duration")},
    ]
    assert [each["subject"]["kind"] for each in premises["given"]] == ["named", "named", "over-time", "named"]
    assert premises["answers"] == [
        {"granted": True, "role": "supervisor", "ago": (3_000_000, "duration")},
        {"granted": False, "role": "chief"},
    ]
    assert premises["released"] == (3_000_000, "duration")
    assert premises["issued"] == {"distance": (5_000_000, "duration"), "ahead": True}
    assert premises["in_force"] == {"version": 8}
    assert premises["identity"] == {"text": "x"}
    assert (premises["replayed"], premises["tampered"]) == ({"kind": "replayed"}, {"kind": "tampered"})


def test_example_of_the_design_is_parsed(unit: Read, plain: Plain) -> None:
    (test,) = unit("""
test "low battery turns an inspection into a return" {
  given battery = 20 %, gps.fix = fix_3d
  when  inspect_area(area = bridge_a, altitude = 20 m) by operator through agent
  expect fallback return_home because state/violated
}
""").tests
    found = plain(test)
    assert found["name"] == {"text": "low battery turns an inspection into a return"}
    assert found["request"] == {
        "skill": "inspect_area",
        "arguments": [
            {"name": "area", "value": "&bridge_a"},
            {"name": "altitude", "value": (20_000, "length")},
        ],
        "asker": {"role": "operator", "source": "agent"},
    }
    assert found["expectation"] == {"outcome": "fallback", "target": "return_home", "reason": "state/violated"}
    assert "table" not in found


def test_row_may_begin_with_a_name_after_any_expectation(unit: Read, plain: Plain) -> None:
    (test,) = unit("""
test "rows" from morning {
  when  hover(1 s) through onboard
  table gps.fix, (a > 3 within the last 5 s) {
    no_fix, true     expect fallback
    fix_2d, false    expect fallback hover
    fix_3d, unknown  expect allow
    dgps measured 1 s ago, true expect fallback
    unknown, true expect deny because authority/forbidden at "forbid hover ..."
  }
}
""").tests
    found = plain(test)
    assert found["nominal"] == "morning"
    assert found["request"]["asker"] == {"source": "onboard"}
    rows = found["table"]["rows"]
    assert [row["cells"][0].get("value") for row in rows] == ["&no_fix", "&fix_2d", "&fix_3d", "&dgps", None]
    assert [row["expectation"].get("target") for row in rows] == [None, "hover", None, None, None]
    assert rows[4]["expectation"]["clause"] == {"text": "forbid hover ..."}


def test_string_after_at_is_a_moment_or_a_clause(unit: Read) -> None:
    text = 'test "a" { when hover() expect deny at "battery > 3 %" at "2026-06-01T08:00Z" }'
    other = 'test "a" { when hover() expect deny at "2026-06-01T08:00Z" }'
    for source, clause in ((text, "battery > 3 %"), (other, None)):
        (test,) = unit(source).tests
        assert test.expectation is not None
        assert (None if test.expectation.clause is None else test.expectation.clause.text) == clause
        assert test.premises.instant is not None


def test_keywords_of_tests_are_names_elsewhere() -> None:
    words = ("nominal", "test", "given", "expect", "because", "table", "measured", "ago", "allow", "deny", "tampered")
    for word in words:
        text = f"""
signal {word} : ratio = A.b stale after 5 s
zone z = union({word}, circle(1 N, 2 E, 3 m))
skill {word}({word}: zone) {{ require {word} > 3 % and position inside {word} fallback {word} for 2 s, {word} }}
policy p version 1 {{ permit {word} by role {word} when {word} > 3 % degrade {word} to {word} contingency {word} }}
mission m under {word}@1 on {word} {{ phase {word} {{ {word}() {word} ({word} = {word})
  {word}() }} }}
"""
        assert parse(Source("x", text)).diagnostics == (), word
