"""`rtshcua run --mode process` over UDP: a boundary process under its own user, with the keys."""

import json
import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.boundary.home import PATIENCE_S
from rtshcua.adapters.store.vehicle_records import BoundaryStore
from rtshcua.adapters.store.writing import lock
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.tlog import read
from virtual.sampling import each_once

SPEED = 3
AS = ("--boundary-user", "nobody") if os.geteuid() == 0 else ()


def link_key(ground: Any) -> list[str]:
    key = ground.folder / "link.key"
    key.write_text("5a" * 32 + "\n")
    key.chmod(0o600)
    return ["--signing-key", str(key), "--unsigned-radio"]


def let_go(kept: Path) -> None:
    """Wait until the boundary of a run that is over has written what it keeps."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            os.close(lock(kept))
            return
        except BlockingIOError:
            assert time.monotonic() < until_s
            time.sleep(0.05)


@pytest.mark.slow
def test_flight_with_a_boundary_process(ground: Any) -> None:
    """It has the link's key: a vehicle that enforces signing obeys, and the log is what the boundary signed for. What
    a run remembers is its own, and in reach of who takes it over; the boundary remembers that the bundle flew, too.
    """
    bundle, words = ground.bundle(), ("--mode", "process", *AS)
    flown = ground.run(bundle, *words, *link_key(ground), speed=SPEED).end()
    assert flown.code == 0, flown.stderr
    verified = ground.start("verify-log", "--audit", str(flown.folder), "--json").end()
    assert verified.code == 0, verified.events
    (said,) = verified.events
    proven = {claim["slug"] for claim in said["proven"]}
    assert "boundary" in proven, said
    data = Path(ground.environment["RTSHCUA_DATA_DIR"])
    (kept,) = data.rglob("boundary/vehicle-quad-07.kept")
    assert kept.stat().st_mode & 0o077 == 0
    for marker in data.rglob("replay/vehicle-quad-07/*"):
        marker.unlink()
    again = ground.run(bundle, *words, speed=SPEED).end()
    assert again.code == 5, again.stderr
    assert "undecided" in [event["event"] for event in again.events], "by the boundary"


@pytest.mark.slow
def test_broken_off_flight_lands_if_the_boundary_does_not_start(ground: Any, port: int) -> None:
    """What it kept was damaged while nobody flew: nothing new flies, and what does comes down without it."""
    ground.vehicle(port, SPEED)
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--mode", "process")
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    (killed,) = (ground.folder / "runs").iterdir()
    (kept,) = Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("boundary/vehicle-quad-07.kept")
    let_go(kept)
    kept.write_bytes(bytes(kept.stat().st_size))

    other_bundle = ground.bundle(name="another")
    refused = ground.run(other_bundle, *words, speed=SPEED).end()
    assert refused.code == 3, refused.stderr
    assert f"run {killed / 'mission.bundle'}` brings the vehicle down" in refused.events[-1]["help"]
    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    (told,) = [event["text"] for event in second.events if "is damaged" in event.get("text", "")]
    assert told.startswith(f"`{kept}` is damaged")
    (other,) = set((ground.folder / "runs").iterdir()) - {killed}
    modes = [json.loads((run / "log.jsonl").read_bytes().splitlines()[0])["mode"] for run in (killed, other)]
    assert modes == ["process", "software"], "who decided stands in the log"
    third = ground.run(other_bundle, *words, speed=SPEED).end()
    assert third.code == 3, third.stderr
    assert third.events[-1]["slug"] == "boundary-damaged"
    assert "broke off" not in third.events[-1]["help"]


def halted_in_flight(ground: Any, port: int, *also: str) -> tuple[str, tuple[str, ...], int]:
    """A boundary that hangs while its flight's runtime is killed: the bundle, the words of the run, and its process."""
    ground.vehicle(port, SPEED)
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--mode", "process", *also)
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    boundary = first.child("rtshcua-boundary")
    os.kill(boundary, signal.SIGSTOP)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    return bundle, words, boundary


def modes(ground: Any) -> list[str]:
    """Who decided in each run, as its log says."""
    folders = (ground.folder / "runs").iterdir()
    return sorted(json.loads((run / "log.jsonl").read_bytes().splitlines()[0])["mode"] for run in folders)


def test_hanging_boundary_ends_with_its_runtime(ground: Any, port: int) -> None:
    """It would keep the restart from its file, and the vehicle in the air."""
    bundle, words, boundary = halted_in_flight(ground, port, *AS)
    try:
        second = ground.run(bundle, *words, speed=SPEED).end()
    finally:
        with suppress(ProcessLookupError):
            os.kill(boundary, signal.SIGKILL)
    assert second.code == 6, second.stderr
    assert modes(ground) == ["process", "process"]


