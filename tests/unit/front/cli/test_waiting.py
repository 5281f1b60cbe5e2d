"""A waiting run: documents are admitted or refused, a recall or Ctrl-C ends it, and followers are notified."""

import json
import socket
import tempfile
import threading
from base64 import b64encode
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from reference.documents import approval, low, recall, replacement
from reference.world import START
from rtshcua.adapters.agent_socket import flight_at, hand_in
from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.utc import UtcWatch
from rtshcua.app.fly import waiting
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.stop_wishes import Interrupts, Wish
from rtshcua.app.fly.waiting import Admitted, MissionWait
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.console import TerminalConsole
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Event, Presented, Readings

BUNDLE = b"the bundle of a test"


class Clock(SystemClock):
    """The machine's clock, except for the day, which is that of the documents."""

    def now(self) -> Now:
        return Now(super().now().monotonic_us, START.utc_us, 0)


class Wished(Interrupts):
    """Ctrl-C, once `asked` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = threading.Event()

    def wish(self) -> Wish | None:
        return Wish.LAND if self.asked.is_set() else None


class Vehicle:
    """On the ground, and ready once it was polled a few times."""

    def __init__(self, base: Loaded) -> None:
        self.polls = 0
        self.announced: list[str] = []
        self.passed: list[bytes] = []
        self.slot = next(each.slot for each in base.bundle.policy.signals if each.name == "battery")
        self.driver = SimpleNamespace(
            unready="GPS", seen=SimpleNamespace(armed=False, airborne=None), asks_utc=True,
            source=SimpleNamespace(utc=lambda now_us: None), flavour=SimpleNamespace(name="px4"),
        )  # fmt: skip

    def poll(self, now_us: int, timeout_us: int) -> list[Event]:
        threading.Event().wait(0.001)
        self.polls += 1
        self.driver.unready = "GPS" if self.polls < 4 else None
        return [Readings(now_us, ((self.slot, 8_000),))]

    def pass_on(self, frame: bytes) -> Refusal | None:
        self.passed.append(frame)
        return None if frame == b"frame" else Refusal("not-a-request", "no")

    def announce(self, severity: int, text: str) -> None:
        self.announced.append(text)


class World:
    """A wait in a thread of its own, and its socket."""

    def __init__(self, folder: Path, base: Loaded, most_s: float) -> None:
        self.base, self.path = base, folder / "s"
        self.agents = Agents(self.path, base, waits=True)
        self.vehicle, self.interrupts = Vehicle(base), Wished()
        self.tried: list[bytes] = []
        self.newer: Refusal | None = None
        self.flies = low()
        self.clock, vehicle = Clock(), cast(Any, self.vehicle)
        self.utc = UtcWatch(self.clock, kernel_us=lambda: None)
        self.waiting = MissionWait(
            base, self.admit, lambda: self.newer, lambda: None, vehicle, self.clock, self.utc, self.interrupts,
            self.agents, console=TerminalConsole("json", Path(), None), most_s=most_s, notes=["a note"],
        )  # fmt: skip
        self.ended: Admitted | Refusal | None = None
        self.thread = threading.Thread(target=self.run)

    def admit(self, data: bytes) -> Loaded | Refusal:
        self.tried.append(data)
        return self.flies if data == BUNDLE else Refusal("untrusted", "not to be trusted")

    def run(self) -> None:
        self.ended = self.waiting.follow([])

    def hand(self, document: bytes) -> str:
        return hand_in(self.path, document).slug

    def end(self) -> Any:
        self.thread.join(30)
        assert not self.thread.is_alive()
        return self.ended


@pytest.fixture
def begin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., World]]:
    monkeypatch.setattr(waiting, "REPORT_S", 0.01)
    made: list[World] = []
    with tempfile.TemporaryDirectory(dir="/tmp") as name:

        def start(most_s: float = 60) -> World:
            made.append(World(Path(name), low(), most_s))
            made[-1].thread.start()
            return made[-1]

        yield start
        for each in made:
            each.interrupts.asked.set()
            each.thread.join(30)
            each.agents.__exit__(None, None, None)


def lines_of(world: World, count: int) -> list[dict[str, Any]]:
    """The first lines sent to a reader."""
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(world.path))
        file = link.makefile("rb")
        return [json.loads(file.readline()) for _ in range(count)]


def test_admitted_bundle_flies_under_the_announced_id(
    begin: Callable[..., World], capfd: pytest.CaptureFixture[str]
) -> None:
    world = begin()
    assert flight_at(world.path) == world.base.in_force.flight
    assert world.hand(BUNDLE) == "accepted"
    assert world.end() == Admitted(BUNDLE, world.flies)
    hello = world.agents._greeting().splitlines()
    assert [json.loads(each)["type"] for each in hello] == ["hello", "mission"]
    told = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [each["event"] for each in told if each["event"] != "vehicle"] == ["note", "waiting", "admitted"]
    assert world.vehicle.announced == [waiting.ANNOUNCED]


def test_documents_after_the_bundle_go_to_the_flight(
    begin: Callable[..., World], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: such a document, even a recall, was dropped without an answer."""
    world = begin()
    beside: list[Event] = [Presented(0, BUNDLE, 1), Presented(0, recall(world.base), 2)]
    monkeypatch.setattr(world.agents, "events", lambda now: [beside.pop(0) for _ in beside[:]])
    assert world.end() == Admitted(BUNDLE, world.flies)
    assert [cast("Presented", event).sender for event in Agents.events(world.agents, Clock().now())] == [2]


