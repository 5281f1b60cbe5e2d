"""Agents reach a vehicle by MCP servers that others made, as they come, through a gateway: they fly what the policy
permits, and read why the rest is refused.
"""

import json
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from virtual.gateway_clients import INSIDE, OTHERS, PROGRAMS, REASONS, Side, carried_out, flown, gateway, reads
from virtual.gateway_run import ScriptClient, mavlink

pytestmark = [pytest.mark.clients, pytest.mark.long]


def mcp(side: Side, role: str, server: str, *actions: Sequence[object]) -> list[str]:
    """Call tools of an MCP server that is a client in this role; what an agent reads after each."""
    address = f"tcp:127.0.0.1:{side.ports[role]}"
    options = {
        "mavlink_mcp": ["--conn", address, "--enable-actuation", "--allow-real-vehicle"],
        "ardupilot_mcp": ["--connect", address, "--enable-actuation"],
    }[server]
    program = [sys.executable, str(PROGRAMS / "mcp_program.py"), json.dumps(actions)]
    return [reads(each) for each in carried_out([*program, sys.executable, "-m", f"{server}.server", *options], OTHERS)]


@pytest.mark.skipif(not OTHERS.exists(), reason="`make clients` installs the MCP servers")
def test_agent_of_mavlink_mcp_flies_and_reads_why_it_is_refused(tmp_path: Path) -> None:
    """Of a refused height it reads the result alone: the server keeps no other texts than those of arming."""
    place = {"latitude": INSIDE[0], "longitude": INSIDE[1], "altitude_m": 8}
    with gateway(tmp_path, "ardupilot", "tcpin") as side, ThreadPoolExecutor() as pool:
        asked = {
            role: pool.submit(
                mcp, side, role, "mavlink_mcp", ["takeoff", {"altitude_m": 8}, "check_armable", "vehicle reported"]
            )
            for role in REASONS
        }
        height = pool.submit(mcp, side, "operator", "mavlink_mcp", ["takeoff", {"altitude_m": 80}])
        for role, check in asked.items():
            (told,) = check.result()
            assert REASONS[role] in told, (role, told)
        assert "MAV_RESULT_DENIED" in height.result()[0]
        up, there, down = mcp(
            side, "operator", "mavlink_mcp", ["takeoff", {"altitude_m": 8}], ["goto", place], ["land", {}]
        )
        assert "reached" in up
        assert "arrived" in there
        assert "landed and disarmed" in down
        flown(side.run, tmp_path)


def uploaded(client: ScriptClient, height_m: float) -> int:
    """Upload a mission to a height and a place, and down again; the MISSION_ACK."""
    items = [(22, 0, 0, 0.0), (22, 0, 0, height_m), (16, *INSIDE, height_m), (21, 0, 0, 0.0)]  # slot 0 is home
    client.link.mav.mission_count_send(1, 1, len(items))
    while True:
        asked = client.until(lambda each: each.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"))
        if asked.get_type() == "MISSION_ACK":
            return int(asked.type)
        command, latitude, longitude, height = items[asked.seq]
        client.link.mav.mission_item_int_send(
            1, 1, asked.seq, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, command, 0, 1, 0, 0, 0, 0,
            round(latitude * 1e7), round(longitude * 1e7), height,
        )  # fmt: skip


@pytest.mark.skipif(not OTHERS.exists(), reason="`make clients` installs the MCP servers")
def test_agent_of_ardupilot_mcp_flies_the_mission_of_a_script_and_reads_why_it_is_refused(tmp_path: Path) -> None:
    """It has tools to arm and to set modes: what Auto flies comes from a script at the same address, as from a ground
    station.
    """
    server = "ardupilot_mcp"
    texts: tuple[object, ...] = ("ardupilot_recent_statustext", {"n": 20})
    with gateway(tmp_path, "ardupilot", "tcpin") as side, ThreadPoolExecutor() as pool:
        asked = {role: pool.submit(mcp, side, role, server, ["ardupilot_arm", {}], texts) for role in REASONS}
        for role, check in asked.items():
            arming, told = check.result()
            assert "DENIED" in arming or "REJECTED" in arming, arming
            assert all(word in told for word in REASONS[role].split()), (role, told)
        script = ScriptClient(side.ports["operator"], scheme="tcp")
        script.meet()
        assert uploaded(script, 60) != mavlink.MAV_MISSION_ACCEPTED
        assert any("30 m" in each for each in script.texts), script.texts
        assert uploaded(script, 8) == mavlink.MAV_MISSION_ACCEPTED
        arming, _ = mcp(side, "operator", server, ["ardupilot_arm", {}], ["ardupilot_set_mode", {"mode": "AUTO"}])
        assert "ACCEPTED" in arming
        script.until_higher(6)
        script.until_at(*INSIDE)
        script.until_disarmed()
        flown(side.run, tmp_path)
        script.close()
