"""Access to the MCP server over HTTP: the token file, and requests that are refused first."""

import stat
from pathlib import Path

import pytest

from rtshcua.adapters.store.reading import NotRegular
from rtshcua.front.mcp.access import BadToken, refusal, token_of

TOKEN = b"t" * 40
GOOD = {b"host": b"127.0.0.1:8790", b"authorization": b"Bearer " + TOKEN}


def asked(path: str = "/mcp", more: tuple[tuple[bytes, bytes], ...] = (), **changed: bytes | None) -> int | None:
    headers = GOOD | {name.encode(): value for name, value in changed.items()}
    return refusal(path, [*((name, value) for name, value in headers.items() if value is not None), *more], TOKEN, 8790)


def test_local_request_with_the_token_is_accepted() -> None:
    assert asked() is None
    assert asked(host=b"localhost:8790", origin=b"http://localhost:8790") is None
    assert asked(authorization=b"bearer   " + TOKEN) is None


@pytest.mark.parametrize(
    "authorization",
    [None, b"", b"Bearer", b"Bearer ", b"Basic " + TOKEN, TOKEN, b"Bearer " + TOKEN[1:], b"Bearer " + TOKEN + b"t",
     b"Bearer T" + TOKEN[1:], b"Bearer \xff\xff", b"Bearer " + TOKEN + b"," + TOKEN],
)  # fmt: skip
def test_request_without_the_token_is_refused(authorization: bytes | None) -> None:
    assert asked(authorization=authorization) == 401
    assert asked("/other", authorization=authorization) == 401, "nor is it said what there is"


def test_two_tokens_are_none() -> None:
    assert asked(more=((b"authorization", b"Bearer " + TOKEN),)) == 401


@pytest.mark.parametrize(
    "host", [None, b"", b"127.0.0.1", b"127.0.0.1:80", b"evil.example:8790", b"localhost:8790.evil.example"]
)
def test_a_name_of_another_machine_is_refused_whoever_asks(host: bytes | None) -> None:
    """A page whose host name resolves to this machine (DNS rebinding)."""
    assert asked(host=host) == 421
    assert asked(more=((b"host", b"evil.example"),)) == 421


@pytest.mark.parametrize(
    "origin",
    [b"null", b"https://evil.example", b"http://127.0.0.1", b"https://localhost:8790", b"http://localhost:87900"],
)
def test_request_of_a_foreign_origin_is_refused(origin: bytes) -> None:
    assert asked(origin=origin) == 403
    assert asked(origin=b"http://localhost:8790", more=((b"origin", origin),)) == 403


def test_there_is_one_place() -> None:
    assert asked("/") == 404
    assert asked("/mcp/") == 404


def test_a_token_is_made_once_and_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "token"
    token = token_of(path)
    assert len(token) >= 32
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert token_of(path) == token
    assert token_of(tmp_path / "other") != token


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o644])
def test_a_token_that_others_may_read_or_write_is_refused(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "token"
    token_of(path)
    path.chmod(mode)
    with pytest.raises(BadToken, match="not private"):
        token_of(path)


@pytest.mark.parametrize("text", ["", "short", "a" * 31, "a b" * 20, "a" * 40 + "\nb", "é" * 40])
def test_invalid_token_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "token"
    path.write_text(text, "utf-8")
    path.chmod(0o600)
    with pytest.raises(BadToken, match="has no valid token"):
        token_of(path)


def test_folder_as_token_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises((NotRegular, IsADirectoryError)):
        token_of(tmp_path)
