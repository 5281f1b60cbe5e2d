"""A mission flies over a serial line of 57,600 baud, in virtual time over a real pseudo-terminal; over TCP too."""

import socket
from pathlib import Path

import pytest

from rtshcua.adapters.vehicle.address import Address, Way
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Ending
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cose, names
from virtual.flight import Flight
from virtual.line import Connection, FarEnd, LinedVehicle, Terminal
from virtual.shipped import shipped, simulated

BUNDLE = shipped("short")


def lined(address: Address, end: FarEnd | None, flavour: str, capacity: int) -> LinedVehicle:
    policy, mission = (cose.unverified(envelope).payload for envelope in bundles.envelopes(BUNDLE))
    steps = bundles.parse(names.MISSION, mission, Mission).invocations
    flat = bundles.parse(names.POLICY, policy, Policy)
    return LinedVehicle(flat, simulated(flavour), address, end, capacity, steps, free=False)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_mission_flies_over_a_slow_serial_line(tmp_path: Path, flavour: str) -> None:
    terminal = Terminal(tmp_path / "ttyAMA0")
    vehicle = lined(Address(Way.SERIAL, str(terminal.path), 57_600), terminal, flavour, 5_760)
    flown = Flight(BUNDLE, simulated(flavour), vehicle=vehicle).fly()
    assert flown.ending is Ending.COMPLETED
    assert {outcome for _, outcome, _ in flown.decisions()} == {"allow"}
    assert vehicle.sent_octets * 1_000_000 // vehicle.clock.elapsed_us < 5_760 * 9 // 10
    (delivered,) = [each["detail"] for each in flown.effects("noted") if each["detail"].startswith("streams: ")]
    assert " of 5760 that the link carries" in delivered
    vehicle.close()


def test_a_mission_flies_over_tcp() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        vehicle = lined(Address(Way.TCP, *server.getsockname()), None, "px4", 100_000)
        vehicle.poll(vehicle.clock.monotonic_us, 0)
        vehicle.end = Connection(server.accept()[0])
    assert Flight(BUNDLE, simulated("px4"), vehicle=vehicle).fly().ending is Ending.COMPLETED
    vehicle.close()
