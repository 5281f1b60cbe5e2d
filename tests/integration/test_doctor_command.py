"""`rtshcua doctor` with a simulated vehicle in a separate process, and without a vehicle."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from rtshcua.adapters.boundary import process as boundary_process
from rtshcua.adapters.boundary.process import MISSING, Measure, measures_here
from rtshcua.adapters.doctor.diagnosis import MissionVerdict
from rtshcua.adapters.simulator import Simulator
from rtshcua.front.cli.commands import doctor as doctor_command
from rtshcua.front.cli.commands.doctor import _boundary
from rtshcua.onboard.enforcement.load import EnforcementMode
from virtual.forked import Forked

COMMAND = [sys.executable, "-m", "rtshcua", "doctor"]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port: int = link.getsockname()[1]
        return port


def doctor(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *words], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.slow
def test_doctor_examines_a_vehicle_over_udp() -> None:
    port = free_port()
    with Simulator(["--port", str(port), "--flavour", "ardupilot"]):
        done = doctor("--connect", f"udpin:127.0.0.1:{port}", "--seconds", "5", "--json")
    said = json.loads(done.stdout)
    found = {each["slug"]: each["verdict"] for each in said["findings"]}
    assert found["link/heartbeat"] == found["autopilot/version"] == found["link/answers"] == "ok"
    assert said["exit_code"] == done.returncode
    assert done.stderr == ""
    missing = {f"boundary/{each.name.lower().replace('_', '-')}" for each in Measure if each not in measures_here(None)}
    assert {slug for slug in found if slug.startswith("boundary/")} == missing | {"boundary/process"}
    assert all(found[slug] == "warn" for slug in missing)


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["--connect", "serial:/dev/ttyAMA0:57601"], 2, "    |                     ^^^^^"),
        (["--connect", "serial:/dev/no-such-device:57600"], 8, "no such file"),
        (["--connect", "udpin:127.0.0.1:14550", "missing.bundle"], 3, "no such file"),
        ([], 2, "--connect"),
        (["--connect", "udpin:127.0.0.1:14550", "--agent-user", "no-such-user"], 2, "unknown user `no-such-user`"),
    ],
)
def test_wrong_options_are_refused(commands: Forked, words: list[str], code: int, says: str, tmp_path: Path) -> None:
    done = commands.run(["doctor", *words], tmp_path, 120)
    assert done.code == code
    assert says in done.err
    assert "Traceback" not in done.err


def test_missing_hardening_measures_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """By a program that lacks it, which is a script here; and that it breaks off."""
    script = tmp_path / "boundary"

    def asked(program: str) -> list[tuple[str, MissionVerdict, str]]:
        script.write_text(f"#!{sys.executable}\n{program}\n")
        script.chmod(0o755)
        return [(each.slug, each.verdict, each.found) for each in _boundary(EnforcementMode.PROCESS)]

    says = "import os, sys; os.write(int(sys.argv[2]), ({}).to_bytes(4, 'little') + bytes(8))"
    every = sum(Measure)
    monkeypatch.setattr(boundary_process, "program", lambda: script)
    for measure in Measure:
        (_, (slug, verdict, text)) = asked(says.format(every - measure))
        assert (slug, verdict) == (f"boundary/{measure.name.lower().replace('_', '-')}", MissionVerdict.WARN)
        assert MISSING[measure] in text
    assert [each[:2] for each in asked(says.format(every))] == [("boundary/process", MissionVerdict.OK)]
    for broken in ("raise SystemExit(3)", "pass"):
        ((slug, verdict, text),) = asked(broken)
        assert (slug, verdict) == ("boundary/process", MissionVerdict.STOP), "as `run` refuses"
        assert "did not start" in text


def test_in_process_run_is_judged_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its boundary's process is not asked, also where its program was built."""
    for built in (Path("rtshcua-boundary"), None):
        monkeypatch.setattr(doctor_command, "program", lambda built=built: built)
        ((slug, verdict, text),) = [
            each[:3] for each in map(msgspec.structs.astuple, _boundary(EnforcementMode.SOFTWARE))
        ]
        assert (slug, verdict) == ("boundary/process", MissionVerdict.WARN)
        assert "decides in its own process" in text
    ((_, verdict, _),) = [each[:3] for each in map(msgspec.structs.astuple, _boundary(EnforcementMode.NONE))]
    assert verdict is MissionVerdict.STOP, "as `run` refuses it"
