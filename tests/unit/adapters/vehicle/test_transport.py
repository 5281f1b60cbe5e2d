"""Serial lines and TCP connections: connect, loss, reconnection, and error messages."""

import errno
import os
import pty
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.transport import (
    InheritedTransport,
    SerialTransport,
    TcpListener,
    TcpTransport,
    UdpTransport,
    open_transport,
)
from rtshcua.onboard.ports import Event, LinkBack, LinkLost, Noted
from rtshcua.simulation.config import AutopilotKind, Boot, SimulationConfig
from virtual.line import Connection, LinedVehicle, Terminal
from virtual.policy import POLICY

S = 1_000_000
HERE = "127.0.0.1"
CONFIG = SimulationConfig(flavour=AutopilotKind.PX4, boot=Boot.FAST)


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    made = Terminal(tmp_path / "ttyUSB0")
    yield made
    made.close()


def lined(terminal: Terminal, baud: int = 57_600, config: SimulationConfig = CONFIG) -> LinedVehicle:
    address = Address(LinkCarrier.SERIAL, str(terminal.path), baud)
    return LinedVehicle(POLICY, config, address, terminal, baud // 10)


def live(vehicle: LinedVehicle, seconds: float, until: Callable[[], bool] = lambda: False) -> list[Event]:
    """Let time pass; return the events."""
    events: list[Event] = []
    end_us = vehicle.clock.elapsed_us + round(seconds * S)
    while vehicle.clock.elapsed_us < end_us and not until():
        events += vehicle.poll(vehicle.clock.monotonic_us, 100_000)
    return events


def notes(events: list[Event]) -> list[str]:
    return [event.text for event in events if isinstance(event, Noted)]


# ---------------------------------------------------------------- a serial line


@pytest.mark.slow
@pytest.mark.parametrize("flavour", [AutopilotKind.PX4, AutopilotKind.ARDUPILOT])
@pytest.mark.parametrize("baud", [57_600, 921_600])
def test_vehicle_on_a_serial_line_becomes_ready_within_its_capacity(
    terminal: Terminal, baud: int, flavour: AutopilotKind
) -> None:
    vehicle = lined(terminal, baud, SimulationConfig(flavour=flavour, boot=Boot.FAST))
    live(vehicle, 30, lambda: vehicle.driver.flavour is not None)
    assert vehicle.driver.flavour is not None
    live(vehicle, 20)
    before, at_us = vehicle.sent_octets, vehicle.clock.elapsed_us
    vehicle.dropped = 0
    said = live(vehicle, 15)
    rate = (vehicle.sent_octets - before) * S // (vehicle.clock.elapsed_us - at_us)
    assert rate < baud // 10
    assert vehicle.dropped == 0, "nothing that the vehicle sent was lost for want of room"
    assert not [event for event in said if isinstance(event, LinkLost)]
    measured = vehicle.driver.stream_requests.measured
    assert measured is not None
    assert abs(measured[0] - rate) < rate // 5, "what is measured is what came"
    vehicle.close()


def test_pulled_serial_cable_is_reported_and_reconnected(terminal: Terminal) -> None:
    vehicle = lined(terminal)
    live(vehicle, 10, lambda: vehicle.driver.flavour is not None)
    live(vehicle, 3)
    terminal.pull()
    said = live(vehicle, 3)
    assert any("was lost" in text for text in notes(said))
    assert [event for event in said if isinstance(event, LinkLost)]
    assert vehicle.transport.trouble == os.strerror(errno.ENOENT).lower()
    terminal.plug_in()
    said = live(vehicle, 5, lambda: vehicle.driver._watch.down is None)
    assert any("is open again" in text for text in notes(said))
    assert [event for event in said if isinstance(event, LinkBack)]
    vehicle.close()


def test_a_busy_port_says_so(terminal: Terminal) -> None:
    address = Address(LinkCarrier.SERIAL, str(terminal.path), 57_600)
    first = SerialTransport(address)
    with pytest.raises(OSError, match="another program has it open") as error:
        SerialTransport(address)
    assert error.value.errno == errno.EBUSY
    first.close()
    SerialTransport(address).close()


def test_regular_file_as_serial_device_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="not a serial device"):
        SerialTransport(Address(LinkCarrier.SERIAL, str(tmp_path / "file"), 57_600))
    with pytest.raises(OSError, match="No such file"):
        SerialTransport(Address(LinkCarrier.SERIAL, str(tmp_path / "nothing"), 57_600))


def test_garbage_is_told_from_silence(terminal: Terminal) -> None:
    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.SERIAL, str(terminal.path), 57_600), None, 5_760)
    live(vehicle, 1)
    assert vehicle.connected.silence is None, "nothing came, and nothing is known to be wrong"
    terminal.write(Random(2).randbytes(600))
    live(vehicle, 1)
    assert vehicle.connected.silence is not None
    assert "600 octets arrived, but no MAVLink frame" in vehicle.connected.silence
    assert "baud rate is probably wrong" in vehicle.connected.silence
    vehicle.close()


