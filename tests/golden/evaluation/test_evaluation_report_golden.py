"""The Markdown of the report of a few results.

`UPDATE_GOLDENS=1 pytest tests/golden/evaluation` writes it anew; read the difference before you keep it.
"""

import os
from pathlib import Path

from reference.evaluation_results import COMPUTER, campaign, case_flights, checks, flights, sizes, timings
from rtshcua.evaluation import report_text
from rtshcua.evaluation.design import POINTS
from rtshcua.evaluation.report_content import evaluation_report
from rtshcua.evaluation.results import UnavailableMode

GOLDEN = Path(__file__).with_name("evaluation_report.md")


def test_markdown_of_a_few_results_matches_the_golden() -> None:
    modes, points = ["none", "software", "process"], POINTS[::7]
    results = [
        *flights(modes, points, runs=2),
        *checks(modes, points, runs=1),
        *case_flights(),
        *timings(2),
        *sizes(),
        UnavailableMode(mode="optee", why="qemu-system-aarch64 is not installed"),
    ]
    report = evaluation_report(results, COMPUTER, "2026-11-29 00:00 UTC", (("runs", "2"),), (campaign(),))
    text = report_text.render(report)
    if os.environ.get("UPDATE_GOLDENS"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")
