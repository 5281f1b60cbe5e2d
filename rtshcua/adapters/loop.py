"""The thin loop around the runtime: waits for the world, steps, carries out the actions in their order.

The same loop runs on a machine's clock and in virtual time: it knows ports only.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import (
    Action,
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

#: The longest that the loop waits for the vehicle before it steps the runtime again, in us of its clock.
WAIT_US = 50_000


class Stepped(Protocol):
    """The runtime, as far as the loop knows it."""

    def step(self, now: Now, events: Sequence[Event]) -> Sequence[Action]:
        """What to do at `now` after these events."""
        ...


Watch = Callable[[Now, Sequence[Event], Sequence[Action]], None]


class Loop:
    """One run. `watch` sees each step's events and actions, after they were carried out; it must not block."""

    def __init__(
        self, runtime: Stepped, vehicle: Vehicle, sink: EvidenceSink, clock: Clock, watch: Watch, wait_us: int = WAIT_US
    ) -> None:
        self._runtime = runtime
        self._vehicle = vehicle
        self._sink = sink
        self._clock = clock
        self._watch = watch
        self._wait_us = wait_us
        self._answers: list[Event] = []

    def turn(self, also: Sequence[Event] = ()) -> Ending | None:
        """Wait, step, act; `also` are events from elsewhere (Ctrl-C). Gives the ending once there is one."""
        answers, self._answers = self._answers, []
        wait_us = 0 if answers or also else self._wait_us
        seen = self._vehicle.poll(self._clock.now().monotonic_us, wait_us)
        now = self._clock.now()
        events = [*also, *answers, *seen]
        actions = self._runtime.step(now, events)
        ending = self._act(actions)
        self._watch(now, events, actions)
        return ending

    def _act(self, actions: Sequence[Action]) -> Ending | None:
        ending: Ending | None = None
        recorded = True
        for action in actions:
            match action:
                case Append(line, durable):
                    recorded = self._append(line, durable) and recorded
                case Dispatch():
                    self._dispatch(action, recorded)
                case Release():
                    self._vehicle.release()
                case End(how):
                    ending = how
        return ending

    def _append(self, line: bytes, durable: bool) -> bool:
        try:
            self._sink.append(line, durable)
        except OSError as error:
            self._answers.append(EvidenceFailed(self._clock.now().monotonic_us, error.strerror or str(error)))
            return False
        return True

    def _dispatch(self, dispatch: Dispatch, recorded: bool) -> None:
        """Look at the clock again: what is late is not sent, nor is what had to be recorded first and was not."""
        now_us = self._clock.now().monotonic_us
        if now_us > dispatch.not_after_us:
            self._answers.append(Failed(now_us, dispatch.command.token, "late"))
        elif dispatch.needs_record and not recorded:
            self._answers.append(Failed(now_us, dispatch.command.token, "withheld"))
        else:
            self._vehicle.begin(dispatch.command, now_us)
