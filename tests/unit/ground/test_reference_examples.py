"""Every example of these pages is compiled, and nothing is found in it."""

import re
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.render import render
from rtshcua.front.cli.app import main
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[3]
PAGE, SURVEY, PAYLOAD = (
    (CHECKOUT / "docs" / name).read_text(encoding="utf-8") for name in ("language.md", "survey.md", "flying/payload.md")
)
SOURCES = re.findall(r"^```rts\n(.*?)^```$", PAGE + SURVEY + PAYLOAD, re.DOTALL | re.MULTILINE)
CONDITIONS = [
    line
    for block in re.findall(r"^```condition\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    for line in block.splitlines()
]

AROUND = """
import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

skill example() {
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 35 s
  grace    1 s
  require  CONDITION
           where fitted
  fallback return_home, emergency_land
  energy   at most 4 %
  record   intent, decision, state, authorization, effect
}

policy examples version 1 {
  permit example by role operator
  permit hover, return_home, emergency_land by any
  airspace inside city outside school
  contingency hover for 10 s, return_home, emergency_land
}
"""


def findings(text: str) -> str:
    """What a person reads when the text is checked."""

    def read(path: str) -> bytes:
        return text.encode() if path == "example.rts" else Path(path).read_bytes()

    program = load(["example.rts"], read, str(CHECKOUT))
    return render(check_program(program, dialect.load()), program.sources)


def test_there_are_examples_of_everything() -> None:
    assert len(SOURCES) >= 7
    assert len(CONDITIONS) >= 15
    words = "\n".join([*SOURCES, *CONDITIONS])
    for word in ("import", "signal", "zone", "vehicle", "skill", "template", "policy", "mission", "rising", "abs("):
        assert word in words, word


@rows("source", SOURCES)
def test_a_source_is_compiled_without_a_finding(source: str) -> None:
    assert findings(source) == ""


@rows("condition", CONDITIONS)
def test_a_condition_is_compiled_without_a_finding(condition: str) -> None:
    assert findings(AROUND.replace("CONDITION", condition)) == ""


def test_a_policy_forbids_what_a_skill_is_told_to_look_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The tests of the example are its claims."""
    (source,) = re.findall(r"^```rts\n(.*?)^```$", PAYLOAD, re.DOTALL | re.MULTILINE)
    (tmp_path / "privacy.rts").write_text(source, encoding="utf-8")
    assert main(["test", str(tmp_path / "privacy.rts")]) == ExitCode.OK
    assert "3 tests, 5 cases: all passed" in capsys.readouterr().out
