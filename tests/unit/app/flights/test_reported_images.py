"""Images on the page of a flight: on the map, in a table, and what a redacted page keeps of them."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from reference.forgery import read
from reference.imaged_flight import MISSING, flown, run_in
from rtshcua.app.fly.narrator import ImageCounts
from rtshcua.app.fly.story import Summary
from rtshcua.front.cli.render.live.lines import ending
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flight_page import page
from virtual import case
from virtual.flight_reports import report_of, told

HOME = case.policy().projection


@pytest.fixture(scope="module")
def imaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_in(tmp_path_factory.mktemp("imaged") / "run")


@pytest.fixture(scope="module")
def report(imaged: Path) -> FlightReport:
    return report_of(imaged).report


def details() -> list[dict[str, Any]]:
    records = [read(line) for line in flown()]
    return [json.loads(each["detail"]) for each in records if each.get("event") == "image"]


def test_every_image_is_in_the_report_with_its_record(report: FlightReport) -> None:
    assert [each.number for each in report.images] == [each["index"] for each in details()]
    first = next(each for each in report.images if each.number == 0)
    record = read(flown()[first.seq])
    assert json.loads(record["detail"])["index"] == 0
    assert first.above_home == json.loads(record["detail"])["above_home_mm"]
    assert first.where is not None
    assert first.accuracy == 900
    assert not first.of_vehicle
    told = {each.told for each in report.gaps if each.what == "images"}
    failed = sum(each["index"] is None for each in details())
    assert told == {f"1 of camera 100: {MISSING}", f"{failed} pictures failed, as the camera reported"}
    assert any("each recorded once" in each for each in report.proven)
    assert any("that an image exists" in each for each in report.unproven)


def test_images_are_near_the_track(report: FlightReport) -> None:
    assert report.track is not None
    for image in report.images:
        assert image.where is not None
        x, y = image.where
        assert min((x - a) ** 2 + (y - b) ** 2 for a, b in report.track.places) < 1_500**2


def test_the_page_has_a_mark_and_a_row_for_each_image(report: FlightReport) -> None:
    text = page(report)
    assert text.count('<circle class="image"') == len(report.images)
    assert f"{len(report.images)} images, one by one" in text
    assert text.count("(requested again)") == sum(each.asked > 0 for each in report.images)
    assert '<a href="#images">The images</a>' in text
    assert "images" not in page(report._replace(images=(), gaps=(), proven=(), unproven=(), records=())).lower()


@pytest.mark.parametrize("removed", [("position",), ("names",), ("position", "names")])
def test_a_redacted_page_has_no_place_of_an_image(imaged: Path, removed: tuple[str, ...]) -> None:
    report = report_of(imaged, *removed).report
    text = re.sub(
        r"<(style|script)(?! type=.application/json).*?</\1>", "", page(report.without_log()), flags=re.DOTALL
    )
    assert len(report.images) == len(details())
    placed = "position" not in removed
    assert all((each.where is not None) == placed for each in report.images)
    assert all((each.heading is not None) == placed for each in report.images)
    assert ('<circle class="image"' in text) == placed
    assert "IMG_" not in text
    for each in details() if not placed else ():
        assert str(each["latitude"]) not in text
        assert f"{each['latitude'] / 1e7:.7f}" not in text


def test_images_are_counted_for_the_summary() -> None:
    counts = ImageCounts()
    for line in flown():
        record = read(line)
        if record["type"] == "effect":
            counts.add(record["event"], record["detail"])
    taken = sum(each["index"] is not None for each in details())
    assert (counts.taken, counts.failed, counts.missing) == (taken, len(details()) - taken, 1)
    counts.add("image", "nonsense")
    counts.add("images-missing", "{}")
    counts.add("payload.failed", "2000 to 1, 7: unsupported")
    assert (counts.taken, counts.missing, counts.commands_failed) == (taken, 1, 1)


def test_the_page_names_commands_to_payload_that_failed(tmp_path: Path) -> None:
    lines = [line.replace(b'"event":"image"', b'"event":"payload.failed"') for line in flown()]
    gaps = {each.told for each in told(lines, tmp_path).gaps if each.what == "payload"}
    assert gaps == {f"{len(details())} commands to cameras or other payload failed"}


def test_the_summary_of_a_run_names_images_only_where_there_are_some() -> None:
    summary = Summary(
        mission="m", policy="p@1", vehicle="v", flavour="px4", mode="software", ending="completed", exit_code=0,
        steps=1, steps_done=1, outcomes={}, flight_us=1, records=1, whole=True, folder="f", log="l", next="n",
        images_taken=34, images_missing=1, images_failed=2, payload_failed=173,
    )  # fmt: skip
    assert "  payload  173 commands failed" in list(ending(summary))
    assert "  images   34 recorded, 1 missing, 2 pictures failed" in list(ending(summary))
    none = Summary(
        mission="m", policy="p@1", vehicle="v", flavour="px4", mode="software", ending="completed", exit_code=0,
        steps=1, steps_done=1, outcomes={}, flight_us=1, records=1, whole=True, folder="f", log="l", next="n",
    )  # fmt: skip
    assert not any("images" in line or "payload" in line for line in ending(none))
