"""Threat: a client of the gateway floods it, sends garbage, or opens connections without end.

Nothing of it reaches the vehicle, and the vehicle's frames reach FLIGHT and the other clients meanwhile, all of them.
"""

import random
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any, Final

import pytest

from hostile.relayed import (
    HERE,
    Relayed,
    arming,
    beat,
    clock,
    relayed,
    sockets_of,
    tcp_client,
    udp_client,
    until,
)
from rtshcua.adapters.gateway.messages import ClientSetup, RelayKind

pytestmark = pytest.mark.slow

_UDP, _TCP = "udpin:127.0.0.1:0", "tcpin:127.0.0.1:0"
_FRAMES: Final = 20_000
_BLOCK: Final = 250  # between two of them the vehicle sends a frame
_CONNECTIONS: Final = 2_000


@pytest.fixture
def opened() -> Iterator[Callable[..., Any]]:
    """Closes at the end what it is called with, and returns it."""
    with ExitStack() as stack:

        def keep(thing: Any) -> Any:
            stack.callback(thing.close)
            return thing

        yield keep


def hostile_frames(seed: int) -> Iterator[bytes]:
    """Commands with changed octets, cut, lengthened, repeated, joined to others, and octets at random."""
    draw = random.Random(seed)
    while True:
        frame = bytearray(arming(draw.randrange(256)))
        match draw.randrange(6):
            case 0:
                frame[draw.randrange(len(frame))] ^= 1 << draw.randrange(8)
            case 1:
                del frame[draw.randrange(1, len(frame)) :]
            case 2:
                frame += draw.randbytes(draw.randrange(2_000))
            case 3:
                frame = bytearray(draw.randbytes(draw.randrange(1, 300)))
            case 4:
                frame[1] = draw.randrange(256)  # another length
            case 5:
                frame *= draw.randrange(1, 20)
        yield bytes(frame)


def undisturbed(gateway: Relayed, number: int, readers: list[socket.socket]) -> None:
    """The next frame of the vehicle reaches everybody."""
    gateway.says(clock(number))
    for link in readers:
        assert until(number, link.recv) == [number]


def nothing_reached(gateway: Relayed) -> None:
    """FLIGHT's next frame is the next one that the vehicle gets."""
    gateway.flight.send(arming(77))
    assert gateway.vehicle.recv(4_096) == arming(77)


def test_flood_of_mutated_frames(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("hostile", _UDP), ClientSetup("good", _UDP)))
    one, two = gateway.ports()
    hostile, good = opened(udp_client(one)), opened(udp_client(two))
    gateway.next(RelayKind.UP)
    gateway.next(RelayKind.UP)
    frames = hostile_frames(36)
    for number in range(1, _FRAMES // _BLOCK + 1):
        for _ in range(_BLOCK):
            hostile.send(next(frames))
        undisturbed(gateway, number, [good, gateway.flight])
        gateway.came(RelayKind.DOWN)  # the starter reads
    nothing_reached(gateway)
    counted = gateway.counters(lambda found: len(found.clients) == 2)
    assert sum(each.frames for each in counted.clients) < _FRAMES  # most were turned away, and counted
    assert sum(each.garbage for each in counted.clients) > 0


def test_connections_without_end(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("hostile", _TCP), ClientSetup("good", _UDP)))
    one, two = gateway.ports()
    good = opened(udp_client(two))
    gateway.next(RelayKind.UP)
    kept: list[socket.socket] = []
    most = sockets_of(gateway.process.pid) + 64
    for number in range(1, _CONNECTIONS + 1):
        link = opened(socket.socket())
        link.setblocking(False)
        with suppress(BlockingIOError):
            link.connect((HERE, one))
        kept.append(link)
        if number % 3 == 0:
            with suppress(OSError):
                link.send(arming()[: number % 40 + 1])  # a frame that never ends
        if number % 50 == 0:
            undisturbed(gateway, number, [good, gateway.flight])
            assert sockets_of(gateway.process.pid) <= most
        if len(kept) == 400:
            for each in kept:
                each.close()
            kept.clear()
    nothing_reached(gateway)


def test_place_comes_free_after_the_connections(opened: Callable[..., Any]) -> None:
    gateway: Relayed = opened(relayed(ClientSetup("hostile", _TCP)))
    (port,) = gateway.ports()
    links = [tcp_client(port) for _ in range(64)]
    for link in links:
        link.close()
    client = opened(tcp_client(port))
    client.send(beat())
    gateway.next(RelayKind.UP)
    undisturbed(gateway, 1, [client, gateway.flight])
