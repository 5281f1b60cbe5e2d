"""The view in a terminal, redrawn in place several times a second with the newest state."""

import queue
import textwrap
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from rich.cells import cell_len
from rich.console import Console
from rich.live import Live
from rich.text import Text

from rtshcua.app.fly.story import Area, Message, duration, tenths
from rtshcua.diagnostics.excerpt import visible
from rtshcua.front.cli.render.live.board import Board
from rtshcua.front.cli.render.live.chart import FENCE, FLOWN, HOMEWARD, KEEP_OUT, MARK, ZONE, Cell, Chart, chart
from rtshcua.front.cli.render.live.lines import ending
from rtshcua.model.step_number import number_of
from rtshcua.onboard.runtime.view import RunStage

_FRAME_S = 0.125
_BAR: Final = 16
_MAP_COLUMNS: Final = 36
_MOST_MAP_ROWS: Final = 16
_LEAST_MAP_ROWS: Final = 4
#: minimum width for a map next to the steps, columns
_BESIDE: Final = 64
#: rows of the latest happenings at least
_LEAST_LATEST: Final = 4
#: rows of one happening at most
_MOST_ROWS: Final = 3
#: where the text of a happening stands, in columns
_INDENT: Final = 12

_MARKS = {
    "": ("·", "dim"), "admitted": ("·", "green"), "deferred": ("…", "yellow"), "refused": ("✗", "red"),
    "running": ("▶", "bold cyan"), "done": ("✓", "green"), "failed": ("✗", "red"), "skipped": ("↷", "yellow"),
}  # fmt: skip
_LAYER_STYLES = {
    FENCE: "green", KEEP_OUT: "red", ZONE: "blue", HOMEWARD: "yellow", FLOWN: "cyan", MARK: "bold", "": "",
}  # fmt: skip
_OUTCOME_STYLES = {"allow": "green", "deny": "red", "defer": "yellow", "fallback": "magenta", "note": "yellow"}


