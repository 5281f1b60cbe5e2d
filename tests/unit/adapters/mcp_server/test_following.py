"""What is known of a vehicle that is followed."""

import socket
import threading
import time
from pathlib import Path

from rtshcua.adapters.mcp_server.flight import FIRST_S, Following

HELLO = b'{"type":"hello","vehicle":"quad-07","flight":"ab"}\n'


def test_the_first_word_is_waited_for(tmp_path: Path) -> None:
    """Who asks at once was told that it cannot be reached."""
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


def test_what_cannot_be_reached_is_waited_for_no_longer_than_that_shows(tmp_path: Path) -> None:
    began_s = time.monotonic()
    followed = Following(tmp_path / "none.sock")
    followed.await_first()
    assert followed.stage == "unreachable"
    assert time.monotonic() - began_s < FIRST_S
    followed.end()