def test_a_vehicle_that_speaks_the_old_protocol_is_told(terminal: Terminal) -> None:
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.SERIAL, str(terminal.path), 57_600), None, 5_760)
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(mavlink.MAVLink(None, 1, 1), force_mavlink1=True)
    for _ in range(3):
        terminal.write(beat)
        live(vehicle, 0.2)
    assert vehicle.connected.silence is not None
    assert vehicle.connected.silence.startswith("3 frames of MAVLink 1 arrived")
    assert "MAV_PROTO_VER" in vehicle.connected.silence
    vehicle.close()


def test_full_port_does_not_block() -> None:
    far, near = pty.openpty()
    transport = SerialTransport(Address(LinkCarrier.SERIAL, os.ttyname(near), 57_600))
    for _ in range(2_000):
        transport.send(bytes(60), None)
    assert transport.tend(0) == []
    transport.close()
    os.close(far)
    os.close(near)


# ---------------------------------------------------------------- TCP


def listening() -> socket.socket:
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.bind((HERE, 0))
    made.listen()
    return made


def test_tcp_client_reconnects() -> None:
    server = listening()
    port = server.getsockname()[1]
    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.TCP, HERE, port), None, 100_000)
    live(vehicle, 0.1)
    vehicle.end = Connection(server.accept()[0])
    live(vehicle, 10, lambda: vehicle.driver.flavour is not None)
    assert vehicle.driver.flavour is not None
    live(vehicle, 3)
    vehicle.end.close()
    server.close()
    vehicle.end = None
    said = live(vehicle, 3)
    assert any("was lost" in text for text in notes(said))
    assert vehicle.transport.trouble == "connection refused"
    server = socket.socket()
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    server.bind((HERE, port))
    server.listen()
    live(vehicle, 1)
    vehicle.end = Connection(server.accept()[0])
    said = live(vehicle, 5, lambda: vehicle.driver._watch.down is None)
    assert [event for event in said if isinstance(event, LinkBack)]
    vehicle.close()
    server.close()


def test_refused_connection_is_reported_as_the_reason() -> None:
    server = listening()
    port = server.getsockname()[1]
    server.close()
    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.TCP, HERE, port), None, 100_000)
    live(vehicle, 1)
    assert vehicle.connected.silence == "connection refused"
    vehicle.close()


def test_tcp_listener_refuses_a_second_connection() -> None:
    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.TCP_IN, HERE, 0), None, 100_000)
    assert isinstance(vehicle.transport, TcpListener)
    assert vehicle.connected.silence == "nobody has connected"
    stranger, far = (socket.create_connection((HERE, vehicle.transport.port)) for _ in range(2))
    vehicle.end = Connection(far)
    live(vehicle, 10, lambda: vehicle.driver.flavour is not None)
    assert vehicle.driver.flavour is not None
    live(vehicle, 2)
    stranger.setblocking(False)
    stranger.send(b"nothing that is a frame")
    live(vehicle, 1)
    with pytest.raises(BlockingIOError):
        stranger.recv(100)  # frames are sent only to the vehicle
    assert vehicle.driver.link.crowd is None
    stranger.close()
    far.close()
    vehicle.end = None
    live(vehicle, 2)
    again = socket.create_connection((HERE, vehicle.transport.port))
    vehicle.end = Connection(again)
    said = live(vehicle, 5, lambda: vehicle.driver._watch.down is None)
    assert [event for event in said if isinstance(event, LinkBack)], "the vehicle came back over another connection"
    vehicle.close()


def test_more_connections_than_any_vehicle_needs_are_refused() -> None:
    transport = TcpListener(Address(LinkCarrier.TCP_IN, HERE, 0))
    callers = []
    for _ in range(6):
        callers.append(socket.create_connection((HERE, transport.port), timeout=5))
        transport.tend(0)
    assert len(transport.lines) == 4
    for caller in callers:
        caller.close()
    transport.close()


def test_a_port_that_is_taken_is_an_error_at_once() -> None:
    taken = listening()
    with pytest.raises(OSError, match="in use"):
        TcpListener(Address(LinkCarrier.TCP_IN, HERE, taken.getsockname()[1]))
    taken.close()
    with pytest.raises(OSError):
        TcpTransport(Address(LinkCarrier.TCP, "no such host", 1))


# ---------------------------------------------------------------- UDP that speaks first


def test_udp_that_speaks_first_is_answered() -> None:
    far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    far.bind((HERE, 0))
    far.settimeout(5)
    vehicle = LinedVehicle(POLICY, CONFIG, Address(LinkCarrier.UDP_OUT, HERE, far.getsockname()[1]), None, 100_000)
    live(vehicle, 0.1)
    greeting, peer = far.recvfrom(300)
    assert greeting[5:7] == bytes([1, 191]), "of an onboard computer, never of a ground station"
    far.connect(peer)
    vehicle.end = Connection(far)
    live(vehicle, 10, lambda: vehicle.driver.flavour is not None)
    assert vehicle.driver.flavour is not None
    vehicle.close()


