"""Hostile texts in a report: what an agent, a vehicle or a source wrote is text, and never part of the page."""

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.forgery import edit, signed
from reference.html_outline import Outline
from rtshcua.ground.flight.flight_page import page
from rtshcua.ground.flight.logbook_page import LogbookEntry, logbook_page
from virtual import case, flight_reports, run_folder
from virtual.flight_reports import report_of

SCRIPT = "</script><script>alert(1)</script>"
HOSTILE = [
    SCRIPT,
    "<img src=x onerror=alert(1)>",
    '"><svg onload=alert(1)>',
    "`</code><script>alert(1)</script>`",
    "<!--",
    "]]><script>",
    "{{ 7 * 7 }}{% include 'x' %}",
    "\u202egnp.exe\u2066",
    "a\u0000b\u001b[31m",
    "&lt;script&gt;",
    "javascript:alert(1)",
]


def tags(text: str) -> list[str]:
    return [name for name, _ in Outline(text).elements]


@pytest.fixture(scope="module")
def harmless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flight_reports.completed(tmp_path_factory.mktemp("harmless") / "run")


def changed(run: Path, at: Path, text: str) -> Path:
    """The same flight, whose effects all have this detail, and whose ending is this text."""
    lines = (run / "log.jsonl").read_bytes().splitlines(keepends=True)
    hostile = [edit(line, detail=text) if b'"type":"effect"' in line else line for line in lines[:-1]]
    (at / "log.jsonl").write_bytes(b"".join(signed([*hostile, edit(lines[-1], ending=text)])))
    return at


@pytest.mark.parametrize("text", HOSTILE)
def test_details_and_endings_are_text(harmless: Path, tmp_path: Path, text: str) -> None:
    report = report_of(changed(harmless, tmp_path, text)).report
    made = page(report)
    plain = page(report_of(harmless).report)
    assert {"img", "iframe", "object", "embed", "form", "base"}.isdisjoint(tags(made))
    assert tags(made).count("script") <= tags(plain).count("script")
    assert not Outline(made).wrong
    attributes = [name for _, each in Outline(made).elements for name in each]
    assert [name for name in attributes if name.startswith("on")] == []
    assert "\u202e" not in made
    assert "\x1b" not in made
    assert logbook_page([LogbookEntry("a.html", report)], "now", "us").count("<script") == 1


def test_intent_and_proposer_are_text(tmp_path: Path) -> None:
    text = " ".join(HOSTILE)
    mission = replace(case.mission(case.short_steps()[:1]), intent=text, proposer=text)
    run = run_folder.folder(tmp_path / "run", run_folder.fly(mission, case.simulated("px4")))
    made = page(report_of(run).report)
    assert {"img", "iframe"}.isdisjoint(tags(made))
    assert not Outline(made).wrong
    data = made.partition('id="flight-data">')[2].partition("</script>")[0]
    assert json.loads(data)["signals"]


def test_policy_names_every_script_by_its_digest(harmless: Path) -> None:
    made = page(report_of(harmless).report)
    policy = made.partition('Content-Security-Policy" content="')[2].partition('"')[0]
    assert "unsafe" not in policy
    assert "http" not in policy
    assert policy.startswith("default-src 'none'")
