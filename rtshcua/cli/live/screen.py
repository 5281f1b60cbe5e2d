"""The view in a terminal: drawn in place, a few times a second, from the newest that is known."""

import queue
import threading
import time
from collections.abc import Iterator

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from rtshcua.cli.live.board import Board, line
from rtshcua.cli.live.chart import chart
from rtshcua.cli.live.lines import ending
from rtshcua.cli.live.story import Message, duration
from rtshcua.diagnostics.excerpt import visible
from rtshcua.onboard.runtime.view import Stage

_FRAME_S = 0.125
_BAR = 24
_MAP_COLUMNS, _MAP_ROWS = 36, 9

_MARKS = {
    "": ("·", "dim"), "admitted": ("·", "green"), "deferred": ("…", "yellow"), "refused": ("✗", "red"),
    "running": ("▶", "bold cyan"), "done": ("✓", "green"), "failed": ("✗", "red"), "skipped": ("↷", "yellow"),
}  # fmt: skip
_OUTCOME_STYLES = {"allow": "green", "deny": "red", "defer": "yellow", "fallback": "magenta"}


def draw(messages: Iterator[Message]) -> None:
    """Draw until the messages end; reading never waits for drawing."""
    console, board, inbox = Console(), Board(), queue.SimpleQueue[Message | None]()

    def read() -> None:
        for message in messages:
            inbox.put(message)
        inbox.put(None)

    threading.Thread(target=read, daemon=True).start()
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        ended = False
        while not ended:
            ended = _drain(board, inbox)
            live.update(picture(board), refresh=True)
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


def picture(board: Board) -> RenderableType:
    """The whole view."""
    plan, view = board.plan, board.view
    if plan is None:
        return Text(visible(board.note or "starting"), style="dim")
    head = f"{plan.mission} under {plan.policy} on {plan.vehicle}"
    middle = Table.grid(padding=(0, 3))
    middle.add_row(_steps(board), Group(_signals(board), Text("\n".join(_map(board)), style="cyan")))
    intent = Text(visible(plan.intent), style="italic")
    parts: list[RenderableType] = [intent, Text(), middle, _contract(board), Text(), _latest(board)]
    if board.note:
        parts.append(Text(visible(board.note), style="yellow"))
    stage = view.stage if view is not None else "waiting"
    speed = "" if plan.speed == 1 else f", {plan.speed:g} times as fast as life"
    return Panel(Group(*parts), title=visible(head), subtitle=f"{stage}, mode {plan.mode}{speed}", title_align="left")


def _steps(board: Board) -> RenderableType:
    table = Table.grid(padding=(0, 1))
    assert board.plan is not None
    phase = -1
    for number, step in enumerate(board.plan.steps):
        if step.phase != phase:
            phase = step.phase
            here = board.view is not None and board.view.phase == board.plan.phases[phase]
            table.add_row("", Text(visible(f"phase {board.plan.phases[phase]}"), style="bold" if here else "dim"))
        mark, style = _MARKS[board.steps.get(number, "")]
        table.add_row(Text(mark, style=style), Text(visible(step.text), style=style))
    return table


def _signals(board: Board) -> RenderableType:
    table = Table.grid(padding=(0, 2))
    for reading in board.view.signals if board.view is not None else ():
        unknown = None in reading.values
        style = "red" if reading.stale or unknown else ""
        age = "never" if unknown else f"{reading.age_us / 1_000_000:.1f} s old{', stale' if reading.stale else ''}"
        table.add_row(
            Text(visible(reading.name)),
            Text(visible(board.value(reading)), style=style),
            Text(age, style=style or "dim green"),
        )
    return table


def _contract(board: Board) -> RenderableType:
    """The active contract, and what is left of its deadline or its time."""
    view = board.view
    if view is None or not view.contract:
        return Text()
    text = Text("\ncontract ").append(visible(view.contract), style="bold")
    if view.left_us is None or not board.longest_us:
        return text
    filled = max(0, min(_BAR, _BAR * view.left_us // board.longest_us))
    what = "to be dispatched within" if view.stage is Stage.DECIDING else "may go on for"
    text.append(f"  {what} {max(0, view.left_us) / 1_000_000:.1f} s  " if view.left_us < 60_000_000 else
                f"  {what} {duration(view.left_us)}  ")  # fmt: skip
    return text.append("━" * filled, style="cyan").append("━" * (_BAR - filled), style="dim")


def _latest(board: Board) -> RenderableType:
    text = Text(no_wrap=True, overflow="ellipsis")
    for what in board.latest:
        text.append(line(what) + "\n", style=_OUTCOME_STYLES.get(what.outcome, "dim"))
    return text


def _map(board: Board) -> list[str]:
    plan = board.plan
    if plan is None or board.here is None:
        return []
    return ["", *chart(board.track, plan.path, board.here, _MAP_COLUMNS, _MAP_ROWS)]