@pytest.mark.slow
def test_broken_off_flight_lands_if_the_boundary_file_is_locked(ground: Any, port: int) -> None:
    """Whoever holds it is no run: the one before broke off, and nobody holds its log."""
    ground.vehicle(port, SPEED)
    words = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--mode", "process")
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    beside = ground.run(bundle, *words, speed=SPEED).end()
    assert (beside.code, beside.events[-1]["slug"]) == (5, "boundary-in-use"), "a run that goes on has the vehicle"
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    (kept,) = Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("boundary/vehicle-quad-07.kept")
    let_go(kept)
    held = lock(kept)
    try:
        second = ground.run(bundle, *words, speed=SPEED).end()
        assert second.code == 6, second.stderr
        assert any("another run's boundary has locked" in event.get("text", "") for event in second.events)
        assert modes(ground) == ["process", "software"]
        third = ground.run(ground.bundle(name="another"), *words, speed=SPEED).end()
        assert (third.code, third.events[-1]["slug"]) == (5, "boundary-in-use"), "nothing new flies"
    finally:
        os.close(held)


def kill_boundary(run: Any) -> None:
    os.kill(run.child("rtshcua-boundary"), signal.SIGKILL)


def heights(folder: Path, after_us: int) -> tuple[list[int], list[int]]:
    """What the vehicle said after a moment (UTC): how high above home it was, in mm, and whether it was landed."""
    height, landed = [], []
    for entry in read((folder / "telemetry.tlog").read_bytes()):
        for each in Codec(0, 0).parse(entry.frame) if entry.at_us >= after_us else ():
            if each.component == 1 and each.name == "GLOBAL_POSITION_INT":
                height.append(each.message.relative_alt)
            elif each.component == 1 and each.name == "EXTENDED_SYS_STATE":
                landed.append(each.message.landed_state)
    return height, landed


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "signed"), each_once(("px4", "ardupilot"), (False, True)))
def test_boundary_killed_in_flight_is_survived(flavour: str, signed: bool, ground: Any) -> None:
    """What it had signed ahead brings the vehicle down, which obeys nothing else; the log says so, and proves no more
    than it can.
    """
    words = link_key(ground) if signed else []
    run = ground.run(ground.bundle(), "--mode", "process", *AS, "--flavour", flavour, *words, speed=SPEED)
    run.until("obeyed", step=1)
    kill_boundary(run)
    run.end()
    assert run.code == 6, run.stderr
    assert "verify-log --audit" in run.events[-1]["next"]
    records = run.log()
    (lost,) = [record for record in records if record.get("event") == "boundary-lost"]
    after = records[lost["seq"] :]
    links = [(r["kind"], r["step"], r["detail"]) for r in after if r.get("event") == "dispatched"]
    assert links[0][:2] == (1, 1), "the chain of the step that ran"
    assert links[-1][2] in ("return_home", "emergency_land")
    assert not [record for record in after if record["type"] == "decision"]
    assert [record for record in after if record.get("event") in ("succeeded", "landed")]
    height, landed = heights(run.folder, lost["utc_us"])
    assert max(height) > 3_000
    assert abs(height[-1]) < 1_000
    assert landed[-1] == 1

    verified = ground.start("verify-log", "--audit", str(run.folder), "--json").end()
    (said,) = verified.events
    assert (verified.code, said["verdict"], said["failure"]) == (10, "incomplete", None)
    assert (said["shortfall"]["slug"], said["shortfall"]["record"]) == ("boundary/lost", lost["seq"])
    assert "boundary" in {claim["slug"] for claim in said["unproven"]}
    (state,) = {path.parent.parent for path in Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("boundary/*.kept")}
    assert any(BoundaryStore(state, "quad-07").kept().digest), "the next session names this one, which broke off"


#: with a key as fast as life alone: a vehicle that is flown faster signs by the time outside, and falls behind
RESTARTS = [pytest.param(False, SPEED, id="keyless"), pytest.param(True, 1, id="signed", marks=pytest.mark.soak)]


@pytest.mark.slow
@pytest.mark.parametrize(("signed", "speed"), RESTARTS)
def test_run_killed_with_its_boundary_flies_the_contingency(signed: bool, speed: int, ground: Any, port: int) -> None:
    """As one in software mode does: the boundary knows the bundle, and begins no step of it."""
    key = link_key(ground) if signed else []
    ground.vehicle(port, speed, *key[:2])
    words = (
        "--connect",
        f"udpin:127.0.0.1:{port}",
        "--vehicle",
        "quad-07",
        "--mode",
        "process",
        *AS,
        *key,
        "--utc-error",
        "1s",
    )
    bundle = ground.bundle()
    first = ground.run(bundle, *words, speed=speed)
    first.until("dispatched", step=1)
    first.signal(signal.SIGSTOP)  # both at once
    kill_boundary(first)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    (killed,) = (ground.folder / "runs").iterdir()

    second = ground.run(bundle, *words, speed=speed).end()
    assert second.code == 6, second.stderr
    (other,) = set((ground.folder / "runs").iterdir()) - {killed}
    records = [json.loads(line) for line in (other / "log.jsonl").read_text().splitlines()]
    assert "resumed" in [record.get("event") for record in records]
    flown = [(record["kind"], record["detail"]) for record in records if record.get("event") == "dispatched"]
    assert {kind for kind, _ in flown} == {2}, "the contingency, and no step"
    assert flown[-1][1] in ("return_home", "emergency_land")
    for folder in (killed, other):
        verified = ground.start("verify-log", "--audit", str(folder), "--json").end()
        assert verified.code == 0, verified.events
