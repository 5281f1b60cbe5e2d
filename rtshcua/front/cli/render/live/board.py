"""The state of the screen, collected from messages; no drawing."""

from collections import deque
from typing import NamedTuple

from rtshcua.app.fly.story import Asks, FlightPlanView, Happened, Happening, Message, Note, Snapshot, Summary, tenths
from rtshcua.front.cli.render.live.lines import alarm, sentence, waiting_for
from rtshcua.model.quantity import Dimension, display
from rtshcua.onboard.runtime.view import RunStage, RuntimeView, SignalReading

_LATEST = 40
_TRACK = 2_000
_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}

#: the step state after each event
_STATES = {"dispatched": "running", "succeeded": "done", "skipped": "skipped"} | dict.fromkeys(
    ("failed", "violated", "replaced", "superseded", "released", "time-over", "landed"), "failed"
)


class BoardLine(NamedTuple):
    """A line of what happened, and the outcome of the decision that it tells (`note`: a word about the run)."""

    text: str
    outcome: str


class _Waits(NamedTuple):
    """The step that people are asked about, and the roles that agreed."""

    step: int
    subject: str
    asks: Asks
    agreed: tuple[str, ...] = ()


class Board:
    """The plan, the newest snapshot, the state of each step, the latest happenings, and the way flown.

    `rings` counts the steps that began to wait for a person.
    """

    def __init__(self) -> None:
        self.plan: FlightPlanView | None = None
        self.view: RuntimeView | None = None
        self.summary: Summary | None = None
        self.note = ""
        self.steps: dict[int, str] = {}
        self.latest: deque[BoardLine] = deque(maxlen=_LATEST)
        self.track: deque[tuple[int, int]] = deque(maxlen=_TRACK)
        self.longest_us = 0
        self._alarm: Happening | None = None
        self.rings = 0
        self._waits: _Waits | None = None
        self._counting: tuple[str, int, str] | None = None

    def take(self, message: Message) -> None:
        """Process one message."""
        match message:
            case FlightPlanView():
                self.plan = message
            case Snapshot(view):
                self._look(view)
            case Happened(what):
                self._happen(what)
            case Note(text):
                self.note = text
                self.latest.append(BoardLine(text, "note"))
            case Summary():
                self.summary = message

    @property
    def here(self) -> tuple[int, int] | None:
        """The position of the vehicle, in mm east and north of home."""
        return self.track[-1] if self.track else None

    def banner(self, width: int) -> list[str]:
        """The banner: the pending approval with its command, or the reason for the end of the flight."""
        waits, view = self._waits, self.view
        if self._alarm is not None or waits is None:
            return [] if self._alarm is None else alarm(self._alarm, width)
        if view is not None and (view.stage is not RunStage.DECIDING or view.step != waits.step):
            return []
        left_us = waits.asks.until_us - view.at_us if view is not None else None
        return waiting_for(waits.step, waits.subject, waits.asks, left_us, waits.agreed, width)

    def value(self, reading: SignalReading) -> str:
        """Return a signal's value with its unit, or `?` if it is unknown."""
        signal = next((each for each in self.plan.signals if each.name == reading.name), None) if self.plan else None
        if signal is None or None in reading.values:
            return "?"
        values = [value for value in reading.values if value is not None]
        if signal.labels:
            return signal.labels.get(values[0], str(values[0]))
        if len(values) == 2:
            x, y = map(tenths, values)
            return f"{x.lstrip('-')} m {'W' if x[0] == '-' else 'E'}, {y.lstrip('-')} m {'S' if y[0] == '-' else 'N'}"
        dimension = _DIMENSIONS.get(signal.dimension, Dimension.COUNT)
        if dimension in (Dimension.LENGTH, Dimension.ALTITUDE, Dimension.SPEED):
            return f"{tenths(values[0])} {'m/s' if dimension is Dimension.SPEED else 'm'}"
        return display(values[0], dimension)

    def _look(self, view: RuntimeView) -> None:
        self.view = view
        counting = (view.stage, view.step, view.contract)
        if counting != self._counting:
            self._counting, self.longest_us = counting, 0
        self.longest_us = max(self.longest_us, view.left_us or 0)
        for reading in view.signals:
            if self.plan is not None and reading.name == self.plan.position:
                self._follow(reading)

    def _follow(self, reading: SignalReading) -> None:
        x, y = reading.values
        if x is not None and y is not None and (x, y) != self.here:
            self.track.append((x, y))

    def _happen(self, what: Happening) -> None:
        self.latest.append(BoardLine(line(what), what.outcome))
        self._alarm = what if alarm(what) else self._alarm
        self._wait(what)
        if what.step < 0 or what.subject.startswith("fallback: "):
            return
        if what.event == "decision":
            self.steps[what.step] = {"allow": "admitted", "defer": "deferred"}.get(what.outcome, "refused")
        elif what.event in _STATES:
            self.steps[what.step] = _STATES[what.event]

    def _wait(self, what: Happening) -> None:
        if what.asks is not None:
            self.rings += self._waits is None or self._waits.step != what.step
            self._waits = _Waits(what.step, what.subject, what.asks)
        elif self._waits is not None and what.step == self._waits.step:
            if what.role:
                self._waits = self._waits._replace(agreed=(*self._waits.agreed, what.role))
            elif what.event != "repeated":
                self._waits = None


def line(what: Happening) -> str:
    """Return an event as a line with its time."""
    return f"{tenths(what.t_us // 1_000):>8} s  {sentence(what)}"
