"""The page for approvers against whoever reaches its port: other programs, pages from elsewhere, and hostile texts."""

import http.client
import json
import re
import socket
import tempfile
import threading
from base64 import b64decode
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace as with_fields
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from msgspec.structs import replace

from rtshcua.app.approvals import ApprovalDraft
from rtshcua.front.web.approval_server import ApprovalPage
from rtshcua.model.outcome import Outcome, Reason
from virtual.waiting_flight import Attended, WaitingFlight, desk_at, keys_and_bundles


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder / "data"))
        keys_and_bundles(folder)
        yield folder


class Site:
    """A flight, Ada's desk, and her page. `session` is that of her browser."""

    def __init__(self, place: Path) -> None:
        self.flight = WaitingFlight(place, Path("low.bundle"))
        self.ada = Attended(desk_at(place))
        self.page = ApprovalPage(self.ada.desk)
        self.url = urlsplit(self.page.address)
        self.session = ""

    @property
    def host(self) -> str:
        return self.url.netloc

    def ask(
        self, path: str, body: Any = None, method: str = "POST", raw: bytes | None = None, **changed: str | None
    ) -> tuple[int, dict[str, str], Any]:
        headers: dict[str, str | None] = {
            "Host": self.host, "Origin": f"http://{self.host}", "Content-Type": "application/json",
            "Authorization": f"Bearer {self.session}",
        }  # fmt: skip
        headers |= {name.replace("_", "-"): value for name, value in changed.items()}
        data = json.dumps(body).encode() if raw is None else raw
        link = http.client.HTTPConnection("127.0.0.1", self.url.port or 0, timeout=20)
        link.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in {"Content-Length": str(len(data)), **headers}.items():
            if value is not None:
                link.putheader(name, value)
        with suppress(BrokenPipeError, ConnectionResetError):  # it may be refused before the body is read
            link.endheaders(data)
        answer = link.getresponse()
        found = answer.status, dict(answer.getheaders()), answer.read()
        link.close()
        with suppress(ValueError):
            return found[0], found[1], json.loads(found[2])
        return found

    def open(self) -> None:
        status, _, told = self.ask("/open", {"secret": self.url.fragment})
        assert status == 200
        self.session = told["session"]

    def question(self) -> dict[str, Any]:
        """The open question, as the page sees it."""
        self.flight.asks()
        self.ada.until("question")
        found = self.ask("/state", {"seen": 0})[2]["question"]
        assert isinstance(found, dict)
        return found

    def answer(self, nonce: str, granted: bool = True, **changed: str | None) -> tuple[int, str]:
        body = {"nonce": nonce, "granted": granted, "other_path": False}
        status, _, told = self.ask("/answer", body, **changed)
        return status, told["slug"] if isinstance(told, dict) else ""


@pytest.fixture
def site(made: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(made / "data"))
    monkeypatch.chdir(made)
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        found = Site(Path(name) / "s")
        with found.page:
            yield found
        found.ada.end()
        found.flight.hang_up()


def test_answer_of_the_page_is_signed(site: Site) -> None:
    site.open()
    question = site.question()
    assert (question["skill"], question["step_number"], question["role"]) == ("inspect_area", 3, "supervisor")
    assert site.answer(question["nonce"]) == (200, "accepted")
    assert site.flight.slugs == ["accepted"]
    assert site.ask("/state", {"seen": 0})[2]["question"] is None


# ------------------------------------------------------------------------------------------- without the secret


@pytest.mark.parametrize("shown", [None, "", "Bearer ", "Bearer x", "Basic x", "bearer"])
def test_without_the_session_nothing_is_told_or_answered(site: Site, shown: str | None) -> None:
    site.open()
    nonce = site.question()["nonce"]
    for path, body in (("/state", {"seen": 0}), ("/answer", {"nonce": nonce, "granted": True, "other_path": False})):
        status, _, told = site.ask(path, body, Authorization=shown)
        assert (status, told["slug"]) == (401, "no-session")
        assert nonce not in json.dumps(told)
    assert site.flight.slugs == []


def test_before_the_page_is_opened_there_is_no_session(site: Site) -> None:
    site.flight.asks()
    question = site.ada.until("question").question
    assert question is not None
    assert site.answer(question.nonce)[0] == 401
    assert site.answer(question.nonce, Authorization="Bearer ")[0] == 401
    assert site.flight.slugs == []


