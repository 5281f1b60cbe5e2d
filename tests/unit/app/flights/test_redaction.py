"""A redacted picture: what is removed is nowhere in the page, and what is embedded has no record of it."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.forgery import edit, signed
from rtshcua.app.flights.redaction import REDACTABLE, redaction_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.merkle import MerkleTree, leaf_hash
from rtshcua.evidence.note import octets
from rtshcua.ground.flight.embedding import extract
from rtshcua.ground.flight.flight_content import FlightReport, as_plain
from rtshcua.ground.flight.flight_page import page
from virtual.flight_reports import report_of

#: a place in degrees, in every way that our texts and records write it
DEGREES = re.compile(r"\b(?:47|8)\.\d{4,}|\b47\d{7}\b|\b8\d{7}\b")


def shown(report: FlightReport) -> str:
    """All that a redacted page has: its text, and the embedded records."""
    return page(report.without_log()) + extract(report.log).decode()


@pytest.mark.parametrize("run", ["completed", "turned"])
def test_names_are_gone(run: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(run)
    whole = page(report_of(folder).report)
    names = ["quad-07", "inspect_bridge_a", "bridge_a", "openclaw", "bridge_inspection"]
    assert all(name in whole for name in names[:2])
    text = shown(report_of(folder, "names").report)
    assert [name for name in names if name in text] == []
    assert "not a record" in text


@pytest.mark.parametrize("run", ["completed", "turned"])
def test_positions_are_gone(run: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(run)
    found = report_of(folder, "position")
    assert DEGREES.search(page(report_of(folder).report)) is not None
    assert DEGREES.search(shown(found.report)) is None
    assert found.report.site.zones == ()
    assert found.report.way.steps == ()
    assert {"velocity.north", "velocity.east"}.isdisjoint(each.series.name for each in found.report.signals)


def test_heights_and_times_stay(completed: Path) -> None:
    whole, redacted = report_of(completed).report, report_of(completed, "position", "names").report
    assert redacted.highest == whole.highest
    assert [each.t_us for each in redacted.decisions] == [each.t_us for each in whole.decisions]
    assert [each.outcome for each in redacted.decisions] == [each.outcome for each in whole.decisions]
    assert whole.track is not None
    assert redacted.track is not None
    assert redacted.track.places == ()
    assert redacted.site.elevation is None
    assert [each.above_home for each in redacted.track.points] == [each.above_home for each in whole.track.points]
    data = json.loads(page(redacted).partition('id="flight-data">')[2].partition("</script>")[0])
    assert (data["track"]["x"], data["track"]["y"], data["map"], data["home"]) == ([], [], None, None)
    assert any(data["track"]["up"])


@pytest.mark.parametrize("removed", [("position",), ("names",), REDACTABLE])
def test_leaves_are_those_of_the_log(completed: Path, removed: tuple[str, ...]) -> None:
    document = json.loads(extract(report_of(completed, *removed).report.log))
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    tree = MerkleTree()
    for line, leaf in zip(lines, document["leaves"], strict=True):
        assert octets(leaf) == leaf_hash(line)
        tree.push(leaf_hash(line))
    assert octets(document["root"]) == tree.root()
    for number, text in document["lines"]:
        assert text.encode() + b"\n" == lines[number]
        assert json.loads(text)["type"] not in ("genesis", "decision")
    assert bool(document["checkpoints"]) == ("names" not in removed)


def test_page_with_something_left_is_refused(completed: Path) -> None:
    found = report_of(completed, "position", "names")
    assert found.redaction is not None
    text = page(found.report)
    assert found.redaction.left(text) is None
    for left in ("quad-07", "47.3977418", "inspect_bridge_a"):
        refused = found.redaction.left(text.replace("<main", f"<p>{left}</p><main"))
        assert isinstance(refused, Refusal)
        assert left in refused.text


def test_word_of_every_page_may_be_a_name(completed: Path, tmp_path: Path) -> None:
    genesis, *rest = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "log.jsonl").write_bytes(b"".join(signed([edit(genesis, mission="timeline"), *rest])))
    found = report_of(tmp_path, "names")
    assert found.redaction is not None
    assert found.redaction.left(page(found.report)) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [(None, ()), ("names", ("names",)), ("names,position", ("position", "names")), ("position, names", REDACTABLE)],
)
def test_what_is_named(text: str | None, expected: tuple[str, ...]) -> None:
    assert redaction_of(text) == expected


@given(st.text(max_size=20).filter(lambda text: not {each.strip() for each in text.split(",")} <= set(REDACTABLE)))
def test_anything_else_is_refused(text: str) -> None:
    found = redaction_of(text)
    assert isinstance(found, Refusal)
    assert (found.slug, found.code) == ("usage", ExitCode.USAGE)


def test_every_text_of_the_report_is_changed(completed: Path) -> None:
    def texts(value: object, take: Callable[[str], None]) -> None:
        if isinstance(value, str):
            take(value)
        elif isinstance(value, dict):
            for each in value.values():
                texts(each, take)
        elif isinstance(value, list):
            for each in value:
                texts(each, take)

    found: list[str] = []
    texts(as_plain(report_of(completed, "names").report.without_log()), found.append)
    assert [text for text in found if "quad-07" in text] == []
