"""Threat: a process connects to the agent socket repeatedly, or a listener there never answers."""

import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import chain, count, repeat
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters import agent_socket
from rtshcua.adapters.agent_socket import (
    AHEAD,
    AT_ONCE,
    MOST_OF_A_PEER,
    MOST_READERS,
    MOST_TAKEN,
    MOST_WELCOMED,
    WELCOME_US,
    AgentSocket,
    Peer,
    SocketTaken,
    hand_in,
)


@pytest.fixture
def path() -> Iterator[Path]:
    """A short path, because the path of a socket has at most 107 bytes."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


class Endless:
    """A listener with an endless sequence of connections that are closed at once."""

    def __init__(self) -> None:
        self.accepted = 0

    def accept(self) -> tuple[socket.socket, str]:
        self.accepted += 1
        assert self.accepted < 1_000, "the flight waits for whoever connects"
        ours, theirs = socket.socketpair()
        theirs.close()
        return ours, ""

    def fileno(self) -> int:
        return -1


def test_flight_continues_under_connection_flood(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    agents = AgentSocket(path, lambda: b"{}\n")
    endless: Any = Endless()
    with monkeypatch.context() as patched:
        patched.setattr(agents, "_listener", endless)
        for turn in range(1, 5):
            assert agents.poll(turn * 1_000_000) is None
            assert endless.accepted <= turn * MOST_TAKEN
    agents.close()


def test_one_turn_limits_greetings_and_output(path: Path) -> None:
    """A greeting describes the mission, of any size, and is sent on each new connection."""
    greeting, greeted = b"x" * 150_000 + b"\n", list[int]()

    def greet() -> bytes:
        greeted.append(1)
        return greeting

    agents = AgentSocket(path, greet)
    with ExitStack() as held:
        links = [held.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(MOST_OF_A_PEER)]
        for each in links:
            each.connect(str(path))
        came = 0
        for turn in range(1, 15):
            before = len(greeted)
            agents.poll(turn * WELCOME_US)
            if turn == 1:
                assert len(agents.readers) == MOST_WELCOMED
            assert len(greeted) - before <= MOST_WELCOMED
            told = _now(links[0])
            came += len(told)
            assert len(told) <= 2 * AT_ONCE, "as it is greeted, and of what waits"
        assert came == len(greeting)
        assert len(greeted) == len(links)
    agents.close()


def _now(link: socket.socket) -> bytes:
    try:
        return link.recv(1 << 20, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return b""


def test_repeated_connections_are_rate_limited(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other clients do not wait until all of its connections were greeted."""
    agents = AgentSocket(path, lambda: b"{}\n")
    peers, welcomed = chain(repeat(7, 3 * MOST_TAKEN), repeat(8)), list[int]()
    endless: Any = Endless()
    monkeypatch.setattr(agent_socket, "peer_of", lambda _: Peer(next(peers), None))
    with monkeypatch.context() as patched:
        patched.setattr(agents, "_listener", endless)
        patched.setattr(agents, "_send", lambda reader, line: welcomed.append(reader.peer.process))
        turns = 0
        while 8 not in welcomed:
            agents.poll(1_000_000)
            turns += 1
    assert welcomed.count(7) == AHEAD
    assert turns == AHEAD // MOST_WELCOMED + 3, "its first connections, and the rest as fast as they are hung up on"
    agents.close()


def test_silent_listener_does_not_delay_start(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its queue is full, so that a connection would wait for ever."""
    monkeypatch.setattr(agent_socket, "_PATIENCE_S", 0.01)
    with socket.socket(socket.AF_UNIX) as listener, socket.socket(socket.AF_UNIX) as first:
        listener.bind(str(path))
        listener.listen(0)
        first.connect(str(path))
        with pytest.raises(SocketTaken):
            AgentSocket(path, bytes)
    assert path.is_socket(), "and it stays where it is"


@pytest.mark.parametrize("most", [MOST_OF_A_PEER, MOST_READERS])
def test_recall_gets_a_slot_among_idle_readers(path: Path, monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """The readers belong to one process or to several."""
    processes = repeat(1) if most == MOST_OF_A_PEER else count(1)
    monkeypatch.setattr(agent_socket, "peer_of", lambda _: Peer(next(processes), None))
    agents = AgentSocket(path, lambda: b"{}\n")
    idle = [socket.socket(socket.AF_UNIX) for _ in range(MOST_READERS)]
    for number, each in enumerate(idle, start=1):
        each.connect(str(path))
        agents.poll(number * 1_000_000)
    with socket.socket(socket.AF_UNIX) as late:
        late.connect(str(path))
        late.sendall(b'{"id": 7, "document": "AAAA"}\n')
        handed = agents.poll(100_000_000)
        assert handed is not None
        assert handed.document == bytes(3)
        agents.answer(handed.sender, "accepted", "")
        assert b'"id":7' in late.recv(1_000)
    assert len(agents.readers) == most
    agents.close()
    for each in idle:
        each.close()


#: connects as often as it can, holds some of the connections and says something on others, until it did so often enough
#: and its standard input ends
FLOOD = """
import select, socket, sys, time
held, made = [], 0
print("begun", flush=True)
while made < 100 or not select.select([sys.stdin], [], [], 0)[0]:
    link = socket.socket(socket.AF_UNIX)
    link.setblocking(False)
    try:
        link.connect(sys.argv[1])
        if made % 3 == 0:
            link.send(b'{"id": 1, "document": "AAAA"}' + bytes(made % 2 * 50_000))
        made += 1
    except OSError:
        time.sleep(0.000_5)
    held = [*held[-60:], link]
print(made)
"""


@pytest.mark.parametrize("operators", [True, False], ids=["their own socket", "the agents' socket"])
def test_a_recall_gets_through_a_flood(path: Path, operators: bool) -> None:
    """Two processes flood the agents' socket; all recalls of the operator are answered, one after the other."""
    numbers = count(1)
    agents = AgentSocket(path, lambda: b"{}\n" * 100, numbers=numbers)
    own = AgentSocket(path.with_name("o"), lambda: b"{}\n", own=True, numbers=numbers)
    over = threading.Event()

    def fly() -> None:
        while not over.wait(0.02):
            for each in (own, agents):
                event = each.poll(time.monotonic_ns() // 1_000)
                if event is not None:
                    each.answer(event.sender, "accepted" if event.document == b"recall" else "malformed", "")

    flight = threading.Thread(target=fly)
    flight.start()
    floods = [
        subprocess.Popen(
            [sys.executable, "-c", FLOOD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    try:
        for each in floods:
            assert each.stdout is not None
            assert each.stdout.readline() == "begun\n"
        for _ in range(5):
            assert hand_in(own.path if operators else path, b"recall", patience_s=60).slug == "accepted"
    finally:
        made = [int(each.communicate()[0]) for each in floods]
        over.set()
        flight.join()
        agents.close()
        own.close()
    assert min(made) >= 100
    assert len(agents.users) == 1
