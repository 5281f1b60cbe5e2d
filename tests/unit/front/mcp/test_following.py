"""The state of a followed vehicle."""

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from rtshcua.front.mcp import flight
from rtshcua.front.mcp.flight import FIRST_S, LONGEST, Following

HELLO = b'{"type":"hello","vehicle":"quad-07","flight":"ab"}\n'


def test_the_first_word_is_waited_for(tmp_path: Path) -> None:
    """Regression: an early request reported that the vehicle cannot be reached."""
    place = tmp_path / "quad.sock"
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(place))
        door.listen()
        followed = Following(place)
        peer, _ = door.accept()
        with peer:
            threading.Timer(0.1, peer.sendall, (HELLO,)).start()
            followed.await_first()
            assert followed.stage == "waiting"
            followed.end()


def test_unreachable_vehicle_is_not_waited_for(tmp_path: Path) -> None:
    began_s = time.monotonic()
    followed = Following(tmp_path / "none.sock")
    followed.await_first()
    assert followed.stage == "unreachable"
    assert time.monotonic() - began_s < FIRST_S
    followed.end()


@pytest.mark.parametrize("line", [b"[" * 200_000, b"[" + b"[]," * 100_000 + b"[]]", b"{" * 3, b"x" * (LONGEST + 9)])
def test_invalid_line_drops_only_the_current_connection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: bytes
) -> None:
    monkeypatch.setattr(flight, "AGAIN_S", 0.01)
    place = tmp_path / "quad.sock"
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(place))
        door.listen()
        door.settimeout(20)
        followed = Following(place)
        peer, _ = door.accept()
        with peer, suppress(BrokenPipeError):
            peer.sendall(HELLO + line + b"\n")
        peer, _ = door.accept()
        with peer:
            peer.sendall(HELLO)
            with followed.turn:
                assert followed.turn.wait_for(lambda: followed.connected, 20)
        followed.end()


@pytest.mark.parametrize("values", [1, 1_000])
def test_kept_records_are_bounded_by_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, values: int) -> None:
    """A record of a megabyte, or one of few octets and many values."""
    monkeypatch.setattr(flight, "MOST_KEPT", 300_000)
    followed = Following(tmp_path / "none.sock")
    followed.end()
    weight = 100_000 if values == 1 else 10 + flight.VALUE * values
    for number in range(20):
        followed._take({"type": "effect", "seq": number}, weight)
    assert [each["seq"] for each in followed.records] == [*range(20)][-(300_000 // weight) :]
    followed._take({"type": "hello", "flight": "another"}, 1)
    followed._take({"type": "effect", "seq": 1}, 1)
    assert followed._kept == 1
    for number in range(flight.MOST_LINES + 3):
        followed._take({"type": "seal", "seq": number}, 1)
    assert len(followed.records) == len(followed._weights) == flight.MOST_LINES
    assert followed.records[0]["seq"] == 3
