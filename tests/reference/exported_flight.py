"""A flight in virtual time as a run folder and as an export, and the same flight elsewhere on earth."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Any

from pymavlink import mavutil

from reference.forgery import edit, signed
from reference.kept_frames import Entries, kept
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.flights import flight_export as service
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.export.exported import ExportedRecord, FlightExport, with_usable_track
from rtshcua.ground.flight.flown import Flight, FlightTelemetry, GeoPlace, TrackPoint
from rtshcua.mavlink import tlog
from rtshcua.model.flat.zone import meridian
from virtual import case
from virtual.flight import Flight as VirtualFlight
from virtual.once import once


def _fly() -> tuple[list[bytes], Entries]:
    flight = VirtualFlight(case.seal(case.mission(case.short_steps())), case.simulated("px4"))
    entries = kept(flight)
    return flight.fly().lines, entries


@cache
def flown() -> tuple[list[bytes], Entries]:
    """The lines of its log and the frames of its telemetry."""
    return once("exported-flight", _fly)


def run_in(folder: Path) -> Path:
    """Its run folder, whose log is signed with the digest of the telemetry."""
    lines, entries = flown()
    data = b"".join(tlog.encode(at_us, frame) for at_us, frame in entries)
    folder.mkdir(parents=True, exist_ok=True)
    close = edit(lines[-1], tlog=hashlib.sha256(data).hexdigest())
    (folder / "log.jsonl").write_bytes(b"".join(signed([*lines[:-1], close])))
    (folder / "telemetry.tlog").write_bytes(data)
    return folder


def trust_its_root() -> None:
    """Put the root of its keys into the key store."""
    path = KeyStore(data_folder()).root_path
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.write_bytes(case.root()[1])


def export_of(run: Path) -> FlightExport:
    """The run as an export."""
    found = read_flight(run / "log.jsonl")
    assert not isinstance(found, Refusal)
    flight, _ = with_usable_track(found)
    return FlightExport(flight, service._told(run / "log.jsonl", flight), "rtshcua test", False, "not verified: a test")


def telemetry_of(export: FlightExport) -> FlightTelemetry:
    assert export.flight.telemetry is not None
    return export.flight.telemetry


def with_telemetry(export: FlightExport, **changed: Any) -> FlightExport:
    telemetry = telemetry_of(export)._replace(**changed)
    return export._replace(flight=export.flight._replace(telemetry=telemetry))


def moved(export: FlightExport, north: int, east: int) -> FlightExport:
    """The same flight elsewhere, in 1e-7 degree."""
    flight: Flight = export.flight
    projection = flight.policy.projection
    fields = {name: getattr(projection, name) for name in ("latitude", "longitude", "east", "north")}
    fields["latitude"] += north
    fields["longitude"] = meridian(fields["longitude"] + east, 0)
    import msgspec

    policy = msgspec.structs.replace(flight.policy, projection=type(projection)(**fields))
    telemetry = telemetry_of(export)
    assert telemetry.home is not None

    def place(at: Any) -> Any:
        return at._replace(latitude=at.latitude + north, longitude=meridian(at.longitude + east, 0))

    track: tuple[TrackPoint, ...] = tuple(map(place, telemetry.track))
    home: GeoPlace = place(telemetry.home)
    there = telemetry._replace(track=track, home=home)
    return export._replace(flight=flight._replace(policy=policy, telemetry=there))


def told(words: str, t_us: int = 1_000_000, **fields: Any) -> ExportedRecord:
    """A decision in these words."""
    return ExportedRecord(t_us, True, "allow", "admitted", 0, words)._replace(**fields)


def by_pymavlink(path: Path, *names: str) -> list[Any]:
    """The messages of a tlog from the autopilot, decoded by pymavlink, which sets `_timestamp` (UTC, s)."""
    log = mavutil.mavlink_connection(str(path))
    found = []
    while (message := log.recv_match(type=list(names) or None)) is not None:
        if message.get_type() != "BAD_DATA":
            found.append(message)
    log.close()
    return found
