"""The report in a browser: it fits, in light and dark, has one cursor for all drawings, and verifies itself."""

import random
import time
from collections.abc import Iterator
from math import asinh, pi, radians, tan
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from reference.browser import AXE, CHROMIUM, OpenPage, layout, opened, running
from rtshcua.app.flights.flight_report import LiveFlight
from rtshcua.front.web.page_server import PageServer, served
from rtshcua.ground.flight.embedding import embed, extract
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flight_page import page
from rtshcua.ground.flight.logbook_page import LogbookEntry, logbook_page
from virtual.flight_reports import MADE_US, PIN, report_of

WIDTHS = [390, 820, 1280]
NEEDS_AXE = pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed")

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with running() as started:
        yield started


@pytest.fixture(scope="module")
def made(turned: Path) -> str:
    return page(report_of(turned).report)


def file_of(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "page.html"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_and_labels_do_not_overlap(tmp_path: Path, made: str, width: int) -> None:
    measured = layout(tmp_path, made, width)
    assert measured["scroll"] <= measured["inner"] == width
    assert (measured["wide"], measured["thin"]) == ([], [])


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", WIDTHS)
@NEEDS_AXE
def test_page_is_accessible_and_fetches_nothing(
    browser: Browser, tmp_path: Path, made: str, width: int, *, dark: bool
) -> None:
    file = file_of(tmp_path, made)
    with opened(browser, file, width=width, dark=dark) as shown:
        for each in shown.page.locator("details").all():
            each.evaluate("each => each.open = true")
        assert shown.axe() == []
        assert shown.errors == []
        assert shown.requests == [file.as_uri()]


@NEEDS_AXE
def test_logbook_is_accessible_and_sorts(browser: Browser, tmp_path: Path, completed: Path, turned: Path) -> None:
    whole, early = (report_of(run).report for run in (completed, turned))
    lasted, highest = whole.lasted_us, whole.highest or 0
    flights = {  # each column has another order
        "a": whole._replace(lasted_us=lasted * 2, highest=highest, ending="completed"),
        "b": early._replace(lasted_us=lasted, highest=highest * 3, ending="interrupted"),
        "c": early._replace(lasted_us=lasted * 3, highest=highest * 2, ending="aborted"),
    }
    by_time, by_height, by_ending = ["b", "a", "c"], ["a", "c", "b"], ["c", "a", "b"]
    entries = [LogbookEntry(name, each) for name, each in flights.items()]
    with opened(browser, file_of(tmp_path, logbook_page(entries, "now", "us"))) as shown:
        assert shown.axe() == []

        def links() -> list[str]:
            return [each.get_attribute("href") or "" for each in shown.page.locator("tbody a").all()]

        def column(number: int) -> list[str]:
            return shown.page.locator(f"tbody td:nth-child({number})").all_inner_texts()

        for number, name, up in ((4, "Lasted", by_time), (6, "Highest", by_height), (8, "Ended", by_ending)):
            shown.page.get_by_role("button", name=name).click()
            assert links() == up, name
            shown.page.get_by_role("button", name=name).press("Enter")
            assert links() == up[::-1], name
            assert shown.page.locator("th[aria-sort]").inner_text() == name
            assert len(set(column(number))) > 1
        assert shown.errors == []


def told(shown: OpenPage) -> str:
    return shown.page.locator("#cursor-told").inner_text()


def test_one_cursor_for_map_heights_timeline_and_signals(browser: Browser, tmp_path: Path, turned: Path) -> None:
    report = report_of(turned).report
    with opened(browser, file_of(tmp_path, page(report))) as shown:
        lines, here = shown.page.locator(".time-line"), shown.page.locator(".here")
        assert lines.count() == 2 + len(
            [each for each in report.signals if any(v is not None for _, v in each.series.points)]
        )
        slider = shown.page.get_by_label("Time", exact=True)
        slider.focus()
        slider.press("End")
        end, place = told(shown), here.get_attribute("cx")
        slider.press("Home")
        for _ in range(150):
            slider.press("ArrowRight")
        assert told(shown) != end
        assert here.get_attribute("cx") != place
        assert "m above home" in told(shown)
        assert "battery" in told(shown)
        # the same time by the pointer, in any drawing
        lanes = shown.page.locator("svg.timed").nth(1)
        lanes.scroll_into_view_if_needed()
        box = lanes.bounding_box()
        assert box is not None
        shown.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        halfway = told(shown)
        span = [float(each) for each in (lanes.get_attribute("data-span") or "").split()]
        expected = span[2] + (880 / 2 - span[0]) / (span[1] - span[0]) * (span[3] - span[2])
        minutes, seconds = halfway.partition(" ")[0].split(":")
        assert abs(60 * int(minutes) + float(seconds) - expected / 1_000) < 0.5
        assert shown.errors == []


def test_tiles_are_fetched_when_asked_for_and_lie_where_they_belong(
    browser: Browser, tmp_path: Path, turned: Path
) -> None:
    report = report_of(turned).report
    text = page(report, tiles="https://tiles.example/{z}/{x}/{y}.png")
    with opened(browser, file_of(tmp_path, text)) as shown:
        shown.page.route("https://tiles.example/**", lambda route: route.fulfill(status=200, body=b""))
        assert len(shown.requests) == 1
        assert shown.page.locator("svg image").count() == 0
        shown.page.get_by_label("Fetch map tiles from https://tiles.example").check()
        images = shown.page.locator("svg image")
        assert 1 <= images.count() <= 64
        fetched = 1 + images.count()
        deadline_s = time.monotonic() + 10
        while len(shown.requests) < fetched and time.monotonic() < deadline_s:
            shown.page.wait_for_timeout(20)
        assert len(shown.requests) == fetched
        # the tile that has home in it, by the definition of Web Mercator
        assert report.projection is not None
        latitude, longitude = report.projection.latitude / 1e7, report.projection.longitude / 1e7
        z = int((images.first.get_attribute("href") or "").split("/")[3])
        column = int((longitude + 180) / 360 * 2**z)
        row = int((1 - asinh(tan(radians(latitude))) / pi) / 2 * 2**z)
        tile = shown.page.locator(f'svg image[href="https://tiles.example/{z}/{column}/{row}.png"]')
        x, y, width, height = (float(tile.get_attribute(name) or "") for name in ("x", "y", "width", "height"))
        share = (longitude + 180) / 360 * 2**z - column, (1 - asinh(tan(radians(latitude))) / pi) / 2 * 2**z - row
        cross = shown.page.locator("path.home").get_attribute("d") or ""
        home = [float(each) for each in cross[1 : cross.index("m")].split()]
        assert abs(x + share[0] * width - home[0]) < 0.5
        assert abs(y + share[1] * height - home[1]) < 0.5
        shown.page.get_by_label("Fetch map tiles").uncheck()
        assert images.count() == 0


def test_link_to_a_record_opens_it(browser: Browser, tmp_path: Path, made: str) -> None:
    with opened(browser, file_of(tmp_path, made)) as shown:
        link = shown.page.locator("a.record").last
        name = (link.get_attribute("href") or "")[1:]
        link.click()
        assert shown.page.locator(f"#{name}").is_visible()


def test_page_without_scripts_has_everything_but_the_cursor(browser: Browser, tmp_path: Path, made: str) -> None:
    context = browser.new_context(java_script_enabled=False)
    shown = context.new_page()
    shown.goto(file_of(tmp_path, made).as_uri())
    assert shown.locator("svg").count() >= 4
    assert not shown.locator("#cursor-bar").is_visible()
    assert shown.get_by_text("rtshcua verify-log", exact=False).count()
    context.close()


def test_printed_page_has_the_drawings(browser: Browser, tmp_path: Path, made: str) -> None:
    with opened(browser, file_of(tmp_path, made)) as shown:
        shown.page.emulate_media(media="print")
        assert shown.page.locator("svg").first.is_visible()
        assert not shown.page.locator("#cursor-bar").is_visible()
        assert len(shown.page.pdf()) > 20_000


def verdict(shown: OpenPage) -> str:
    shown.page.fill("#pinned-key", PIN.key.hex())
    shown.page.click("#verify")
    shown.page.wait_for_selector("#badge:not(.checking)")
    return shown.page.locator("#badge").get_attribute("class") or ""


def test_log_inside_is_verified_and_mutants_are_red(browser: Browser, tmp_path: Path, turned: Path) -> None:
    report = report_of(turned).report
    with opened(browser, file_of(tmp_path, page(report))) as shown:
        assert shown.page.locator("#badge").get_attribute("class") == "unverified"
        assert verdict(shown) == "verified"
    log, choice = extract(report.log), random.Random(7)
    lines = log.splitlines(keepends=True)
    mutants = [
        b"".join(lines[:5] + lines[6:]),
        b"".join([*lines[:5], lines[6], lines[5], *lines[7:]]),
        b"".join([*lines[:5], lines[5], *lines[5:]]),
        b"".join(lines) + lines[-1],
        b"".join(lines[1:]),
    ]
    while len(mutants) < 20:
        at = choice.randrange(len(log))
        octet = bytes([choice.choice([each for each in range(32, 127) if each != log[at]])])
        mutants.append(log[:at] + octet + log[at + 1 :])
    for mutant in mutants:
        with opened(browser, file_of(tmp_path, page(report._replace(log=embed(mutant))))) as shown:
            assert verdict(shown) == "failed", mutant
            assert shown.errors == []


def test_changed_letter_of_the_page_is_red(browser: Browser, tmp_path: Path, made: str, turned: Path) -> None:
    log = report_of(turned).report.log
    middle = len(log) // 2
    other = "A" if log[middle] != "A" else "B"
    with opened(browser, file_of(tmp_path, made.replace(log, log[:middle] + other + log[middle + 1 :]))) as shown:
        assert verdict(shown) == "failed"


def test_redacted_page_is_never_verified(browser: Browser, tmp_path: Path, turned: Path) -> None:
    for removed in (("position",), ("names",), ("position", "names")):
        report = report_of(turned, *removed).report
        with opened(browser, file_of(tmp_path, page(report))) as shown:
            assert verdict(shown) == "redacted"
            assert "not a record" in shown.page.locator("#verification").inner_text()
            assert shown.errors == []


def test_page_grows_while_the_flight_is_recorded(browser: Browser, tmp_path: Path, turned: Path) -> None:
    data = (turned / "log.jsonl").read_bytes()
    lines = data.splitlines(keepends=True)
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(lines[:12]))
    live = LiveFlight(log, ())

    def current() -> object:
        live.update()
        found = live.report(MADE_US)
        assert isinstance(found, FlightReport)
        return served(page(report_of(tmp_path).report) if live.closed else page(found, live=True))

    with PageServer(current) as server:  # type: ignore[arg-type]
        shown = browser.new_page()
        errors: list[str] = []
        shown.on("console", lambda said: errors.append(said.text) if said.type in ("warning", "error") else None)
        shown.goto(server.address)
        rows = shown.locator("section[aria-labelledby=records] tbody tr, [id^=record-]")
        before = rows.count()
        expect(shown.locator(".said")).to_have_text("Still flying")
        log.write_bytes(b"".join(lines[:20]))
        expect(shown.locator("#record-19, #record-18").first).to_be_attached(timeout=10_000)
        assert rows.count() > before
        log.write_bytes(data)
        expect(shown.locator(".said")).to_have_text("Verified", timeout=10_000)
        assert shown.locator("#growing-note").count() == 0
        assert errors == []
        shown.close()
