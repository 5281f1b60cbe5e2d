"""Whoever connects to the agent socket again and again, and one that listens there and never answers."""

import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters import agent_socket
from rtshcua.adapters.agent_socket import MOST_READERS, AgentSocket, SocketTaken


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
            assert endless.accepted <= turn * MOST_READERS
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


def test_a_recall_finds_a_place_among_readers_that_only_stay(path: Path) -> None:
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
    assert len(agents.readers) == MOST_READERS
    agents.close()
    for each in idle:
        each.close()
