"""A run with a boundary process takes the time of day only from that process."""

import signal
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.boundary.process import program
from rtshcua.adapters.utc import kernel_error_us

pytestmark = [
    pytest.mark.skipif(program() is None, reason="the boundary's program was not built"),
    pytest.mark.skipif(kernel_error_us() is not None, reason="this machine's clock is synchronised"),
]


def clock_of(run: Any) -> str:
    """Return the last recorded source of the time of day."""
    told: list[str] = [
        record["detail"] for record in run.log() if record["type"] == "effect" and record["event"] == "clock"
    ]
    return told[-1]


def audited(ground: Any, folder: Path) -> dict[str, Any]:
    done = ground.start("verify-log", "--audit", str(folder), "--json").end()
    (said,) = done.events
    return dict(said)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_signed_link_gives_the_vehicles_time(ground: Any, port: int, flavour: str) -> None:
    """The boundary verifies the vehicle's SYSTEM_TIME itself, by a nonce."""
    key = ground.folder / "link.key"
    key.write_text("5a" * 32 + "\n")
    key.chmod(0o600)
    linked = ("--signing-key", str(key))
    bundle = ground.bundle()
    ground.vehicle(port, 1, "--flavour", flavour, *linked)
    where = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--unsigned-radio", "--mode", "process")
    run = ground.run(bundle, *where, *linked, speed=1)
    run.until("dispatched", step=0)
    run.signal(signal.SIGINT)
    run.end()
    said = audited(ground, run.folder)
    assert not said.get("finding"), said
    assert clock_of(run).startswith("vehicle: "), clock_of(run)
    (clock,) = [claim for claim in said["proven"] if claim["slug"] == "clock"]
    assert "by the vehicle" in clock["text"]


@pytest.mark.slow
def test_unsigned_link_needs_a_stated_clock_bound(ground: Any, port: int) -> None:
    bundle = ground.bundle()
    ground.vehicle(port, 1)
    where = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--mode", "process")
    run = ground.run(bundle, *where, speed=1)
    run.until("decision", reason="freshness/clock-uncertain")
    run.signal(signal.SIGINT)
    run.end()
    assert clock_of(run).startswith("unknown")
    assert audited(ground, run.folder).get("finding") is None