def draw(messages: Iterator[Message]) -> None:
    """Draw until the messages end; drawing does not block reading."""
    console, board, inbox = Console(), Board(), queue.SimpleQueue[Message | None]()

    def read() -> None:
        for message in messages:
            inbox.put(message)
        inbox.put(None)

    threading.Thread(target=read, daemon=True).start()
    rung = 0
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        ended = False
        while not ended:
            ended = _drain(board, inbox)
            if board.rings > rung:
                rung = board.rings
                console.bell()
            last = [] if board.summary is None else list(ending(board.summary))
            rows = console.height - sum(1 + cell_len(each) // console.width for each in last)
            live.update(Text("\n").join(picture(board, console.width, rows - bool(last))), refresh=True)
    if board.summary is not None:
        for text in ending(board.summary):
            console.print(text, markup=False, highlight=False, soft_wrap=True)


def _drain(board: Board, inbox: "queue.SimpleQueue[Message | None]") -> bool:
    """Take in all that comes within one frame's time; True at the end."""
    until = time.monotonic() + _FRAME_S
    while (left := until - time.monotonic()) > 0:
        try:
            message = inbox.get(timeout=left)
        except queue.Empty:
            break
        if message is None:
            return True
        board.take(message)
    return False


def picture(board: Board, width: int, height: int) -> list[Text]:
    """The whole view: at most `height` lines of at most `width` columns. What is too long is cut, the newest stays."""
    plan = board.plan
    if plan is None:
        return [_fitted(Text(visible(board.note or "starting"), style="dim"), width)]
    head = [_heading(board, width), _contract(board)]
    banner = [Text(each.ljust(width)[:width], style="bold black on yellow") for each in board.banner(width)]
    room = max(0, height - len(head) - len(banner))
    latest = _latest(board, width)
    wanted = _middle_rows(board)
    rows = max(0, min(wanted, room - 1 - min(len(latest), _LEAST_LATEST)))
    middle = _middle(board, width, rows)
    rest = max(0, room - len(middle) - 1)
    lines = [*head, *banner, *middle, Text(), *(latest[-rest:] if rest else [])]
    return [_fitted(each, width) for each in lines[:height]]


def _fitted(text: Text, width: int) -> Text:
    text.no_wrap, text.overflow = True, "ellipsis"
    text.truncate(width, overflow="ellipsis")
    return text


def _heading(board: Board, width: int) -> Text:
    plan, view = board.plan, board.view
    assert plan is not None
    speed = "" if plan.speed == 1 else f", {plan.speed:g}x speed"
    stage = f"{view.stage if view is not None else 'waiting'}, mode {plan.mode}{speed}"
    text = Text(visible(f"{plan.mission} under {plan.policy} on {plan.vehicle}"), style="bold reverse")
    text.truncate(max(0, width - cell_len(stage) - 2), overflow="ellipsis")
    return text.append(" " * max(2, width - text.cell_len - cell_len(stage))).append(stage)


def _middle_rows(board: Board) -> int:
    """How many rows the steps with the signals would take, and the map as many as it is drawn with."""
    assert board.plan is not None
    signals = len(board.view.signals) if board.view is not None else 0
    return max(len(board.plan.steps) + len(board.plan.phases) + 1 + signals, _MOST_MAP_ROWS if board.here else 0)


def _middle(board: Board, width: int, rows: int) -> list[Text]:
    """Steps and signals, and the map beside them."""
    if rows <= 0:
        return []
    beside = width >= _BESIDE and board.here is not None and rows >= _LEAST_MAP_ROWS
    left = width - _MAP_COLUMNS - 2 if beside else width
    signals = list(_signals(board, left))[: max(0, rows - 3)]
    steps = _steps(board)
    window = _around(steps, rows - len(signals) - bool(signals))
    lines = [*window, *([Text()] if signals else []), *signals]
    if not beside:
        return lines[:rows]
    drawn = _map(board, min(rows, _MOST_MAP_ROWS))
    both = []
    for number in range(max(len(lines), len(drawn))):
        line = lines[number] if number < len(lines) else Text()
        line.truncate(left, overflow="ellipsis", pad=True)
        both.append(line.append("  ").append_text(drawn[number] if number < len(drawn) else Text()))
    return both[:rows]


def _around(steps: Sequence[tuple[Text, bool]], rows: int) -> list[Text]:
    """So many rows of the steps, the current one among them."""
    current = next((number for number, (_, here) in enumerate(steps) if here), 0)
    first = max(0, min(current - rows // 2, len(steps) - rows))
    return [text for text, _ in steps[first : first + max(0, rows)]]


def _steps(board: Board) -> list[tuple[Text, bool]]:
    """A row for each phase and each step, and whether it is the current one."""
    assert board.plan is not None
    rows: list[tuple[Text, bool]] = []
    phase = -1
    for index, step in enumerate(board.plan.steps):
        if step.phase != phase:
            phase = step.phase
            here = board.view is not None and board.view.phase == board.plan.phases[phase]
            rows.append((Text(visible(f"  phase {board.plan.phases[phase]}"), style="bold" if here else "dim"), False))
        mark, style = _MARKS[board.steps.get(index, "")]
        text = Text(f"{mark} {number_of(index):>2} {visible(step.text)}", style=style)
        rows.append((text, board.view is not None and board.view.step == index))
    return rows


def _signals(board: Board, width: int) -> Iterator[Text]:
    """A row for each signal: its name, its value, and its age where it counts."""
    readings = board.view.signals if board.view is not None else ()
    longest = max((cell_len(reading.name) for reading in readings), default=0)
    for reading in readings:
        unknown = None in reading.values
        value = "no value" if unknown else visible(board.value(reading))
        late = f", {tenths(reading.age_us // 1_000)} s old" if reading.stale and not unknown else ""
        text = Text(f"{visible(reading.name):<{min(longest, width // 2)}}  ")
        yield text.append(f"{value}{late}", style="red" if reading.stale or unknown else "green")


def _contract(board: Board) -> Text:
    """The active contract, and what is left of its deadline or its time."""
    view = board.view
    if view is None or not view.contract:
        return Text(visible(board.plan.intent if board.plan is not None else ""), style="italic")
    text = Text("contract ").append(visible(view.contract), style="bold")
    if view.left_us is None or not board.longest_us or board.banner(1):  # a person has another time than the step
        return text
    filled = max(0, min(_BAR, _BAR * view.left_us // board.longest_us))
    what = "to be dispatched within" if view.stage is RunStage.DECIDING else "may go on for"
    left_us = max(0, view.left_us)
    text.append(f"  {what} {tenths(left_us // 1_000)} s  " if left_us < 60_000_000 else
                f"  {what} {duration(left_us)}  ")  # fmt: skip
    return text.append("━" * filled, style="cyan").append("━" * (_BAR - filled), style="dim")


def _latest(board: Board, width: int) -> list[Text]:
    """What happened last, over as many rows as each takes, the newest at the end."""
    rows: list[Text] = []
    for said in board.latest:
        text = said.text if said.outcome != "note" else f"{'':{_INDENT}} {visible(said.text)}"
        wrapped = textwrap.wrap(
            text, max(width, _INDENT + 8), subsequent_indent=" " * (_INDENT + 1), drop_whitespace=True,
            max_lines=_MOST_ROWS, placeholder=" ...", break_on_hyphens=False,
        )  # fmt: skip
        rows += [Text(each, style=_OUTCOME_STYLES.get(said.outcome, "dim")) for each in wrapped]
    return rows


def _map(board: Board, rows: int) -> list[Text]:
    """The map, and under it its scale and what it shows."""
    plan = board.plan
    if plan is None or board.here is None:
        return []
    found = chart(board.track, plan.path, board.here, _MAP_COLUMNS, rows - 1, plan.areas)
    lines = [_row(cells) for cells in found.rows]
    if lines:
        lines[0] = _row(found.rows[0][:-2]).append(" N", style="bold")
        if len(lines) > 1:
            lines[1] = _row(found.rows[1][:-2]).append(" ↑", style="bold")
    return [*lines, _legend(found, plan.areas)]


def _row(cells: Iterable[Cell]) -> Text:
    return Text.assemble(*((cell.letter, _LAYER_STYLES[cell.shows]) for cell in cells))


def _legend(found: Chart, areas: Sequence[Area]) -> Text:
    text = Text(f"├{'─' * max(0, found.bar_columns - 2)}┤ {found.bar_m} m ")
    kinds = {area.kind for area in areas}
    told = [("keep out", KEEP_OUT)] if "outside" in kinds else []
    told += [("fence beyond" if found.beyond else "fence", FENCE)] if "inside" in kinds else []
    for what, layer in (*told, ("H home", MARK), ("way home", HOMEWARD)):
        if text.cell_len + 1 + len(what) <= _MAP_COLUMNS:
            text.append(f" {what}", style=_LAYER_STYLES[layer])
    return text
