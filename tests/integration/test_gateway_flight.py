"""A script flies through the gateway on both simulated autopilots, and is refused with a reason; the log verifies.

Nothing is in place but a field's KML file: no keys, no policy, no configuration.
"""

import json
import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.simulator import Simulator
from virtual.gateway_run import KML, PATIENCE_S, GatewayRun, ScriptClient, verified

pytestmark = pytest.mark.slow

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
#: what a stranger may wait from the start to the first refusal on the screen, in seconds (the requirement)
ONE_MINUTE_S = 60.0
INSIDE, BACK, OUTSIDE = (47.39780, 8.54585), (47.39774, 8.54555), (47.39774, 8.54900)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(folder: Path, *words: str) -> Iterator[tuple[GatewayRun, ScriptClient]]:
    (folder / "field.kml").write_text(KML)
    port = free_port()
    quick = ("--allow", "takeoff,goto,land", "--below", "30", "m", "--inside", "field.kml")
    run = GatewayRun(folder, *quick, "--client", f"script=udpin:127.0.0.1:{port}", *words)
    client = ScriptClient(port)
    try:
        yield run, client
    finally:
        client.close()
        run.stop()


def records(log: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def effects(log: Path) -> list[dict[str, Any]]:
    return [each for each in records(log) if each["type"] == "effect"]


def taken_off(client: ScriptClient, height_m: float = 6.0) -> None:
    client.meet()
    client.retry(lambda: client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
    client.retry(lambda: client.takeoff(height_m))
    client.until_higher(height_m - 1.2)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_script_flies_and_is_refused(tmp_path: Path, flavour: str) -> None:
    with running(tmp_path, "--flavour", flavour, "--sessions", "1") as (run, client):
        client.meet()
        # the first refusal, on the client's screen
        client.retry(lambda: client.takeoff(80), DENIED)
        assert any("30 m" in text for text in client.texts), client.texts
        assert time.monotonic() - run.began_s < ONE_MINUTE_S

        taken_off(client)
        assert client.goto(*OUTSIDE, 8) == DENIED
        assert any("not permitted" in text for text in client.texts), client.texts
        assert client.goto(*INSIDE, 60) == DENIED
        assert client.goto(*INSIDE, 8) == ACCEPTED
        client.until_at(*INSIDE)
        assert client.goto(47.39800, 8.54600, 8) == ACCEPTED
        client.until_s(1.0)
        assert client.goto(*BACK, 8) == ACCEPTED  # supersedes the one before
        client.until_at(*BACK)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        assert run.wait() == 0
        told = run.wait_for("session")
    assert told["ending"] == "completed"
    log = tmp_path / told["log"]
    assert "superseded" in [each["event"] for each in effects(log)]
    # take-off, three go-tos, landing; holds between them are links
    assert {each["step"] for each in effects(log) if each["event"] == "dispatched"} - {-1} == {0, 1, 2, 3, 4}
    refusals = [json.loads(each["detail"]) for each in records(log) if each.get("event") == "client"]
    assert {"takeoff", "goto"} <= {each.get("skill") for each in refusals if each["effect"] == "refused"}
    audit = verified(run, ["--audit", told["log"]], tmp_path)
    assert audit.returncode == 0, audit.stdout + audit.stderr


def test_the_next_flight_begins_where_the_vehicle_landed(tmp_path: Path) -> None:
    """Away from its home: the policy is written again for the new one."""
    with running(tmp_path, "--flavour", "ardupilot", "--sessions", "2") as (run, client):
        taken_off(client)
        assert client.goto(*INSIDE, 6) == ACCEPTED
        client.until_at(*INSIDE)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        run.wait_for("session")
        run.wait_for("policy", 2)
        taken_off(client)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        assert run.wait() == 0
        assert [each["ending"] for each in run.all("session")] == ["completed"] * 2


def test_ctrl_c_brings_the_vehicle_down(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        taken_off(client)
        run.process.send_signal(signal.SIGINT)
        client.until_disarmed()
        assert run.wait() == 130
        told = run.wait_for("session")
    assert told["ending"] == "interrupted"
    assert verified(run, ["--audit", told["log"]], tmp_path).returncode == 0


def test_ctrl_c_on_the_ground_ends_at_once(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        client.meet()
        assert run.interrupt() == 0
        assert run.all("session") == []


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