def test_untrusted_bundle_changes_nothing(
    begin: Callable[..., World], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(waiting, "REFUSAL_S", 3600)
    world = begin()
    assert world.hand(approval(world.base)) == "not-flying"
    assert world.hand(replacement(world.base)) == "not-flying"
    assert world.hand(b"") == "untrusted"
    assert world.hand(bytes(200_000)) == "untrusted"
    assert world.hand(recall(world.base, vehicle="quad-08")) == "wrong-vehicle"
    assert world.tried == [b"", bytes(200_000)]
    assert world.ended is None
    told = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [each["slug"] for each in told if each["event"] == "not-admitted"] == ["not-flying"], "once in REFUSAL_S"


def test_followers_see_that_the_vehicle_waits(begin: Callable[..., World]) -> None:
    world = begin()
    hello, waits, *vehicle = lines_of(world, 12)
    assert (hello["type"], waits["type"], waits["policy"]) == ("hello", "waiting", "bridge_inspection@7")
    assert waits["policy_digest"] == world.base.bundle.policy_digest.hex()
    assert {each["type"] for each in vehicle} == {"vehicle"}
    last = vehicle[-1]
    assert (last["ready"], last["unready"], last["armed"]) == (True, None, False)
    assert (last["utc_us"], last["utc_error_us"], last["at_us"] > 0) == (START.utc_us, 0, True)
    assert (world.utc.bound.source, world.vehicle.driver.asks_utc) == ("unknown", True)
    world.vehicle.driver.source.utc = lambda now_us: (START.utc_us, 0)
    lines_of(world, 12)
    assert (world.utc.bound.source, world.vehicle.driver.asks_utc) == ("vehicle", False)
    (battery,) = (each for each in last["signals"] if each["name"] == "battery")
    assert (battery["value"], battery["stale"]) == ("80 %", False)
    assert next(each["value"] for each in last["signals"] if each["name"] != "battery") == "unknown"


def test_a_recall_ends_it(begin: Callable[..., World]) -> None:
    world = begin()
    assert world.hand(recall(world.base)) == "accepted"
    refused = cast("Refusal", world.end())
    assert (refused.code, refused.slug) == (ExitCode.ABORTED, "recalled")


def test_ctrl_c_ends_it(begin: Callable[..., World]) -> None:
    world = begin()
    world.interrupts.asked.set()
    refused = cast("Refusal", world.end())
    assert (refused.code, refused.slug) == (ExitCode.INTERRUPTED, "interrupted")


def test_wait_for_documents_times_out(begin: Callable[..., World]) -> None:
    refused = cast("Refusal", begin(most_s=0.05).end())
    assert (refused.code, refused.slug) == (ExitCode.REFUSED, "nothing-handed-in")


def test_malformed_lines_are_answered(begin: Callable[..., World]) -> None:
    world = begin()
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(world.path))
        link.sendall(b'{"id": 3, "document": 7}\n{"id": 4, "document": "' + b64encode(b"x") + b'"}\n')
        file = link.makefile("rb")
        answers: list[dict[str, Any]] = []
        while len(answers) < 2:
            said = json.loads(file.readline())
            answers += [said] if said["type"] == "answer" else []
    assert [(each["id"], each["slug"]) for each in answers] == [(3, "malformed"), (4, "untrusted")]


def test_once_the_vehicle_has_another_root_the_wait_is_over(begin: Callable[..., World]) -> None:
    world = begin()
    world.newer = Refusal("root-superseded", "the trust root changed meanwhile")
    assert world.end() is world.newer
    assert world.tried == []


def test_requests_reach_the_vehicle_during_the_wait_and_lines_about_clients_have_no_log_yet(
    begin: Callable[..., World],
) -> None:
    world = begin()
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(world.path))
        for number, text in enumerate((b"frame", b"other")):
            link.sendall(json.dumps({"id": number, "request": b64encode(text).decode()}).encode() + b"\n")
        link.sendall(b'{"id":2,"client":"{}"}\n')
        file, answers = link.makefile("rb"), dict[int, str]()
        while len(answers) < 3:
            line = json.loads(file.readline())
            if line["type"] == "answer":
                answers[line["id"]] = line["slug"]
    assert answers == {0: "accepted", 1: "not-a-request", 2: "not-flying"}
    assert world.vehicle.passed == [b"frame", b"other"]
