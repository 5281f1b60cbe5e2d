"""How a reader verifies the log of a page: key, button, badge and details, in a browser."""

import re
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from gzip import compress
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from reference.browser import AXE, CHROMIUM, OpenPage, opened
from reference.forgery import edit, flight, read, signed, write
from reference.long_log import RECORDS, long_log
from reference.verifiers import ROOT_KEY
from reference.verify_page import page
from rtshcua.ground.flight.embedding import MOST_OCTETS, embed, redact
from rtshcua.wire.keys import Duty
from virtual import case

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]

Show = Callable[..., AbstractContextManager[OpenPage]]


@pytest.fixture
def show(browser: Browser, tmp_path: Path) -> Show:
    """Opens the page with a log; the browser must report no errors, and request nothing."""

    @contextmanager
    def opening(
        data: bytes | str, *, redacted: bool = False, width: int = 1280, dark: bool = False
    ) -> Iterator[OpenPage]:
        file = tmp_path / "page.html"
        file.write_text(page(data if isinstance(data, str) else embed(data), redacted=redacted), encoding="utf-8")
        with opened(browser, file, width=width, dark=dark) as found:
            yield found
            assert found.errors == []
            assert found.requests == [file.as_uri()]

    return opening


def verdict(shown: OpenPage, key: str | None = ROOT_KEY.hex()) -> tuple[str, str]:
    """The badge and the details after a click on the button."""
    if key is not None:
        shown.page.fill("#pinned-key", key)
    shown.page.click("#verify")
    shown.page.wait_for_selector("#badge:not(.checking)")
    badge = shown.page.locator("#badge")
    assert badge.get_attribute("class") == badge.inner_text()
    return badge.inner_text(), shown.page.inner_text("#verification")


CLOSED = b"".join(flight())


def test_page_begins_unverified_and_is_verified_on_demand(show: Show) -> None:
    with show(CLOSED) as shown:
        assert shown.page.inner_text("#badge") == "unverified"
        assert shown.page.inner_text("#verification") == ""
        word, details = verdict(shown)
        assert word == "verified"
        assert f"all {len(flight())} records" in details
        assert ROOT_KEY.hex() in details
        assert "A key from the same source as this page proves nothing" in details
        assert "Not shown:" in details


@pytest.mark.parametrize(
    "key",
    [
        case.KEYS[Duty.ROOT].kid.hex(), ROOT_KEY.hex().upper(), ROOT_KEY.hex(":"), f"  {ROOT_KEY.hex(' ', 4)}\t",
    ],
)  # fmt: skip
def test_key_may_be_written_in_several_ways(show: Show, key: str) -> None:
    with show(CLOSED) as shown:
        assert verdict(shown, key)[0] == "verified"


@pytest.mark.parametrize("key", ["", "12", "x" * 64, ROOT_KEY.hex()[:-1], ROOT_KEY.hex() + "00", "<b>" + "0" * 61])
def test_what_is_no_key_is_refused(show: Show, key: str) -> None:
    with show(CLOSED) as shown:
        word, details = verdict(shown, key)
        assert word == "unverified"
        assert "Enter the operator's root key" in details
        assert shown.page.get_attribute("#pinned-key", "aria-invalid") == "true"
        assert verdict(shown)[0] == "verified"
        assert shown.page.get_attribute("#pinned-key", "aria-invalid") == "false"


def test_verdict_is_withdrawn_when_the_key_changes(show: Show) -> None:
    with show(CLOSED) as shown:
        assert verdict(shown)[0] == "verified"
        shown.page.type("#pinned-key", "0")
        assert shown.page.inner_text("#badge") == "unverified"
        assert shown.page.inner_text("#verification") == ""
        word, details = verdict(shown, "00" * 32)
        assert word == "failed"
        assert "Record 0 (line 1)" in details
        assert "trust/root-unknown-key" in details


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (case.root()[1], "the root key of the trust root in given"),
        (ROOT_KEY.hex().encode() + b"\n", "the key in given"),
        (case.root()[1][:-1], "neither a root key in hexadecimal nor a valid trust root"),
        (b"duty: root", "neither a root key"),
        (bytes(3 << 20), "neither a root key"),
    ],
)
@pytest.mark.parametrize("way", ["chosen", "dropped"])
def test_key_may_come_from_a_file(show: Show, content: bytes, said: str, way: str, tmp_path: Path) -> None:
    file = tmp_path / "given"
    file.write_bytes(content)
    with show(CLOSED) as shown:
        if way == "chosen":
            shown.page.set_input_files("#pinned-file", file)
        else:
            given = shown.page.evaluate_handle(
                """text => {
                const data = new DataTransfer(), octets = Uint8Array.from(atob(text), each => each.charCodeAt(0));
                data.items.add(new File([octets], "given")); return data; }""",
                b64encode(content).decode(),
            )
            shown.page.dispatch_event("#pinned-key", "drop", {"dataTransfer": given})
        shown.page.wait_for_selector("#verification p")
        assert said in shown.page.inner_text("#verification")
        if "neither" in said:
            assert shown.page.input_value("#pinned-key") == ""
        else:
            assert "proves nothing" in shown.page.inner_text("#verification")
            word, details = verdict(shown, None)
            assert (word, said in details) == ("verified", True)


def test_incomplete_log(show: Show) -> None:
    with show(b"".join(flight()[:-1])) as shown:
        word, details = verdict(shown)
        assert word == "incomplete"
        assert "without its signed close" in details


