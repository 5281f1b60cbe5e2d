"""`rtshcua agent-bundle`: the plug-in fits its hosts, contains no secret, and its hook refuses calls.

What hosts ask: Claude Code's published schema of manifests, hooks and servers (SchemaStore, of 2026-04-23:
`claude-code-plugin-manifest.json`), and the specification of Agent Skills. Whoever has Claude Code names the program in
RTSHCUA_CLAUDE, and its own validator is asked too; that of 2.1.330 was.
"""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtshcua import __version__
from rtshcua.adapters.store.folders import data_folder
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands.agent_bundle import COPIED, NAME, plugin
from rtshcua.wire.keys import Duty

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = CHECKOUT / "policies/bridge_inspection.rts"
SOCKET = "/tmp/a place/quad.sock"
#: events of Claude Code's hooks that refuse a call, by its published schema
EVENTS = {"PreToolUse"}


@pytest.fixture
def base(own_world: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    made = tmp_path / "base.bundle"
    assert main(["keys", "init"]) == 0
    assert main(["compile", str(CHECKOUT / "missions/proposal.json"), "--with", str(POLICY), "-o", str(made)]) == 0
    capsys.readouterr()
    return made


def made(base: Path, folder: Path, *more: str) -> int:
    words = ["agent-bundle", str(folder), "--bundle", str(base), "--to", SOCKET, "--with", str(POLICY)]
    return main([*words, *more])


def read(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def test_plug_in_has_the_required_files_and_no_secret(
    base: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert made(Path("base.bundle"), Path("plug"), "--json") == 0
    told = json.loads(capsys.readouterr().out)
    plug = tmp_path / "plug"
    files = {str(path.relative_to(plug)) for path in plug.rglob("*") if path.is_file()}
    assert files == set(told["files"]) == {".claude-plugin/plugin.json", ".mcp.json", "hooks/hooks.json", *COPIED}
    manifest = read(plug / ".claude-plugin/plugin.json")
    assert re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", manifest["name"])
    assert re.fullmatch(r"\d+\.\d+\.\d+([-+].+)?", manifest["version"])
    assert (manifest["name"], manifest["version"]) == (NAME, __version__)
    assert set(manifest) == {"name", "version", "description", "author", "keywords"}
    assert [*manifest["author"]] == ["name"]
    texts = [manifest["description"], manifest["author"]["name"], *manifest["keywords"]]
    assert all(isinstance(text, str) and text for text in texts)
    ((name, server),) = read(plug / ".mcp.json")["mcpServers"].items()
    assert name == NAME
    assert set(server) <= {"command", "args", "env"}
    assert all(isinstance(word, str) for word in (*server["args"], *server.get("env", {}).values()))
    assert Path(server["command"]).is_absolute()
    at = server["args"].index("mcp")
    assert server["args"][at:] == ["mcp", str(base), "--to", SOCKET, "--with", str(POLICY)]
    hooks = read(plug / "hooks/hooks.json")
    assert set(hooks) == {"description", "hooks"}
    for event, matchers in hooks["hooks"].items():
        assert event in EVENTS
        for matcher in matchers:
            assert set(matcher) == {"matcher", "hooks"}
            re.compile(matcher["matcher"])
            for hook in matcher["hooks"]:
                assert set(hook) == {"type", "command", "timeout"}
                assert hook["type"] == "command"
                assert hook["timeout"] > 0
    whole = b"".join((plug / file).read_bytes() for file in files)
    keys = [path.read_bytes() for path in data_folder().rglob("*.key")]
    assert keys
    assert not any(key in whole for key in keys)
    assert base.read_bytes() not in whole


@pytest.mark.skipif(
    "RTSHCUA_CLAUDE" not in os.environ, reason="names the program of Claude Code, which is not ours to have"
)
def test_claude_validator_accepts_the_plug_in_and_rejects_a_broken_one(base: Path, tmp_path: Path) -> None:
    def validated(plug: Path) -> bool:
        command = [os.environ["RTSHCUA_CLAUDE"], "plugin", "validate", "--strict", "--json", str(plug)]
        settings = {"HOME": str(tmp_path), "DISABLE_AUTOUPDATER": "1", "CLAUDE_CODE_DISABLE_NONESSENTIAL_TRAFFIC": "1"}
        ended = subprocess.run(command, env=os.environ | settings, capture_output=True, check=False, timeout=60)
        told = json.loads(ended.stdout)
        assert told["success"] is (ended.returncode == 0)
        if told["success"]:
            assert [each["name"] for each in told["provides"]["mcpServers"]] == [NAME]
            assert told["provides"]["skills"] == [f"{NAME}:{NAME}"]
            assert [each["event"] for each in told["provides"]["hooks"]] == ["PreToolUse"]
        return bool(told["success"])

    plug = tmp_path / "plug"
    assert made(base, plug) == 0
    assert validated(plug)
    for name, word, other in (
        (".claude-plugin/plugin.json", f'"name": "{NAME}"', f'"name": "{NAME} {NAME}"'),
        (".mcp.json", '"command"', '"comand"'),
        ("hooks/hooks.json", "PreToolUse", "PreTool"),
    ):
        text = (plug / name).read_text("utf-8")
        (plug / name).write_text(text.replace(word, other, 1), "utf-8")
        assert not validated(plug), name
        (plug / name).write_text(text, "utf-8")


def test_the_skill_is_one_by_the_specification_of_skills(base: Path, tmp_path: Path) -> None:
    assert made(base, tmp_path / "plug") == 0
    text = (tmp_path / f"plug/skills/{NAME}/SKILL.md").read_text("utf-8")
    _, front, body = text.split("---\n", 2)
    fields = dict(line.split(": ", 1) for line in front.splitlines())
    assert set(fields) == {"name", "description"}
    assert fields["name"] == NAME, "that of its folder"
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", fields["name"])
    assert len(fields["name"]) <= 64
    assert not re.search(r"[<>]|: | #", fields["description"]), "plain text, in YAML too"
    assert 0 < len(fields["description"]) <= 1024
    tools = set(re.findall(r"`([a-z]+_[a-z]+|cancel|replan)`", body))
    server = (CHECKOUT / "rtshcua/front/mcp/server.py").read_text("utf-8")
    for tool in tools - {"idempotency_key", "wait_s", "from_step_number"}:
        assert f'"{tool}"' in server, "the skill speaks of tools that there are"
    assert {"describe_vehicle", "propose_mission", "mission_status", "cancel", "replan"} <= tools


def hooked(plug: Path, call: bytes) -> "subprocess.CompletedProcess[bytes]":
    (matcher,) = read(plug / "hooks/hooks.json")["hooks"]["PreToolUse"]
    words = shlex.split(matcher["hooks"][0]["command"].replace("${CLAUDE_PLUGIN_ROOT}", str(plug)))
    return subprocess.run(words, input=call, capture_output=True, check=False)


def test_hook_blocks_only_access_to_keys_and_socket(base: Path, tmp_path: Path) -> None:
    plug = tmp_path / "a plug"
    assert made(base, plug) == 0
    key = next(data_folder().rglob("mission-agent.key"))
    for path in (str(key), SOCKET):
        for tool in ({"command": f"cat '{path}'"}, {"file_path": path}):
            found = hooked(plug, json.dumps({"tool_name": "Bash", "tool_input": tool}).encode())
            assert (found.returncode, found.stdout) == (2, b"")
            assert b"use the tools" in found.stderr
    for call in (b'{"tool_name": "Bash", "tool_input": {"command": "ls"}}', b"{}", b"", b"[1]", b"\xff"):
        assert hooked(plug, call).returncode == 0, call


def test_invalid_input_creates_no_plug_in(base: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plug = tmp_path / "plug"
    other = tmp_path / "other.rts"
    other.write_text(POLICY.read_text("utf-8").replace("version 7", "version 8"), "utf-8")
    no_policy = tmp_path / "none.rts"
    no_policy.write_text("policy {", "utf-8")
    words = ["agent-bundle", str(plug), "--bundle", str(base), "--to", SOCKET, "--with"]
    assert main([*words, str(other)]) == 3
    assert "the policy of the sources" in capsys.readouterr().err
    assert main([*words, str(no_policy)]) == 3
    assert "have errors" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "missing.rts")]) == 3
    (tmp_path / "b").write_bytes(b"no bundle")
    assert made(tmp_path / "b", plug) in (3, 4)
    assert made(base, plug, "--mission-key", str(tmp_path / "missing.key")) == 3
    assert not plug.exists()
    assert made(base, plug) == 0
    assert made(base, plug) == 3
    assert "--force" in capsys.readouterr().err
    assert made(base, plug, "--force") == 0


def test_a_key_of_its_own_is_named_and_not_copied(base: Path, tmp_path: Path) -> None:
    key = next(data_folder().rglob("mission-agent.key"))
    assert made(base, tmp_path / "plug", "--mission-key", str(key)) == 0
    args = read(tmp_path / "plug/.mcp.json")["mcpServers"][NAME]["args"]
    assert args[args.index("--mission-key") + 1] == str(key)
    assert Duty.MISSION not in args


def test_module_is_started_in_isolation_without_a_script(
    base: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder `rtshcua` in the host's working folder must not be imported."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    assert made(base, tmp_path / "plug") == 0
    server = read(tmp_path / "plug/.mcp.json")["mcpServers"][NAME]
    assert [server["command"], *server["args"][:3]] == [str(tmp_path / "python3"), "-P", "-m", "rtshcua"]


@pytest.mark.parametrize(
    ("variable", "below"), [("RTSHCUA_DATA_DIR", ""), ("XDG_DATA_HOME", "rtshcua"), (None, None)]
)  # fmt: skip
def test_a_server_finds_the_key_store_of_who_made_its_plug_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str | None, below: str | None
) -> None:
    for each in ("RTSHCUA_DATA_DIR", "XDG_DATA_HOME"):
        monkeypatch.delenv(each, raising=False)
    if variable is not None:
        monkeypatch.setenv(variable, str(tmp_path))
    (server,) = json.loads(plugin([], SOCKET, "p@1", "quad")[".mcp.json"])["mcpServers"].values()
    told = None if below is None else {"RTSHCUA_DATA_DIR": str(tmp_path / below)}
    assert server.get("env") == told
