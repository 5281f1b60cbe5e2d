"""What the screen shows, brought together from what it was told; no drawing here."""

from collections import deque

from rtshcua.cli.live.lines import sentence
from rtshcua.cli.live.story import Happened, Happening, Message, Note, Plan, Snapshot, Summary
from rtshcua.model.quantity import Dimension, display
from rtshcua.onboard.runtime.view import Reading, View

_LATEST = 8
_TRACK = 2_000
_DIMENSIONS = {dimension.value: dimension for dimension in Dimension}

#: what an event makes of a step
_STATES = {"dispatched": "running", "succeeded": "done", "skipped": "skipped"} | dict.fromkeys(
    ("failed", "violated", "replaced", "released", "time-over", "landed"), "failed"
)


class Board:
    """The plan, the newest snapshot, the state of each step, the latest happenings, and the way flown."""

    def __init__(self) -> None:
        self.plan: Plan | None = None
        self.view: View | None = None
        self.summary: Summary | None = None
        self.note = ""
        self.steps: dict[int, str] = {}
        self.latest: deque[Happening] = deque(maxlen=_LATEST)
        self.track: deque[tuple[int, int]] = deque(maxlen=_TRACK)
        self.longest_us = 0
        self._counting: tuple[str, int, str] | None = None

    def take(self, message: Message) -> None:
        """Take in one message."""
        match message:
            case Plan():
                self.plan = message
            case Snapshot(view):
                self._look(view)
            case Happened(what):
                self._happen(what)
            case Note(text):
                self.note = text
            case Summary():
                self.summary = message

    @property
    def here(self) -> tuple[int, int] | None:
        """Where the vehicle is, in mm east and north of home."""
        return self.track[-1] if self.track else None

    def value(self, reading: Reading) -> str:
        """A signal's value with its unit, `?` while it is not known."""
        signal = next((each for each in self.plan.signals if each.name == reading.name), None) if self.plan else None
        if signal is None or None in reading.values:
            return "?"
        values = [value for value in reading.values if value is not None]
        if signal.labels:
            return signal.labels.get(values[0], str(values[0]))
        if len(values) == 2:
            return f"{values[0] / 1_000:.1f} m east, {values[1] / 1_000:.1f} m north"
        dimension = _DIMENSIONS.get(signal.dimension, Dimension.COUNT)
        if dimension in (Dimension.LENGTH, Dimension.ALTITUDE, Dimension.SPEED):
            return f"{values[0] / 1_000:.1f} {'m/s' if dimension is Dimension.SPEED else 'm'}"
        return display(values[0], dimension)

    def _look(self, view: View) -> None:
        self.view = view
        counting = (view.stage, view.step, view.contract)
        if counting != self._counting:
            self._counting, self.longest_us = counting, 0
        self.longest_us = max(self.longest_us, view.left_us or 0)
        for reading in view.signals:
            if self.plan is not None and reading.name == self.plan.position:
                self._follow(reading)

    def _follow(self, reading: Reading) -> None:
        x, y = reading.values
        if x is not None and y is not None and (x, y) != self.here:
            self.track.append((x, y))

    def _happen(self, what: Happening) -> None:
        self.latest.append(what)
        if what.step < 0 or what.subject.startswith("fallback: "):
            return
        if what.event == "decision":
            self.steps[what.step] = {"allow": "admitted", "defer": "deferred"}.get(what.outcome, "refused")
        elif what.event in _STATES:
            self.steps[what.step] = _STATES[what.event]


def line(what: Happening) -> str:
    """A happening with its time."""
    return f"{what.t_us / 1_000_000:8.1f} s  {sentence(what)}"
