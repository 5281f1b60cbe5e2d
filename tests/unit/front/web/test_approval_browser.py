"""The page for approvers in a browser, as wide as a phone: what it shows, that it rings, and that a confirmed answer is
signed by the command behind it.
"""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from reference.browser import AXE, CHROMIUM, running
from rtshcua.app.approval_desk import StepQuestion
from rtshcua.front.web.approval_server import ApprovalPage
from rtshcua.model.outcome import Outcome, Reason
from virtual.waiting_flight import Attended, WaitingFlight, desk_at, keys_and_bundles

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]
PHONE = 390
#: where pictures of the page are kept, if somebody wants to see them
SHOTS = os.environ.get("RTSHCUA_SHOTS")
#: counts the tones that the page plays
TONES = """
window.tones = 0;
const begin = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...given) { window.tones += 1; return begin.apply(this, given); };
"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with running() as started:
        yield started


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("browser")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder / "data"))
        keys_and_bundles(folder)
        yield folder


class Visit:
    """A flight, Ada's desk, and her browser on its page."""

    def __init__(self, browser: Browser, place: Path, *, dark: bool = False) -> None:
        self.flight = WaitingFlight(place, Path("low.bundle"))
        self.ada = Attended(desk_at(place))
        self.served = ApprovalPage(self.ada.desk)
        self.serves, self.scheme = True, "dark" if dark else "light"
        self.context = browser.new_context(
            viewport={"width": PHONE, "height": 844}, color_scheme="dark" if dark else "light", has_touch=True
        )
        self.context.add_init_script(TONES)
        self.errors: list[str] = []
        self.page = self.tab()

    def tab(self) -> Page:
        page = self.context.new_page()
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        return page

    def stop_serving(self) -> None:
        if self.serves:
            self.serves = False
            self.served.__exit__()

    def shot(self, name: str) -> None:
        if SHOTS is not None:
            self.page.screenshot(path=f"{SHOTS}/{name}-{self.scheme}.png", full_page=True)

    def fits(self) -> bool:
        return bool(self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"))


@pytest.fixture(params=[False, True], ids=["light", "dark"])
def visit(
    browser: Browser, made: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[Visit]:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(made / "data"))
    monkeypatch.chdir(made)
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        found = Visit(browser, Path(name) / "s", dark=request.param)
        found.served.__enter__()
        found.page.goto(found.served.address)
        yield found
        found.context.close()
        found.stop_serving()
        found.ada.end()
        found.flight.hang_up()


def test_approver_confirms_on_a_phone(visit: Visit) -> None:
    page = visit.page
    expect(page.locator("#stage")).to_contain_text("Follows the flight")
    assert page.evaluate("location.hash") == "", "the secret is out of sight"
    page.locator("#sound").click()
    expect(page.locator("#sound")).to_contain_text("on")
    before = page.evaluate("window.tones")
    assert before == 3, "it can be tried"
    visit.flight.asks()
    expect(page.locator("#what")).to_have_text("Step 3: inspect_area")
    expect(page.locator("#left")).to_contain_text("s left")
    expect(page.locator("#arguments")).to_contain_text("m from west to east")
    expect(page.locator("#arguments")).to_contain_text("from home, bearing")
    expect(page.locator("#map")).to_be_visible()
    assert page.locator("#map").evaluate("each => each.complete && each.naturalWidth") == 400
    assert page.evaluate("window.tones") == 6
    assert visit.fits()
    if AXE.is_file():
        page.evaluate(AXE.read_text(encoding="utf-8"))
        assert page.evaluate("axe.run(document).then(found => found.violations.map(each => each.id))") == []
    for name in ("approve", "refuse"):
        box = page.locator(f"#{name}").bounding_box()
        assert box is not None
        assert box["height"] >= 48
    visit.shot("question")
    page.locator("#approve").click()
    expect(page.locator("#say")).to_have_text("Sign as supervisor that step 3, inspect_area, may be flown?")
    assert visit.flight.slugs == [], "nothing is signed before it is confirmed"
    visit.shot("confirm")
    page.locator("#sign").click()
    expect(page.locator("#result")).to_contain_text("Signed and accepted")
    assert visit.flight.slugs == ["accepted"]
    expect(page.locator("#question")).to_be_hidden()
    visit.flight.decides(Outcome.ALLOW, Reason.ADMITTED)
    visit.flight.ends()
    expect(page.locator("#stage")).to_contain_text("the flight has ended")
    visit.shot("over")
    assert visit.errors == []


def test_refusal_back_and_lapse(visit: Visit) -> None:
    page = visit.page
    visit.flight.asks()
    page.locator("#refuse").click()
    expect(page.locator("#say")).to_contain_text("is refused?")
    page.locator("#back").click()
    expect(page.locator("#choose")).to_be_visible()
    page.locator("#refuse").click()
    visit.flight.decides(Outcome.DENY, Reason.APPROVAL_TIMED_OUT)
    expect(page.locator("#question")).to_be_hidden()
    expect(page.locator("#told")).to_contain_text("nobody answered in time")
    assert visit.flight.slugs == []
    visit.flight.asks()
    expect(page.locator("#choose")).to_be_visible()
    page.locator("#refuse").click()
    page.locator("#sign").click()
    expect(page.locator("#result")).to_contain_text("Signed and accepted")
    assert visit.flight.slugs == ["accepted"]


def test_question_that_changes_under_the_finger_is_not_answered(visit: Visit) -> None:
    page = visit.page
    visit.flight.asks()
    page.locator("#approve").click()
    expect(page.locator("#sign")).to_be_enabled()
    visit.flight.decides(Outcome.DENY, Reason.APPROVAL_TIMED_OUT)
    visit.ada.until("closed")
    visit.flight.asks()
    visit.ada.until("question", 2)
    page.evaluate("document.getElementById('sign').click()")  # of the question before, if it is still shown
    expect(page.locator("#choose")).to_be_visible()
    assert visit.flight.slugs == []


def test_connection_and_command_that_are_gone_are_told(visit: Visit) -> None:
    page = visit.page
    visit.flight.asks()
    expect(page.locator("#approve")).to_be_enabled()
    visit.flight.hang_up()
    expect(page.locator("#stage")).to_contain_text("connection to the flight is lost")
    visit.flight.listen()
    expect(page.locator("#stage")).to_contain_text("Follows the flight")
    visit.stop_serving()
    expect(page.locator("#stage")).to_contain_text("does not answer")
    expect(page.locator("#approve")).to_be_disabled()
    visit.shot("gone")


def test_address_opens_one_page_and_survives_a_reload(visit: Visit) -> None:
    page = visit.page
    expect(page.locator("#stage")).to_contain_text("Follows the flight")
    page.reload()
    expect(page.locator("#stage")).to_contain_text("Follows the flight")
    other = visit.tab()
    other.goto(visit.served.address)
    expect(other.locator("#stage")).to_contain_text("was used before")
    assert "end this command" in visit.ada.until("page-reused").text
    lone = visit.tab()
    lone.goto(visit.served.address.partition("#")[0])
    expect(lone.locator("#stage")).to_contain_text("Open the address")


def test_hostile_texts_run_nothing(visit: Visit) -> None:
    page = visit.page
    hostile = "<img src=x onerror='window.hit = 1'><script>window.hit = 1</script>"
    visit.flight.asks()
    visit.ada.until("question")
    desk = visit.ada.desk
    views = desk.view

    def view(shown: StepQuestion) -> dict[str, Any]:
        arguments = [{"name": hostile, "value": hostile, "where": hostile}]
        texts = dict.fromkeys(("mission", "skill", "path", "spacing", "other_path", "rule", "vehicle"), hostile)
        return views(shown) | texts | {"arguments": arguments, "number": 77}

    desk.view = view  # type: ignore[method-assign]
    desk.tell("note", hostile)
    expect(page.locator("#what")).to_contain_text("<script>")
    expect(page.locator("#told")).to_contain_text("<img")
    assert page.evaluate("window.hit") is None
    assert page.locator("main script, main img:not(#map)").count() == 0
    assert visit.fits()
    expect(page.locator("#warning")).to_be_visible()
    expect(page.locator("#approve")).to_be_disabled()
    page.locator("#other-path").check()
    expect(page.locator("#approve")).to_be_enabled()
    visit.shot("hostile")
