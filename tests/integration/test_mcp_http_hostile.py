"""Attacks on `rtshcua mcp --http`: by another user of the machine, by a page in a browser, and by a host that misuses
its token. The real command on a real port, with raw bytes.
"""

import http.client
import json
import re
import resource
import select
import signal
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the extra `mcp` is not installed: `make setup` installs it")

from rtshcua.front.mcp.connections import MOST, PATIENCE_S

CHECKOUT = Path(__file__).resolve().parents[2]
POLICY = CHECKOUT / "policies/bridge_inspection.rts"
SPEAKS = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
GREETING = {
    "jsonrpc": "2.0", "id": 1, "method": "initialize",
    "params": {"protocolVersion": "2025-11-25", "capabilities": {}, "clientInfo": {"name": "t", "version": "1"}},
}  # fmt: skip
LISTED = {"jsonrpc": "2.0", "id": 2, "method": "tools/list"}
SESSION = "Mcp-Session-Id"


@dataclass
class Served:
    """A server that runs, and who speaks to it."""

    port: int
    token: str
    run: Any

    def ask(
        self, what: Any = LISTED, method: str = "POST", path: str = "/mcp", wait_s: float = 20, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """An answer: its status, its headers with names in lower case, and what it says. A stream is not read."""
        body = what if isinstance(what, bytes) else json.dumps(what).encode()
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=wait_s)
        try:
            all_headers = SPEAKS | {"Authorization": f"Bearer {self.token}"} | spelled(headers)
            link.connect()
            with suppress(ConnectionError):  # it may answer, and hang up, before it has read all of a request
                link.request(method, path, body=body if method == "POST" else None, headers=all_headers)
            answer = link.getresponse()
            said = {name.lower(): value for name, value in answer.getheaders()}
            stream = method == "GET" and answer.status == 200
            return answer.status, said, b"" if stream else content(answer)
        finally:
            link.close()

    def status(self, *args: Any, **named: Any) -> int:
        return self.ask(*args, **named)[0]

    def greeted(self) -> str:
        """A session of its own."""
        status, said, _ = self.ask(GREETING)
        assert status == 200
        return said[SESSION.lower()]

    def left(self, session: str) -> int:
        return self.status(method="DELETE", Mcp_Session_Id=session)

    def dial(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)

    def raw(self, data: bytes) -> bytes:
        """What comes back to these bytes, until it hangs up or has answered."""
        with self.dial() as link:
            with suppress(ConnectionError):  # as in `ask`
                link.sendall(data)
            return first(link)

    def head(self, line: str = "POST /mcp HTTP/1.1", *headers: str) -> bytes:
        return "\r\n".join((line, f"Host: 127.0.0.1:{self.port}", *headers, "", "")).encode("latin-1")

    def bearer(self) -> str:
        return f"Authorization: Bearer {self.token}"

    def complaints(self) -> bytes:
        """What it wrote to the terminal of whoever runs it since it said where it serves."""
        found = b""
        stream = self.run.process.stderr
        while select.select([stream], [], [], 0)[0] and (more := stream.read1(65_536)):
            found += more
        return found


def spelled(headers: dict[str, str]) -> dict[str, str]:
    return {name.replace("_", "-"): value for name, value in headers.items()}


def content(answer: http.client.HTTPResponse) -> bytes:
    """The body of an answer. Where the end of the connection ends it, this may be a reset: TCP sends one if the server
    closes before it has read our body, behind the whole answer.
    """
    if answer.length is not None or answer.chunked:
        return answer.read()
    found = b""
    with suppress(ConnectionResetError):
        while more := answer.read1(65_536):
            found += more
    return found


def first(link: socket.socket) -> bytes:
    """The head of an answer; nothing where it was hung up on."""
    found = b""
    try:
        while b"\r\n\r\n" not in found and (more := link.recv(65_536)):
            found += more
    except ConnectionError:
        pass
    return found


def code(answer: bytes) -> int:
    """The status of an answer, 0 where there is none."""
    return int(answer.split(b" ", 2)[1]) if answer else 0


