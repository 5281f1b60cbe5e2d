"""Threat: an agent, with or without a mission key, repeatedly presents documents that take long to decode, verify or
hash, so that the flight's thread would stall and frames of the vehicle would wait.
"""

import json
import socket
import tempfile
import threading
import time
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from hostile.documents import enveloped, head, hostile
from reference.documents import large, low, low_mission, recall, replacement
from reference.world import MISSION_KEY, ROOT, START, VEHICLE, Run, loaded, sealed_again
from rtshcua.adapters.agent_socket import GAP_US, SHORT, WORK_AT_ONCE, WORK_RATE, AgentSocket, Encoded
from rtshcua.app.fly import agents
from rtshcua.app.fly.agents import Agents
from rtshcua.app.telling import prose
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.enforcement.isolated import PART, PRESENT, Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Event, Presented
from rtshcua.onboard.runtime import runtime
from rtshcua.virtual.boundary_in_process import Served
from rtshcua.wire import cbor, cose, response
from rtshcua.wire.cose import MAX_PROTECTED, EnvelopeError

#: functions whose time grows with the document: never called in the flight's thread
LONG: list[tuple[Any, str]] = [
    (Commands, "_of_step"), (response, "own_clauses"), (prose, "call"), (Encoded, "decoded"), (agents, "b64encode"),
    (runtime, "b64encode"),
]  # fmt: skip
#: CBOR items that one turn may decode in the flight's thread: about 0.1 ms
ITEMS = 150
HOSTILE = hostile(MISSION_KEY)


