"""The folder of a run with telemetry, the track that its autopilot recorded, and the key that binds them."""

import hashlib
from collections.abc import Callable
from pathlib import Path

from reference.autopilot_logs import px4_log
from reference.forgery import LOG_KEY, edit, signed
from reference.kept_frames import kept
from rtshcua.adapters.store.writing import write_new
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.ground.flight.autopilot_log import AutopilotPoint
from rtshcua.ground.flight.flown import Flight as Flown
from rtshcua.mavlink import tlog
from rtshcua.wire.key_file import dump_signing_key
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight
from virtual.once import once

ROOT = case.KEYS[Duty.ROOT].public.hex()


def _flown(issued_later_us: int) -> tuple[list[bytes], bytes]:
    """The lines of the log and the telemetry of a flight on the simulated PX4."""
    mission = case.mission(case.short_steps(), issued_at_us=case.flat.ISSUED + issued_later_us)
    flight = Flight(case.seal(mission), case.simulated("px4"))
    entries = kept(flight)
    lines = flight.fly().lines
    return lines, b"".join(tlog.encode(at_us, frame) for at_us, frame in entries)


def run_folder(path: Path, *, other: bool = False) -> Path:
    """A run with its telemetry and a file `log.key`; `other`: of another flight."""
    name = "bound_run_other" if other else "bound_run"
    lines, telemetry = once(name, lambda: _flown(int(other)))
    last = edit(lines[-1], tlog=hashlib.sha256(telemetry).hexdigest())
    path.mkdir(exist_ok=True)
    (path / "log.jsonl").write_bytes(b"".join(signed([*lines[:-1], last])))
    (path / "telemetry.tlog").write_bytes(telemetry)
    write_new(path / "log.key", dump_signing_key(LOG_KEY, passphrase=None), mode=0o600)
    return path


def flight_of(run: Path) -> Flown:
    """The flight of a run."""
    flight = read_flight(run / "log.jsonl")
    assert isinstance(flight, Flown)
    return flight


def recorded(flight: Flown) -> list[AutopilotPoint]:
    """The track that the autopilot recorded, every 200 ms: the one that it reported."""
    assert flight.telemetry is not None
    points = [
        AutopilotPoint(boot_us, point.latitude, point.longitude, point.above_sea)
        for point, (_, boot_us) in zip(flight.telemetry.track, flight.telemetry.boot_us, strict=True)
    ]
    return [point for n, point in enumerate(points) if n in (0, len(points) - 1) or not point.boot_us % 200_000]


def bind_words(run: Path, file: Path) -> list[str]:
    """The command line that binds a file to the run."""
    return ["bind", str(run), str(file), "--root", ROOT, "--log-key", str(run / "log.key")]


def with_log(run: Path, name: str = "flight.ulg", write: Callable[[list[AutopilotPoint]], bytes] = px4_log) -> Path:
    """Write the autopilot's log of a run into its folder."""
    path = run / name
    path.write_bytes(write(recorded(flight_of(run))))
    return path
