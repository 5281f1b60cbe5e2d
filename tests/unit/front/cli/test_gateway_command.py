"""`rtshcua gateway`: a wrong command line is refused before anything starts, with the nearest fix, in 80 columns."""

import json
from pathlib import Path

import pytest

from rtshcua.app.gateway.configuration import reached
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands.gateway import _Console

KML = "<kml><Placemark><Polygon/></Placemark></kml>"
QUICK = ["--allow", "takeoff,goto,land", "--below", "30", "m"]

#: what is recorded about a client, by the line that people read
CLIENTS: dict[str, dict[str, object]] = {
    "goto denied: altitude 60 m, accepted 30 m (authority/out-of-scope)": {
        "effect": "refused", "skill": "goto", "reason": "authority/out-of-scope",
        "answer": "goto denied: altitude 60 m, accepted 30 m (authority/out-of-scope)",
    },
    "permitted goto target 47.3983000 N, 8.5455900 E altitude 20 m": {
        "effect": "permitted", "skill": "goto", "step": 1,
        "arguments": {"target": "47.3983000 N, 8.5455900 E", "altitude": "20 m"},
    },
    "refused command 246: command 246 has no mapping (80 more before it)": {
        "effect": "refused", "left_out": 80, "command": 246, "reason": "command 246 has no mapping",
    },
    "absorbed parameter MIS_TAKEOFF_ALT": {"effect": "absorbed", "parameter": "MIS_TAKEOFF_ALT"},
}  # fmt: skip

WRONG = {
    "no policy": ([], 2, "the gateway has no policy", "--allow takeoff,goto,land --below 30 m"),
    "a skill": (["--allow", "takeof", "--below", "30 m"], 2, "`takeof` is not a skill", "did you mean `takeoff`?"),
    "no height": (["--allow", "takeoff"], 2, "`--allow` requires `--below HEIGHT`", "--below 30 m"),
    "no unit": (
        ["--allow", "takeoff", "--below", "30"],
        2,
        "`30` in `--below` is not a height",
        "did you mean `30 m`?",
    ),
    "no length": (["--allow", "takeoff", "--below", "30 s"], 2, "`30 s` in `--below`", "--below 30 m"),
    "another unit": (["--allow", "takeoff", "--below", "30", "ft"], 2, "`30 ft` in `--below` is not a height", "30 m"),
    "no take-off": (["--allow", "goto", "--below", "30 m"], 2, "`--allow` has no `takeoff`", "--allow takeoff,goto"),
    "too low": (["--allow", "takeoff", "--below", "2 m"], 2, "`--below 2 m` is out of range", "`5 m`"),
    "too high": (["--allow", "takeoff", "--below", "1 km"], 2, "`--below 1 km` is out of range", "`500 m`"),
    "without `--allow`": (["--inside", "field.kml"], 2, "`--inside` requires `--allow`", "--allow takeoff"),
    "two policies": ([*QUICK, "--policy", "rules.rts"], 2, "`--allow` writes the policy", ""),
    "a second configuration": ([*QUICK, "a.toml", "b.toml"], 2, "`b.toml`", "one configuration"),
    "a missing area": ([*QUICK, "--inside", "none.kml"], 3, "cannot read `none.kml`", ""),
    "an area without polygon": ([*QUICK, "--inside", "field.kml"], 3, "no outer boundaries", ""),
    "a policy": (["kept/policy.rts"], 3, "this is a source of a policy", "rtshcua gateway kept/gateway.toml"),
    "another policy": (["mine.rts"], 3, "this is a source of a policy", "rtshcua gateway --policy mine.rts"),
    "a missing configuration": (["none.toml"], 3, "cannot read `none.toml`", ""),
    "a client": ([*QUICK, "--client", "a=udpin:1"], 2, "port of the link is missing", "udpin"),
    "an address twice": (
        [*QUICK, "--client", "a=tcpin:0.0.0.0:9", "--pilot", "tcpin:0.0.0.0:9"],
        2,
        "`a` and `pilot` have the same address",
        "the address says who speaks",
    ),
    "a vehicle's address": ([*QUICK, "--connect", "udpin:x"], 2, "port of the link is missing", ""),
    "the simulated vehicle": (
        [*QUICK, "--connect", "udpin:0.0.0.0:14550", "--battery", "50"],
        2,
        "options of the simulated vehicle",
        "rtshcua sim",
    ),
}


