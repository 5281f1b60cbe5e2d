"""`rtshcua operator` over real sockets: a flight that disconnects, reconnects, does not read, or ends."""

import dataclasses
import json
import os
import signal
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from rtshcua.adapters.agent_socket import FlightFollower
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.flight_documents import bundle_in_flight
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.records import Close, Effect, encode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands.operator import OperatorConsole, Patience
from rtshcua.front.cli.interrupts import StopRequest
from rtshcua.front.cli.stdout import MOST_LINES, NewestLines
from rtshcua.front.cli.unlock import unlock_person
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.request import Ref

MISSION = Path(__file__).resolve().parents[4] / "missions/short.rts"
SIGNER = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
CONFIRM = "confirm takeoff by role supervisor within 30 s, whatever the state of the vehicle and of the weather may be"
#: time limits: tests shorten those that they wait for, and the others are never reached
CALM = Patience(again_s=0.3, lost_s=60, answer_s=60, silent_s=60, drain_s=0.3)


@pytest.fixture(scope="module")
def flying(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Bundle, SigningKey]]:
    folder = tmp_path_factory.mktemp("operator")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder / "data"))
        assert main(["keys", "init"]) == ExitCode.OK
        assert main(["compile", str(MISSION), "-o", "m.bundle"]) == ExitCode.OK
        yield (
            bundle_in_flight(Path("m.bundle"), [], None, 10**15, stops=True),
            unlock_person(KeyStore(data_folder()), None, None, path=None, passphrase_file=None),
        )


class Flight:
    """A listener in place of a flight that handles each connection by the next entry of `turns`."""

    def __init__(self, path: Path, *turns: Callable[[socket.socket], None]) -> None:
        self.path = path
        self.documents: list[bytes] = []
        self.over = threading.Event()
        self._turns = turns
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with self._listener:
            for turn in self._turns:
                link, _ = self._listener.accept()
                with link:
                    link.sendall(b'{"type":"hello","flight":"' + b"ab" * 16 + b'"}\n')
                    turn(link)

    def end(self) -> None:
        self.over.set()
        self._thread.join()


class Seat:
    """A person at the console: the typed input, and the events shown."""

    def __init__(self, flying: tuple[Bundle, SigningKey]) -> None:
        self._flying = flying
        self.typing, self.types = os.pipe()
        self.reads, self.output = os.pipe()
        self._heard = b""

    def until(self, event: str) -> None:
        """Read the output until an event of this kind."""
        while f'"event": "{event}"'.encode() not in self._heard:
            self._heard += os.read(self.reads, 1 << 16)

    def until_said(self, words: str) -> None:
        """Read the output until it contains this text."""
        while words.encode() not in self._heard:
            self._heard += os.read(self.reads, 1 << 16)

    def type(self, words: str) -> None:
        os.write(self.types, words.encode())

    def sits(self, path: Path, *, as_json: bool = True, **changed: float) -> ExitCode:
        bundle, key = self._flying
        patience = CALM._replace(**changed)
        console = OperatorConsole(
            path, FlightFollower(path), bundle, key, 300, typing=self.typing, output=self.output, as_json=as_json,
            bundle="m.bundle", patience=patience,
        )  # fmt: skip
        try:
            with StopRequest() as stop:
                return console.follow(stop)
        finally:
            console.close()

    def events(self) -> list[str]:
        return [each["event"] for each in self.told()]

    def told(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.lines()]

    def lines(self) -> list[str]:
        if self.output >= 0:
            os.close(self.output)
            self.output = -1
            self._heard += b"".join(iter(lambda: os.read(self.reads, 1 << 16), b""))
        return self._heard.decode().splitlines()

    def end(self) -> None:
        for each in (self.typing, self.types, self.reads, self.output):
            if each >= 0:
                os.close(each)


@pytest.fixture
def seat(flying: tuple[Bundle, SigningKey]) -> Iterator[Seat]:
    made = Seat(flying)
    yield made
    made.end()


@pytest.fixture
def place() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


def hangs_up(link: socket.socket) -> None:
    pass


def closes(link: socket.socket) -> None:
    link.sendall(encode(Close("0" * 64, 0, 0, None, "0" * 64, "completed", 0, 0, 1, None, "close", 0, 0)))


def effect(number: int) -> bytes:
    return encode(Effect("0" * 64, 0, "", "buffered", "noted", 0, -1, number, -1, -1, "effect", 0, 0))


