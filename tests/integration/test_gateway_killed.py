"""A part of the gateway is killed while the vehicle flies: it is brought down, and nothing is left behind."""

import os
import signal
import time
from pathlib import Path

import pytest

from rtshcua.adapters.simulator import Simulator
from virtual.gateway_run import KML, PATIENCE_S, GatewayRun, ScriptClient, free_port, running, taken_off, verified

pytestmark = [pytest.mark.slow, pytest.mark.long]


def test_a_killed_flight_is_brought_down_by_the_next_one(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        taken_off(client)
        os.kill(child(run.process.pid, "--wait"), signal.SIGKILL)
        client.until_disarmed()
        told = run.wait_for("session")
        assert told["ending"] in ("aborted", "recovered", "interrupted"), told
        assert run.interrupt() == 0


def test_a_killed_relay_is_started_again_and_the_vehicle_brought_down(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        taken_off(client)
        os.kill(child(run.process.pid, "rtshcua.adapters.gateway"), signal.SIGKILL)
        client.until_disarmed()
        run.wait_for("session")
        assert any("relay" in each["text"] for each in run.all("note"))
        taken_off(client)  # the next session
        assert run.interrupt() == 130


def test_a_killed_gateway_leaves_nothing_behind_and_its_successor_brings_the_vehicle_down(tmp_path: Path) -> None:
    link, port = free_port(), free_port()
    (tmp_path / "field.kml").write_text(KML)
    words = ("--allow", "takeoff,goto,land", "--below", "20 m", "--inside", "field.kml", "--utc-error", "500ms")
    words += ("--connect", f"udpin:127.0.0.1:{link}", "--client", f"script=udpin:127.0.0.1:{port}")
    with Simulator(["--port", str(link), "--stock"]):
        run, client = GatewayRun(tmp_path, *words), ScriptClient(port)
        try:
            taken_off(client)
            relay, flight = child(run.process.pid, "rtshcua.adapters.gateway"), child(run.process.pid, "--wait")
            run.process.kill()
            for each in (relay, flight):
                ended(each)
            run.stop()
            run = GatewayRun(tmp_path, *words)
            client.until_disarmed()
            told = run.wait_for("session")
            assert told["exit_code"] == 6, told
            assert run.interrupt() == 0
        finally:
            client.close()
            run.stop()
    logs = sorted(str(each) for each in (tmp_path / "runs").iterdir() if each.is_dir())
    assert len(logs) == 2
    assert [verified(run, ["--audit", each], tmp_path).returncode for each in logs] == [0, 0]


def ended(process: int) -> None:
    """Wait until a process has ended."""
    end_s = time.monotonic() + PATIENCE_S
    while Path(f"/proc/{process}").exists() and "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def child(parent: int, word: str) -> int:
    """The process id of the child of a process whose command line has a word."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        for each in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
            if word.encode() in Path(f"/proc/{each}/cmdline").read_bytes().split(b"\0"):
                return int(each)
        time.sleep(0.05)
    raise AssertionError(f"no child with `{word}`")