@pytest.fixture(scope="module")
def served(grounds: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One server for all tests: each leaves it as it found it, and the last of all says so."""
    with (
        tempfile.TemporaryDirectory(dir="/tmp") as place,
        grounds(tmp_path_factory.mktemp("http"), tmp_path_factory.mktemp("data")) as ground,
    ):
        token = ground.folder / "token"
        at = ("--with", str(POLICY), "--http", "0", "--token-file", str(token))
        run = ground.start("mcp", ground.bundle(), "--to", f"{place}/s", *at)
        made = Served(run.http_port(token), token.read_text().strip(), run)
        yield made
        session = made.greeted()
        assert made.status(Mcp_Session_Id=session) == 200, "it still serves who may speak"
        assert made.left(session) == 200
        run.signal(signal.SIGTERM)
        run.process.wait(20)
        assert b"Traceback" not in made.complaints()


# ------------------------------------------------------------------------------------------ without the token


@pytest.mark.parametrize(
    "value",
    ["", "Bearer", "Bearer {upper}", "Bearer {short}", "Basic {token}", "{token}", "Bearer {token}, Bearer {token}",
     'Bearer "{token}"', "Bearer token={token}", "Bearer {token}\x0b"],
)  # fmt: skip
def test_wrong_token_is_refused(served: Served, value: str) -> None:
    token = served.token
    said = value.format(token=token, upper=token.swapcase(), short=token[:-1])
    status, headers, body = served.ask(Authorization=said)
    assert (status, body) in ((401, b""), (400, b"Invalid HTTP request received."))
    assert status == 400 or headers["www-authenticate"] == "Bearer"


@pytest.mark.parametrize(
    "path", ["/mcp?token={}", "/mcp?access_token={}", "/mcp#{}", "/mcp/{}", "/mcp;token={}", "//x:{}@127.0.0.1/mcp"]
)
def test_token_in_the_address_is_refused(served: Served, path: str) -> None:
    """Addresses appear in histories and logs."""
    assert served.raw(served.head(f"POST {path.format(served.token)} HTTP/1.1")).startswith(b"HTTP/1.1 401")


def test_misplaced_or_repeated_token_is_refused(served: Served) -> None:
    assert code(served.raw(served.head("POST /mcp HTTP/1.1", f"Cookie: token={served.token}"))) == 401
    assert code(served.raw(served.head("POST /mcp HTTP/1.1", f"Proxy-{served.bearer()}"))) == 401
    assert code(served.raw(served.head("POST /mcp HTTP/1.1", served.bearer(), served.bearer()))) == 401
    assert code(served.raw(served.head("POST /mcp HTTP/1.1", served.bearer(), "Authorization: Bearer x"))) == 401


def test_header_names_and_scheme_are_case_insensitive(served: Served) -> None:
    """As RFC 9110 has it: so none that is spelled otherwise is overlooked either."""
    session = served.greeted()
    named = ("Content-Type: application/json", "Accept: application/json, text/event-stream", f"{SESSION}: {session}")
    body = json.dumps(LISTED).encode()
    long = f"Content-Length: {len(body)}"
    asked = served.head("POST /mcp HTTP/1.1", f"aUTHORIZATION: bEARER {served.token}", long, *named)
    assert code(served.raw(asked + body)) == 200
    asked = served.head("POST /mcp HTTP/1.1", served.bearer(), "oRiGiN: https://evil.example", long, *named)
    assert code(served.raw(asked + body)) == 403
    assert served.left(session) == 200


@pytest.mark.parametrize("method", ["GET", "HEAD", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "PROPFIND", "X"])
def test_every_method_needs_the_token(served: Served, method: str) -> None:
    assert code(served.raw(served.head(f"{method} /mcp HTTP/1.1"))) == 401


@pytest.mark.parametrize(
    "path", ["/", "/mcp/", "//mcp", "/mcp/../mcp", "/MCP", "/..%2f..%2fetc/passwd", "/../../etc/passwd", "/mcp%00", "*",
             "http://evil.example/mcp", "/sse", "/messages/", "/.well-known/oauth-protected-resource"],
)  # fmt: skip
def test_other_paths_do_not_reveal_the_endpoint(served: Served, path: str) -> None:
    assert code(served.raw(served.head(f"GET {path} HTTP/1.1"))) == 401
    assert code(served.raw(served.head(f"GET {path} HTTP/1.1", served.bearer()))) == 404


# ------------------------------------------------------------------------------------------ a page in a browser


@pytest.mark.parametrize(
    "host",
    ["evil.example:{}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.example:{}", "localhost.:{}", "[::1]:{}",
     "0.0.0.0:{}", "2130706433:{}", "127.1:{}", "user@127.0.0.1:{}", "127.0.0.1:{}, evil.example", ""],
)  # fmt: skip
def test_dns_rebinding_host_is_refused(served: Served, host: str) -> None:
    """DNS rebinding: the page's own name comes in Host, and with it its origin counts as the same one."""
    name = host.format(served.port)
    assert served.status(Host=name) in (400, 421)
    assert served.status(Host=name, Origin=f"http://{name}") in (400, 421)


@pytest.mark.parametrize(
    "origin",
    ["null", "https://evil.example", "http://evil.example:{}", "https://127.0.0.1:{}", "http://127.0.0.1", "file://",
     "http://127.0.0.1:{} https://evil.example", "http://127.0.0.1:{}.evil.example", "chrome-extension://abc", ""],
)  # fmt: skip
def test_foreign_origin_is_refused_even_with_the_token(served: Served, origin: str) -> None:
    assert served.status(Origin=origin.format(served.port)) == 403


def test_cors_preflight_allows_nothing(served: Served) -> None:
    """A browser asks first where a page wants to send a token or JSON: no answer lets it."""
    for origin in ("https://evil.example", "null", f"http://127.0.0.1:{served.port}"):
        wanted = ("Access-Control-Request-Method: POST", "Access-Control-Request-Headers: authorization, content-type")
        private = "Access-Control-Request-Private-Network: true"
        answer = served.raw(served.head("OPTIONS /mcp HTTP/1.1", f"Origin: {origin}", *wanted, private))
        assert code(answer) in (401, 403)
        assert b"access-control" not in answer.lower()
    status, headers, _ = served.ask(GREETING, Origin=f"http://localhost:{served.port}")
    assert status == 200
    assert not [name for name in headers if name.startswith("access-control")]
    assert served.left(headers[SESSION.lower()]) == 200


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""])
def test_simple_cors_requests_are_refused(served: Served, kind: str) -> None:
    """The content types that a browser sends without a preflight."""
    assert served.status(GREETING, Content_Type=kind) in (400, 415)


