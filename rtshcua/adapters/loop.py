"""The thin loop around the runtime: waits for the world, steps, carries out the actions in their order.

The same loop runs on a machine's clock and in virtual time: it knows ports only. It never waits for the evidence: a
command that must be recorded first is held until its record is kept, and the loop goes on meanwhile; a fallback is held
for nothing.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import (
    Action,
    Announce,
    Append,
    Clock,
    Dispatch,
    End,
    Ending,
    Event,
    EvidenceFailed,
    EvidenceSink,
    Failed,
    Release,
    Vehicle,
)

#: The longest that the loop waits for the vehicle before it steps the runtime again, in us of its clock;
WAIT_US = 50_000
#: while a command is held for its record, it looks this often whether that is kept.
HELD_WAIT_US = 300


class Stepped(Protocol):
    """The runtime, as far as the loop knows it."""

    def step(self, now: Now, events: Sequence[Event]) -> Sequence[Action]:
        """What to do at `now` after these events."""
        ...


Watch = Callable[[Now, Sequence[Event], Sequence[Action]], None]


class _Held(NamedTuple):
    """A command, and how many lines of evidence must be kept before it is sent."""

    dispatch: Dispatch
    lines: int


class Loop:
    """One run. `watch` sees each step's events and actions, after they were carried out; it must not block."""

    def __init__(
        self, runtime: Stepped, vehicle: Vehicle, sink: EvidenceSink, clock: Clock, watch: Watch,
        wait_us: int = WAIT_US, held_wait_us: int = HELD_WAIT_US,
    ) -> None:  # fmt: skip
        self._runtime = runtime
        self._vehicle = vehicle
        self._sink = sink
        self._clock = clock
        self._watch = watch
        self._wait_us = wait_us
        self._held_wait_us = min(wait_us, held_wait_us)
        self._held: _Held | None = None
        self._lines = 0  # that were given to the sink
        self._answers: list[Event] = []

    def turn(self, also: Sequence[Event] = ()) -> Ending | None:
        """Wait, step, act; `also` are events from elsewhere (Ctrl-C). Gives the ending once there is one."""
        self._tend()
        wait_us = self._wait_us if self._held is None else self._held_wait_us
        seen = self._vehicle.poll(self._clock.now().monotonic_us, 0 if self._answers or also else wait_us)
        self._tend()
        answers, self._answers = self._answers, []
        now = self._clock.now()
        events = [*also, *answers, *seen]
        actions = self._runtime.step(now, events)
        ending = self._act(actions)
        self._watch(now, events, actions)
        return ending

    def _tend(self) -> None:
        """See what became of the records; send the command that waits for its own, or withhold it."""
        reason = self._sink.trouble()
        if reason is not None:
            self._answers.append(EvidenceFailed(self._clock.now().monotonic_us, reason))
        held = self._held
        if held is None:
            return
        if reason is not None:
            self._refuse(held.dispatch, "withheld")
        elif self._sink.kept >= held.lines:
            self._send(held.dispatch)
        elif self._clock.now().monotonic_us > held.dispatch.not_after_us:
            self._refuse(held.dispatch, "late")

    def _act(self, actions: Sequence[Action]) -> Ending | None:
        ending: Ending | None = None
        lines: int | None = self._lines
        for action in actions:
            match action:
                case Append():
                    lines = self._append(action, lines)
                case Dispatch():
                    self._dispatch(action, lines)
                case Release():
                    self._held = None
                    self._vehicle.release()
                case Announce(severity, text):
                    self._vehicle.announce(severity, text)
                case End(how):
                    self._held = None
                    ending = how
        return ending

    def _append(self, append: Append, lines: int | None) -> int | None:
        """How many lines must be kept for this one to be; None if it, or one before it in this step, was refused."""
        try:
            given = self._sink.append(append.line, append.durable)
        except OSError as error:
            self._answers.append(EvidenceFailed(self._clock.now().monotonic_us, error.strerror or str(error)))
            return None
        self._lines = given
        return given if lines is not None else None

    def _dispatch(self, dispatch: Dispatch, lines: int | None) -> None:
        """Send a command, or hold it until its record is kept. The one that was held is replaced."""
        self._held = None
        if not dispatch.needs_record:
            self._send(dispatch)
        elif lines is None:
            self._refuse(dispatch, "withheld")
        elif self._sink.kept >= lines:
            self._send(dispatch)
        else:
            self._held = _Held(dispatch, lines)

    def _send(self, dispatch: Dispatch) -> None:
        """Look at the clock again: what is late is not sent."""
        now_us = self._clock.now().monotonic_us
        if now_us > dispatch.not_after_us:
            self._refuse(dispatch, "late")
            return
        self._held = None
        self._vehicle.begin(dispatch.command, now_us)

    def _refuse(self, dispatch: Dispatch, reason: str) -> None:
        self._held = None
        self._answers.append(Failed(self._clock.now().monotonic_us, dispatch.command.token, reason))
