"""Whole flights over real UDP: they complete, they are recorded, and nothing of the ground was on board."""

import json
import subprocess
import sys
from typing import Any

import pytest

from rtshcua.codec.frames import Codec
from rtshcua.mavlink import tlog


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_short_mission_is_flown_and_recorded(ground: Any, flavour: str) -> None:
    run = ground.run(ground.bundle(), "--flavour", flavour).end()
    assert run.code == 0, run.stderr
    assert run.dispatched() == ["takeoff", "goto", "return_home"]
    assert run.effects().count("succeeded") == 3
    records = run.log()
    assert (records[0]["type"], records[-1]["type"], records[-1]["ending"]) == ("genesis", "close", "completed")
    assert records[-1]["tlog"] is not None
    summary = json.loads((run.folder / "summary.json").read_text())
    assert summary == {key: value for key, value in run.summary.items() if key != "event"}
    assert (summary["flavour"], summary["steps_done"], summary["whole"]) == (flavour, 3, True)
    frames = list(tlog.read((run.folder / "telemetry.tlog").read_bytes()))
    assert [entry.at_us for entry in frames] == sorted(entry.at_us for entry in frames)
    names = {frame.name for entry in frames for frame in Codec(1, 1).parse(entry.frame)}
    assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "COMMAND_LONG", "COMMAND_ACK"} <= names


def test_each_decision_is_written_before_it_is_acted_on(ground: Any) -> None:
    run = ground.run(ground.bundle()).end()
    kinds = [(r["type"], r.get("event") or r.get("outcome")) for r in run.log() if r.get("step") == 1]
    assert kinds == [("decision", "allow"), ("effect", "dispatched"), ("effect", "succeeded")]


def test_nothing_of_the_ground_is_loaded_on_board(ground: Any) -> None:
    words = ["run", ground.bundle(), "--speed", "20", "--json"]
    program = f"import sys; from rtshcua.cli.app import main; print(main({words})); print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=ground.folder, capture_output=True, text=True, check=True, timeout=60
    )
    *_, code, modules = run.stdout.splitlines()
    assert code == "0"
    loaded = modules.split()
    ours = [name for name in loaded if name.startswith("rtshcua.")]
    assert "rtshcua.onboard.runtime.runtime" in ours
    ground_only = ("lark", "shapely", "rtshcua.ground", "rtshcua.model.ir")
    assert not [name for name in loaded if name.startswith(ground_only)]
    # typer reads options with pydantic; nothing of ours needs it.
    program = f"import sys\nfor name in {ours}: __import__(name)\nprint('pydantic' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout == "False\n"


def test_a_bundle_flies_once(ground: Any) -> None:
    bundle = ground.bundle()
    assert ground.run(bundle).end().code == 0
    for _ in range(2):  # each is a new process: it is on the disk
        again = ground.run(bundle).end()
        assert again.code == 5
        assert "a bundle flies once" in again.stderr
        assert again.events == [
            {"event": "refused", "slug": "replayed", "text": again.events[0]["text"], "exit_code": 5}
        ]
    assert len(list((ground.folder / "runs").iterdir())) == 1
    assert ground.run(bundle, "--fresh-state").end().code == 0


def test_without_json_a_pipe_gets_plain_lines(ground: Any) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "rtshcua.cli.app", "run", ground.bundle(), "--speed", "20"],
        cwd=ground.folder, capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    lines = run.stdout.splitlines()
    assert lines[0].startswith("mission inspect_bridge_a under bridge_inspection@7 on quad-07")
    assert [line.split()[2:4] for line in lines if " dispatched " in line] == [["dispatched", "step"]] * 3
    assert lines[-4].startswith("completed: 3 of 3 steps done in ")
    assert lines[-1].split()[:3] == ["next", "rtshcua", "verify-log"]
