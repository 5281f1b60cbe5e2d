"""A script flies through the gateway on both simulated autopilots, and is refused with a reason; the log verifies.

Nothing is in place but a field's KML file: no keys, no policy, no configuration.
"""

import json
import math
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from virtual.gateway_run import running, taken_off, verified

pytestmark = [pytest.mark.slow, pytest.mark.long]

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
#: what a stranger may wait from the start to the first refusal on the screen, in seconds (the requirement)
ONE_MINUTE_S = 60.0
INSIDE, BACK, OUTSIDE = (47.39780, 8.54585), (47.39774, 8.54555), (47.39774, 8.54900)


def records(log: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def effects(log: Path) -> list[dict[str, Any]]:
    return [each for each in records(log) if each["type"] == "effect"]


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
        assert any("target outside field, nearest accepted 47." in text for text in client.texts), client.texts
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
    assert run.events[-1] == {"event": "summary", "exit_code": 0, "sessions": 1}
    assert "fd:" not in json.dumps(run.events), "the flight's link is the vehicle's address"
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
        assert client.goto(*INSIDE, 6) == ACCEPTED, client.texts
        client.until_at(*INSIDE)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        run.wait_for("session")
        renewed = run.wait_for("policy", 2)
        assert renewed["why"].endswith(" from its home")
        assert {each[:2] for each in renewed["changed"]} == {"- ", "+ "}
        taken_off(client)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        assert run.wait() == 0
        assert [each["ending"] for each in run.all("session")] == ["completed"] * 2


def test_ctrl_c_brings_the_vehicle_down(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        taken_off(client)
        for _ in range(2):  # the second one asks the flight for its state
            run.process.send_signal(signal.SIGINT)
            client.until_s(0.5)
        client.until_disarmed()
        assert run.wait() == 130
        told = run.wait_for("session")
        assert len(run.all("interrupted")) == 1
        assert run.events[-1] == {"event": "summary", "exit_code": 130, "sessions": 1}
    assert told["ending"] == "interrupted"
    assert verified(run, ["--audit", told["log"]], tmp_path).returncode == 0


def test_a_disarming_withdraws_the_take_off_before_it(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        client.meet()
        client.retry(lambda: client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
        results: list[tuple[int, int]] = []
        highest_mm = 0

        def heard(message: Any) -> bool:
            nonlocal highest_mm
            if message.get_type() == "COMMAND_ACK":
                results.append((message.command, message.result))
            if message.get_type() == "GLOBAL_POSITION_INT":
                highest_mm = max(highest_mm, message.relative_alt)
            return time.monotonic() >= end_s

        here = client.position()
        ground_m = (here.alt - here.relative_alt) / 1_000
        values = (0, 0, 0, math.nan, math.nan, math.nan, ground_m + 8)
        client.link.mav.command_long_send(client.link.target_system, 1, mavlink.MAV_CMD_NAV_TAKEOFF, 0, *values)
        end_s = time.monotonic() + 0.06
        client.until(heard)
        # a take-off that was given out meanwhile is cancelled first, and the client is told to ask again
        until_s = time.monotonic() + 30
        while (400, 0) not in results and time.monotonic() < until_s:
            client.link.mav.command_long_send(client.link.target_system, 1, 400, 0, *[0] * 7)
            end_s = time.monotonic() + 0.5
            client.until(heard)
        end_s = time.monotonic() + 15
        client.until(heard)
        assert (22, 0) not in results, results
        assert results[-1] == (400, 0), results
        assert highest_mm < 500, "it stays on the ground"
        taken_off(client)  # and the next one flies
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        client.until_disarmed()
        client.until(lambda _: any(each["ending"] == "completed" for each in run.all("session")))
        assert run.interrupt() == 0


def test_a_stream_of_setpoints_does_not_undo_the_clients_landing(tmp_path: Path) -> None:
    with running(tmp_path, "--flavour", "px4", "--sessions", "1") as (run, client):
        taken_off(client)
        latitude, longitude = INSIDE

        def stream(seconds: float) -> None:
            """At 5 Hz, a place 3 m higher."""
            for _ in range(round(seconds * 5)):
                client.link.mav.set_position_target_global_int_send(
                    0, client.link.target_system, 1, 6, 0xDF8, round(latitude * 1e7), round(longitude * 1e7), 9,
                    *[0] * 8,
                )  # fmt: skip
                client.until_s(0.2)

        assert client.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == ACCEPTED
        stream(3)
        assert client.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
        stream(10)
        client.until_disarmed()
        assert run.wait() == 0
        assert run.wait_for("session")["ending"] == "completed"


def test_ctrl_c_on_the_ground_ends_at_once(tmp_path: Path) -> None:
    with running(tmp_path) as (run, client):
        client.meet()
        assert run.interrupt() == 0
        assert run.all("session") == []
