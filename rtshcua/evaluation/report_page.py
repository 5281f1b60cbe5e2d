"""Renders the report of the evaluation as one self-contained HTML page: no script, no other file, no network."""

from rtshcua.evaluation.published import CHOICES
from rtshcua.evaluation.report_parts import EvaluationReport, ReportChart
from rtshcua.ground.drawing.bar_chart import BarChart
from rtshcua.ground.drawing.html import rendered


def render(report: EvaluationReport) -> str:
    """Return the HTML page; the same bytes for the same report."""
    return rendered("rtshcua.evaluation", "evaluation.html", report=report, choices=CHOICES, template_of=_template)


def _template(part: object) -> str | None:
    """The template of a chart; None for a table."""
    if not isinstance(part, ReportChart):
        return None
    return "bar_chart.svg" if isinstance(part.chart, BarChart) else "stacked_chart.svg"
