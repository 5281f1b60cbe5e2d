"""A gateway under a policy whose every role may take off under another condition, so that one vehicle on the ground
refuses for every reason; and programs that others made, as its clients.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import gmtime
from typing import Any, Final

from reference.sources import CHECKOUT
from rtshcua.adapters.simulator import Simulator
from virtual.gateway_run import GatewayRun, free_port

PROGRAMS: Final = CHECKOUT / "tests/integration/gateway_programs"
#: where `.make/clients` installs packages of other versions than ours
OTHERS: Final = CHECKOUT / "build/gateway-clients"
PATIENCE_S: Final = 120.0
ROLES: Final = ("operator", "zone", "skill", "daylight", "battery", "wind")
#: what each role's refusal says; the time of day that is permitted is a minute twelve hours from now
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
