"""A whole run over the agent socket: an agent follows it, is refused, and replans; a person recalls it."""

import json
import os
import socket
import tempfile
import threading
import time
from base64 import b64encode
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from reference.documents import approval, low, recall, replacement
from reference.world import Run
from rtshcua.adapters.agent_socket import GAP_US
from rtshcua.app.fly.agents import SAME_USER, Agents
from rtshcua.app.fly.narrator import Teller
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Ending, Event, Presented, Reply
from rtshcua.wire.keys import Duty, SigningKey


class Followed(Run):
    """A run with a reader on its socket."""

    def __init__(self, folder: Path) -> None:
        of = low()
        self.agents = Agents(folder / "s", of)
        self.link = socket.socket(socket.AF_UNIX)
        self.link.connect(str(folder / "s"))
        self.link.setblocking(False)
        super().__init__(of, ready=False)

    def told(self) -> list[dict[str, Any]]:
        try:
            return [json.loads(line) for line in self.link.recv(1 << 22).splitlines()]
        except BlockingIOError:
            return []

    def send(self, document: bytes) -> None:
        self.link.setblocking(True)
        self.link.sendall(json.dumps({"id": 5, "document": b64encode(document).decode()}).encode() + b"\n")
        self.link.setblocking(False)

    def hand(self, document: bytes) -> list[dict[str, Any]]:
        """Hand a document in; what is told in the turn in which it is taken up. Another thread prepares it meanwhile:
        the time of the flight stands still.
        """
        self.send(document)
        events: list[Event] = []
        self.clock.advance(GAP_US)
        until_s = time.monotonic() + 30
        while not events and time.monotonic() < until_s:
            events += self.agents.events(self.clock.now())
            time.sleep(0.001)
        self.told()
        self.agents.watch(self.tick(*events))
        return self.told()


@pytest.fixture
def run() -> Iterator[Followed]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        found = Followed(Path(name))
        with found.agents:
            yield found
        found.link.close()


def test_first_lines_name_the_mission(run: Followed) -> None:
    run.agents.events(run.clock.now())
    hello, mission = run.told()
    assert hello == {
        "type": "hello",
        "format": "rtshcua/agent",
        "version": 1,
        "vehicle": "quad-07",
        "flight": "0" * 32,
        "mode": "software",
    }
    assert mission["digest"] == run.loaded.bundle.mission_digest.hex()
    assert [(step["step"], step["skill"], step["phase"]) for step in mission["steps"]] == [
        (0, "takeoff", "departure"), (1, "goto", "inspection"), (2, "inspect_area", "inspection"),
        (3, "return_home", "recovery"),
    ]  # fmt: skip
    assert mission["steps"][2]["id"] == run.loaded.bundle.mission.invocations[2].invocation_id.hex()


def test_records_are_forwarded_unchanged(run: Followed) -> None:
    run.agents.events(run.clock.now())
    run.told()
    run.hand(b"")
    before = len(run.lines)
    actions = run.tick()
    run.agents.watch(actions)
    assert [json.dumps(each) for each in run.told()] == [json.dumps(json.loads(each)) for each in run.lines[before:]]


def test_documents_and_their_answers(run: Followed) -> None:
    answer = {"type": "answer", "id": 5}
    told = run.hand(approval(run.loaded))
    assert [each["type"] for each in told] == ["effect", "answer"]
    assert told[-1] | answer == told[-1]
    assert told[-1]["slug"] == "accepted"
    told = run.hand(replacement(run.loaded))
    assert [each["type"] for each in told] == ["effect", "answer", "mission"]
    assert [step["skill"] for step in told[-1]["steps"]] == ["takeoff", "goto", "return_home"]
    assert told[-1]["digest"] == run.loaded.bundle.mission_digest.hex()
    told = run.hand(b"nonsense")
    assert [each["type"] for each in told] == ["effect", "answer"]
    assert told[-1]["slug"] == "malformed"
    told = run.hand(recall(run.loaded))
    assert told[-1]["slug"] == "accepted"
    assert run.ending is Ending.RECALLED
    run.agents.tell(b'{"type":"close"}\n')
    assert run.told() == [{"type": "close"}]


def test_document_after_the_mission_is_answered(run: Followed) -> None:
    run.send(recall(run.loaded))
    told: list[dict[str, Any]] = []
    before = len(run.lines)
    while not any(each["type"] == "answer" for each in told):
        run.clock.advance(GAP_US)
        run.agents.turn_away(run.clock.now())
        told += run.told()
    assert [each["type"] for each in told] == ["hello", "mission", "answer"]
    assert (told[-1]["id"], told[-1]["slug"]) == (5, "falling-back")
    assert len(run.lines) == before


