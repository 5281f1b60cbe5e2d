"""Missions fly over a serial line of 57,600 and of 921,600 baud, in virtual time over a real pseudo-terminal; with
deadlines of 0.1 s too, and over TCP.
"""

import socket
from pathlib import Path

import pytest

from integration.test_flight_deadlines import MISSION
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Ending
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cose, names
from virtual.flight import Flight
from virtual.line import Connection, FarEnd, LinedVehicle, Terminal
from virtual.shipped import NAMES, sealed, shipped, simulated

BUNDLE = shipped("short")
BAUDS = (57_600, 921_600)


def lined(bundle: bytes, address: Address, end: FarEnd | None, flavour: str, capacity: int) -> LinedVehicle:
    policy, mission = (cose.unverified(envelope).payload for envelope in bundles.envelopes(bundle))
    steps = bundles.parse(names.MISSION, mission, Mission).invocations
    flat = bundles.parse(names.POLICY, policy, Policy)
    return LinedVehicle(flat, simulated(flavour), address, end, capacity, steps, free=False)


def flies_over_serial(bundle: bytes, folder: Path, flavour: str, baud: int) -> LinedVehicle:
    """Every step is admitted and done, and the line is not filled."""
    terminal, capacity = Terminal(folder / "ttyAMA0"), baud // 10
    vehicle = lined(bundle, Address(LinkCarrier.SERIAL, str(terminal.path), baud), terminal, flavour, capacity)
    flown = Flight(bundle, simulated(flavour), vehicle=vehicle).fly()
    vehicle.close()
    assert flown.ending is Ending.COMPLETED
    assert {outcome for _, outcome, _ in flown.decisions()} == {"allow"}
    assert vehicle.sent_octets * 1_000_000 // vehicle.clock.elapsed_us < capacity * 9 // 10
    (delivered,) = [each["detail"] for each in flown.effects("noted") if each["detail"].startswith("streams: ")]
    assert f" of {capacity} that the link carries" in delivered
    return vehicle


@pytest.mark.slow
@pytest.mark.parametrize("baud", BAUDS)
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_mission_flies_over_a_serial_line(tmp_path: Path, flavour: str, baud: int) -> None:
    flies_over_serial(BUNDLE, tmp_path, flavour, baud)


@pytest.mark.soak
@pytest.mark.parametrize("baud", BAUDS)
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("name", NAMES[1:])
def test_every_shipped_mission_flies_over_a_serial_line(tmp_path: Path, name: str, flavour: str, baud: int) -> None:
    flies_over_serial(shipped(name), tmp_path, flavour, baud)


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "baud"), [("px4", 57_600), ("ardupilot", 57_600), ("px4", 921_600)])
def test_short_deadlines_hold_over_a_serial_line(tmp_path: Path, flavour: str, baud: int) -> None:
    source = tmp_path / "short.rts"
    source.write_text(MISSION.format(deadline=100))
    vehicle = flies_over_serial(sealed(source), tmp_path, flavour, baud)
    asked = vehicle.driver.stream_requests.plan.intervals
    assert asked["GPS_RAW_INT"] <= 100_000, "a report within each deadline"


@pytest.mark.slow
def test_mission_flies_over_tcp() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        vehicle = lined(BUNDLE, Address(LinkCarrier.TCP, *server.getsockname()), None, "px4", 100_000)
        vehicle.poll(vehicle.clock.monotonic_us, 0)
        vehicle.end = Connection(server.accept()[0])
    assert Flight(BUNDLE, simulated("px4"), vehicle=vehicle).fly().ending is Ending.COMPLETED
    vehicle.close()
