"""`rtshcua watch`: which log it serves, and wrong input. The page itself: `tests/unit/front/web`."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest

from rtshcua.app.flights.watched import log_of_flight
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from virtual import flight_reports


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_web_is_required(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", "runs"]) == ExitCode.USAGE
    assert "`--web` is missing" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["missing", "empty", "text.txt"])
def test_what_is_no_flight_is_refused(here: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    Path("empty").mkdir()
    Path("text.txt").write_text("no log\n")
    assert main(["watch", name, "--web"]) == ExitCode.INPUT
    captured = capsys.readouterr()
    assert name in captured.err
    assert "Traceback" not in captured.err


def test_run_folder_is_its_log(here: Path) -> None:
    run = flight_reports.completed(here / "run")
    assert log_of_flight(run, here) == run / "log.jsonl"
    assert log_of_flight(run / "log.jsonl", here) == run / "log.jsonl"


@contextmanager
def listening(*lines: bytes) -> Iterator[Path]:
    """A socket that sends these lines to whoever connects."""

    def greet() -> None:
        link, _ = server.accept()
        with link:
            link.sendall(b"".join(lines))
            link.recv(10)

    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s")
        server.listen()
        thread = Thread(target=greet)
        thread.start()
        yield Path("s")
        thread.join()


def test_socket_of_another_program_is_refused(here: Path) -> None:
    with listening(b"220 smtp.example\r\n") as path, pytest.raises(OSError):
        log_of_flight(path, here)


def test_flight_without_a_log_here_is_refused(here: Path) -> None:
    flight_reports.completed(here / "run")
    hello = {"type": "hello", "format": "rtshcua/agent", "version": 1, "vehicle": "v", "flight": "ab" * 16, "mode": "m"}
    with listening(json.dumps(hello).encode() + b"\n") as path:
        found = log_of_flight(path, here)
    assert isinstance(found, Refusal)
    assert "--runs" in found.help


def test_flight_of_a_socket_is_found_by_its_id(here: Path) -> None:
    run = flight_reports.completed(here / "some" / "run")
    hello = {"type": "hello", "format": "rtshcua/agent", "version": 1, "vehicle": "v", "flight": "00" * 16, "mode": "m"}
    with listening(json.dumps(hello).encode() + b"\n") as path:
        assert log_of_flight(path, here) == run / "log.jsonl"
