"""`rtshcua run --mode trustzone-m`, over UDP: the boundary in the secure world of an emulated Cortex-M33."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from boundary.secure_world import needs_emulator
from integration.test_run_process import heights, link_key
from rtshcua.adapters.boundary.trustzone_m import EMULATOR
from virtual.sampling import each_once

pytestmark = [needs_emulator, pytest.mark.clients, pytest.mark.long]

SPEED = 3
CHECKOUT = Path(__file__).resolve().parents[2]
MODE = ("--mode", "trustzone-m")


def test_a_flight_by_the_secure_world(ground: Any) -> None:
    """It has the keys of link, boundary and log; a bundle flies once; the emulator is gone afterwards."""
    bundle = ground.bundle()
    flown = ground.run(bundle, *MODE, *link_key(ground), speed=SPEED).end()
    assert flown.code == 0, flown.stderr
    verified = ground.start("verify-log", "--audit", str(flown.folder), "--json").end()
    assert verified.code == 0, verified.events
    proven = {claim["slug"]: claim["text"] for claim in verified.events[0]["proven"]}
    assert "boundary" in proven
    assert code_image("trustzone-m") in proven["home"], "the boundary attested the code that was built"
    assert flown.log()[0]["mode"] == "trustzone-m"
    data = Path(ground.environment["RTSHCUA_DATA_DIR"])
    for marker in data.rglob("replay/vehicle-quad-07/*"):
        marker.unlink()
    again = ground.run(bundle, *MODE, speed=SPEED).end()
    assert again.code == 5, again.stderr
    assert "undecided" in [event["event"] for event in again.events], "by the boundary"


@pytest.mark.parametrize(("flavour", "how"), each_once(("px4", "ardupilot"), (signal.SIGKILL, signal.SIGSTOP)))
def test_a_secure_world_that_dies_or_hangs_in_flight(flavour: str, how: signal.Signals, ground: Any) -> None:
    """What it had signed ahead brings the vehicle down."""
    run = ground.run(ground.bundle(), *MODE, "--flavour", flavour, *link_key(ground), speed=1)
    run.until("obeyed", step=1)
    emulator = run.child(EMULATOR)
    os.kill(emulator, how)
    run.end()
    assert run.code == 6, run.stderr
    records = run.log()
    (lost,) = [record for record in records if record.get("event") == "boundary-lost"]
    after = records[lost["seq"] :]
    assert [r["detail"] for r in after if r.get("event") == "dispatched"][-1] in ("return_home", "emergency_land")
    assert not [record for record in after if record["type"] == "decision"]
    height, landed = heights(run.folder, lost["utc_us"])
    assert abs(height[-1]) < 1_000
    assert landed[-1] == 1
    assert is_gone(emulator)


def test_the_emulator_ends_with_a_run_that_is_killed(ground: Any, port: int) -> None:
    ground.vehicle(port, SPEED)
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", *MODE)
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    emulator = first.child(EMULATOR)
    first.signal(signal.SIGKILL)
    first.process.wait()
    assert is_gone(emulator)
    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr


def test_a_machine_without_the_emulator_says_what_installs_it(ground: Any) -> None:
    bundle = ground.bundle()
    ground.environment["PATH"] = str(ground.folder)
    refused = ground.run(bundle, *MODE).end()
    assert (refused.code, refused.events[-1]["slug"]) == (5, "boundary-missing")
    assert EMULATOR in refused.events[-1]["text"]
    assert "apt-get install" in refused.events[-1]["help"]


def code_image(home: str) -> str:
    """The digest that `make size` prints for what was built."""
    table = subprocess.run(
        [sys.executable, CHECKOUT / ".make/footprint"], capture_output=True, text=True, check=True
    ).stdout
    found = re.search(rf"^{home} .*\n.*: ([0-9a-f]{{64}})$", table, re.MULTILINE)
    assert found is not None, table
    return found[1]


def is_gone(process: int) -> bool:
    """Whether it is within a second or so."""
    until_s = time.monotonic() + 10
    while time.monotonic() < until_s:
        try:
            state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False
