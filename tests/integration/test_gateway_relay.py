"""The gateway's relay over real links: who gets which frames, and what becomes of those who are gone."""

import os
import pty
import select
import signal
import socket
import subprocess
import sys
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any

import msgspec
import pytest
from pymavlink.dialects.v10 import ardupilotmega as old
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from hostile.relayed import (
    HERE,
    PATIENCE_S,
    Relayed,
    acknowledged,
    arming,
    beat,
    clock,
    free_port,
    know,
    numbers,
    relayed,
    tcp_client,
    udp,
    udp_client,
    until,
)
from rtshcua.adapters.gateway.messages import EVERY_CLIENT, ClientSetup, RelayKind, Up, encoded
from rtshcua.adapters.gateway.process import RelayError, RelayProcess
from rtshcua.diagnostics.exits import ExitCode

pytestmark = pytest.mark.slow

UDP, TCP = "udpin:127.0.0.1:0", "tcpin:127.0.0.1:0"


@pytest.fixture
def opened() -> Iterator[Callable[..., Any]]:
    """Closes at the end what it is called with, and returns it."""
    with ExitStack() as stack:

        def keep(thing: Any) -> Any:
            stack.callback(thing.close)
            return thing

        yield keep


def test_frames_of_the_vehicle_reach_everybody_and_nothing_else_comes(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP), ClientSetup("b", TCP), ClientSetup("q", UDP, pilot=True)))
    one, two, pilot = gateway.ports()
    clients = [opened(udp_client(one)), opened(tcp_client(two)), opened(udp_client(pilot))]
    clients[1].send(beat())
    for _ in clients:
        gateway.next(RelayKind.UP)
    assert gateway.vehicle.recv(4_096) == beat()  # the pilot's, and of no other client
    frames = [clock(number) for number in range(1, 101)]
    gateway.says(*frames)
    for link in (gateway.flight, *clients):
        assert until(100, link.recv) == list(range(1, 101))
    gateway.process.telemetry.settimeout(PATIENCE_S)
    assert until(100, gateway.process.telemetry.recv)[-1] == 100


def test_a_client_hears_a_vehicle_only_when_the_gateway_knows_it(opened: Callable[..., Any]) -> None:
    """MAVSDK gives up when its first command is refused, and it sends one as soon as it hears a vehicle."""
    clients = ClientSetup("a", UDP), ClientSetup("q", UDP, pilot=True)
    gateway: Relayed = opened(relayed(*clients, known=False))
    client, pilot = (opened(udp_client(port)) for port in gateway.ports())
    assert gateway.vehicle.recv(4_096) == beat()  # the pilot's
    gateway.next(RelayKind.CLIENT)  # so the relay has both
    gateway.says(clock(1))
    assert until(1, pilot.recv)[-1] == 1
    gateway.know()
    gateway.answer(EVERY_CLIENT, beat())
    assert client.recv(4_096) == beat(), "the starter's word was read before"
    gateway.says(clock(2))
    assert until(2, client.recv)[0] == 2, "and the frame before it was not passed on"


def test_only_a_session_and_a_pilot_reach_the_vehicle(opened: Callable[..., Any]) -> None:
    clients = ClientSetup("a", UDP), ClientSetup("q", UDP, pilot=True)
    gateway: Relayed = opened(relayed(*clients, known=False))
    one, two = gateway.ports()
    client, pilot = opened(udp_client(one)), opened(udp_client(two))
    assert gateway.vehicle.recv(4_096) == beat()  # the pilot's
    client.send(arming())
    message = gateway.next(RelayKind.CLIENT, lambda each: each.payload != beat())
    assert message.payload == arming()
    pilot.send(arming(1))
    assert gateway.vehicle.recv(4_096) == arming(1)
    assert gateway.next(RelayKind.PILOT, lambda each: each.payload != beat()).payload == arming(1)
    gateway.flight.send(arming(2) + beat())
    assert gateway.vehicle.recv(4_096) == arming(2) + beat()
    asks = mavlink.MAVLink_command_long_message(1, 1, 32_100, 0, 1, 0, 0, 0, 0, 0, 0)
    asked = bytes(asks.pack(mavlink.MAVLink(None, srcSystem=255, srcComponent=190)))
    pilot.send(asked)
    pilot.send(arming(3) + asked + arming(4))
    assert gateway.vehicle.recv(4_096) == arming(3) + arming(4), "the gateway answers requests for control"
    message = gateway.next(RelayKind.PILOT, lambda each: each.payload not in (beat(), arming(1)))
    assert message.payload == asked
    gateway.know()
    gateway.process.control.send(encoded(RelayKind.ANSWER, message.client, beat()))
    assert pilot.recv(4_096) == beat(), "it has read both"
    asks = mavlink.MAVLink_command_long_message(2, 1, 32_100, 0, 1, 0, 0, 0, 0, 0, 0)
    elsewhere = bytes(asks.pack(mavlink.MAVLink(None, srcSystem=255, srcComponent=190)))
    pilot.send(asked + elsewhere)
    assert gateway.vehicle.recv(4_096) == elsewhere, "control of another vehicle is no business of the gateway"


