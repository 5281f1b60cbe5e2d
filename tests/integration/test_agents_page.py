"""docs/agents.md: its examples turn a model's call into the tool's result, for either API."""

import json
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rtshcua.front.cli import app

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = (CHECKOUT / "docs/agents.md").read_text(encoding="utf-8")
SHARED, ANTHROPIC, OPENAI = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with a policy, and keys; the command runs in this process."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rules.rts").write_text((CHECKOUT / "policies/bridge_inspection.rts").read_text("utf-8"), "utf-8")
    capsys.readouterr()

    def run(words: list[str], **_: Any) -> SimpleNamespace:
        assert words[0] == "rtshcua"
        app.main(words[1:])
        return SimpleNamespace(stdout=capsys.readouterr().out)

    run(["rtshcua", "keys", "init"])
    monkeypatch.setattr(subprocess, "run", run)
    return tmp_path


def proposal(altitude: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((CHECKOUT / "missions/proposal.json").read_text("utf-8"))
    found["phases"][0]["steps"][0]["arguments"]["altitude"] = altitude
    return found


def of(example: str) -> Any:
    """What an example defines, run after what all share."""
    names: dict[str, Any] = {}
    exec(SHARED + example, names)
    return names["propose"]


@pytest.mark.parametrize("altitude", ["25 m", "41 m"])
@pytest.mark.parametrize("api", ["anthropic", "openai"])
def test_examples_of_the_page_handle_a_tool_call(here: Path, api: str, altitude: str) -> None:
    given: dict[str, Any] = {}
    spec = proposal(altitude)
    call = SimpleNamespace(type="tool_use", id="7", input=spec)
    item = SimpleNamespace(type="function_call", call_id="7", arguments=json.dumps(spec))

    def create(**words: Any) -> SimpleNamespace:
        given.update(words)
        return SimpleNamespace(content=[call], output=[item])

    endpoint = SimpleNamespace(create=create)
    client = SimpleNamespace(messages=endpoint, responses=endpoint)
    messages = of(ANTHROPIC if api == "anthropic" else OPENAI)(client, "some", [])
    assert [tool["name"] for tool in given["tools"]] == ["propose_mission"]
    last = messages[-1]["content"][0]["content"] if api == "anthropic" else messages[-1]["output"]
    told = json.loads(last)
    assert told["accepted"] == (altitude == "25 m")
    assert [each["pointer"] for each in told["findings"]] == (
        [] if told["accepted"] else ["/phases/0/steps/0/arguments/altitude"]
    )
    assert (here / "spec.bundle").exists() == told["accepted"]