@pytest.fixture
def folder(own_world: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "field.kml").write_text(KML)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "gateway.toml").touch()
    return tmp_path


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_command_line_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    words, code, said, help = WRONG[what]
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["gateway", *words]) == code
    plain = capsys.readouterr().err
    assert max(map(len, plain.splitlines())) <= 80
    text = " ".join(plain.split())
    assert " ".join(said.split()) in text
    assert help in text
    assert main(["gateway", *words, "--json"]) == code
    told = json.loads(capsys.readouterr().out)
    assert told["exit_code"] == code
    assert told["error"]["text"]
    assert not (folder / "runs").exists()


def test_a_policy_with_errors_ends_with_1(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rules.rts").write_text("policy rules version 1 {")
    assert main(["gateway", "--policy", "rules.rts"]) == 1
    assert "the policy's sources have errors" in " ".join(capsys.readouterr().err.split())


def test_a_policy_needs_keys(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "rules.rts").write_text('import "lib:policies/bridge_inspection.rts"\n')
    source = Path(__file__).resolve().parents[4] / "policies/bridge_inspection.rts"
    assert main(["gateway", "--policy", str(source)]) == 4
    told = capsys.readouterr().err
    assert "no-keys" in told
    assert "rtshcua keys init" in told


def test_save_never_replaces_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine").mkdir()
    (folder / "mine" / "gateway.toml").write_text("")
    assert main(["gateway", *QUICK, "--save", "mine"]) == 3
    assert "mine/gateway.toml" in capsys.readouterr().err
    assert (folder / "mine" / "gateway.toml").read_text() == ""


def test_events_are_lines_of_text_or_json(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    events = [
        {"event": "policy", "text": "policy gateway version 1 {\n}\n"},
        {
            "event": "ready", "vehicle": "simulated px4", "policy": "gateway@1", "runs": "runs", "keys": "/keys",
            "operator_socket": "/tmp/operator.sock", "development": True, "saved": "mine",
            "clients": [
                {
                    "name": "station", "opened": "udpout:127.0.0.1:14550", "connect": "udpin:127.0.0.1:14550",
                    "pilot": False, "role": "operator",
                },
                {
                    "name": "pilot", "opened": "tcpin:0.0.0.0:5760", "connect": "tcp:127.0.0.1:5760", "pilot": True,
                    "role": "operator",
                },
            ],
        },
        {"event": "client-up", "name": "station", "peer": "127.0.0.1:9\x1b[2J"},
        *({"event": "client", "told": {"client": "station"} | told} for told in CLIENTS.values()),
        {"event": "policy", "text": "", "why": "the vehicle landed 13 m from its home", "changed": ["- a", "+ b"]},
        {"event": "interrupted"},
        {"event": "summary", "exit_code": 0, "sessions": 2},
        {"event": "session", "ending": "completed", "exit_code": 0, "log": "runs/a/log.jsonl", "root": "/keys/root"},
        {"event": "unknown"},
    ]  # fmt: skip
    for event in events:
        _Console(as_json=False).tell(event)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "udpin:127.0.0.1:14550  (as operator)" in text
    assert "tcp:127.0.0.1:5760  (pilot, full passage)" in text
    assert "from another machine, with this one's address" in text
    plain = " ".join(text.split())
    for line in CLIENTS:
        assert f"station: {line}" in plain, line
    assert "renewed: the vehicle landed 13 m from its home; what changed: - a + b" in plain
    assert "\x1b" not in text
    assert "rtshcua verify-log --audit runs/a/log.jsonl --root /keys/root" in " ".join(text.split())
    for event in events:
        _Console(as_json=True).tell(event)
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == events


def test_the_other_end_of_an_address() -> None:
    """By hand: what a client on this machine connects to. A sender's place is no address of the gateway's."""
    for opened, connect in (
        ("udpin:0.0.0.0:14550", "udpout:127.0.0.1:14550"),
        ("udpout:127.0.0.1:14550", "udpin:127.0.0.1:14550"),
        ("tcpin:192.168.1.4:5760", "tcp:192.168.1.4:5760"),
        ("serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:57600"),
        ("127.0.0.1:40312", "127.0.0.1:40312"),
    ):
        assert reached(opened) == connect
