"""Pads the lines: like columns of neighbouring lines, and the comments at their ends."""

from collections.abc import Callable, Iterator

from rtshcua.ground.format.comments import BLANKS
from rtshcua.ground.format.page import Line

ROW = "row"
_APART = 2  # blanks before a comment


def align(lines: list[Line], width: int) -> str:
    """The text of the lines, with what stands in columns in columns."""
    for run in _runs(lines, lambda line, last: line.kind not in ("", ROW) and line.kind == last.kind):
        _columns(run, width)
    for run in _tables(lines):
        _columns(run, width)
    for run in _runs(lines, lambda line, last: not line.own and not last.own and "\n" not in last.comment):
        _comments(run, width)
    made = []
    for line in lines:
        if line.blank:
            made.append("")
        made.append(f"{' ' * line.indent}{line.text}{line.comment}".rstrip(BLANKS))
    return "\n".join(made) + "\n" if made else ""


def _runs(lines: list[Line], belongs: Callable[[Line, Line], bool]) -> Iterator[list[Line]]:
    """Neighbours of one indentation that belong together."""
    run = lines[:1]
    for line in lines[1:]:
        if run[-1].indent == line.indent and not line.blank and belongs(line, run[-1]):
            run.append(line)
        else:
            yield run
            run = [line]
    yield run


def _tables(lines: list[Line]) -> Iterator[list[Line]]:
    """The rows of each table, whatever stands between them."""
    run: list[Line] = []
    for line in lines:
        if run and line.indent < run[0].indent:
            yield run
            run = []
        if line.kind == ROW:
            run.append(line)
    if run:
        yield run


def _columns(run: list[Line], width: int) -> None:
    """Aligns as many columns, from the left, as leave no line too wide that was not."""
    cuts = [dict(line.cuts) for line in run]
    room = [max(width - line.width, 0) for line in run]
    pads: list[list[tuple[int, int]]] = [[] for _ in run]
    shifts = [0] * len(run)
    for column in sorted({number for each in cuts for number in each}):
        here = [number for number, each in enumerate(cuts) if column in each]
        target = max(cuts[number][column] + shifts[number] for number in here)
        missing = {number: target - cuts[number][column] - shifts[number] for number in here}
        if any(shifts[number] + pad > room[number] for number, pad in missing.items()):
            break
        for number, pad in missing.items():
            shifts[number] += pad
            pads[number].append((cuts[number][column], pad))
    for line, padded, shift in zip(run, pads, shifts, strict=True):
        if shift:
            text, pieces, at = line.text, [], 0
            for place, pad in padded:
                pieces += [text[at:place], " " * pad]
                at = place
            line.pieces = [*pieces, text[at:]]
            line.width += shift


def _comments(run: list[Line], width: int) -> None:
    """Puts the comments of a run below each other, if that makes no line too wide that was not."""
    told = [line for line in run if line.comment]
    column = max((line.width for line in told), default=0) + _APART
    fits = all(column + len(line.comment) <= max(width, line.width + _APART + len(line.comment)) for line in told)
    for line in told:
        line.comment = " " * (column - line.width if fits else _APART) + line.comment
