"""Print the results of archive commands as a table, JSON or CSV."""

import csv
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from enum import StrEnum

from msgspec import to_builtins

from rtshcua.app.log_archive import ArchiveResult
from rtshcua.app.wording import many, shorten, utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.width import columns

_TIMES = frozenset(
    {"utc_us", "begun_us", "first_us", "last_us", "added_us", "checked_us", "one_begun_us", "other_begun_us"}
)
_NAMES = frozenset({"log", "one", "other", "before", "last_leaf", "missing_leaf", "after_leaf", "boot"})
_WHOLE = frozenset({"tells"})
_NAME_SHOWN = 16  # digits of a digest
_CELL = 48
_TOLD = 20  # number of logs that are listed individually


class Shape(StrEnum):
    """The output format of rows."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"


def tell(names: Sequence[str], rows: Sequence[Sequence[object]], shape: Shape) -> None:
    """Print rows on standard output."""
    if shape is Shape.JSON:
        out_json(json.dumps([dict(zip(names, row, strict=True)) for row in rows], ensure_ascii=False, default=str))
    elif shape is Shape.CSV:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([visible(each) if isinstance(each, str) else each for each in row] for row in rows)
    else:
        _table(names, [[_cell(name, value) for name, value in zip(names, row, strict=True)] for row in rows])


def _table(names: Sequence[str], cells: list[list[str]]) -> None:
    """Print a table if it fits the width, otherwise each row as lines of name and value."""
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


def counted(counts: Mapping[str, int]) -> str:
    """Return the counts of logs on one line."""
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count) or "none"


def tell_result(result: ArchiveResult, *, as_json: bool) -> None:
    """Print the results of logs that were added or verified."""
    counts = Counter(each.entry.status for each in result.done)
    if as_json:
        out_json(json.dumps(_object(result, counts), ensure_ascii=False))
    else:
        _text(result, counts)


def _object(result: ArchiveResult, counts: Mapping[str, int]) -> dict[str, object]:
    return {
        "archive": str(result.folder),
        "exit_code": int(result.code()),
        "pinned": {"key": result.pinned.key.hex(), "source": result.pinned.source},
        "counts": dict(counts),
        "known": sum(each.known for each in result.done),
        "skipped": [{"path": str(each.path), "why": each.why} for each in result.skipped],
        "logs": [{"path": str(e.path), "known": e.known, **to_builtins(e.entry)} for e in result.done],
        "other_roots": result.others,
        "missing": [dict(zip(result.missing.columns, row, strict=True)) for row in result.missing.rows],
        "conflicts": [dict(zip(result.conflicts.columns, row, strict=True)) for row in result.conflicts.rows],
    }


def _text(result: ArchiveResult, counts: Mapping[str, int]) -> None:
    for left in result.skipped[:_TOLD]:
        out(f"skipped     {visible(str(left.path))}: {left.why}")
    if len(result.skipped) > _TOLD:
        out(f"... and {len(result.skipped) - _TOLD} more that are not logs")
    wrong = [each for each in result.done if each.entry.status != "verified"]
    for each in wrong[:_TOLD]:
        what = f"{each.entry.finding}, {visible(each.entry.finding_text or '')}"
        out(f"{each.entry.status:<10}  {visible(str(each.path))}: {what}")
    if len(wrong) > _TOLD:
        out(f"... and {len(wrong) - _TOLD} more; run `rtshcua archive query findings`")
    new = sum(not each.known for each in result.done)
    source = visible(result.pinned.source)
    out(f"{many(len(result.done), 'log')}, {new} of them verified now, under {source}: {counted(counts)}")
    if result.others:
        rest = "was verified under another root" if result.others == 1 else "were verified under other roots"
        out(f"{many(result.others, 'log')} in the archive {rest}; name that root with `--root`")
    if result.missing.rows:
        out(f"missing: the logs before {len(result.missing.rows)} of these; run `rtshcua archive query missing`")
    for one, other, seq in result.pairs[:_TOLD]:
        two = f"`{visible(result.names[one])}` and `{visible(result.names[other])}`"
        out(f"conflict: {two} were signed differently at record {seq}")
    if result.pairs:
        out(f"conflict: {many(len(result.pairs), 'pair')} of logs; run `rtshcua archive query conflicts`")
