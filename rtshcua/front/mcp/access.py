"""Who may speak to the server over HTTP: a token from a file that nobody else may read, from hosts and origins of this
machine.

A page that a browser shows may send requests to this machine too, so Host and Origin count (DNS rebinding), and none of
them is enough without the token.
"""

import hmac
import re
import secrets
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import exposed, open_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, write_new

#: where the server answers
PATH: Final = "/mcp"
HOST: Final = "127.0.0.1"
#: what a token is made of (RFC 6750, section 2.1), and how long it is at least
TOKEN: Final = re.compile(rb"[A-Za-z0-9._~+/-]{32,4096}=*")
_MADE_BYTES: Final = 32
_MOST: Final = 1 << 13


class BadToken(Exception):
    """A token file that is not to be used."""


def token_of(path: Path) -> bytes:
    """The token in a file, which is made with a new one where there is none. Raises `BadToken` and OSError."""
    with suppress(FileExistsError):
        write_new(path, secrets.token_urlsafe(_MADE_BYTES).encode() + b"\n", mode=PRIVATE_FILE)
    with open_regular(path) as file:
        others = exposed(file)
        token = file.read(_MOST).strip()
    if others is not None:
        raise BadToken(f"`{path}` is not private: {others}")
    if not TOKEN.fullmatch(token):
        raise BadToken(f"`{path}` has no valid token: at least 32 letters, digits or `-._~+/`, and nothing else")
    return token


def refusal(path: str, headers: Iterable[tuple[bytes, bytes]], token: bytes, port: int) -> int | None:
    """The status with which a request is refused before anything else of it counts; None where it may be answered.

    `headers` with names in lower case, as ASGI gives them. One that is repeated counts for none.
    """
    said: dict[bytes, list[bytes]] = {}
    for name, value in headers:
        said.setdefault(name, []).append(value)
    names = tuple(f"{host}:{port}".encode() for host in (HOST, "localhost"))
    if len(said.get(b"host", [])) != 1 or said[b"host"][0] not in names:
        return 421
    if any(origin not in tuple(b"http://" + name for name in names) for origin in said.get(b"origin", [])):
        return 403
    given = said.get(b"authorization", [])
    scheme, _, value = given[0].partition(b" ") if len(given) == 1 else (b"", b"", b"")
    if scheme.lower() != b"bearer" or not hmac.compare_digest(value.strip(), token):
        return 401
    return None if path == PATH else 404