@pytest.mark.parametrize("address", [UDP, TCP])
def test_everything_of_a_pilot_reaches_the_vehicle(opened: Callable[..., Any], address: str) -> None:
    """More than the rate of a client, in datagrams of many frames, while another sender floods his address."""
    gateway: Relayed = opened(relayed(ClientSetup("q", address, pilot=True, rate=10)))
    (port,) = gateway.ports()
    pilot, noise = (opened(udp_client(port) if address == UDP else tcp_client(port)) for _ in range(2))
    for number in range(50):
        noise.send(beat() * 40)
        pilot.send(b"".join(arming(number * 5 + at) for at in range(5)))
    octets = b""
    while octets.count(arming(0)[15:40]) < 250 or octets.count(beat()[10:]) < 2_000:
        octets += gateway.vehicle.recv(1 << 16)


def test_dialogues_of_others_are_not_for_clients(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP), ClientSetup("q", UDP, pilot=True)))
    one, two = gateway.ports()
    client, pilot = opened(udp_client(one)), opened(udp_client(two))
    gateway.next(RelayKind.UP)
    gateway.next(RelayKind.UP)
    gateway.says(acknowledged(), acknowledged() + clock(1), clock(2))
    assert until(2, client.recv) == [1, 2]
    assert until(2, pilot.recv) == until(2, gateway.flight.recv) == [-1, -1, 1, 2]


def test_answers_and_withheld_messages(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP), ClientSetup("q", UDP, pilot=True)))
    one, two = gateway.ports()
    client, another, pilot = opened(udp_client(one)), opened(udp_client(one)), opened(udp_client(two))
    numbers_of = {}
    for _ in range(3):
        up = gateway.next(RelayKind.UP)
        numbers_of[msgspec.json.decode(up.payload, type=Up).peer] = up.client
    first = numbers_of["{}:{}".format(*client.getsockname())]
    gateway.answer(first, acknowledged())
    gateway.withhold(first, 2, 30)
    gateway.answer(EVERY_CLIENT, beat())
    assert client.recv(4_096) == acknowledged()
    assert client.recv(4_096) == beat()
    assert another.recv(4_096) == beat()
    gateway.says(clock(1), clock(2) + beat())
    assert client.recv(4_096) == beat()  # SYSTEM_TIME is withheld
    assert until(2, another.recv) == [1, 2]
    camera, other = (mavlink.MAVLink(None, srcSystem=system, srcComponent=each) for system, each in ((1, 100), (2, 1)))
    for speaker in (camera, other):
        gateway.says(clock(9), bytes(mavlink.MAVLink_system_time_message(10, 10).pack(speaker)))
        assert until(10, client.recv) == [10]  # of the autopilot alone
        assert until(10, another.recv)[-2:] == [9, 10]
    gateway.withhold(first)
    gateway.answer(first, acknowledged())
    assert client.recv(4_096) == acknowledged()
    gateway.says(clock(3))
    assert until(3, client.recv) == [3]
    assert until(3, pilot.recv) == [1, 2, -1, 9, 10, 9, 10, 3]  # no answer for every client
    gateway.answer(60_000, acknowledged())  # nobody
    gateway.says(clock(4))
    assert until(4, client.recv) == [4]


def test_place_of_a_silent_sender_goes_to_another_one(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(
        relayed(ClientSetup("a", UDP, peers=1, silence_s=0), ClientSetup("b", UDP, peers=1, silence_s=1_000))
    )
    one, two = gateway.ports()
    first = opened(udp_client(one))
    up = gateway.next(RelayKind.UP)
    second = opened(udp_client(one))
    assert gateway.next(RelayKind.DOWN).client == up.client
    gateway.next(RelayKind.UP)
    gateway.says(clock(1))
    assert until(1, second.recv) == [1]
    first.settimeout(0)
    with pytest.raises(BlockingIOError):
        first.recv(4_096)
    held = opened(udp_client(two))
    gateway.next(RelayKind.UP)
    late = opened(udp_client(two))
    assert gateway.counters(lambda counters: counters.turned_away > 0).turned_away == 1
    gateway.says(clock(2))
    assert until(2, held.recv) == [2]
    late.settimeout(0)
    with pytest.raises(BlockingIOError):
        late.recv(4_096)


def test_connection_ends_and_another_one_comes(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", TCP, peers=1, silence_s=1_000)))
    (port,) = gateway.ports()
    first = tcp_client(port)
    first.send(beat()[:5])
    first.send(beat()[5:] + b"nonsense" + beat())
    up = gateway.next(RelayKind.UP)
    refused = opened(tcp_client(port))
    assert refused.recv(100) == b""  # no place
    first.close()
    assert gateway.next(RelayKind.DOWN).client == up.client
    second = opened(tcp_client(port))
    second.send(beat())
    assert gateway.next(RelayKind.UP).client != up.client
    gateway.says(clock(1))
    assert until(1, second.recv) == [1]


def test_frames_of_mavlink_1_are_converted(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP), ClientSetup("b", TCP)))
    one, two = gateway.ports()
    frame = bytes(old.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(old.MAVLink(None, 255, 190)))
    client, other = opened(udp()), opened(tcp_client(two))
    client.sendto(frame, (HERE, one))
    other.send(frame)
    for _ in range(2):
        assert gateway.next(RelayKind.CLIENT).payload == beat()[:4] + b"\0" + beat()[5:]