@pytest.mark.parametrize("secret", ["", "x", "\x00", "é" * 32, "a" * 3_000])
def test_wrong_secret_opens_nothing(site: Site, secret: str) -> None:
    status, _, told = site.ask("/open", {"secret": secret})
    assert (status, told["slug"]) == (401, "unknown-secret")
    assert not site.page.session


def test_secret_is_good_once_and_a_second_use_is_told(site: Site) -> None:
    site.open()
    status, _, told = site.ask("/open", {"secret": site.url.fragment})
    assert (status, told["slug"]) == (409, "used")
    assert "session" not in told
    assert "end this command" in site.ada.until("page-reused").text


def test_the_secret_is_no_session_and_no_path(site: Site) -> None:
    site.open()
    secret = site.url.fragment
    assert site.ask("/state", {"seen": 0}, Authorization=f"Bearer {secret}")[0] == 401
    assert site.ask(f"/{secret}", method="GET")[0] == 404


def test_page_itself_has_no_secret_and_no_question(site: Site) -> None:
    site.open()
    question = site.question()
    status, headers, page = site.ask("/", method="GET")
    assert status == 200
    assert isinstance(page, bytes)
    for each in (site.url.fragment, site.session, question["nonce"], question["mission"], "ada"):
        assert each.encode() not in page or each in ("low", "ada"), each
    policy = re.search(rb'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    said = policy[1].replace(b"&#39;", b"'").decode()
    assert "default-src 'none'" in said
    assert "unsafe" not in said
    assert "connect-src 'self'" in said
    assert headers["X-Frame-Options"] == "DENY"
    assert "Access-Control-Allow-Origin" not in headers


# ------------------------------------------------------------------------------------------- pages from elsewhere


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "0.0.0.0", "", None])
def test_other_hosts_are_misdirected(site: Site, host: str | None) -> None:
    site.open()
    nonce = site.question()["nonce"]
    port = site.url.port
    for name in (host, None if host is None else f"{host}:{port}" if ":" not in host and host != "127.0.0.1" else host):
        body = {"nonce": nonce, "granted": True, "other_path": False}
        assert site.ask("/answer", body, Host=name, Origin=f"http://{name}")[0] in (400, 421)
        assert site.ask("/", method="GET", Host=name)[0] in (400, 421)
    assert site.flight.slugs == []


@pytest.mark.parametrize(
    "origin",
    [None, "", "null", "http://evil.example", "https://{host}", "http://{host}.evil.example", "http://{host}/"],
)
def test_other_origins_are_refused(site: Site, origin: str | None) -> None:
    site.open()
    nonce = site.question()["nonce"]
    said = None if origin is None else origin.format(host=site.host)
    body = {"nonce": nonce, "granted": True, "other_path": False}
    status, headers, _ = site.ask("/answer", body, Origin=said)
    assert status == 403
    assert "Access-Control-Allow-Origin" not in headers
    assert site.flight.slugs == []


def test_forms_of_other_pages_are_refused(site: Site) -> None:
    """A form needs no permission of the server, but cannot say that it is JSON."""
    site.open()
    body = {"nonce": site.question()["nonce"], "granted": True, "other_path": False}
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data", None):
        assert site.ask("/answer", body, Content_Type=kind)[0] == 415
    assert site.flight.slugs == []


@pytest.mark.parametrize("method", ["GET", "HEAD", "PUT", "DELETE", "OPTIONS", "PATCH"])
def test_no_other_method_changes_anything(site: Site, method: str) -> None:
    site.open()
    nonce = site.question()["nonce"]
    for path in ("/answer", f"/answer?nonce={nonce}&granted=true&other_path=false", "/open", "/state"):
        body = {"nonce": nonce, "granted": True, "other_path": False}
        assert site.ask(path, body, method=method)[0] in (404, 501)
    assert site.flight.slugs == []


# ------------------------------------------------------------------------------------------- answers


def test_nonce_is_not_accepted_again(site: Site) -> None:
    site.open()
    nonce = site.question()["nonce"]
    assert site.answer(nonce) == (200, "accepted")
    for granted in (True, False):
        assert site.answer(nonce, granted) == (409, "question-over")
    assert site.flight.slugs == ["accepted"]


