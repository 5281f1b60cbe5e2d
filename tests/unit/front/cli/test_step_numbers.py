"""Steps are numbered from 1 wherever a person or an agent reads or types one; records hold the index, from 0."""

import ast
import json
import re
from pathlib import Path

import pytest

from reference.documents import low, replacement
from reference.low_source import low_source
from reference.world import Run
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.story import Happened, Happening
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.records import DecisionRecord
from rtshcua.front.cli.app import main
from rtshcua.front.cli.render.live.lines import as_json, plain
from rtshcua.front.mcp.server import TOOLS
from rtshcua.ground.audit.dispatches import ref_words
from rtshcua.model.step_number import index_of, number_of, step_words
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref

PACKAGE = Path(__file__).resolve().parents[4] / "rtshcua"
FLIGHT = ("--flight", bytes(16).hex())
LOW = low_source()
#: the third step is the only one that needs approval, and the only inspection
ASKED = 3


@pytest.fixture(scope="module")
def flown() -> Run:
    """A flight to its end, in virtual time."""
    run = Run(low())
    run.until_over()
    return run


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "low.rts").write_text(LOW)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["keys", "approver", "owner", "--role", "supervisor"]) == ExitCode.OK
    assert main(["compile", "low.rts"]) == ExitCode.OK
    capsys.readouterr()
    return tmp_path


def told(capsys: pytest.CaptureFixture[str], *words: str, code: int = ExitCode.OK) -> str:
    assert main(list(words)) == code
    said = capsys.readouterr()
    return said.out + said.err