def test_serial_client_and_serial_vehicle(opened: Callable[..., Any]) -> None:
    ends = [pty.openpty() for _ in range(2)]
    for _, near in ends:
        tty.setraw(near)
    (vehicle, its), (client, theirs) = ends
    names = [os.ttyname(near) for near in (its, theirs)]
    process: RelayProcess = opened(
        RelayProcess(f"serial:{names[0]}:115200", [ClientSetup("a", f"serial:{names[1]}:115200")])
    )
    know(process)
    flight = opened(process.session())
    flight.send(beat())
    assert os.read(vehicle, 4_096) == beat()  # so the relay has the session
    unknown = bytes([0xFD, 3, 0, 0, 1, 1, 1, 0xFF, 0xFF, 0x7F]) + bytes(5)  # of no dialect
    os.write(vehicle, b"garbage" + clock(1) + acknowledged() + unknown + clock(2)[:9])
    os.write(vehicle, clock(2)[9:])
    wanted = clock(1) + unknown + clock(2)
    found = b""
    while len(found) < len(wanted) and select.select([client], [], [], PATIENCE_S)[0]:
        found += os.read(client, 4_096)
    assert found == wanted
    flight.settimeout(PATIENCE_S)
    heard = b""
    while len(heard) < len(wanted) + len(acknowledged()):
        heard += flight.recv(4_096)
    assert heard == clock(1) + acknowledged() + unknown + clock(2)
    os.write(client, arming())
    flight.send(arming(1))
    assert os.read(vehicle, 4_096) == arming(1)
    for descriptor in (vehicle, its, client, theirs):
        os.close(descriptor)


def test_next_session_replaces_the_last_and_its_end_is_told(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP)))
    (port,) = gateway.ports()
    client = opened(udp_client(port))
    gateway.next(RelayKind.UP)
    second = opened(gateway.process.session())
    gateway.next(RelayKind.FLIGHT_ENDED)
    assert gateway.flight.recv(10) == b""
    with pytest.raises(OSError, match="Broken pipe"):
        gateway.flight.send(arming())
    second.settimeout(PATIENCE_S)
    second.send(arming(3))
    assert gateway.vehicle.recv(4_096) == arming(3)
    second.close()
    gateway.next(RelayKind.FLIGHT_ENDED)
    gateway.says(clock(1))
    assert until(1, client.recv) == [1]  # telemetry goes on


def test_slow_reader_of_a_connection_is_dropped_and_the_others_lose_nothing(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", TCP), ClientSetup("b", UDP)))
    one, two = gateway.ports()
    slow = opened(socket.socket())
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_096)
    slow.connect((HERE, one))
    slow.send(beat())
    quick = opened(udp_client(two))
    gateway.next(RelayKind.UP)
    gateway.next(RelayKind.UP)
    sent = 0
    while (gone := gateway.came(RelayKind.DOWN)) is None:
        for _ in range(50):
            sent += 1
            gateway.says(clock(sent))
        assert until(sent, quick.recv) == list(range(sent - 49, sent + 1))
        assert until(sent, gateway.flight.recv)[-1] == sent
        assert sent < 200_000
    # the limit of its buffer, or the time that TCP waits for it, whichever comes first on this machine
    assert gone.payload in (b"it reads too slowly", b"connection timed out")


