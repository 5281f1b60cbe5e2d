"""`rtshcua run --mode process`, over UDP: by a boundary of its own process, under a user of its own, with the keys."""

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

from rtshcua.adapters.store.writing import lock

SPEED = 3
AS = ("--boundary-user", "nobody") if os.geteuid() == 0 else ()


def let_go(kept: Path) -> None:
    """Wait until the boundary of a run that is over has written what it keeps."""
    until_s = time.monotonic() + 10
    while True:
        try:
            os.close(lock(kept))
            return
        except BlockingIOError:
            assert time.monotonic() < until_s
            time.sleep(0.05)


def test_a_flight_by_a_boundary_of_its_own(ground: Any) -> None:
    """It has the link's key: a vehicle that enforces signing obeys, and the log is what the boundary signed for."""
    key = ground.folder / "link.key"
    key.write_text("5a" * 32 + "\n")
    key.chmod(0o600)
    flown = ground.run(
        ground.bundle(), "--mode", "process", *AS, "--signing-key", str(key), "--unsigned-radio", speed=SPEED
    ).end()
    assert flown.code == 0, flown.stderr
    verified = ground.start("verify-log", "--audit", str(flown.folder), "--json").end()
    assert verified.code == 0, verified.events
    (said,) = verified.events
    proven = {claim["slug"] for claim in said["proven"]}
    assert "boundary" in proven, said
    (kept,) = Path(ground.environment["RTSHCUA_DATA_DIR"]).rglob("boundary/vehicle-quad-07.kept")
    assert kept.stat().st_mode & 0o077 == 0


def test_the_same_bundle_is_refused_by_the_boundary_where_the_run_has_forgotten_it(ground: Any) -> None:
    """What a run remembers is its own, and in reach of who takes it over; the boundary remembers too."""
    bundle = ground.bundle()
    assert ground.run(bundle, "--mode", "process", speed=SPEED).end().code == 0
    data = Path(ground.environment["RTSHCUA_DATA_DIR"])
    for marker in data.rglob("replay/vehicle-quad-07/*"):
        marker.unlink()
    again = ground.run(bundle, "--mode", "process", speed=SPEED).end()
    assert again.code == 5, again.stderr


def test_what_is_in_the_air_comes_down_where_the_boundary_does_not_begin(ground: Any, port: int) -> None:
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

    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    (told,) = [event["text"] for event in second.events if "is damaged" in event.get("text", "")]
    assert told.startswith(f"`{kept}` is damaged")
    (other,) = set((ground.folder / "runs").iterdir()) - {killed}
    modes = [json.loads((run / "log.jsonl").read_bytes().splitlines()[0])["mode"] for run in (killed, other)]
    assert modes == ["process", "software"], "who decided stands in the log"
    third = ground.run(ground.bundle(name="another"), *words, speed=SPEED).end()
    assert third.code == 3, third.stderr
    assert third.events[-1]["slug"] == "boundary-damaged"
