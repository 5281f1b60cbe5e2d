"""A redacted picture of a flight with documents of persons: an approval, a replaced mission, a recall."""

import json
from pathlib import Path

import pytest

from reference.documents import approval, hand, low, recall, replacement
from reference.flat_case import S
from reference.world import APPROVAL_KEY, ROOT_KEY, TICK, Run
from rtshcua.app.flights.flight_report import FlightReportRequest, ReportedFlight, flight_report
from rtshcua.app.flights.redaction import REDACTABLE
from rtshcua.app.pin import Pin
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.embedding import extract
from rtshcua.ground.flight.flight_content import as_plain
from rtshcua.ground.flight.flight_page import page
from virtual.flight_reports import MADE_US


@pytest.fixture(scope="module")
def signed_for(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Approved, then replaced, then recalled on the way home."""
    run = Run(low()).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    assert hand(run, replacement(run.loaded)) == "accepted"
    run.until_flies("return_home")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    for _ in range(S // TICK):
        run.clock.advance(TICK)
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    path = tmp_path_factory.mktemp("documents") / "log.jsonl"
    path.write_bytes(b"".join([*run.lines, close]))
    return path


def reported(log: Path, *removed: str) -> ReportedFlight:
    pin = Pin(ROOT_KEY.public, "the root of the world")
    found = flight_report(FlightReportRequest(log, pin, (), MADE_US, removed))
    assert isinstance(found, ReportedFlight), found
    return found


@pytest.mark.parametrize("removed", [("names",), REDACTABLE])
def test_persons_and_their_keys_are_gone(removed: tuple[str, ...], signed_for: Path) -> None:
    whole, found = reported(signed_for), reported(signed_for, *removed)
    kid = APPROVAL_KEY.kid.hex()
    assert {word for word in ("ada", "supervisor", kid) if word in page(whole.report)} == {"ada", "supervisor", kid}
    assert found.redaction is not None
    text = page(found.report.without_log())
    assert found.redaction.left(page(found.report)) is None
    values = json.dumps(as_plain(found.report.without_log())) + extract(found.report.log).decode()
    for gone in (" ada", "supervisor", kid, "malformed"):
        assert gone not in values
        assert gone not in text.partition("<main")[2].partition("<script")[0]
    assert "by signature: step 3" in found.report.summary[1].answer
    assert len(found.report.timeline) == len(whole.report.timeline)
    for left in ("Ada", f"key {kid}", "SUPERVISOR"):
        assert isinstance(found.redaction.left(page(found.report).replace("<main", f"<p>{left}</p><main")), Refusal)