def asks(flying: Bundle, utc_us: int) -> bytes:
    """The event that the first step waits for a supervisor: 30 s, of which 5 are over."""
    recorder = Recorder(lambda _: b"", SIGNER.public, lambda: bytes(32))
    now = Now(105_000_000, utc_us, 0)
    recorder.genesis(now, bundle=b"", root=b"", boot=bytes(16), vehicle="quad", mission="short", mode="software")
    clause = Clause(CONFIRM, 0, 0, 0, ())
    mission = {"type": "mission", "digest": flying.mission_digest.hex()}
    return json.dumps(mission).encode() + b"\n" + recorder.decision(
        now, ref=Ref(0, 0, -1), invocation=bytes(16), state=State((), ()),
        context=Context(bytes(32), "quad", 2, 0, 100_000_000, 1, 0, ()),
        decided=Decision(Outcome.DEFER, Reason.AWAITING_APPROVAL, 8, clause, None, None, 130_000_000),
    )  # fmt: skip


def documents(link: socket.socket) -> bytes:
    return link.recv(1 << 16)


def test_a_flight_that_closes_its_log_is_over(seat: Seat, place: Path) -> None:
    flight = Flight(place, closes)
    assert seat.sits(place) == ExitCode.OK
    flight.end()
    assert seat.events() == ["following", "ready", "over"]
    assert seat.told()[-1]["text"].endswith("completed")


def test_a_connection_that_is_lost_is_made_again(seat: Seat, place: Path) -> None:
    flight = Flight(place, hangs_up, hangs_up, closes)
    assert seat.sits(place) == ExitCode.OK
    flight.end()
    assert seat.events() == ["following", "ready", "lost", "following", "lost", "following", "over"]


def test_lost_flight_is_not_reported_as_ended(seat: Seat, place: Path) -> None:
    flight = Flight(place, hangs_up)
    assert seat.sits(place, lost_s=0.5) == ExitCode.LINK
    flight.end()
    assert seat.events() == ["following", "ready", "lost", "gone"]


def test_unanswered_recall_is_reported_and_repeated(seat: Seat, place: Path) -> None:
    told: list[bytes] = []

    def takes_it_and_hangs_up(link: socket.socket) -> None:
        told.append(documents(link))
        seat.until("unanswered")

    def answers(link: socket.socket) -> None:
        told.append(documents(link))
        link.sendall(b'{"type":"answer","id":1,"slug":"recalled","text":"t"}\n')
        closes(link)

    flight = Flight(place, takes_it_and_hangs_up, answers)
    seat.type("recall\n")
    assert seat.sits(place, answer_s=0.8) == ExitCode.OK
    flight.end()
    assert seat.events() == [
        "following", "ready", "sent", "unanswered", "lost", "following", "sent", "refused", "over",
    ]  # fmt: skip
    assert [b'"document"' in each for each in told] == [True, True]


def test_a_recall_that_is_typed_while_the_flight_is_lost_is_kept(seat: Seat, place: Path) -> None:
    def hangs_up_and_is_recalled(link: socket.socket) -> None:
        place.rename(place.with_name("gone"))  # connections are refused
        link.close()
        seat.until("lost")
        seat.type("p\n")
        seat.until("kept")
        place.with_name("gone").rename(place)

    def accepts(link: socket.socket) -> None:
        documents(link)
        link.sendall(b'{"type":"answer","id":1,"slug":"accepted","text":"t"}\n')
        closes(link)

    flight = Flight(place, hangs_up_and_is_recalled, accepts)
    assert seat.sits(place) == ExitCode.OK
    flight.end()
    assert seat.events() == ["following", "ready", "lost", "kept", "following", "sent", "accepted", "over"]


def test_a_flight_that_does_not_read_keeps_nobody_from_leaving(seat: Seat, place: Path) -> None:
    flight = Flight(place, lambda _: flight.over.wait(30) and None)  # type: ignore[func-returns-value]
    seat.type("recall\n" * 500 + "quit\n")
    assert seat.sits(place) == ExitCode.LINK, "no recall was answered"
    flight.end()
    events = seat.events()
    assert events[2] == "sent"
    assert events[-2:] == ["kept", "left"]


def test_slow_terminal_does_not_block_a_recall(seat: Seat, place: Path) -> None:
    def is_recalled(link: socket.socket) -> None:
        for number in range(2 * MOST_LINES):
            link.sendall(effect(number))
        seat.type("recall\n")
        told.append(documents(link))
        closes(link)

    told: list[bytes] = []
    flight = Flight(place, is_recalled)
    assert seat.sits(place) == ExitCode.LINK
    flight.end()
    assert b'"document"' in told[0]
    events = seat.events()
    assert events[:2] == ["following", "ready"]
    assert events.count("noted") < 2 * MOST_LINES, "the pipe has no room for all"