def test_the_view_follows_a_replacement_and_shows_no_signature(run: Followed) -> None:
    policy, mission = run.loaded.bundle.policy, run.loaded.bundle.mission
    teller = Teller(policy, mission, 0)
    before = len(run.lines)
    run.hand(replacement(run.loaded))
    (what,) = [teller.tell(line) for line in run.lines[before:]]
    assert what is not None
    assert (what.event, what.detail) == ("replacement", "from step 3 on")
    teller.replace(run.loaded.bundle.mission)
    longest = b'{"type":"effect","at_us":1,"kind":0,"step":9,"event":"x"}\n'
    far = teller.tell(longest)
    assert far is not None
    assert far.subject == ""


def test_operators_have_a_socket_of_their_own_and_are_looked_at_first(tmp_path: Path) -> None:
    of = low()
    with tempfile.TemporaryDirectory(dir="/tmp") as name, ExitStack() as stack:
        paths = [Path(name) / "a", Path(name) / "o"]
        agents = stack.enter_context(Agents(paths[0], of, operators=paths[1], group=os.getegid()))
        assert [path.stat().st_mode & 0o777 for path in paths] == [0o660, 0o600]
        links = [stack.enter_context(socket.socket(socket.AF_UNIX)) for _ in paths]
        for link, path, number in zip(links, paths, (1, 2), strict=True):
            link.connect(str(path))
            link.sendall(b'{"id": %d, "document": "AAA%s"}\n' % (number, b"ABCD"[number : number + 1]))
        first, second = agents.events(Now(1, 1, 0))
        assert isinstance(first, Presented)
        assert isinstance(second, Presented)
        assert (first.document[-1], second.document[-1]) == (2, 1), "the operator's comes first"
        assert first.sender != second.sender
        assert agents.notes() == [SAME_USER], "both run as one user"
        agents.events(Now(GAP_US * 2, 1, 0))
        assert agents.notes() == [], "which is told once"
        agents.watch([Reply(second.sender, "accepted", "to the agent"), Reply(first.sender, "expired", "to the other")])
        for link, number, slug in zip(links, (1, 2), ("accepted", "expired"), strict=True):
            lines = [json.loads(line) for line in link.recv(1 << 20).splitlines()]
            assert [each["type"] for each in lines] == ["hello", "mission", "answer"]
            assert (lines[-1]["id"], lines[-1]["slug"]) == (number, slug)


def test_agent_documents_do_not_delay_operators(tmp_path: Path) -> None:
    """Replacements are prepared ahead, by at most one thread for each socket."""
    of, over = low(), threading.Event()
    seeds = (number.to_bytes(32) for number in range(1, 14))
    keys = [SigningKey.from_seed(seed, duty=Duty.MISSION, development=True) for seed in seeds]
    large = iter([b64encode(replacement(of, key=key)).decode() for key in keys])
    with tempfile.TemporaryDirectory(dir="/tmp") as name, ExitStack() as stack:
        paths = [Path(name) / "a", Path(name) / "o"]
        agents = stack.enter_context(Agents(paths[0], of, operators=paths[1]))
        stack.callback(over.set)
        agents._sockets[1].worker.submit(over.wait)
        links = [stack.enter_context(socket.socket(socket.AF_UNIX)) for _ in paths]
        for link, path, times in zip(links, paths, (12, 1), strict=True):
            link.connect(str(path))
            for _ in range(times):
                link.sendall(json.dumps({"document": next(large)}).encode() + b"\n")
        found: list[Event] = []
        for turn in range(1, 200):
            found += agents.events(Now(turn * GAP_US, 1, 0))
        agents._sockets[0].worker.submit(int).result(60)  # after the operator's document
        found += agents.events(Now(200 * GAP_US, 1, 0))
        assert len(found) == 1, "the operator's; eight of the agent's wait, and the others are told that"
        slugs = [json.loads(line).get("slug") for line in links[0].recv(1 << 20).splitlines()]
        assert slugs.count("busy") == 4


def test_a_socket_that_cannot_be_made_leaves_no_other_behind(tmp_path: Path) -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        path = Path(name) / "o"
        with pytest.raises(OSError, match="No such file"):
            Agents(Path(name) / "missing" / "a", low(), operators=path)
        assert not path.exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--agent-socket", "s", "--operator-socket", "s"], "must be different paths"),
        (["--agent-group", "root"], "requires `--agent-socket`"),
        (["--wait"], "`--wait` requires `--agent-socket PATH`"),
        (["--wait-for", "5s"], "requires `--wait`"),
        (["--idle", "5s"], "requires `--live`"),
        (["--live"], "`--live` requires `--agent-socket PATH`"),
        (["--live", "--agent-socket", "s", "--dry-run"], "conflicts with `--dry-run`"),
        (["--wait", "--agent-socket", "s", "--dry-run"], "conflicts with `--dry-run`"),
        (["--agent-socket", "s", "--agent-group", "no-such-group"], "unknown group `no-such-group`"),
    ],
)
def test_sockets_that_make_no_sense(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "b", *words]) == ExitCode.USAGE
    assert text in capsys.readouterr().err