@pytest.mark.slow
def test_every_command_gives_the_inspection_the_same_number(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"{ASKED} inspect_area" in told(capsys, "check", "low.rts")
    assert f"{ASKED} inspect_area(" in told(capsys, "show", "low.bundle")
    assert f"Step {ASKED}, inspect_area(" in told(capsys, "why", "low.rts", "--step", str(ASKED))
    assert f"Step {ASKED}, inspect_area(" in told(capsys, "why", "low.bundle", "--step", str(ASKED))
    assert f"{ASKED} inspect_area" in told(capsys, "why", "low.bundle", code=ExitCode.USAGE), "those that there are"
    approved = told(capsys, "approve", "low.bundle", "--step", str(ASKED), "-o", "yes", *FLIGHT)
    assert f"step {ASKED} of `low`" in approved
    assert f"300 s: step {ASKED}, `inspect_area(" in approved
    rehearsed = told(capsys, "run", "low.bundle", "--dry-run", "--fresh-state", "--speed", "10")
    assert re.search(rf"\n +{ASKED}  \w+ +inspection +inspect_area\(", rehearsed)
    page = told(capsys, "docs", "low.rts", "-o", "-")
    assert re.search(rf"<t[dh][^>]*>{ASKED}</t[dh]>(\s*<[^>]+>)*\s*inspect", page)


@pytest.mark.parametrize("number", ["0", "-1"])
def test_step_numbers_below_one_are_refused(here: Path, number: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "1 takeoff" in told(capsys, "why", "low.bundle", "--step", number, code=ExitCode.USAGE)
    assert "greater than or equal to 1" in told(
        capsys, "approve", "low.bundle", "--step", number, "-o", "x", *FLIGHT, code=ExitCode.USAGE
    )
    replaced = ("compile", "low.rts", "--replaces", "low.bundle", "--from", number, *FLIGHT)
    assert "greater than or equal to 1" in told(capsys, *replaced, code=ExitCode.USAGE)
    assert not (here / "x").exists()


def test_a_replacement_is_new_from_the_step_that_was_typed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shorter = LOW.replace("inspect_area(bridge_a, altitude = 9 m, pattern = perimeter)", "hover(5 s)")
    (here / "shorter.rts").write_text(shorter)
    command = ("compile", "shorter.rts", "--replaces", "low.bundle", *FLIGHT)
    assert "new from step 3" in told(capsys, *command, "--from", "3")
    assert "new from step 3" in told(capsys, "show", "shorter.replacement")
    assert json.loads(told(capsys, *command, "--from", "3", "--json"))["replacement"]["from_step_number"] == 3
    assert "step 3 should be kept" in told(capsys, *command, "--from", "4", code=ExitCode.REFUSED)
    assert "accepted: 1 to 5" in told(capsys, *command, "--from", "6", code=ExitCode.USAGE)


def test_json_with_a_step_index_has_the_step_number(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    why = json.loads(told(capsys, "why", "low.bundle", "--step", str(ASKED), "--json"))
    assert (why["step"], why["step_number"], why["skill"]) == (ASKED - 1, ASKED, "inspect_area")
    checked = json.loads(told(capsys, "check", "low.rts", "--json"))
    (mission,) = checked["missions"]
    assert [each["step_number"] for each in mission["steps"]] == [1, 2, 3, 4]
    assert mission["steps"][ASKED - 1]["skill"] == "inspect_area"


def test_log_is_shown_with_step_numbers(flown: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "evidence.jsonl"
    log.write_bytes(b"".join(flown.lines))
    shown = told(capsys, "show", str(log))
    assert "step 1 `takeoff(" in shown
    assert "step 0" not in shown
    found = json.loads(told(capsys, "show", str(log), "--json"))["records"]
    about = [each for each in found if each.get("step", -1) >= 0]
    assert about
    assert all(each["step_number"] == each["step"] + 1 for each in about)
    assert all("step_number" not in each for each in found if each.get("step", -1) < 0)
    first = next(each["seq"] for each in found if each["type"] == "decision" and each["step"] == 0)
    assert "Step 1, takeoff(" in told(capsys, "why", str(log), "--record", str(first))


def test_mission_for_agents_has_index_and_number(tmp_path: Path) -> None:
    with Agents(None, low()) as agents:
        steps = json.loads(agents._mission())["steps"]
    assert [(each["step"], each["step_number"]) for each in steps] == [(at, at + 1) for at in range(len(steps))]
    (tool,) = (each for each in TOOLS if each.name == "replan")
    assert tool.input_schema["properties"]["from_step_number"]["minimum"] == 1


def test_an_event_of_a_run_has_both_and_its_text_the_number() -> None:
    (event,) = as_json(Happened(Happening("succeeded", 1_000_000, 0, "takeoff()")))
    assert (json.loads(event)["step"], json.loads(event)["step_number"]) == (0, 1)
    (without,) = as_json(Happened(Happening("ready", 1_000_000)))
    assert "step" not in without
    (line,) = plain(Happened(Happening("replacement", 1, 2, detail=f"from {step_words(2)} on")))
    assert "from step 3 on" in line


def test_audit_uses_step_numbers() -> None:
    assert ref_words(Ref(STEP, 0, -1)) == "step 1"
    assert ref_words(Ref(FALLBACK_LINK, 2, 0)) == "link 1 of the fallback of step 3"
    assert ref_words(Ref(FALLBACK_LINK, 2, DEGRADE)) == "the target of a degrade rule, at step 3"
    assert ref_words(Ref(CONTINGENCY_LINK, -1, 1)) == "link 2 of the contingency"
    for odd in (Ref(STEP, -1, -1), Ref(STEP, 0, 3), Ref(9, 1, 1), Ref(CONTINGENCY_LINK, 0, 0)):
        assert ref_words(odd).startswith("neither a step nor a link")


def test_a_record_holds_the_index(flown: Run) -> None:
    decided = [json.loads(line) for line in flown.lines if b'"type":"decision"' in line]
    assert decided[0]["step"] == 0
    assert "step_number" not in decided[0]
    assert "step_number" not in DecisionRecord.__struct_fields__


def test_number_and_index_are_one_apart() -> None:
    assert [number_of(index_of(number)) for number in (1, 2, 600)] == [1, 2, 600]
    assert (index_of(1), step_words(0)) == (0, "step 1")


def test_no_text_is_made_of_an_index() -> None:
    """Text with `step` before a value must use `step_number`: an index would be off by one."""
    wrong = []
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text("utf-8")
        if "step {" not in text:  # to parse all files takes seconds
            continue
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.JoinedStr):
                continue
            for before, value in zip(node.values, node.values[1:], strict=False):
                if not isinstance(before, ast.Constant) or not isinstance(value, ast.FormattedValue):
                    continue
                taken = ast.unparse(value.value)
                if not re.search(r"\bstep $", str(before.value)) or "number_of(" in taken:
                    continue
                if re.search(r"\.step\b|\[.step.\]|\bindex\b", taken):
                    wrong.append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert wrong == []


def test_replacement_in_a_log_uses_step_numbers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "r"
    path.write_bytes(replacement(low()))
    shown = told(capsys, "show", str(path))
    assert "new from step 3" in " ".join(shown.split())
