"""How answers of an archive are told: a table for a person, JSON or CSV for a program."""

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from enum import StrEnum

from rtshcua.app.logs import finding_code
from rtshcua.app.wording import shorten, utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.width import columns

_TIMES = frozenset(
    {"utc_us", "begun_us", "first_us", "last_us", "added_us", "checked_us", "one_begun_us", "other_begun_us"}
)
_NAMES = frozenset({"log", "one", "other", "before", "last_leaf", "missing_leaf", "after_leaf", "boot"})
_WHOLE = frozenset({"tells"})
_NAME_SHOWN = 16  # digits of a digest
_CELL = 48


class Shape(StrEnum):
    """How rows are printed."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"


def tell(names: Sequence[str], rows: Sequence[Sequence[object]], shape: Shape) -> None:
    """Prints rows on the standard output."""
    if shape is Shape.JSON:
        out_json(json.dumps([dict(zip(names, row, strict=True)) for row in rows], ensure_ascii=False, default=str))
    elif shape is Shape.CSV:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([visible(each) if isinstance(each, str) else each for each in row] for row in rows)
    else:
        _table(names, [[_cell(name, value) for name, value in zip(names, row, strict=True)] for row in rows])


def _table(names: Sequence[str], cells: list[list[str]]) -> None:
    """As a table where that fits, else each row as lines of a name and a value."""
    widths = [max(len(row[i]) for row in [list(names), *cells]) for i in range(len(names))]
    if cells and not _WHOLE & {*names} and sum(widths) + 2 * (len(widths) - 1) > columns():
        width = max(map(len, names))
        for number, row in enumerate(cells):
            out(*[""] * (number > 0), *(f"{name:<{width}}  {text}" for name, text in zip(names, row, strict=True)))
        return
    for row in [list(names), *cells]:
        out("  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip())


def _cell(name: str, value: object) -> str:
    if value is None:
        return "-"
    if name in _TIMES and isinstance(value, int):
        return utc(value)
    if name in _NAMES and isinstance(value, str):
        return visible(value)[:_NAME_SHOWN]
    text = visible(str(value))
    return text if name in _WHOLE else shorten(text, _CELL)


def code_of(status: str, finding: str | None) -> ExitCode:
    """The exit code for a log, as `rtshcua verify-log` has it."""
    if status != "failed":
        return ExitCode.OK if status == "verified" else ExitCode.INCOMPLETE
    return finding_code(finding or "")


def counted(counts: Mapping[str, int]) -> str:
    """Counts of logs in one line."""
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count) or "none"