def test_vehicle_keeps_its_place_until_it_is_silent(opened: Callable[..., Any]) -> None:
    vehicle, port = opened(udp()), free_port()
    process: RelayProcess = opened(RelayProcess(f"udpin:{HERE}:{port}", [], silence_s=1))
    flight, stranger = opened(process.session()), opened(udp())
    flight.settimeout(PATIENCE_S)
    flight.send(arming())  # nobody to send it to
    stranger.sendto(b"nonsense", (HERE, port))
    while not select.select([flight], [], [], 0.05)[0]:  # until the relay has the session
        vehicle.sendto(clock(1), (HERE, port))
    stranger.sendto(clock(2), (HERE, port))
    vehicle.sendto(clock(3), (HERE, port))
    assert set(until(3, flight.recv)) == {1, 3}
    flight.send(arming(1))
    assert vehicle.recv(4_096) == arming(1)
    number = 4
    flight.settimeout(0.05)
    heard: list[int] = []
    while not heard:  # the vehicle is silent
        stranger.sendto(clock(number), (HERE, port))
        number += 1
        with suppress(TimeoutError):
            heard = numbers(flight.recv(4_096))
        assert number < 2_000
    flight.send(arming(2))
    assert stranger.recv(4_096) == arming(2)


def test_vehicle_whose_frames_are_cut_by_a_bridge(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed())
    stream = b"".join(clock(number) for number in range(1, 60))
    gateway.says(*(stream[start : start + 50] for start in range(0, len(stream), 50)))
    assert until(59, gateway.flight.recv) == list(range(1, 60))


def test_peer_that_does_not_listen_yet(opened: Callable[..., Any]) -> None:
    port = free_port()
    addresses = (f"udpout:{HERE}:{port}", f"tcp:{HERE}:{port}")
    gateway: Relayed = opened(relayed(*(ClientSetup(each, each) for each in addresses)))
    for number in range(1, 40):
        gateway.says(clock(number))
        assert until(number, gateway.flight.recv) == [number]
    client = opened(udp(port))
    gateway.says(clock(40), clock(41))
    assert until(41, client.recv)[-1] == 41
    listener = opened(socket.create_server((HERE, port)))
    listener.settimeout(PATIENCE_S)
    late = opened(listener.accept()[0])
    late.settimeout(PATIENCE_S)
    late.send(beat())
    assert msgspec.json.decode(gateway.next(RelayKind.UP).payload, type=Up).index == 1
    gateway.says(clock(42))
    assert until(42, late.recv) == [42]


@pytest.mark.parametrize("whose", ["vehicle", "client", "connections"])
def test_address_in_use_is_a_clear_refusal(whose: str, opened: Callable[..., Any]) -> None:
    taken = opened(udp())
    port = taken.getsockname()[1]
    vehicle, client = f"udpin:{HERE}:{free_port()}", f"udpin:{HERE}:{free_port()}"
    if whose == "vehicle":
        vehicle = f"udpin:{HERE}:{port}"
    elif whose == "client":
        client = f"udpin:{HERE}:{port}"
    else:
        listener = opened(socket.create_server((HERE, 0)))
        port = listener.getsockname()[1]
        client = f"tcpin:{HERE}:{port}"
    with pytest.raises(RelayError) as caught:
        RelayProcess(vehicle, [ClientSetup("a", client)])
    failure = caught.value.failure
    assert failure.client == (None if whose == "vehicle" else 0)
    assert failure.text.endswith(f":{port}` cannot be opened: address already in use")
    assert failure.help == "another program has it open: end that one, or choose another address"


def test_wrong_address_is_a_clear_refusal() -> None:
    with pytest.raises(RelayError) as caught:
        RelayProcess("udpin:127.0.0.1", [])
    assert caught.value.failure.text == "the port of the link is missing"
    with pytest.raises(RelayError) as caught:
        RelayProcess(f"udpin:{HERE}:{free_port()}", [ClientSetup("a", "serial:/dev/null:57600")])
    assert caught.value.failure.client == 0
    assert "not a serial device" in caught.value.failure.text


def test_relay_ends_at_a_signal_and_with_its_starter(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("a", UDP)))
    os.kill(gateway.process.pid, signal.SIGINT)  # of the terminal: it goes on
    gateway.says(clock(1))
    assert until(1, gateway.flight.recv) == [1]
    os.kill(gateway.process.pid, signal.SIGTERM)
    assert gateway.flight.recv(10) == b""
    assert gateway.process.wait(PATIENCE_S) == ExitCode.OK


def test_killed_starter_takes_the_relay_along(opened: Callable[..., Any]) -> None:
    port = free_port()
    words = (
        "from rtshcua.adapters.gateway.process import RelayProcess; import time; "
        f"each = RelayProcess('udpin:{HERE}:{port}', []); print(each.pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", words], stdout=subprocess.PIPE) as starter:
        assert starter.stdout is not None
        relay = int(starter.stdout.readline())
        starter.kill()
    with suppress(ProcessLookupError):
        handle = os.pidfd_open(relay)
        assert select.select([handle], [], [], PATIENCE_S)[0]
        os.close(handle)
    udp(port).close()  # the address is free again
