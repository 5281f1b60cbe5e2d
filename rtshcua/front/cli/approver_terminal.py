"""The terminal of `rtshcua approve --wait`: rings for each question, shows it, and passes on what is typed."""

import json
import os
import select
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final

from rtshcua.app.approval_desk import ApprovalDesk, DeskEvent, StepQuestion
from rtshcua.app.approvals import ApprovalDraft, places_of_step
from rtshcua.app.fly.narrator import plan_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import refuse
from rtshcua.front.cli.render.live.chart import chart
from rtshcua.front.cli.stdout import out, out_json, out_rendered

_QUITS: Final = frozenset({"q", "quit", "exit"})
_ANSWERS: Final = {"yes": True, "no": False}
_OTHER_PATH: Final = "other-path"
_CHUNK: Final = 4_096
#: the longest wait for anything, s
_TURN_S: Final = 0.5
#: the size of the map, in characters, and the dots along each leg of the step
_COLUMNS, _ROWS, _DOTS = 60, 14, 40


class ApproverTerminal:
    """Shows what a desk tells, and reads answers from the descriptor `typing` while that is open."""

    def __init__(self, desk: ApprovalDesk, typing: int | None, *, as_json: bool) -> None:
        self._desk, self._as_json, self._typing = desk, as_json, typing
        self._typed = b""

    def follow(self) -> ExitCode:
        """Run until the flight ends, the connection is lost for good, or the person quits. Raises OSError."""
        while True:
            for event in self._desk.turn():
                self._show(event)
            if self._desk.code is not None:
                return self._desk.code
            waits = [each for each in (self._typing, self._desk.descriptor) if each is not None]
            readable = select.select(waits, [], [], _TURN_S)[0]
            if self._typing is not None and self._typing in readable and self._read(self._typing):
                self.tell("left", "nobody is asked here any more; the flight continues")
                return ExitCode.OK

    def tell(self, event: str, text: str, **more: object) -> None:
        """Print an event."""
        if self._as_json:
            out_json(json.dumps({"event": event, "text": text} | more, ensure_ascii=False), flush=True)
        else:
            out(f"{event:<12} {text}", flush=True)

    def _show(self, event: DeskEvent) -> None:
        shown = event.question
        if shown is None:
            self.tell(event.event, event.text)
            return
        view = self._desk.view(shown)
        if self._as_json:
            self.tell(event.event, event.text, **view, answer=_how(shown, view))
            return
        if sys.stdout.isatty():
            out_rendered("\a", end="")
        self.tell(event.event, f"{view['number']}: {event.text}, {-(-view['left_ms'] // 1_000)} s left")
        out(*(f"  {line}" for line in _lines(shown, view)), flush=True)

    def _read(self, typing: int) -> bool:
        """Take what was typed; return whether it was to quit."""
        data = os.read(typing, _CHUNK)
        if not data:
            self._typing = None
        *lines, self._typed = (self._typed + (data or b"\n")).split(b"\n")
        self._typed = self._typed[-_CHUNK:]
        return any(self._quits(line.decode(errors="replace").lower().split()) for line in lines)

    def _quits(self, words: list[str]) -> bool:
        """Act on a line; return whether it was to quit."""
        first, shown = (words or [""])[0], self._desk.state()[2]
        if not words or first in _QUITS:
            return bool(words)
        if shown is None:
            self.tell("none", "no question is open")
        elif first not in _ANSWERS or words[1:2] != [str(shown.asked.number)]:
            self.tell("unclear", _how(shown, self._desk.view(shown)))
        else:
            other = words[2:] == [_OTHER_PATH]
            said = self._desk.answer(shown.nonce, granted=_ANSWERS[first], other_path=other)
            if isinstance(said, Refusal):
                refuse(said)
        return False


def _how(shown: StepQuestion, view: dict[str, Any]) -> str:
    """What a person types to answer."""
    if shown.draft is None:
        return f"it cannot be answered here: {shown.why_not}"
    yes = f"yes {view['number']}{f' {_OTHER_PATH}' if view['other_path'] else ''}"
    signs = f"to sign as {view['role']} that the step may be flown"
    return f"type `{yes}` and Enter {signs}, `no {view['number']}` that it is refused"


def _lines(shown: StepQuestion, view: dict[str, Any]) -> Iterator[str]:
    """A question in lines."""
    if shown.draft is not None:
        yield f"step {view['step_number']} of `{view['mission']}` on `{view['vehicle']}`: {view['skill']}"
        for each in view["arguments"]:
            where = f"  [{each['where']}]" if each["where"] else ""
            yield f"  {each['name']} = {each['value']}{where}"
        yield from (f"  {each}" for each in (view["path"], view["spacing"]) if each)
        yield from _map(shown.draft)
    yield f"because of `{view['rule']}`"
    if view.get("other_path"):
        yield f"warning: {view['other_path']}"
    yield _how(shown, view)


def _map(draft: ApprovalDraft) -> Iterator[str]:
    """A small map of the step, north up, with its legend."""
    places = places_of_step(draft)
    dots = [
        (ax + (bx - ax) * part // _DOTS, ay + (by - ay) * part // _DOTS)
        for (ax, ay), (bx, by) in pairwise(places)
        for part in range(_DOTS)
    ]
    areas = plan_of(draft.bundle.policy, draft.bundle.mission, mode="", speed=1).areas
    drawn = chart(dots, places[-1:], places[0], _COLUMNS, _ROWS, areas, homeward=False)
    yield from (line.rstrip() for line in drawn.lines() if line.strip())
    yield f"{'─' * drawn.bar_columns} {drawn.bar_m} m, north up; H home, X begin of the step, o its end"
