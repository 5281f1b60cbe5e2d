"""`rtshcua approve --wait` at a terminal and in a pipe: what it shows, and which words sign."""

import json
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.approver_terminal import ApproverTerminal
from rtshcua.model.outcome import Outcome, Reason
from virtual.waiting_flight import PATIENCE_S, WaitingFlight, desk_at, keys_and_bundles


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("waits")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder / "data"))
        keys_and_bundles(folder)
        yield folder


class Seat:
    """Ada at a terminal: what she reads and types; `terminal` says whether it looks like one."""

    def __init__(self, place: Path, patch: pytest.MonkeyPatch, *, as_json: bool, terminal: bool = False) -> None:
        self.flight = WaitingFlight(place, Path("low.bundle"))
        self.typing, self._types = os.pipe()
        self.code: ExitCode | None = None
        self.shown = Shown(terminal=terminal)
        patch.setattr(sys, "stdout", self.shown)
        self._desk = desk_at(place)
        asking = ApproverTerminal(self._desk, self.typing, as_json=as_json)
        self._thread = threading.Thread(target=self._follow, args=(asking,), daemon=True)
        self._thread.start()

    def _follow(self, asking: ApproverTerminal) -> None:
        self.code = asking.follow()

    def type(self, words: str) -> None:
        os.write(self._types, words.encode())

    def until(self, words: str) -> None:
        assert self.shown.until(words), (words, self.shown.text)

    def events(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.shown.text.splitlines()]

    def ended(self) -> ExitCode | None:
        self._thread.join(PATIENCE_S)
        return self.code

    def end(self) -> None:
        self.flight.ends()
        self.ended()
        self._desk.close()
        self.flight.hang_up()
        os.close(self.typing)
        if self._types >= 0:
            os.close(self._types)

    def end_of_input(self) -> None:
        os.close(self._types)
        self._types = -1


class Shown:
    """A standard output."""

    def __init__(self, *, terminal: bool) -> None:
        self.text = ""
        self._terminal, self._turn = terminal, threading.Condition()
        self.encoding = "utf-8"

    def write(self, text: str) -> int:
        with self._turn:
            self.text += text
            self._turn.notify_all()
        return len(text)

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return self._terminal

    def until(self, words: str, count: int = 1) -> bool:
        with self._turn:
            return self._turn.wait_for(lambda: self.text.count(words) >= count, PATIENCE_S)


@pytest.fixture
def place(made: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(made / "data"))
    monkeypatch.chdir(made)
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name) / "s"


def test_question_at_a_terminal_rings_and_has_a_map(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=False, terminal=True)
    seat.until("questions wait for ada as supervisor")
    assert "\a" not in seat.shown.text
    seat.flight.asks()
    seat.until("type `yes 1` and Enter to sign as supervisor")
    text = seat.shown.text
    assert text.count("\a") == 1
    for words in ("step 3 of `low` on `quad-07`: inspect_area", "area = bridge_a  [", "from home, bearing", "s left",
                  "because of `confirm inspect_area when altitude < 10 m", "north up", "H"):  # fmt: skip
        assert words in text, words
    assert any("\u2801" <= letter <= "\u28ff" for letter in text), "the map is of dots"
    seat.type("yes 1\n")
    seat.until("approved as supervisor: step 3")
    assert seat.flight.slugs == ["accepted"]
    seat.end()
    assert seat.code is ExitCode.OK


def test_pipe_has_no_bell(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=False)
    seat.flight.asks()
    seat.until("type `yes 1`")
    assert "\a" not in seat.shown.text
    seat.end()


def test_only_the_number_of_the_open_question_signs(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=True)
    seat.until("following")
    seat.type("yes\n")
    seat.until('"none"')
    seat.flight.asks()
    seat.until('"question"')
    for words in ("yes", "yes 3", "y 1", "YES 01", "approve", "no no", "yes1"):
        count = seat.shown.text.count('"unclear"')
        seat.type(f"{words}\n")
        assert seat.shown.until('"unclear"', count + 1), words
    assert seat.flight.slugs == []
    seat.flight.decides(Outcome.DENY, Reason.APPROVAL_TIMED_OUT)
    seat.until("nobody answered in time")
    seat.flight.asks()
    seat.until('"number": 2')
    seat.type("yes 1\nno 2\n")
    seat.until("refused as supervisor")
    assert seat.flight.slugs == ["accepted"]
    seat.end()


def test_json_lines_have_everything(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=True)
    seat.flight.asks()
    seat.until('"question"')
    seat.end()
    events = seat.events()
    assert [each["event"] for each in events] == ["following", "question", "over"]
    asked = events[1]
    assert (asked["number"], asked["step_number"]) == (1, 3)
    assert (asked["skill"], asked["role"]) == ("inspect_area", "supervisor")
    assert asked["binding"] == seat.flight.step.binding.hex()
    assert 0 < asked["left_ms"] <= 25_000
    assert {each["name"] for each in asked["arguments"]} >= {"area", "altitude"}
    assert (asked["why_not"], asked["other_path"]) == ("", "")


def test_end_of_input_and_quit(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=True)
    seat.type("quit\n")
    assert seat.ended() is ExitCode.OK
    assert seat.events()[-1]["event"] == "left"
    seat.end()


def test_without_input_it_goes_on(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(place, monkeypatch, as_json=True)
    seat.end_of_input()
    seat.flight.asks()
    seat.until('"question"')
    assert seat.code is None
    seat.end()
    assert seat.code is ExitCode.OK
    assert seat.flight.slugs == [], "nothing is signed without a word"


@pytest.mark.parametrize(
    "more", [["--step", "3"], ["--refuse"], ["-o", "x"], ["--flight", "00" * 16], ["--other-path"], ["--yes"]]
)
def test_options_of_one_answer_do_not_wait(place: Path, capsys: pytest.CaptureFixture[str], more: list[str]) -> None:
    assert main(["approve", "low.bundle", "--wait", "--to", str(place), *more]) == ExitCode.USAGE
    assert "no options of a single answer" in capsys.readouterr().err


def test_step_or_wait_is_needed(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["approve", "low.bundle", "--wait"]) == ExitCode.USAGE
    assert main(["approve", "low.bundle", "--page", "0"]) == ExitCode.USAGE
    assert main(["approve", "low.bundle", "--to", str(place)]) == ExitCode.USAGE
    assert "--wait" in capsys.readouterr().err.splitlines()[-1]
    assert main(["approve", "low.bundle", "--wait", "--to", str(place)]) == ExitCode.INPUT
    assert main(["approve", "low.bundle", "--wait", "--to", str(place), "--role", "operator"]) == ExitCode.USAGE
    assert "accepted: --role `supervisor`" in capsys.readouterr().err
