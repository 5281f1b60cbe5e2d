"""`rtshcua schema`: the general schema, the schema of a policy, and the tool definitions."""

import json
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.ground.agent.specification_schema import schema

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = str(CHECKOUT / "policies" / "bridge_inspection.rts")


def test_default_schema_is_the_general_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out) == schema()


@pytest.mark.parametrize(
    ("form", "key"),
    [("openai", "parameters"), ("anthropic", "input_schema"), ("mcp", "inputSchema"), ("schema", "properties")],
)
def test_under_a_policy_only_its_skills_are_left(form: str, key: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "--policy", POLICY, "--form", form]) == ExitCode.OK
    tool = json.loads(capsys.readouterr().out)
    found = tool if form == "schema" else tool[key]
    assert sorted(found["$defs"]) == ["emergency_land", "goto", "hover", "inspect_area", "return_home", "takeoff"]
    assert found["$defs"]["inspect_area"]["properties"]["arguments"]["properties"]["area"]["enum"] == [
        "bridge_a",
        "bridge_b",
    ]
    assert found["properties"]["imports"]["items"]["enum"] == ["lib:policies/bridge_inspection.rts"]
    assert tool.get("strict", True) is True


def test_a_policy_of_ones_own_is_not_imported(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    own = tmp_path / "own.rts"
    own.write_text((CHECKOUT / "policies" / "training_field.rts").read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["schema", "--policy", str(own)]) == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert found["properties"]["imports"]["maxItems"] == 0
    speed = found["$defs"]["goto"]["properties"]["arguments"]["properties"]["speed"]
    assert "From 1 m/s to 3 m/s" in speed["description"]


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--form", "openi"], ExitCode.USAGE, "did you mean `openai`?"),
        (["--policy", "missing.rts"], ExitCode.INPUT, "missing.rts"),
        (["--policy", "wrong.rts"], ExitCode.DIAGNOSTICS, "hoover"),
        (["--policy", "none.rts"], ExitCode.INPUT, "no policy"),
        (["--name", "another"], ExitCode.USAGE, "`--name` requires `--policy`"),
        (["--policy", POLICY, "--name", "another"], ExitCode.INPUT, "`bridge_inspection`"),
    ],
)
def test_invalid_arguments_are_refused(
    words: list[str],
    code: ExitCode,
    told: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("none.rts").write_text('import "lib:skills/hover.rts"\n', encoding="utf-8")
    Path("wrong.rts").write_text("policy p version 1 { permit hoover by any }\n", encoding="utf-8")
    assert main(["schema", *words]) == code
    said = capsys.readouterr()
    assert told in said.err
    assert said.out == ""
