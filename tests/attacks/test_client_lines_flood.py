"""Threat: a client of the agent socket floods a flight with lines about clients and with requests to the vehicle, to
fill its log, the vehicle's link or the flight's time, or so that a recall waits; or it hides a command in a request.
"""

import json
import socket
import tempfile
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from reference.documents import low, recall
from reference.world import Run
from rtshcua.adapters.agent_socket import CLIENT_BYTES, CLIENT_LINES, LIGHT_GAP_US, REQUESTS
from rtshcua.app.fly.agents import Agents
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.ports import ClientRecord, Ending
from rtshcua.onboard.runtime.runtime import CLIENT

SECONDS = 10
TEXT = json.dumps({"refused": "x" * (CLIENT_BYTES - 20)})
LINES = [
    json.dumps({"id": 1, "client": TEXT}),
    json.dumps({"id": 2, "request": b64encode(bytes(50)).decode()}),
    json.dumps({"id": 3, "client": "[" * 100}),
    json.dumps({"id": 4, "request": "!"}),
]


class Flooded(Run):
    """A run with an agent that sends as much as is read."""

    def __init__(self, folder: Path) -> None:
        of = low()
        self.agents = Agents(folder / "a", of, operators=folder / "o")
        self.passed: list[bytes] = []
        self.turns: Counter[int] = Counter()  # by the number of lines taken in one turn
        self.link = socket.socket(socket.AF_UNIX)
        self.link.connect(str(folder / "a"))
        self.link.setblocking(False)
        self.unsent = b""
        super().__init__(of)

    def flood(self) -> None:
        with suppress(BlockingIOError):
            while True:
                self.unsent = self.unsent or "\n".join(LINES * 50).encode() + b"\n"
                self.unsent = self.unsent[self.link.send(self.unsent) :]
        with suppress(BlockingIOError):
            self.link.recv(1 << 20)

    def turn(self) -> None:
        self.flood()
        self.clock.advance(LIGHT_GAP_US)
        before = len(self.passed)
        events = self.agents.events(self.clock.now())
        self.agents.pass_on(self._pass)
        records = [event for event in events if isinstance(event, ClientRecord)]
        self.turns[len(records) + len(self.passed) - before] += 1
        self.agents.watch(self.step(*self.vehicle.poll(self.clock.now().monotonic_us), *events))

    def _pass(self, frame: bytes) -> Refusal | None:
        self.passed.append(frame)
        return None


@pytest.fixture
def flooded() -> Iterator[Flooded]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        found = Flooded(Path(name))
        with found.agents:
            yield found
        found.link.close()


def share(kind: tuple[int, int]) -> int:
    """The most lines of one kind in the time of a test."""
    each_us, at_once = kind
    return at_once + SECONDS * 1_000_000 // each_us + 1


@pytest.mark.slow
def test_flood_costs_one_line_a_turn_and_leaves_log_and_link_alone(flooded: Flooded) -> None:
    for _ in range(SECONDS * 1_000_000 // LIGHT_GAP_US):
        flooded.turn()
    told = [record for record in flooded.records if record.get("event") == CLIENT]
    assert CLIENT_LINES[1] <= len(told) <= share(CLIENT_LINES)
    assert REQUESTS[1] <= len(flooded.passed) <= share(REQUESTS)
    assert max(flooded.turns) == 1
    assert {record["detail"] for record in told} == {TEXT}


def test_recall_gets_through_a_flood(flooded: Flooded) -> None:
    flooded.until_flies("goto")
    for _ in range(200):
        flooded.turn()
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(flooded.agents._sockets[0].socket.path))
        document: Any = b64encode(recall(flooded.loaded, now=flooded.clock.now())).decode()
        link.sendall(json.dumps({"id": 7, "document": document}).encode() + b"\n")
        for _ in range(5):
            flooded.turn()
    assert "recall" in flooded.events, "within some ms"
    assert flooded.until(lambda run: run.ending is not None).ending is Ending.RECALLED
