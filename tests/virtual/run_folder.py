"""A run folder of a flight in virtual time: log, telemetry and bundle, under the keys of `case`."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from reference.forgery import edit, signed
from reference.kept_frames import Entries, kept
from rtshcua.mavlink import tlog
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.config import SimulationConfig
from virtual import case
from virtual.flight import Flight


def fly(mission: Mission, config: SimulationConfig, under: Policy | None = None) -> tuple[list[bytes], Entries, bytes]:
    """The log, the telemetry and the bundle of a flight."""
    bundle = case.seal(mission, under)
    flight = Flight(bundle, config)
    entries = kept(flight)
    return flight.fly().lines, entries, bundle


def folder(at: Path, flown: tuple[Sequence[bytes], Entries, bytes], *, bound: bool = True) -> Path:
    """Write a flight as a run folder; if `bound`, the log has the digest of the telemetry (of at most 100 epochs)."""
    lines, entries, bundle = flown
    data = b"".join(tlog.encode(at_us, frame) for at_us, frame in entries)
    if bound:
        lines = signed([*lines[:-1], edit(lines[-1], tlog=hashlib.sha256(data).hexdigest())])
    at.mkdir(parents=True, exist_ok=True)
    (at / "log.jsonl").write_bytes(b"".join(lines))
    (at / "telemetry.tlog").write_bytes(data)
    (at / "mission.bundle").write_bytes(bundle)
    return at
