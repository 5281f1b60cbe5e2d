"""`rtshcua run --set`, over UDP: set, flown, put back; and after a run that was killed put back by the next one."""

import json
import signal
import socket
import tempfile
import time
from base64 import b64encode
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.boundary.process import program

#: so slow that a busy machine's hold-ups stay below what a permit lasts
SPEED = 3
OWNERS = ("--flavour", "ardupilot", "--parameter", "FENCE_ALT_MAX=12")
#: killed between the two, the boundary of a process of its own loses all that it had not kept
APART = () if program() is None else ("--mode", "process")
SET = ("--set", "FENCE_ALT_MAX=90")


def effects(folder: Path, event: str) -> list[str]:
    """The details of these effects, in the order of the log."""
    found = map(json.loads, (folder / "log.jsonl").read_text().splitlines())
    return [each["detail"] for each in found if each.get("event") == event]


def owed(ground: Any) -> dict[str, list[str]]:
    (kept,) = Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("parameters/vehicle-quad-07")
    found: dict[str, list[str]] = json.loads(kept.read_text())
    return found


@pytest.mark.slow
def test_next_run_restores_parameters_of_a_killed_run(ground: Any, port: int) -> None:
    def runs() -> set[Path]:
        return set((ground.folder / "runs").iterdir())

    ground.vehicle(port, SPEED, *OWNERS)
    bundle, words = ground.bundle(), ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", *APART)
    first = ground.run(bundle, *words, *SET, speed=SPEED)
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    first.process.wait()
    (killed,) = runs()
    assert effects(killed, "preparation") == ["set FENCE_ALT_MAX from 12 to 90"]
    assert effects(killed, "prepared") == ["FENCE_ALT_MAX is 90"]
    assert owed(ground) == {"FENCE_ALT_MAX": ["12", "90"]}

    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    (other,) = runs() - {killed}
    (waits,) = effects(other, "not-restored")
    assert "FENCE_ALT_MAX to 12" in waits
    assert effects(other, "preparation") == ["restore FENCE_ALT_MAX from 90 to 12"]
    assert effects(other, "prepared") == ["FENCE_ALT_MAX is 12"]
    assert owed(ground) == {}
    verified = ground.start("verify-log", "--audit", str(other), "--json").end()
    assert verified.code == 0, verified.events


@pytest.mark.slow
def test_refused_run_restores_parameters_of_a_dead_run(ground: Any, port: int) -> None:
    ground.vehicle(port, SPEED, *OWNERS)
    ground.command = ground.afresh  # its view is as slow to start as it is: else it tells too late to be killed in time
    bundle, words = ground.bundle(), ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    first = ground.run(bundle, *words, *SET, speed=SPEED)
    first.until("prepared")
    first.signal(signal.SIGKILL)
    first.process.wait()
    killed = first.folder
    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 5, "a bundle flies once"
    (other,) = set((ground.folder / "runs").iterdir()) - {killed}
    assert effects(other, "preparation") == ["restore FENCE_ALT_MAX from 90 to 12"]
    assert effects(other, "dispatched") == []
    assert owed(ground) == {}


@pytest.mark.slow
def test_ctrl_c_on_the_ground_restores_parameters(ground: Any, port: int) -> None:
    ground.vehicle(port, SPEED, *OWNERS)
    ground.command = ground.afresh  # as above: else it flies already
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    run = ground.run(ground.bundle(), *words, *SET, speed=SPEED)
    run.until("prepared")
    run.signal(signal.SIGINT)
    assert run.end().code in (130, 6), run.stderr
    assert effects(run.folder, "preparation")[-1] == "restore FENCE_ALT_MAX from 90 to 12"
    assert effects(run.folder, "prepared")[-1] == "FENCE_ALT_MAX is 12"
    assert owed(ground) == {}


@pytest.mark.slow
def test_agent_is_served_while_parameters_are_set(ground: Any, port: int) -> None:
    ground.vehicle(port, SPEED, *OWNERS)
    with tempfile.TemporaryDirectory(dir="/tmp") as folder, socket.socket(socket.AF_UNIX) as link:
        path = Path(folder) / "s"
        words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--agent-socket", str(path))
        run = ground.run(ground.bundle(), *words, *SET, speed=SPEED)
        until_s = time.monotonic() + 60
        while link.connect_ex(str(path)):
            assert time.monotonic() < until_s
            time.sleep(0.01)
        link.settimeout(60)
        link.sendall(json.dumps({"id": 7, "document": b64encode(b"nonsense").decode()}).encode() + b"\n")
        lines = link.makefile("rb")
        told = [json.loads(next(lines)) for _ in range(3)]
        while told[-1]["type"] != "answer":
            told.append(json.loads(next(lines)))
        run.signal(signal.SIGINT)
        run.end()
    events = [each.get("event", each["type"]) for each in told]
    assert events[:3] == ["hello", "mission", "preparation"], "it was welcomed before"
    assert (told[-1]["id"], told[-1]["slug"]) == (7, "malformed")