class Flooded(Run):
    """A run with a client at its socket; counts what each thread decodes."""

    def __init__(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, of: Loaded, *, operators: bool = False,
        idle_us: int | None = None,
    ) -> None:  # fmt: skip
        path = folder / "s"
        self.agents = Agents(None if operators else path, of, operators=path if operators else None)
        self.link = socket.socket(socket.AF_UNIX)
        self.link.connect(str(folder / "s"))
        self.decoded: Counter[int] = Counter()
        self.looked_at: list[bytes] = []
        self.came = b""  # the incomplete line of the input
        self.me = threading.get_ident()
        self.most = 0
        self.busy: Counter[str] = Counter()  # slow functions called in the flight's thread, by name
        item, consider = cbor._item, of.boundary.consider

        def counted(*arguments: Any) -> Any:
            self.decoded[threading.get_ident()] += 1
            return item(*arguments)

        def considered(document: bytes, now: Now) -> Any:
            assert threading.get_ident() != self.me
            self.looked_at.append(document)
            return consider(document, now)

        monkeypatch.setattr(cbor, "_item", counted)
        for where, name in LONG:
            self._watch(where, name, monkeypatch)
        monkeypatch.setattr(of.boundary, "consider", considered)
        super().__init__(of, idle_us=idle_us)

    def _watch(self, where: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        does = getattr(where, name)

        def watched(*arguments: Any, **more: Any) -> Any:
            self.busy[name] += threading.get_ident() == self.me
            return does(*arguments, **more)

        monkeypatch.setattr(where, name, watched)

    def hand(self, document: bytes, *, over: bool = False) -> str:
        """Present a document; returns the answer and records how much the flight's thread decoded meanwhile."""
        self.agents._sockets[0].socket._budgets.clear()
        line = json.dumps({"id": 5, "document": b64encode(document).decode()}).encode() + b"\n"
        sender = threading.Thread(target=self.link.sendall, args=(line,))
        sender.start()
        slug = ""
        while not slug:
            assert over or self.ending is None
            if not self.agents._sockets[0].ahead:  # otherwise wait for the other thread
                self.clock.advance(GAP_US)
            before = self.decoded[self.me]
            if over:
                self.agents.turn_away(self.clock.now())
            else:
                events: list[Event] = list(self.agents.events(self.clock.now()))
                self.agents.watch(self.tick(*events) if events else ())
            self.most = max(self.most, self.decoded[self.me] - before)
            slug = self._answer()
            time.sleep(0.001)  # the other thread has something to do
        sender.join()
        return slug

    def _answer(self) -> str:
        try:
            *came, self.came = (self.came + self.link.recv(1 << 22, socket.MSG_DONTWAIT)).split(b"\n")
        except BlockingIOError:
            return ""
        lines = [json.loads(line) for line in came]
        return next((line["slug"] for line in lines if line["type"] == "answer"), "")


@contextmanager
def flooded(of: Loaded, monkeypatch: pytest.MonkeyPatch, **more: Any) -> Iterator[Flooded]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        found = Flooded(Path(name), monkeypatch, of, **more)
        with found.agents:
            yield found
        found.link.close()


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Iterator[Flooded]:
    with flooded(low(), monkeypatch) as found:
        yield found


def elsewhere() -> tuple[Loaded, list[int]]:
    """The same flight with a boundary elsewhere, and the kinds of calls that it gets."""
    served, kinds = Served(ROOT, VEHICLE), list[int]()

    def call(octets: bytes) -> bytes:
        kinds.append(octets[0])
        return served(octets)

    of = load(
        sealed_again(loaded(mission=low_mission())), root=ROOT, vehicle=VEHICLE, now=START,
        mode=EnforcementMode.PROCESS,
        session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=False, caller=Caller(call),
    )  # fmt: skip
    assert isinstance(of, Loaded), of
    return of, kinds


@pytest.mark.parametrize("operators", [False, True], ids=["agents", "operators"])
@pytest.mark.parametrize("mode", [EnforcementMode.SOFTWARE, EnforcementMode.PROCESS])
def test_replacement_is_prepared_in_another_thread(
    mode: EnforcementMode, operators: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything that takes time in proportion to its steps; activation and the record remain."""
    of = low() if mode is EnforcementMode.SOFTWARE else elsewhere()[0]
    with flooded(of, monkeypatch, operators=operators) as run:
        document = large(of)
        assert len(document) > SHORT
        assert run.hand(document) == "accepted"
        if mode is EnforcementMode.SOFTWARE:  # a separate boundary verifies it in the call
            assert run.most <= ITEMS
            assert not +run.busy, "in the flight's thread"
        else:
            assert +run.busy == Counter(_of_step=61, own_clauses=61), "by the boundary"
        assert len(of.bundle.mission.invocations) == 61
        assert of.in_force.considered(document) is None, "it is taken"
        assert any(b'"event":"replacement"' in line and b64encode(document) in line for line in run.lines)


def test_refused_document_is_not_sent_to_other_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    of, kinds = elsewhere()
    with flooded(of, monkeypatch, operators=True) as run:
        kinds.clear()
        for document, slug in HOSTILE.values():
            assert run.hand(document) == slug
        assert not {PART, PRESENT} & {*kinds}
        assert run.most <= ITEMS
        assert run.busy["decoded"] == 0


def test_misfitting_document_is_not_sent_to_other_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    """Correctly signed documents with different octets: the boundary would verify each, while the flight waits."""
    of, kinds = elsewhere()
    with flooded(of, monkeypatch) as run:
        anew = [large(of, steps) for steps in (20, 21, 22)]
        late = replacement(of, 0, replace(of.bundle.mission, issued_at_us=of.bundle.mission.issued_at_us + 2))
        assert run.hand(late) == "already-released"
        assert PRESENT not in kinds
        assert [run.hand(document) for document in anew] == ["accepted", "superseded", "superseded"]
        assert kinds.count(PRESENT) == 1


def test_live_flight_that_is_replanned_all_the_time_decodes_little_in_its_thread(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each replacement supersedes the running step: its command and its standing permits are new every time."""
    with flooded(loaded(mission=replace(low_mission(), invocations=low_mission().invocations[:2])), monkeypatch,
                 idle_us=60_000_000) as run:  # fmt: skip
        run.until_flies("goto")
        for step in range(2, 32):
            mission = run.loaded.bundle.mission
            more = replace(mission.invocations[1], step=step, invocation_id=step.to_bytes(16))
            anew = replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=(*mission.invocations, more))
            assert run.hand(replacement(run.loaded, step, anew)) == "accepted"
        assert run.events.count("superseded") >= 15, "one in each interval of documents, as long as a step flies"
        assert run.most <= ITEMS
        assert not +run.busy


@pytest.mark.parametrize("name", HOSTILE)
def test_flight_thread_decodes_little_of_any_document(run: Flooded, name: str) -> None:
    document, slug = HOSTILE[name]
    assert run.hand(document) == slug
    assert run.hand(document) == slug
    assert run.most <= ITEMS
    assert len(run.looked_at) <= 1, "its refusal is remembered"


def test_duplicate_replacement_is_verified_once(run: Flooded) -> None:
    document = replacement(run.loaded)
    assert run.hand(document) == "accepted"
    assert run.hand(document) == "superseded"
    assert run.looked_at == [document]
    assert run.most <= ITEMS


def test_nothing_is_decoded_during_fallback_or_after_mission(run: Flooded) -> None:
    run.until_flies("goto")
    assert run.hand(recall(run.loaded, now=run.clock.now())) == "accepted"
    run.most = 0
    for document, slug in HOSTILE.values():
        assert run.hand(document) in ("falling-back", slug)
    for document, _ in HOSTILE.values():
        assert run.hand(document, over=True) == "falling-back"
    assert run.most <= ITEMS


def test_a_protected_header_is_malformed_by_its_length() -> None:
    for size in (MAX_PROTECTED, MAX_PROTECTED + 1):
        with pytest.raises(EnvelopeError) as error:
            cose.unverified(enveloped(head(2, size - 5) + bytes(size - 5), b""))
        assert (error.value.slug, "bytes; the limit is" in str(error.value)) == ("malformed", size > MAX_PROTECTED)


def test_user_budget_ignores_short_documents() -> None:
    long, short = (json.dumps({"document": "A" * size}).encode() + b"\n" for size in (349_000, SHORT // 4 * 4 - 400))
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        listening = AgentSocket(Path(name) / "s", bytes)
        with socket.socket(socket.AF_UNIX) as flood, socket.socket(socket.AF_UNIX) as other:
            for link in (flood, other):
                link.connect(str(Path(name) / "s"))
            sender = threading.Thread(target=flood.sendall, args=(long * 20,))
            sender.start()
            seconds, taken, shorts = 20, 0, 0
            for turn in range(seconds * 50):
                if turn % 50 == 0:
                    other.sendall(short)
                event = listening.poll(turn * GAP_US)
                if isinstance(event, Presented):
                    taken += len(event.document) > SHORT
                    shorts += len(event.document) <= SHORT
                time.sleep(0.000_1)  # the sender has something to do
            sender.join(20)
            listening.close()
    assert 1 <= taken <= (WORK_AT_ONCE + seconds * WORK_RATE) // len(long)
    assert shorts >= seconds - 2


def test_failed_verification_ahead_refuses_document(run: Flooded, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(document: bytes, now: Now) -> None:
        raise MemoryError

    monkeypatch.setattr(run.loaded.boundary, "consider", fails)
    assert run.hand(replacement(run.loaded)) == "failed"