def test_each_way_has_its_transport(terminal: Terminal) -> None:
    made = [
        open_transport(each)
        for each in (
            Address(LinkCarrier.UDP_IN, HERE, 0), Address(LinkCarrier.UDP_OUT, HERE, 9), Address(LinkCarrier.TCP,
                HERE, 9),
            Address(LinkCarrier.TCP_IN, HERE, 0), Address(LinkCarrier.SERIAL, str(terminal.path), 57_600),
        )
    ]  # fmt: skip
    kinds = [UdpTransport, UdpTransport, TcpTransport, TcpListener, SerialTransport]
    assert [type(each) for each in made] == kinds
    assert [each.begins for each in made] == [False, True, True, False, True]
    assert [each.capacity for each in made] == [None, None, None, None, 5_760]
    for each in made:
        each.close()


# ---------------------------------------------------------------- an inherited socket


class Datagrams(Connection):
    """The vehicle's end of a pair: it sends no empty datagrams."""

    def write(self, octets: bytes) -> int:
        return super().write(octets) if octets else 0


def inherited(kind: int) -> tuple[InheritedTransport, socket.socket]:
    """The transport over one end of a pair, and the other end."""
    near, far = socket.socketpair(socket.AF_UNIX, kind)
    transport = open_transport(Address(LinkCarrier.INHERITED, "", near.detach()))
    assert isinstance(transport, InheritedTransport)
    far.setblocking(False)
    return transport, far


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_SEQPACKET])
def test_inherited_pair_keeps_datagrams_apart_and_is_not_passed_on(kind: int) -> None:
    transport, far = inherited(kind)
    (number,) = transport.readable()
    assert not os.get_inheritable(number)
    assert transport.receive() is None
    far.send(b"one")
    far.send(b"another")
    assert transport.receive() == (b"one", number)
    assert transport.receive() == (b"another", number)
    assert transport.counts.octets == 10
    transport.send(b"frame", None)
    transport.send(b"later", number)
    assert [far.recv(100), far.recv(100)] == [b"frame", b"later"]
    transport.close()
    assert transport.readable() == ()
    transport.send(b"to nobody", number)
    far.close()


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_SEQPACKET])
def test_slow_other_end_loses_datagrams_and_blocks_nothing(kind: int) -> None:
    transport, far = inherited(kind)
    for _ in range(5_000):
        transport.send(bytes(200), None)
    assert transport.tend(0) == []
    assert transport.is_open(None)
    assert far.recv(1_000) == bytes(200)
    transport.close()
    far.close()


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_SEQPACKET])
def test_closed_other_end_is_noted_once_and_waited_for_without_spinning(kind: int) -> None:
    transport, far = inherited(kind)
    far.send(b"last")
    far.close()
    received = transport.receive()
    assert received is not None
    assert received[0] == b"last"
    assert transport.receive() is None
    transport.send(b"heartbeat", None)
    (note,) = transport.tend(0)
    assert "lost (closed by the other end): it cannot be opened again" in note
    assert transport.trouble == "closed by the other end"
    assert not transport.is_open(None)
    assert transport.readable() == ()
    assert transport.receive() is None
    assert transport.tend(1) == []
    transport.close()


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_SEQPACKET])
def test_vehicle_behind_an_inherited_pair_is_heard_and_its_loss_is_a_link_loss(kind: int) -> None:
    near, far = socket.socketpair(socket.AF_UNIX, kind)
    vehicle = LinedVehicle(
        POLICY, CONFIG, Address(LinkCarrier.INHERITED, "", near.detach()), Datagrams(far), 10_000_000
    )
    live(vehicle, 10, lambda: vehicle.driver._watch.answers)
    assert vehicle.driver.flavour is not None
    assert vehicle.driver._watch.answers
    far.close()
    vehicle.end = None
    said = live(vehicle, 4)
    assert [text for text in notes(said) if "cannot be opened again" in text]
    assert [event for event in said if isinstance(event, LinkLost)]
    vehicle.close()


def test_descriptor_of_another_kind_is_an_error_and_stays_open(tmp_path: Path) -> None:
    with (tmp_path / "file").open("w") as file, pytest.raises(OSError, match="non-socket"):
        open_transport(Address(LinkCarrier.INHERITED, "", file.fileno()))
    for family, kind in ((socket.AF_INET, socket.SOCK_DGRAM), (socket.AF_UNIX, socket.SOCK_STREAM)):
        with socket.socket(family, kind) as made:
            with pytest.raises(OSError, match="not one end of a pair"):
                open_transport(Address(LinkCarrier.INHERITED, "", made.fileno()))
            assert made.getsockopt(socket.SOL_SOCKET, socket.SO_TYPE) == kind
