"""The loop around the runtime: it waits for events, steps the runtime, and carries out its actions in order. The same
loop runs on a machine's clock and in virtual time, because it only knows their ports.

It never waits for evidence: a command that must be recorded first is held until its record is kept, and the loop goes
on meanwhile; a fallback is never held.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from rtshcua.model.durability import BUFFERED, SYNCED_FIRST
from rtshcua.model.flat.situation import Now
from rtshcua.onboard import ports
from rtshcua.onboard.ports import Action, Command, Ending, Event
from rtshcua.onboard.runtime.runtime import Runtime

#: The longest wait for the vehicle before the next step of the runtime, in us of its clock;
WAIT_US = 50_000
#: while a command is held for its record, this interval.
HELD_WAIT_US = 300


Watch = Callable[[Now, Sequence[Event], Sequence[Action]], None]


def append_all(sink: ports.EvidenceSink, lines: Iterable[bytes], durability: int) -> None:
    """Append lines that belong together to a sink: all of them, even if it refuses one, because it takes that one over
    all the same, and a log has no gaps. Raises the first OSError.
    """
    refused: OSError | None = None
    for line in lines:
        try:
            sink.append(line, durability)
        except OSError as error:
            refused = refused or error
    if refused is not None:
        raise refused


class _Record(NamedTuple):
    """How many lines of evidence must be kept before a command is sent, and their durability class."""

    lines: int
    durability: int


class RunLoop:
    """One run. `watch` gets the events and actions of each step, after they were carried out; it must not block.
    `prepares`: between steps the runtime works ahead, so that the next one is quick. In virtual time nothing waits.
    """

    def __init__(
        self, runtime: Runtime, vehicle: ports.Vehicle, sink: ports.EvidenceSink, clock: ports.Clock, watch: Watch,
        wait_us: int = WAIT_US, held_wait_us: int = HELD_WAIT_US, *, prepares: bool = True,
    ) -> None:  # fmt: skip
        self._runtime = runtime
        self._vehicle = vehicle
        self._sink = sink
        self._clock = clock
        self._watch = watch
        self._wait_us = wait_us
        self._held_wait_us = min(wait_us, held_wait_us)
        self._prepares = prepares
        self._held: tuple[Command, _Record] | None = None  # a command and the record that it waits for
        self._lines = sink.kept  # the number of lines that were handed to the sink
        self._failed: int | None = None  # that number at the sink's first refusal
        self._answers: list[Event] = []

    def turn(self, also: Sequence[Event] = ()) -> Ending | None:
        """Wait, step and act; `also` are events from elsewhere (Ctrl-C). Returns the ending once there is one."""
        self._tend()
        wait_us = self._wait_us if self._held is None else self._held_wait_us
        seen = self._vehicle.poll(self._clock.now().monotonic_us, 0 if self._answers or also else wait_us)
        self._tend()
        answers, self._answers = self._answers, []
        now = self._clock.now()
        events = [*also, *answers, *seen]
        reflex = self._runtime.react(now, events)
        try:
            if reflex is not None:
                self._send(reflex)
        finally:
            actions = self._runtime.actions(now)
            ending = self._act(actions, reflex)
        self._watch(now, events, actions)
        if self._prepares:
            self._runtime.prepare(now)
        return ending

    def _tend(self) -> None:
        """Check the records; send the command that waits for its own, or withhold it."""
        reason, late = self._sink.trouble(), self._sink.late()
        if reason is not None:
            self._fail(reason)
        elif self._failed is not None and self._sink.kept >= self._lines and self._sink.synced >= self._failed:
            self._failed = None
            self._answers.append(ports.EvidenceKept(self._clock.now().monotonic_us))
        if late is not None:
            self._answers.append(ports.Noted(self._clock.now().monotonic_us, late))
        if self._held is None:
            return
        command, record = self._held
        if reason is not None:
            self._refuse(command, ports.WITHHELD)
        elif self._recorded(record):
            self._send(command)
        elif self._clock.now().monotonic_us > command.not_after_us:
            self._refuse(command, "late")

    def _act(self, actions: Sequence[Action], sent: Command | None) -> Ending | None:
        ending: Ending | None = None
        record: _Record | None = _Record(self._lines, BUFFERED)
        for action in actions:
            match action:
                case ports.Append():
                    record = self._append(action, record)
                case Command():
                    if action is not sent:
                        self._dispatch(action, record)
                case ports.Release():
                    self._held = None
                    self._vehicle.release()
                case ports.Announce(severity, text):
                    self._vehicle.announce(severity, text)
                case ports.Expect(steps):
                    self._vehicle.expect(steps)
                case ports.End(how):
                    self._held = None
                    ending = how
        return ending

    def _append(self, append: ports.Append, record: _Record | None) -> _Record | None:
        """The record that a following command waits for; None if it, or an earlier one in this step, was refused."""
        try:
            given = self._sink.append(append.line, append.durability)
        except OSError as error:
            self._lines += 1  # it was taken over all the same
            self._fail(error.strerror or str(error))
            return None
        self._lines = given
        if record is None or not append.awaited:
            return record
        return _Record(given, max(record.durability, append.durability))

    def _dispatch(self, command: Command, record: _Record | None) -> None:
        """Send a command, or hold it until its record is kept. It replaces a command that was held."""
        self._held = None
        if command.needs_record and record is None:
            self._refuse(command, ports.WITHHELD)
        elif not command.needs_record or record is None or self._recorded(record):
            self._send(command)
        else:
            self._held = command, record

    def _recorded(self, record: _Record) -> bool:
        """Whether a record is as durable as the command requires."""
        if record.durability == BUFFERED:
            return True
        return (self._sink.synced if record.durability == SYNCED_FIRST else self._sink.kept) >= record.lines

    def _fail(self, reason: str) -> None:
        self._failed = self._lines
        self._answers.append(ports.EvidenceFailed(self._clock.now().monotonic_us, reason))

    def _send(self, command: Command) -> None:
        """Send a command, unless it is too late by now."""
        now_us = self._clock.now().monotonic_us
        if now_us > command.not_after_us:
            self._refuse(command, "late")
            return
        self._held = None
        self._vehicle.begin(command, now_us)

    def _refuse(self, command: Command, reason: str) -> None:
        self._held = None
        self._answers.append(ports.CommandFailed(self._clock.now().monotonic_us, command.token, reason))