def test_of_two_answers_at_once_one_is_signed(site: Site) -> None:
    site.open()
    nonce = site.question()["nonce"]
    found: list[tuple[int, str]] = []
    threads = [threading.Thread(target=lambda: found.append(site.answer(nonce))) for _ in range(6)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert sorted(found) == [(200, "accepted")] + [(409, "question-over")] * 5
    assert site.flight.slugs == ["accepted"]


def test_answer_to_a_question_that_was_swapped_signs_nothing(site: Site) -> None:
    site.open()
    before = site.question()
    site.flight.decides(Outcome.DENY, Reason.APPROVAL_TIMED_OUT)
    site.ada.until("closed")
    site.flight.asks()
    site.ada.until("question", 2)
    after = site.ask("/state", {"seen": 0})[2]["question"]
    assert after["number"] == before["number"] + 1
    assert site.answer(before["nonce"]) == (409, "question-over")
    assert site.flight.slugs == []
    assert site.answer(after["nonce"]) == (200, "accepted")


WRONG_BODIES = (
    b"", b"{", b"[]", b"null", b'{"nonce":"x"}', b'{"nonce":"x","granted":1,"other_path":false}',
    b'{"nonce":"x","granted":true,"other_path":false,"binding":"00"}', b'{"nonce":5,"granted":true,"other_path":false}',
    b'{"nonce":"\xff","granted":true,"other_path":false}', b'{"nonce":"\\ud800","granted":true,"other_path":false}',
    b"[" * 4_000,
)  # fmt: skip


def test_malformed_answers_are_refused(site: Site) -> None:
    site.open()
    site.question()
    for body in WRONG_BODIES:
        status, _, told = site.ask("/answer", raw=body)
        assert status == 400, body
        assert told["slug"] == "malformed"
    assert site.ask("/answer", raw=b"x" * 5_000)[0] == 413
    for length in ("x", "-1", "", "\xb2", "9" * 30, None):
        assert site.ask("/answer", raw=b"{}", Content_Length=length)[0] in (400, 411, 413)
    assert site.ask("/answer", raw=b"{}", Transfer_Encoding="chunked")[0] == 411
    assert site.flight.slugs == []
    assert site.ask("/state", {"seen": 0})[0] == 200


def test_garbage_is_answered_and_forgotten(site: Site) -> None:
    lines = (b"\r\n\r\n", b"POST\r\n\r\n", b"\x16\x03\x01\x02\x00", b"POST /answer HTTP/9.9\r\n\r\n", b"A" * 70_000)
    for data in lines:
        with socket.create_connection(("127.0.0.1", site.url.port or 0)) as link, suppress(OSError):
            link.sendall(data)
            link.shutdown(socket.SHUT_WR)
            link.settimeout(5)
            link.recv(1_000)
    site.open()
    assert site.ask("/state", {"seen": 0})[0] == 200


# ------------------------------------------------------------------------------------------- hostile texts


def renamed(draft: ApprovalDraft | None, name: str) -> ApprovalDraft:
    """The draft about a mission and a zone of another name."""
    assert draft is not None
    policy = draft.bundle.policy
    zones = tuple(replace(each, name=name) for each in policy.zones)
    mission = replace(draft.bundle.mission, name=name)
    changed = with_fields(draft.bundle, policy=replace(policy, zones=zones), mission=mission)
    return draft._replace(bundle=changed)


def test_hostile_texts_stay_texts(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a policy or a mission says is JSON for the page, which puts it in as text; the map is a picture."""
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(made / "data"))
    monkeypatch.chdir(made)
    hostile = "x\u202e<script>alert(1)</script><img src=x onerror=alert(2)>"
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        site = Site(Path(name) / "s")
        with site.page:
            site.open()
            site.flight.asks()
            shown = site.ada.until("question").question
            assert shown is not None
            desk = site.ada.desk
            desk._shown = shown._replace(draft=renamed(shown.draft, hostile), why_not=hostile)
            desk.tell("note", hostile)
            status, headers, told = site.ask("/state", {"seen": 0})
            assert (status, headers["Content-Type"]) == (200, "application/json")
            assert headers["X-Content-Type-Options"] == "nosniff"
            question = told["question"]
            assert question["mission"].startswith("x<U+202E><script>"), "reordering characters are shown"
            kind, _, data = question["map"].partition(",")
            assert kind == "data:image/svg+xml;base64"
            assert b"<script" not in b64decode(data)
        site.ada.end()
        site.flight.hang_up()


def test_script_of_the_page_puts_in_texts_only() -> None:
    script = Path("rtshcua/front/web/templates/approval.js")
    text = (Path(__file__).resolve().parents[2] / script).read_text("utf-8")
    for word in ("innerHTML", "outerHTML", "insertAdjacent", "document.write", "eval", "Function(", "srcdoc", "http"):
        assert word not in text, word
