"""`rtshcua run --wait` flies a submitted bundle after the same checks as `run`."""

import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.adapters.agent_socket import hand_in
from rtshcua.adapters.boundary.process import program
from rtshcua.adapters.store.vehicle_records import opened_root
from rtshcua.wire.keys import Duty
from virtual import case

#: slow enough that delays of a busy machine stay below a permit's validity
SPEED = 3
#: one boundary over the waiting and the flight, which has the link's key, where there is a program of it
APART = () if program() is None else ("--mode", "process")


@pytest.fixture
def place() -> Iterator[Path]:
    """Where sockets lie: their paths are short."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


@pytest.mark.slow
def test_submitted_bundle_flies_once(ground: Any, place: Path) -> None:
    words = ("--wait", "--agent-socket", str(place), *APART)
    key = ground.folder / "link.key"
    key.write_text("5a" * 32 + "\n")
    key.chmod(0o600)
    base, other = ground.bundle(), ground.bundle(name="other", return_mm=case.LOW + 5 * case.M)
    handed = ground.bundle(name="handed")
    signed = ("--signing-key", str(key), "--unsigned-radio")
    run = ground.run(base, *words, *signed, "--wait-for", "4min")
    run.until("waiting")
    assert not (ground.folder / "runs").exists(), "nothing is recorded before something flies"
    assert hand_in(place, (ground.folder / other).read_bytes()).slug == "other-policy"
    damaged = bytearray((ground.folder / handed).read_bytes())
    damaged[-1] ^= 1
    assert hand_in(place, bytes(damaged)).slug == "bad-signature"
    assert hand_in(place, (ground.folder / handed).read_bytes()).slug == "accepted"
    run.until("admitted")
    assert run.end().code == 0, run.stderr
    assert run.dispatched()[0] == "takeoff"
    assert (run.folder / "mission.bundle").read_bytes() == (ground.folder / handed).read_bytes()

    again = ground.run(base, *words, "--wait-for", "8s")
    again.until("waiting")
    said = hand_in(place, (ground.folder / handed).read_bytes())
    assert said.slug == "replayed", said
    for marker in Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("replay/vehicle-quad-07/*"):
        marker.unlink()
    if program() is not None:
        said = hand_in(place, (ground.folder / handed).read_bytes())
        assert said.slug == "boundary-replayed", "what the run forgot, the boundary did not"
    assert again.end().code == 5, again.stderr


def test_ctrl_c_ends_the_wait(ground: Any, place: Path) -> None:
    run = ground.run(ground.bundle(), "--wait", "--agent-socket", str(place))
    run.until("waiting")
    run.signal(signal.SIGINT)
    assert run.end().code == 130, run.stderr
    assert not place.exists()


@pytest.mark.slow
def test_restarted_wait_lands_a_broken_off_flight(ground: Any, place: Path, port: int) -> None:
    """It waited, and the vehicle hung in the air. It comes down whatever has expired since."""
    ground.vehicle(port, SPEED)
    words = ("--wait", "--agent-socket", str(place), "--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    base, handed = ground.bundle(), ground.bundle(name="handed")
    first = ground.run(base, *words, speed=SPEED)
    first.until("waiting")
    assert hand_in(place, (ground.folder / handed).read_bytes()).slug == "accepted"
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    store, root = ground.store, opened_root(ground.store.root())
    store.root_path.write_bytes(replace(root, expires_at_us=root.issued_at_us + 1).sign(store.signing_key(Duty.ROOT)))

    second = ground.run(base, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    assert [event for event in second.events if event["event"] == "resumed"]
    assert not [event for event in second.events if event["event"] == "dispatched" and event.get("step", -1) >= 0]

    third = ground.run(base, *words, speed=SPEED).end()
    assert third.code == 4, "an expired root is enough to come down, and no more"
