"""`rtshcua run --mode optee`, over UDP: the boundary in a trusted application of OP-TEE, in an emulated machine."""

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from boundary.trusted_application import needs_optee
from integration.test_run_process import heights, link_key
from integration.test_run_secure_world import code_image, is_gone
from rtshcua.adapters.boundary.optee import EMULATOR

#: with a link key each frame is a call of some ms, so a busy machine flies no faster than time
SPEED = 1
#: without a key; a vehicle that flies faster needs no time of day
FASTER = 3
MODE = ("--mode", "optee")


@needs_optee
@pytest.mark.soak
def test_a_flight_by_the_trusted_application(ground: Any) -> None:
    """It has the keys of link, boundary and log; a bundle flies once; the emulator is gone afterwards."""
    bundle = ground.bundle()
    flown = ground.run(bundle, *MODE, *link_key(ground), speed=SPEED).end()
    assert flown.code == 0, flown.stderr
    verified = ground.start("verify-log", "--audit", str(flown.folder), "--json").end()
    assert verified.code == 0, verified.events
    proven = {claim["slug"]: claim["text"] for claim in verified.events[0]["proven"]}
    assert "boundary" in proven
    assert code_image("optee") in proven["home"], "the boundary attested the code that was built"
    assert {"emulated", "development"} <= {claim["slug"] for claim in verified.events[0]["unproven"]}
    assert flown.log()[0]["mode"] == "optee"
    data = Path(ground.environment["RTSHCUA_DATA_DIR"])
    for marker in data.rglob("replay/vehicle-quad-07/*"):
        marker.unlink()
    again = ground.run(bundle, *MODE, speed=FASTER).end()
    assert again.code == 5, again.stderr
    assert "undecided" in [event["event"] for event in again.events], "by the boundary"


@needs_optee
@pytest.mark.soak
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_trusted_application_that_dies_or_hangs_in_flight(flavour: str, how: signal.Signals, ground: Any) -> None:
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


@needs_optee
@pytest.mark.soak
def test_the_emulator_ends_with_a_run_that_is_killed(ground: Any, port: int) -> None:
    ground.vehicle(port, FASTER)
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", *MODE)
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=FASTER)
    first.until("dispatched", step=1)
    emulator = first.child(EMULATOR)
    first.signal(signal.SIGKILL)
    first.process.wait()
    assert is_gone(emulator)
    second = ground.run(bundle, *words, speed=FASTER).end()
    assert second.code == 6, second.stderr


@pytest.mark.slow
def test_a_machine_without_the_emulator_says_what_installs_it(ground: Any) -> None:
    bundle = ground.bundle()
    ground.environment["PATH"] = str(ground.folder)
    refused = ground.run(bundle, *MODE).end()
    assert (refused.code, refused.events[-1]["slug"]) == (5, "boundary-missing")
    assert EMULATOR in refused.events[-1]["text"]
    assert "make optee" in refused.events[-1]["help"]
