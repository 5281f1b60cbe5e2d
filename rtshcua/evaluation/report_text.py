"""Renders the report of the evaluation as Markdown. The charts are in the HTML page; their figures are in tables."""

import re
from collections.abc import Iterable, Iterator
from typing import Final

from rtshcua.diagnostics.excerpt import visible
from rtshcua.evaluation.published import CHOICES
from rtshcua.evaluation.report_parts import EvaluationReport, ReportCell, ReportLinks, ReportSection, ReportTable

#: what Markdown reads as markup in texts of others
_SPECIAL: Final = re.compile(r"([\\*_<>|#&~]|\](?=[(\[]))")

#: the kinds of cells that stand out
_BOLD: Final = ("compared", "missed")


def render(report: EvaluationReport) -> str:
    """Return the Markdown text; the same bytes for the same report."""
    lines = [f"# {_text(report.title)}", "", _text(report.verdict), "", f"*{_text(report.made)}*", "", *_marks()]
    for section in report.sections:
        lines += _section(section)
    lines += choice_lines()
    return "\n".join(lines) + "\n"


def _marks() -> tuple[str, ...]:
    return (
        "[P]: stated in the paper. [D]: derived from stated figures. [?]: the paper does not say; a choice of ours, at "
        "the end.",
        "",
    )


def _section(section: ReportSection) -> Iterator[str]:
    yield from (f"## {_text(section.title)}", "")
    for each in section.lead:
        yield from (_text(each), "")
    for part in section.parts:
        if isinstance(part, ReportTable):
            yield from _table(part)


def _table(table: ReportTable) -> Iterator[str]:
    """A table with its caption, notes and choices; nothing but those where it has no rows."""
    yield from (f"**{_text(table.caption)}**", "")
    if table.rows:
        yield _row(_text(column.name) for column in table.columns)
        yield "|" + "|".join("---:" if column.number else "---" for column in table.columns) + "|"
        for row in table.rows:
            yield _row(map(_cell, row))
        yield ""
    for note in table.notes:
        yield from (_text(note), "")
    if table.choices:
        yield from (f"[?] {', '.join(table.choices)}", "")


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(each or " " for each in cells) + " |"


def _cell(cell: str | ReportCell | ReportLinks) -> str:
    if isinstance(cell, ReportLinks):
        return ", ".join(f"<{address}>" for address in cell.addresses)
    if isinstance(cell, ReportCell):
        return f"**{_text(cell.text)}**" if cell.kind in _BOLD else _text(cell.text)
    return _text(cell)


def choice_lines() -> list[str]:
    """The choices of ours, as a section of Markdown; `docs/evaluation.md` has the same."""
    lines = [
        "## Choices of ours [?]",
        "",
        "| Choice | Experiments | The paper leaves open | Ours |",
        "|---|---|---|---|",
    ]
    lines += [f"| {each.anchor} | {each.experiments} | {each.open} | {each.ours} |" for each in CHOICES]
    return lines


def _text(text: str) -> str:
    """Escape a text on one line: outside of backticks what Markdown reads as markup, within them only the bar."""
    parts = visible(text).split("`")
    # a backtick without its pair is a letter; of several in a row Markdown makes other pairs than we
    if len(parts) % 2 == 0 or "" in parts[1:-1]:
        return _SPECIAL.sub(r"\\\1", visible(text)).replace("`", "\\`")
    return "`".join(
        part.replace("|", "\\|") if number % 2 else _SPECIAL.sub(r"\\\1", part) for number, part in enumerate(parts)
    )