# ------------------------------------------------------------------------------------------ HTTP itself


def test_malformed_request_closes_the_connection(served: Served) -> None:
    for data in (
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(500),  # TLS
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        b"GET /\xff HTTP/1.1\r\n\r\n",
        b"\r\n" * 10 + b"GET\r\n\r\n",
        served.head("POST /mcp HTTP/1.1", served.bearer(), "Content-Length: -1"),
        served.head("POST /mcp HTTP/1.1", served.bearer(), "Content-Length: 1", "Content-Length: 2"),
        served.head("POST /mcp HTTP/1.1", served.bearer(), "Transfer-Encoding: gzip, chunked"),
        served.head("POST /mcp HTTP/1.1", "Host: evil.example", served.bearer()),
        served.head("POST /mcp HTTP/1.1", served.bearer(), " folded: here"),
        served.head("POST /mcp HTTP/1.1", served.bearer(), "X: a\0b"),
    ):
        assert code(served.raw(data)) in (400, 401, 421, 501), data


def test_http_1_0_needs_a_host_header(served: Served) -> None:
    assert code(served.raw(f"POST /mcp HTTP/1.0\r\n{served.bearer()}\r\n\r\n".encode())) == 421
    answer = served.raw(served.head("POST /mcp HTTP/1.0", "Content-Length: 0"))
    assert code(answer) == 401


def test_each_pipelined_request_needs_the_token(served: Served) -> None:
    """The first request has the token, later ones in the same packet do not."""
    with served.dial() as link:
        with_it = served.head("GET /other HTTP/1.1", served.bearer())
        link.sendall(
            with_it + served.head("GET /other HTTP/1.1") + served.head("GET /mcp HTTP/1.1", "Connection: close")
        )
        found = b""
        while more := link.recv(65_536):
            found += more
    assert re.findall(rb"HTTP/1\.1 (\d+)", found) == [b"404", b"401", b"401"]