def test_failed_log_names_its_record(show: Show) -> None:
    with show(CLOSED.replace(b"noted", b"notes")) as shown:
        word, details = verdict(shown)
        assert word == "failed"
        assert "Record 1 (line 2)" in details
        assert "chain/broken" in details
        assert "Shown:" not in details.replace("Not shown:", "")


def test_redacted_log_needs_no_key_and_is_never_verified(show: Show) -> None:
    data = redact(flight(), lambda line: read(line)["type"] in ("genesis", "effect"), checkpoints=True)
    for key, said in (("", "No key was given"), (ROOT_KEY.hex(), "the pinned key signed the trust root")):
        with show(data, redacted=True) as shown:
            word, details = verdict(shown, key)
            assert word == "redacted"
            assert said in details
            assert "this is a redacted picture, not a record; ask for the log" in details


# ------------------------------------------------------------------------------------------------ hostile input


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "cannot be decompressed"),
        ("%", "not base64"),
        (embed(CLOSED)[:-8], "cannot be decompressed"),
        (embed(CLOSED).replace("A", "B", 1), "cannot be decompressed"),
        (embed(CLOSED)[:2000] + "AAAA" + embed(CLOSED)[2004:], "cannot be decompressed"),
        (b64encode(b64decode(embed(CLOSED)) + b"x").decode(), "cannot be decompressed"),
        (b64encode(compress(bytes(MOST_OCTETS + 1))).decode(), f"more than {MOST_OCTETS} octets"),
    ],
)
def test_changed_embedding_fails(show: Show, text: str, why: str) -> None:
    with show(text) as shown:
        word, details = verdict(shown)
        assert word == "failed"
        assert why in details


def test_texts_of_a_log_stay_text(show: Show) -> None:
    hostile = "</script><img src=x onerror=alert(1)><b>\u202e\u2066dorc\u200b\x07\"'&amp;" + "long" * 2_000
    genesis = read(flight()[0]) | {"mission": hostile, "vehicle": hostile}
    lines = signed([write(genesis), *flight()[1:]])
    with show(b"".join(lines), width=390) as shown:
        word, details = verdict(shown)
        assert word == "failed"
        assert "</script><img src=x" in details
        assert not re.search("[\u202e\u2066\u200b\x07]", details)
        assert "\\u{202e}" in details
        assert shown.page.locator("#verification img, #verification b").count() == 0
        assert shown.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_newlines_alone_fail_at_once(show: Show) -> None:
    with show(b"\n" * 50_000_000) as shown:
        assert verdict(shown)[0] == "failed"


def test_page_stays_responsive_with_a_log_of_an_hour(show: Show) -> None:
    with show(long_log()) as shown:
        shown.page.evaluate("globalThis.ticks = 0; setInterval(() => globalThis.ticks += 1, 10)")
        word, details = verdict(shown)
        assert word == "verified"
        assert f"all {long_log().count(bytes([10]))} records" in details
        assert long_log().count(b"\n") >= RECORDS
        assert shown.page.evaluate("globalThis.ticks") > 5


# ------------------------------------------------------------------------------------------------ accessibility


@pytest.mark.skipif(not AXE.exists(), reason="`.make/clients` did not install axe-core")
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [390, 1280])
def test_page_is_accessible(show: Show, width: int, dark: bool) -> None:
    for data, key, word in (
        (CLOSED, ROOT_KEY.hex(), "verified"),
        (CLOSED[:-700], ROOT_KEY.hex(), "incomplete"),
        (CLOSED, "", "unverified"),
    ):
        with show(data, width=width, dark=dark) as shown:
            assert shown.axe() == []
            assert verdict(shown, key)[0] == word
            assert shown.axe() == []
            assert shown.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_button_works_by_keyboard(show: Show) -> None:
    with show(CLOSED) as shown:
        shown.page.focus("#pinned-key")
        shown.page.keyboard.type(ROOT_KEY.hex())
        shown.page.keyboard.press("Tab")
        shown.page.keyboard.press("Tab")
        shown.page.keyboard.press("Enter")
        shown.page.wait_for_selector("#badge.verified")


#: browsers whose Ed25519 is missing, or has another rule than docs/log-format.md
OTHER_BROWSERS = {
    "without Ed25519": "crypto.subtle.importKey = () => Promise.reject(new DOMException('', 'NotSupportedError'))",
    "with the cofactor": "crypto.subtle.verify = () => Promise.resolve(true)",
    "refuses everything": "crypto.subtle.verify = () => Promise.resolve(false)",
}


@pytest.mark.parametrize("name", OTHER_BROWSERS)
def test_library_verifies_where_the_browser_does_not(browser: Browser, tmp_path: Path, name: str) -> None:
    forged = b"".join(_with_signature_changed())
    for data, expected in ((CLOSED, "verified"), (forged, "failed")):
        file = tmp_path / "page.html"
        file.write_text(page(embed(data)), encoding="utf-8")
        with opened(browser, file, before=OTHER_BROWSERS[name]) as shown:
            word, details = verdict(shown)
            assert word == expected
            assert ("seal/signature" in details) == (expected == "failed")


def _with_signature_changed() -> list[bytes]:
    lines = list(flight())
    checkpoint = read(lines[7])["checkpoint"]
    lines[7] = edit(lines[7], checkpoint=checkpoint[:-20] + ("A" if checkpoint[-20] != "A" else "B") + checkpoint[-19:])
    return lines


def test_page_says_where_it_cannot_verify(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text(page(embed(CLOSED)), encoding="utf-8")
    with opened(browser, file, before="Object.defineProperty(crypto, 'subtle', { value: undefined })") as shown:
        word, details = verdict(shown)
        assert word == "unverified"
        assert "open the page from a file or over https" in details
