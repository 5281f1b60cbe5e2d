"""Programs that others made, as they come, are clients of a gateway: each flies what the policy permits, and its user
reads why the rest is refused.

Each client has an address for each role of the policy, and every role may take off under another condition, so that one
vehicle on the ground refuses for every reason. MAVSDK and MAVProxy show texts in flight too, where the wind is known.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from time import gmtime
from typing import Any, Final, NamedTuple

import pytest

from reference.sources import CHECKOUT
from rtshcua.adapters.simulator import Simulator
from virtual.gateway_run import GatewayRun, ScriptClient, free_port, mavlink

pytestmark = pytest.mark.clients

PROGRAMS: Final = Path(__file__).with_name("gateway_programs")
#: where `.make/clients` installs packages of other versions than ours
OTHERS: Final = CHECKOUT / "build/gateway-clients"
PATIENCE_S: Final = 120.0
ROLES: Final = ("operator", "zone", "skill", "daylight", "battery", "wind")
#: what each role's refusal says; the time of day is one at which nobody tests this, a minute of a day long gone by
REASONS: Final = {
    "zone": "inside pad",
    "skill": "the role skill may not",
    "daylight": "time ",
    "battery": "accepted 90.01 %",
    "wind": "wind.speed",
}
POLICY: Final = """
import "lib:skills/signals.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/goto.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

role zone, skill, daylight, battery, wind, supervisor

sizes takeoff(highest = 30 m, longest = 60 s, charge = 5 %)
sizes goto(highest = 30 m, longest = 120 s, charge = 12 %)
sizes return_home(longest = 240 s, charge = 17 %)
sizes emergency_land(longest = 120 s, charge = 8 %)

vehicle copter {
  identity "gateway-01"
  home     47.3977400 N, 8.5455900 E within 10 m
  speed    at most 12 m/s
  climb    at most 3 m/s
  position error 3 m
  energy   100 % = 18 min hover, 16 min flight
  brakes   from 12 m/s in 6 s after 500 ms
  speeds   cruise 5 m/s, climb 1.5 m/s, descent 1.5 m/s, landing 0.5 m/s below 10 m, return 5 m/s, air 16 m/s
  accelerates to 5 m/s in 5 s
  wind     at most 8 m/s
  return   at 30 m
  reserve  15 %
  clock    utc +00:00
  without  obstacle.distance, link.quality
}

zone field = polygon(
  47.3967 N, 8.5440 E, 47.3967 N, 8.5470 E, 47.3987 N, 8.5470 E, 47.3987 N, 8.5440 E,
) ceiling 40 m above home
zone pad = polygon(47.39795 N, 8.54645 E, 47.39805 N, 8.54645 E, 47.39805 N, 8.54655 E, 47.39795 N, 8.54655 E)

