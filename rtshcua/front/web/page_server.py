"""Serves one page on the loopback interface, to whoever knows its token: the path of its address.

Another user or a page from elsewhere does not know the token. A page from elsewhere that made its own name resolve to
this machine sends that name as `Host`, and is refused. Nothing can be changed by a request.
"""

import secrets
import socket
import threading
from collections.abc import Callable, Collection
from contextlib import suppress
from hashlib import sha256
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final, NamedTuple

_HOST: Final = "127.0.0.1"
#: how long a client may take over its request, and as long over the page, s
_PATIENCE_S: Final = 5.0
_MOST_CLIENTS: Final = 16
#: how often the end is looked for, s
_POLL_S: Final = 0.1


class ServedPage(NamedTuple):
    """A page and its tag, which changes with its content."""

    data: bytes
    tag: str


def served(text: str) -> ServedPage:
    """A page with the tag of its content."""
    data = text.encode("utf-8")
    return ServedPage(data, f'"{sha256(data).hexdigest()[:32]}"')


class PageServer:
    """Serves what `page` returns, in threads of its own; the first fault of making it is in `fault`. Raises OSError
    where the port is taken.
    """

    def __init__(self, page: Callable[[], ServedPage], port: int = 0) -> None:
        token = secrets.token_urlsafe(24)
        self._server = _Server(port, _Handler)
        self._server.page, self._server.path = page, f"/{token}/"
        #: the address for a browser
        self.address = f"{self._server.origin}/{token}/"

    @property
    def fault(self) -> Exception | None:
        """Why no page could be made."""
        return self._server.fault

    def __enter__(self) -> "PageServer":
        self._server.begin()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.end()


class LoopbackServer(ThreadingHTTPServer):
    """Serves clients on the loopback interface in threads of its own: a limited number, each for a limited time. Raises
    OSError where the port is taken.
    """

    daemon_threads = True
    request_queue_size = 64

    def __init__(self, port: int, handler: type["LoopbackHandler"]) -> None:
        super().__init__((_HOST, port), handler)
        self.free = threading.BoundedSemaphore(_MOST_CLIENTS)
        taken = self.server_address[1]
        self.origin = f"http://{_HOST}:{taken}"
        #: the names of this server in a request
        self.hosts = {f"{_HOST}:{taken}", f"localhost:{taken}"}

    def begin(self) -> None:
        """Begin to serve."""
        threading.Thread(target=self.serve_forever, args=(_POLL_S,), name="page", daemon=True).start()

    def end(self) -> None:
        """Serve no more."""
        self.shutdown()
        self.server_close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a client in a thread, if there are not too many."""
        if not self.free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a client."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.free.release()

    def handle_error(self, request: object, client_address: object) -> None:
        """A client that goes away is no fault."""


class _Server(LoopbackServer):
    page: Callable[[], ServedPage]
    path: str
    fault: Exception | None = None


def _ended(request: socket.socket) -> None:
    """End the connection of a client that is too slow."""
    with suppress(OSError):
        request.shutdown(socket.SHUT_RDWR)


class LoopbackHandler(BaseHTTPRequestHandler):
    """One request of a client, who is ended where it takes too long."""

    server_version = "rtshcua"
    sys_version = ""
    timeout = _PATIENCE_S

    def setup(self) -> None:
        """Begin to count the time of the client."""
        super().setup()
        self._late = threading.Timer(_PATIENCE_S, _ended, (self.request,))
        self._late.daemon = True
        self._late.start()

    def finish(self) -> None:
        """The client is served."""
        self._late.cancel()
        super().finish()

    def received(self) -> None:
        """It has asked; how long the answer takes is not its fault."""
        self._late.cancel()

    def is_for(self, hosts: Collection[str]) -> bool:
        """Whether the request is for one of these names alone: one of another name may come from a page elsewhere."""
        return self.headers.get_all("Host", []) in [[each] for each in hosts]

    def send_own_headers(self) -> None:
        """Send what every answer says: no copies, no guessing of its type, no use by other pages."""
        for name, value in _HEADERS:
            self.send_header(name, value)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: a secret would be in it."""


class _Handler(LoopbackHandler):
    server: _Server

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, *, with_body: bool) -> None:
        known = secrets.compare_digest(self.path.encode("utf-8", "replace"), self.server.path.encode())
        if not self.is_for(self.server.hosts) or not known:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.received()
        try:
            page = self.server.page()
        except Exception as error:  # noqa: BLE001  the owner of the server has to know
            self.server.fault = error
            self.send_error(HTTPStatus.INTERNAL_SERVER_ERROR)
            return
        same = self.headers.get("If-None-Match") == page.tag
        self.send_response(HTTPStatus.NOT_MODIFIED if same else HTTPStatus.OK)
        self.send_header("ETag", page.tag)
        self.send_own_headers()
        if not same:
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(page.data)))
        self.end_headers()
        if with_body and not same:
            self.wfile.write(page.data)


_HEADERS: Final = (
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
)