def test_request_inside_a_body_is_not_executed(served: Served) -> None:
    """The body of a request that is refused is read over, whatever it looks like."""
    inner = served.head("GET /mcp HTTP/1.1", served.bearer())
    asked = served.head("POST /mcp HTTP/1.1", f"Content-Length: {len(inner)}")
    with served.dial() as link:
        link.sendall(asked + inner)
        link.settimeout(0.5)
        found = first(link)
        with pytest.raises(TimeoutError):
            link.recv(1)
    assert re.findall(rb"HTTP/1\.1 (\d+)", found) == [b"401"]


def test_protocol_upgrade_needs_the_token(served: Served) -> None:
    for wanted in ("websocket", "h2c"):
        asked = served.head(
            "GET /mcp HTTP/1.1", f"Upgrade: {wanted}", "Connection: Upgrade", "Sec-WebSocket-Version: 13"
        )
        assert code(served.raw(asked)) == 401
    assert served.complaints() == b"", "whoever runs it is not written to by strangers"


def test_endless_headers_are_cut_off(served: Served) -> None:
    with served.dial() as link:
        link.sendall(served.head()[:-2])
        sent = 0
        try:
            for _ in range(160):  # 10 MiB
                link.sendall(b"X: " + b"a" * 65_531 + b"\r\n")
                sent += 65_536
        except ConnectionError:
            pass
        assert sent < 10 << 20
    assert code(served.raw(served.head("POST /mcp HTTP/1.1", *("X: y" for _ in range(5_000))))) in (400, 401)
    assert code(served.raw(served.head(f"GET /{'a' * 200_000} HTTP/1.1"))) in (0, 400)


# ------------------------------------------------------------------------------------------ too much, or too slow


def memory(served: Served) -> int:
    """What the server has in memory, in bytes."""
    fields = Path(f"/proc/{served.run.process.pid}/statm").read_text().split()
    return int(fields[1]) * resource.getpagesize()


def open_files(served: Served) -> int:
    """How many files and connections the server has open."""
    return len(list(Path(f"/proc/{served.run.process.pid}/fd").iterdir()))


def test_oversized_body_is_refused(served: Served) -> None:
    assert served.status(b"[" * ((4 << 20) + 1)) == 413
    before = memory(served)
    for headers in ((), (served.bearer(),)):
        with served.dial() as link:
            link.sendall(served.head("POST /mcp HTTP/1.1", "Transfer-Encoding: chunked", *headers))
            chunk = b"10000\r\n" + b" " * 65_536 + b"\r\n"
            try:
                for _ in range(1_000):  # 64 MiB
                    link.sendall(chunk)
            except (ConnectionError, TimeoutError):
                pass
            assert code(first(link)) in (0, 401, 413)
    assert memory(served) - before < 24 << 20


def test_unsent_body_opens_no_session(served: Served) -> None:
    for size in (5 << 20, 10**18, 10**30):
        asked = served.head("POST /mcp HTTP/1.1", served.bearer(), f"Content-Length: {size}")
        assert code(served.raw(asked)) in (400, 413)


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"null", b"[" * 200_000, b'{"a":' * 100_000, b"9" * 100_000, b"\xff\xfe", b"NaN", b'"\\ud800"',
     b"[" + b"[]," * 1_300_000 + b"[]]",
     *(b'{"jsonrpc":"2.0","method":"ping","id":' + each + b"}"
       for each in (b"1.5", b"null", b"true", b'"\\ud800"', b"9" * 5_000))],
    ids=range(16),
)  # fmt: skip
def test_malformed_message_opens_no_session(served: Served, body: bytes) -> None:
    before = memory(served)
    status, headers, said = served.ask(body)
    assert status == 400
    assert "error" in json.loads(said), "an answer of the protocol's"
    session = headers.get(SESSION.lower())
    assert session is None or served.status(Mcp_Session_Id=session) == 404
    session = served.greeted()
    assert served.status(body, Mcp_Session_Id=session) == 400
    assert memory(served) - before < 24 << 20
    assert served.status(Mcp_Session_Id=session) == 200, "a session that there is goes on"
    assert served.left(session) == 200
    assert served.complaints() == b""