def test_silence_is_reported_once(seat: Seat, place: Path) -> None:
    def is_silent(link: socket.socket) -> None:
        seat.until("silent")
        closes(link)

    flight = Flight(place, is_silent)
    assert seat.sits(place, silent_s=0.3) == ExitCode.OK
    flight.end()
    assert seat.events() == ["following", "ready", "silent", "over"]


def test_the_newest_lines_are_kept(seat: Seat) -> None:
    output = NewestLines(seat.output, lambda count: f"without {count}")
    for number in range(5 * MOST_LINES):
        output.tell(f"{number:099}")
        output.write()
    assert output.waiting
    taken = b""
    while output.waiting:
        taken += os.read(seat.reads, 1 << 16)
        output.drain(0.01)
    os.set_blocking(seat.reads, False)
    lines = (taken + os.read(seat.reads, 1 << 16)).split()
    assert lines[-1] == f"{5 * MOST_LINES - 1:099}".encode()
    without = int(lines[lines.index(b"without") + 1])
    assert len(lines) - 2 == 5 * MOST_LINES - without
    assert without > 2 * MOST_LINES


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_the_flight_as_quit_does(seat: Seat, place: Path, number: signal.Signals) -> None:
    """The signal arrives while the console waits, and ends the wait."""

    def turn(link: socket.socket) -> None:
        seat.until("ready")
        os.kill(os.getpid(), number)
        link.recv(1)

    flight = Flight(place, turn)
    assert seat.sits(place) is ExitCode.OK
    flight.end()
    assert seat.events() == ["following", "ready", "left"]


def test_unknown_command_suggests_the_nearest(seat: Seat, place: Path) -> None:
    def turn(link: socket.socket) -> None:
        seat.type("recal\n")
        seat.until_said("unknown command")
        seat.type("q\n")
        link.recv(1)

    flight = Flight(place, turn)
    assert seat.sits(place) is ExitCode.OK
    flight.end()
    assert flight.documents == []
    (said,) = [each["text"] for each in seat.told() if each["event"] == "ready" and "`recal`" in each["text"]]
    assert said.startswith("unknown command `recal`, did you mean `recall`? · recall: ")


@pytest.fixture
def asked(flying: tuple[Bundle, SigningKey]) -> tuple[Bundle, SigningKey]:
    """The same, under a policy that requires a supervisor."""
    bundle, key = flying
    rule = Rule(RuleKind.CONFIRM, (), (), (), None, 0, 30_000_000, None, CONFIRM, 0, 0, 0)
    policy = msgspec.structs.replace(bundle.policy, roles=("supervisor",), rules=(rule,))
    return dataclasses.replace(bundle, policy=policy), key


def test_pending_approval_shows_role_time_and_command(
    asked: tuple[Bundle, SigningKey], place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    seat = Seat(asked)

    def turn(link: socket.socket) -> None:
        link.sendall(asks(asked[0], time.time_ns() // 1000))
        closes(link)

    flight = Flight(place, turn)
    assert seat.sits(place, as_json=False) is ExitCode.OK
    flight.end()
    lines = seat.lines()
    seat.end()
    assert max(map(len, lines)) <= 80, "what was decided and what may be typed are longer"
    text = " ".join(" ".join(lines).replace("\\", "").split())
    assert "** WAITS FOR A PERSON: supervisor ** step 1, takeoff(altitude = 10 m)" in text
    assert "25 s left, then it is denied. Type in another terminal:" in text
    assert f"rtshcua approve m.bundle --step 1 --role supervisor --to {place} " in text
    assert "recall: recall this flight · policy: recall all under its policy · quit: leave it flying" in text


def test_pending_approval_is_in_json(asked: tuple[Bundle, SigningKey], place: Path) -> None:
    seat = Seat(asked)

    def turn(link: socket.socket) -> None:
        link.sendall(asks(asked[0], time.time_ns() // 1000 + 3_600_000_000))
        closes(link)

    flight = Flight(place, turn)
    assert seat.sits(place) is ExitCode.OK
    flight.end()
    (waits,) = [each for each in seat.told() if each["event"] == "waits"]
    seat.end()
    assert (waits["roles"], waits["left_s"]) == (["supervisor"], 25)
    assert waits["commands"] == [
        ["rtshcua", "approve", "m.bundle", "--step", "1", "--role", "supervisor", "--for", "3600", "--to", str(place)]
    ], "the clock of a flight that is sped up is ahead"
