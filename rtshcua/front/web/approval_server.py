"""Serves the page for an approver on the loopback interface: it shows the open question, and passes on their answer.

The address has a secret in its fragment, which a browser sends to nobody by itself. The page exchanges it, once, for
the key of its session, which every later request has to show: who can reach the port alone learns nothing and answers
nothing. A second use of the secret is refused and told to the approver. Requests of other pages are refused by `Origin`
and `Host`; a question is answered by its nonce. No key that signs is here.
"""

import json
import secrets
from base64 import b64encode
from functools import cache
from hashlib import sha256
from http import HTTPStatus
from typing import Any, Final

import msgspec
from markupsafe import Markup

from rtshcua.app.approval_desk import ApprovalDesk
from rtshcua.app.approvals import ApprovalDraft
from rtshcua.diagnostics.excerpt import visible
from rtshcua.front.web.page_server import LoopbackHandler, LoopbackServer
from rtshcua.ground.drawing.drawn_site import way_of_step
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.drawing.html import rendered, templates
from rtshcua.ground.drawing.picture import map_picture
from rtshcua.ground.drawing.zone_map import mission_map

_PACKAGE: Final = "rtshcua.front.web"
#: the width of a map, px: a phone's
_PHONE: Final = 400
#: the most bytes of a request
_MOST_BODY: Final = 4_096
_JSON: Final = "application/json"


class _Asked(msgspec.Struct, forbid_unknown_fields=True):
    """What a page asks with: `seen` is the number of the question whose map it has."""

    secret: str = ""
    seen: int = 0
    nonce: str = ""
    granted: bool | None = None
    other_path: bool = False


class ApprovalPage(LoopbackServer):
    """Serves the page of a desk while it is entered. Raises OSError where the port is taken."""

    def __init__(self, desk: ApprovalDesk, port: int = 0) -> None:
        super().__init__(port, _ApprovalHandler)
        self.desk, self.secret = desk, secrets.token_urlsafe(24)
        #: empty until a browser used the address
        self.session = ""
        #: the address for a browser, for one use
        self.address = f"{self.origin}/#{self.secret}"
        self._map = 0, ""

    def __enter__(self) -> "ApprovalPage":
        self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def opened(self, secret: str) -> tuple[HTTPStatus, dict[str, str]]:
        """Exchange the secret for the key of the session, once."""
        if not secrets.compare_digest(secret.encode(), self.secret.encode()):
            return _refused(HTTPStatus.UNAUTHORIZED, "unknown-secret", "this is not the address of this page")
        with self.desk.lock:
            if not self.session:
                self.session = secrets.token_urlsafe(24)
                self.desk.tell("page-opened", "the page was opened in a browser")
                return HTTPStatus.OK, {"session": self.session}
        text = "the address of the page was used again, and refused: if that was not you, end this command"
        self.desk.tell("page-reused", text)
        return _refused(HTTPStatus.CONFLICT, "used", "this address was used before: it opens one page")

    def state(self, seen: int) -> dict[str, Any]:
        """What the page shows; without the map that it has."""
        stage, told, shown = self.desk.state()
        question = None
        if shown is not None:
            question = self.desk.view(shown) | {"nonce": shown.nonce}
            if shown.draft is not None and seen != shown.asked.number:
                question["map"] = self._map_of(shown.asked.number, shown.draft)
        return {"stage": stage, "told": told, "question": question}

    def _map_of(self, number: int, draft: ApprovalDraft) -> str:
        """The map of a question as a `data:` address, in which no script can run."""
        if self._map[0] != number:
            site = site_of(draft.bundle.policy)
            way = way_of_step(way_of(draft.bundle.mission), draft.step.step, site)
            text = map_picture(mission_map(site, way, width=_PHONE))
            self._map = number, f"data:image/svg+xml;base64,{b64encode(text.encode()).decode()}"
        return self._map[1]


def _refused(status: HTTPStatus, slug: str, text: str) -> tuple[HTTPStatus, dict[str, str]]:
    return status, {"slug": slug, "text": text}


class _ApprovalHandler(LoopbackHandler):
    server: ApprovalPage

    def do_GET(self) -> None:
        if not self.is_for(self.server.hosts):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
        elif self.path != "/":
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            self.received()
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", _page())

    def do_POST(self) -> None:
        refused = self._unfit()
        if refused is not None:
            self.close_connection = True  # its body is not read
            self.send_error(refused)
            return
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.received()
        try:
            status, told = self._answer(msgspec.json.decode(body, type=_Asked))
        except (ValueError, RecursionError):
            status, told = _refused(HTTPStatus.BAD_REQUEST, "malformed", "malformed request")
        # names in it come from a mission, a policy or a flight
        self._send(status, _JSON, visible(json.dumps(told, ensure_ascii=False)).encode())

    def _unfit(self) -> HTTPStatus | None:
        """Why a request is refused before its body is read."""
        said = self.headers
        if not self.is_for(self.server.hosts):
            return HTTPStatus.MISDIRECTED_REQUEST
        if self.path not in ("/open", "/state", "/answer"):
            return HTTPStatus.NOT_FOUND
        if said.get_all("Origin", []) != [f"http://{said['Host']}"]:
            return HTTPStatus.FORBIDDEN
        if said.get_all("Content-Type", []) != [_JSON]:
            return HTTPStatus.UNSUPPORTED_MEDIA_TYPE
        length = said.get_all("Content-Length", [])
        if len(length) != 1 or not (length[0].isascii() and length[0].isdecimal()) or "Transfer-Encoding" in said:
            return HTTPStatus.LENGTH_REQUIRED
        return None if len(length[0]) < 9 and int(length[0]) <= _MOST_BODY else HTTPStatus.REQUEST_ENTITY_TOO_LARGE

    def _answer(self, asked: _Asked) -> tuple[HTTPStatus, dict[str, Any]]:
        """What is answered to a page. Raises ValueError."""
        server, shown = self.server, self.headers.get_all("Authorization", [])
        if self.path == "/open":
            return server.opened(asked.secret)
        known = f"Bearer {server.session}".encode()
        if not server.session or len(shown) != 1 or not secrets.compare_digest(shown[0].encode(), known):
            return _refused(HTTPStatus.UNAUTHORIZED, "no-session", "open the address that `rtshcua approve` printed")
        if self.path == "/state":
            return HTTPStatus.OK, server.state(asked.seen)
        if asked.granted is None:
            raise ValueError
        said = server.desk.answer(asked.nonce, granted=asked.granted, other_path=asked.other_path)
        return _refused(HTTPStatus.OK if said.slug == "accepted" else HTTPStatus.CONFLICT, said.slug, said.text)

    def _send(self, status: HTTPStatus, kind: str, data: bytes) -> None:
        self.send_response(status)
        self.send_own_headers()
        self.send_header("Content-Security-Policy", "frame-ancestors 'none'")
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


@cache
def _page() -> bytes:
    """The page without any question, the same for everybody."""
    environment, _ = templates(_PACKAGE)
    script = environment.get_template("approval.js").render()
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    policy = f"default-src 'none'; script-src 'sha256-{digest}'; connect-src 'self'; img-src data:"
    policy = Markup(f"{policy}; base-uri 'none'; form-action 'none'")
    values = {"title": "Approvals", "generator": "rtshcua", "script": Markup(script), "policy": policy}
    return rendered(_PACKAGE, "approval.html", **values).encode("utf-8")