policy refusals version 1 {
  permit takeoff by role operator through agent when altitude <= 30 m
  permit goto by role operator through agent when target inside field
  permit takeoff by role zone through agent when position inside pad
  permit goto by role skill through agent
  permit takeoff by role daylight through agent when local time in HOUR:00 .. HOUR:01
  permit takeoff by role battery through agent when battery > 90 %
  permit takeoff, goto by role wind through agent when wind.speed < 1 m/s
  permit hover, return_home, emergency_land by any
  confirm takeoff when altitude > 20 m by role supervisor within 6 s
  contingency return_home, emergency_land
  airspace inside field
}
"""
INSIDE: Final = (47.3980, 8.5458)
OUTSIDE: Final = (47.3978, 8.5480)


class Client(NamedTuple):
    """A program: its command before an address and its actions, the scheme of its addresses, and its packages."""

    command: Sequence[str]
    scheme: str
    packages: Path | None = None


CLIENTS: Final = {
    "mavsdk": Client((sys.executable, str(PROGRAMS / "mavsdk_program.py")), "udpout://127.0.0.1:", OTHERS),
    "mavsdk-grpc": Client((sys.executable, str(PROGRAMS / "mavsdk_grpc_program.py")), "udpout://127.0.0.1:"),
    "mavproxy": Client((sys.executable, str(PROGRAMS / "mavproxy_program.py")), "udpout:127.0.0.1:"),
}


class Side:
    """The gateway, and the port of each role."""

    def __init__(self, run: GatewayRun, ports: Mapping[str, int]) -> None:
        self.run = run
        self.ports = ports


@contextmanager
def gateway(folder: Path, flavour: str, listens: str = "udpin") -> Iterator[Side]:
    """A gateway under the policy above, and a vehicle with wind and 80 % of its charge."""
    hour = (gmtime().tm_hour + 12) % 24
    (folder / "rules.rts").write_text(POLICY.replace("HOUR", f"{hour:02}"))
    ports = {role: free_port() for role in ROLES}
    words = [f"{role}={listens}:127.0.0.1:{port},role={role},rank={ROLES.index(role)}" for role, port in ports.items()]
    keys = [word for role in ROLES for word in ("--role", role)]
    subprocess.run(
        [sys.executable, "-m", "rtshcua", "keys", "init", "--development", *keys],
        env=os.environ | {"RTSHCUA_DATA_DIR": str(folder / "data")}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    port = free_port()
    height = "RTL_RETURN_ALT=30" if flavour == "px4" else "RTL_ALT=3000"
    with Simulator(["--port", str(port), "--flavour", flavour, "--battery", "80", "--wind", "3,270"]):
        run = GatewayRun(
            folder, "--policy", "rules.rts", "--connect", f"udpin:127.0.0.1:{port}", "--utc-error", "500ms",
            "--set", height, *[word for each in words for word in ("--client", each)],
        )  # fmt: skip
        try:
            run.wait_for("ready")
            yield Side(run, ports)
        finally:
            run.stop()


def carried_out(command: Sequence[str], packages: Path | None = None) -> list[dict[str, Any]]:
    """Run a program; what it printed about each of its actions."""
    environment = os.environ | ({} if packages is None else {"PYTHONPATH": str(packages)})
    program = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, env=environment,
    )  # fmt: skip
    try:
        out, wrong = program.communicate(timeout=PATIENCE_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)  # MAVSDK and MCP servers are processes of their own
        program.communicate()
    told = [json.loads(line) for line in out.splitlines() if line.startswith('{"action"')]
    assert program.returncode == 0, (told, wrong)
    return told


def reads(told: Mapping[str, Any]) -> str:
    """What a user reads, with one space for several."""
    return " ".join(" ".join(told["reads"]).split())


def flown(run: GatewayRun, folder: Path, number: int = 1) -> None:
    """The session with this number ended as it should, and its log verifies and audits."""
    told = run.wait_for("session", number)
    assert told["ending"] == "completed"
    audit = subprocess.run(
        [sys.executable, "-m", "rtshcua", "verify-log", "--audit", told["log"], "--root", told["root"]],
        cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert audit.returncode == 0, audit.stdout + audit.stderr


@pytest.mark.parametrize(
    ("name", "flavour"), [("mavsdk", "px4"), ("mavsdk-grpc", "ardupilot"), ("mavproxy", "ardupilot")]
)
def test_program_flies_and_reads_why_it_is_refused(name: str, flavour: str, tmp_path: Path) -> None:
    client = CLIENTS[name]
    if client.packages is not None and not client.packages.exists():
        pytest.skip("`make clients` installs MAVSDK 4.1")

    def run(role: str, *actions: Sequence[object]) -> list[dict[str, Any]]:
        address = f"{client.scheme}{side.ports[role]}"
        return carried_out([*client.command, address, json.dumps(actions)], client.packages)

    with gateway(tmp_path, flavour) as side:
        with ThreadPoolExecutor() as pool:
            checks = {role: pool.submit(run, role, ["takeoff", 8]) for role in REASONS}
        for role, check in checks.items():
            (told,) = check.result()
            assert not told["succeeded"]
            assert REASONS[role] in reads(told), (role, told)
        # what a person must approve, and nobody does
        (told,) = run("operator", ["takeoff", 25])
        assert not told["succeeded"]
        assert "approval" in reads(told), told
        goto_in, goto_out = ["goto", *INSIDE, 8], ["goto", *OUTSIDE, 8]
        actions = (["takeoff", 80], ["takeoff", 8], goto_out, goto_in, ["land"])
        height, up, out, there, down = run("operator", *actions)
        assert not height["succeeded"]
        assert "altitude 80 m, accepted 30 m" in reads(height)
        assert up["succeeded"], up
        assert not out["succeeded"]
        assert "inside field" in reads(out)
        assert there["succeeded"], there
        assert down["succeeded"], down
        flown(side.run, tmp_path, 2)


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