def test_batched_messages_are_refused(served: Served) -> None:
    """The protocol has no batches since 2025-06-18."""
    assert served.status([GREETING, LISTED]) == 400


@pytest.mark.slow
def test_idle_connections_do_not_block_others(served: Served) -> None:
    """Twice as many as there is room for; some say a part of a request, some are refused and then go on, bit by bit."""
    session = served.greeted()
    begun, open_before = time.monotonic(), open_files(served)
    crowd = [served.dial() for _ in range(2 * MOST)]
    try:
        for number, link in enumerate(crowd):
            try:
                link.sendall(
                    (b"", b"P", served.head()[:-2], served.head("POST /mcp HTTP/1.1", "Content-Length: 99"))[number % 4]
                )
            except ConnectionError:
                assert number < MOST + 1, "the oldest give way"
        assert served.status(Mcp_Session_Id=session) == 200
        assert served.status(Mcp_Session_Id=session) == 200
        assert open_files(served) <= open_before + MOST
        waiting = crowd
        while waiting and time.monotonic() - begun < 3 * PATIENCE_S:
            for link in select.select(waiting, [], [], 0.5)[0]:
                try:
                    gone = not link.recv(65_536)
                except ConnectionError:
                    gone = True
                waiting = [each for each in waiting if not (gone and each is link)]
            for link in waiting:
                with suppress(ConnectionError):
                    link.sendall(b" ")  # a sign of life changes nothing
        assert waiting == []
        assert time.monotonic() - begun > PATIENCE_S / 2
    finally:
        for link in crowd:
            link.close()
    assert served.left(session) == 200
    assert served.complaints() == b""


# ------------------------------------------------------------------------------------------ sessions


def test_session_belongs_to_its_host_and_ends_on_delete(served: Served) -> None:
    session, other = served.greeted(), served.greeted()
    assert re.fullmatch(r"[0-9a-f]{32}", session), "122 random bits: nothing to guess"
    assert session != other
    for guess in ("0" * 32, session[:-1], session.upper(), session + "0", "../" + session, "", f"{session},{other}"):
        if guess != session:  # an id of digits alone has no other case
            assert served.status(Mcp_Session_Id=guess) in (400, 404), guess
    assert served.status(Mcp_Session_Id=session, Authorization="Bearer x") == 401, "the id alone is nothing"
    assert served.status(method="DELETE", Mcp_Session_Id=session, Authorization="") == 401
    assert served.status(GREETING, Mcp_Session_Id="chosen-by-me-0123456789abcdef012") == 404, "no id is taken over"
    assert served.left(session) == 200
    for method in ("POST", "GET", "DELETE"):
        assert served.status(method=method, Mcp_Session_Id=session) == 404, "gone is gone"
    assert served.status(Mcp_Session_Id=other) == 200
    assert served.left(other) == 200


def test_session_stream_cannot_be_taken_over(served: Served) -> None:
    session = served.greeted()
    with served.dial() as link:
        link.sendall(
            served.head(
                "GET /mcp HTTP/1.1",
                served.bearer(),
                "Connection: close",
                "Accept: text/event-stream",
                f"{SESSION}: {session}",
            )
        )
        assert code(first(link)) == 200
        assert served.status(method="GET", Mcp_Session_Id=session) == 409
        assert served.status(method="GET", Mcp_Session_Id=session, Authorization="Bearer x") == 401
        assert served.left(session) == 200
        link.settimeout(10)
        while link.recv(65_536):  # it ends with the session
            pass


def test_number_of_sessions_is_limited(served: Served) -> None:
    opened = [served.greeted() for _ in range(8)]
    assert served.status(GREETING) == 503
    assert served.status(Mcp_Session_Id=opened[0]) == 200, "those that there are go on"
    for session in opened:
        assert served.left(session) == 200
    session = served.greeted()
    assert served.left(session) == 200


# ------------------------------------------------------------------------------------------ without sessions

VERSION = "2026-07-28"
META = {
    "io.modelcontextprotocol/protocolVersion": VERSION, "io.modelcontextprotocol/clientCapabilities": {},
}  # fmt: skip
NAMED = {"Mcp_Protocol_Version": VERSION, "Mcp_Method": "tools/list"}


