"""Whoever connects to the agent socket again and again, and one that listens there and never answers."""

import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from itertools import count, repeat
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters import agent_socket
from rtshcua.adapters.agent_socket import (
    MOST_OF_A_PEER,
    MOST_READERS,
    MOST_WELCOMED,
    AgentSocket,
    Peer,
    SocketTaken,
    hand_in,
)


@pytest.fixture
def path() -> Iterator[Path]:
    """A short one: a socket's has at most 107 bytes."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


class Endless:
    """A listener to which somebody has always just connected, and hung up again."""

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


def test_the_flight_goes_on_however_many_connect(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    agents = AgentSocket(path, lambda: b"{}\n")
    endless: Any = Endless()
    with monkeypatch.context() as patched:
        patched.setattr(agents, "_listener", endless)
        for turn in range(1, 5):
            assert agents.poll(turn * 1_000_000) is None
            assert endless.accepted <= turn * MOST_WELCOMED
    agents.close()


def test_a_listener_that_answers_nobody_holds_no_start_up(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its queue is full, so a connection would be waited for, for ever."""
    monkeypatch.setattr(agent_socket, "_PATIENCE_S", 0.01)
    with socket.socket(socket.AF_UNIX) as listener, socket.socket(socket.AF_UNIX) as first:
        listener.bind(str(path))
        listener.listen(0)
        first.connect(str(path))
        with pytest.raises(SocketTaken):
            AgentSocket(path, bytes)
    assert path.is_socket(), "and it stays where it is"


@pytest.mark.parametrize("most", [MOST_OF_A_PEER, MOST_READERS])
def test_a_recall_finds_a_place_among_readers_that_only_stay(
    path: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """Whether they are all of one process, or each of another."""
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
while made < 400 or not select.select([sys.stdin], [], [], 0)[0]:
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
    """Two processes flood the agents' socket; the operator's recalls are answered all the same, one after the other."""
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
    assert min(made) >= 400
    assert len(agents.users) == 1
