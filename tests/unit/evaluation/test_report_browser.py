"""The report in a browser, if one is installed: it fits, its labels do not overlap, and the browser reports nothing."""

from pathlib import Path

import pytest

from reference.browser import CHROMIUM, dumped, layout
from reference.evaluation_results import COMPUTER, campaign, everything
from rtshcua.evaluation import report_page
from rtshcua.evaluation.report_content import evaluation_report

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]


@pytest.fixture(scope="module")
def text() -> str:
    return report_page.render(evaluation_report(everything(runs=1), COMPUTER, "now", (), (campaign(),)))


@pytest.mark.parametrize("width", [390, 800, 1400])
def test_page_fits_and_labels_do_not_overlap(tmp_path: Path, text: str, width: int) -> None:
    measured = layout(tmp_path, text, width)
    assert measured["scroll"] <= measured["inner"] == width
    assert (measured["wide"], measured["thin"], measured["over"]) == ([], [], [])


def test_browser_reports_no_errors(tmp_path: Path, text: str) -> None:
    assert "CONSOLE" not in dumped(tmp_path, text, 1200)[1]
