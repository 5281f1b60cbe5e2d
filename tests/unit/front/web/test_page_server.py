"""The page on the loopback interface: by its token alone, for this machine's own names, and read-only."""

import http.client
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from urllib.parse import urlsplit

import pytest

from rtshcua.front.web import page_server
from rtshcua.front.web.page_server import PageServer, ServedPage, served


class Site:
    """A server whose page can be changed."""

    def __init__(self) -> None:
        self.text = "<p>one</p>"
        self.server = PageServer(lambda: served(self.text))
        self.url = urlsplit(self.server.address)

    def ask(self, path: str | None = None, method: str = "GET", **headers: str) -> tuple[int, dict[str, str], bytes]:
        assert self.url.hostname is not None
        link = http.client.HTTPConnection(self.url.hostname, self.url.port or 0, timeout=10)
        link.request(method, self.url.path if path is None else path, headers={**headers})
        answer = link.getresponse()
        found = answer.status, dict(answer.getheaders()), answer.read()
        link.close()
        return found


@pytest.fixture
def site() -> Iterator[Site]:
    made = Site()
    with made.server:
        yield made


def test_page_and_its_tag(site: Site) -> None:
    status, headers, data = site.ask()
    assert (status, data) == (200, b"<p>one</p>")
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Frame-Options"] == "DENY"
    assert site.ask(**{"If-None-Match": headers["ETag"]})[0] == 304
    site.text = "<p>two</p>"
    assert site.ask(**{"If-None-Match": headers["ETag"]})[::2] == (200, b"<p>two</p>")
    assert site.ask(method="HEAD")[::2] == (200, b"")


@pytest.mark.parametrize("path", ["/", "/index.html", "/x/", "//", "/%2e%2e/", "/" + "a" * 33])
def test_other_paths_are_not_found(site: Site, path: str) -> None:
    status, _, data = site.ask(path)
    assert status == 404
    assert b"one" not in data


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "0.0.0.0", ""])
def test_other_names_of_this_machine_are_not_found(site: Site, host: str) -> None:
    assert site.ask(Host=host)[0] == 404


def test_localhost_is_this_machine(site: Site) -> None:
    assert site.ask(Host=f"localhost:{site.url.port}")[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"])
def test_nothing_can_be_changed(site: Site, method: str) -> None:
    assert site.ask(method=method)[0] == 501


def test_only_the_loopback_interface_listens(site: Site) -> None:
    assert site.url.hostname == "127.0.0.1"


def half_open(site: Site, number: int) -> list[socket.socket]:
    """Clients that say nothing."""
    assert site.url.hostname is not None
    return [socket.create_connection((site.url.hostname, site.url.port or 0)) for _ in range(number)]


def test_half_open_clients_do_not_keep_others_out(site: Site) -> None:
    links = half_open(site, page_server._MOST_CLIENTS - 1)
    assert site.ask()[0] == 200
    for link in links:
        link.close()


def test_too_many_half_open_clients_are_ended(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "_PATIENCE_S", 0.2)
    links = half_open(site, 40)
    end_s, status = time.monotonic() + 20, 0
    while status != 200:
        assert time.monotonic() < end_s
        with suppress(OSError, http.client.HTTPException):
            status = site.ask()[0]
    for link in links:
        link.close()


def test_page_that_takes_long_to_make_is_served(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_server, "_PATIENCE_S", 0.2)
    ended = threading.Event()
    site.server._server.page = lambda: served("late") if not ended.wait(0.6) else served("")
    assert site.ask()[::2] == (200, b"late")
    assert site.server.fault is None


def test_fault_of_making_the_page_is_told(site: Site) -> None:
    def wrong() -> ServedPage:
        raise RuntimeError("no page")

    site.server._server.page = wrong
    assert site.ask()[0] == 500
    assert str(site.server.fault) == "no page"


def test_garbage_is_answered_and_forgotten(site: Site) -> None:
    assert site.url.hostname is not None
    for data in (b"\r\n\r\n", b"GET\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GET / HTTP/9.9\r\n\r\n", b"A" * 70_000):
        with socket.create_connection((site.url.hostname, site.url.port or 0)) as link:
            link.sendall(data)
            link.shutdown(socket.SHUT_WR)
            link.settimeout(5)
            with suppress(OSError):
                link.recv(1_000)
    assert site.ask()[0] == 200


def test_tokens_differ() -> None:
    servers = [PageServer(lambda: served("")) for _ in range(3)]
    assert len({urlsplit(each.address).path for each in servers}) == 3
    assert all(len(urlsplit(each.address).path) > 32 for each in servers)
    for each in servers:
        each._server.server_close()
