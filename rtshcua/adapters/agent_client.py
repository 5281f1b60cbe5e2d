"""The other end of the agent socket: hand one document in, and wait for what becomes of it."""

import socket
import time
from base64 import b64encode
from pathlib import Path
from typing import NamedTuple

import msgspec

_CHUNK = 1 << 16


class Answered(NamedTuple):
    """What the flight said: `accepted`, or why not, and a text for a person."""

    slug: str
    text: str


class _Line(msgspec.Struct):
    """What is read of a line; most are records of the log."""

    type: str = ""
    id: int = 0
    slug: str = ""
    text: str = ""


_read = msgspec.json.Decoder(_Line).decode
_NUMBER = 1


def hand_in(path: Path, document: bytes, *, patience_s: float = 10.0) -> Answered:
    """Hand a document to the flight that listens at `path`. Raises OSError, TimeoutError without an answer."""
    line = msgspec.json.encode({"id": _NUMBER, "document": b64encode(document).decode()}) + b"\n"
    until_s = time.monotonic() + patience_s
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(patience_s)
        try:
            link.connect(str(path))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from None
        link.sendall(line)
        waiting = b""
        while (left_s := until_s - time.monotonic()) > 0:
            link.settimeout(left_s)
            chunk = link.recv(_CHUNK)
            if not chunk:
                raise ConnectionResetError("the flight hung up: it is over, or it did not take the document")
            *lines, waiting = (waiting + chunk).split(b"\n")
            for each in lines:
                said = _read(each)
                if said.type == "answer" and said.id in (0, _NUMBER):
                    return Answered(said.slug, said.text)
    raise TimeoutError("the flight did not answer")