def stateless(method: str = "tools/list", number: Any = 5, **params: Any) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": number, "method": method, "params": {"_meta": META} | params}


def test_stateless_request_needs_all_that_others_need(served: Served) -> None:
    status, headers, body = served.ask(stateless(), **NAMED)
    assert (status, json.loads(body)["id"]) == (200, 5)
    assert SESSION.lower() not in headers
    assert served.status(stateless(), **NAMED, Authorization="Bearer x") == 401
    assert served.status(stateless(), **NAMED, Origin="https://evil.example") == 403
    assert served.status(stateless(), **NAMED, Host="evil.example") == 421
    assert served.status(stateless(), **NAMED, Content_Type="text/plain") in (400, 415)
    assert served.status([stateless(), stateless()], **NAMED) == 400
    for method in ("GET", "DELETE"):
        assert served.status(method=method, **NAMED) in (400, 404, 405)
    assert served.status(stateless("tools/destroy"), **NAMED | {"Mcp_Method": "tools/destroy"}) == 404
    for session in ("0" * 32, "../x"):
        assert served.status(stateless(), **NAMED, Mcp_Session_Id=session) in (200, 400, 404)


CANCELS = stateless("tools/call", name="cancel", arguments={})


@pytest.mark.parametrize(
    ("message", "headers"),
    [
        (stateless(), {"Mcp_Method": "tools/call"}),
        (stateless(), {"Mcp_Protocol_Version": "2026-07-29"}),
        (stateless(), {"Mcp_Protocol_Version": "x" * 5_000}),
        (CANCELS, {"Mcp_Method": "tools/call", "Mcp_Name": "describe_policy"}),
        (CANCELS, {"Mcp_Method": "tools/call"}),
        (stateless() | {"params": {}}, {}),
        (stateless() | {"params": {"_meta": META | {"io.modelcontextprotocol/protocolVersion": 7}}}, {}),
        (stateless() | {"params": {"_meta": [META]}}, {}),
        (stateless() | {"method": "initialize"}, {"Mcp_Method": "initialize"}),
        (stateless() | {"id": 1.5}, {}),
        (stateless() | {"id": None}, {}),
    ],
)  # fmt: skip
def test_request_that_contradicts_itself_is_refused(served: Served, message: Any, headers: dict[str, str]) -> None:
    """A proxy that looks at headers and a server that looks at bodies must see the same call."""
    status, _, body = served.ask(message, **NAMED | headers)
    assert status in (400, 404)
    assert "error" in json.loads(body)


def test_key_twice_is_refused_whoever_would_win(served: Served) -> None:
    body = json.dumps(stateless("tools/call", name="describe_policy")).replace('"name"', '"name": "cancel", "name"')
    status, _, said = served.ask(body.encode(), **NAMED | {"Mcp_Method": "tools/call", "Mcp_Name": "describe_policy"})
    assert status == 400
    assert "a key twice" in json.loads(said)["error"]["message"]


@pytest.mark.slow
def test_listeners_are_limited_and_keep_no_other_out(served: Served) -> None:
    asked = stateless("subscriptions/listen", notifications={"resourceSubscriptions": ["rtshcua://flight"]})
    body = json.dumps(asked).encode()
    head = served.head(
        "POST /mcp HTTP/1.1", served.bearer(), f"Content-Length: {len(body)}", "Content-Type: application/json",
        "Accept: application/json, text/event-stream", f"Mcp-Protocol-Version: {VERSION}",
        "Mcp-Method: subscriptions/listen",
    )  # fmt: skip
    links = [served.dial() for _ in range(34)]
    try:
        answers = []
        for link in links:
            link.sendall(head + body)
            answers.append(first(link))
        assert sum(b"text/event-stream" in each for each in answers) == 32
        assert served.status(stateless(), **NAMED) == 200
    finally:
        for link in links:
            link.close()
    until_s = time.monotonic() + 20
    while b"text/event-stream" not in again(served, head + body):
        assert time.monotonic() < until_s, "listeners that have gone make room"
        time.sleep(0.2)


def again(served: Served, data: bytes) -> bytes:
    with served.dial() as link:
        link.sendall(data)
        return first(link)
