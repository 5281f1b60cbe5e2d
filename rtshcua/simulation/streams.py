"""What an autopilot sends unasked, and what faults make of its messages: old values, or none."""

from collections import deque
from collections.abc import Callable, Mapping
from copy import copy
from functools import partial
from random import Random

from rtshcua.codec.frames import Message


class Streams:
    """The intervals of a vehicle's streams, in microseconds. `default` holds those that run from boot.

    `phases` draws when each of them begins, within its interval; without it all begin together.
    """

    def __init__(self, default: Mapping[int, int], phases: Random | None = None) -> None:
        self._default = dict(default)
        self._interval = dict(default)
        self._due = {number: phases.randrange(every) if phases else 0 for number, every in default.items()}
        self.next_us = 0
        """Nothing is due before."""

    def set(self, message_id: int, interval_us: int) -> None:
        """Sets an interval as SET_MESSAGE_INTERVAL means it: 0 is the default one, negative is never.

        One that it has already changes nothing, not even when the next message is due.
        """
        if interval_us == 0:
            interval_us = self._default.get(message_id, -1)
        if interval_us < 0:
            self._interval.pop(message_id, None)
            self._due.pop(message_id, None)
        elif interval_us != self._interval.get(message_id):
            self._interval[message_id] = interval_us
            self._due[message_id] = self.next_us = 0

    def interval(self, message_id: int) -> int:
        """The interval of a message, -1 if it is not streamed."""
        return self._interval.get(message_id, -1)

    def due(self, now_us: int) -> list[int]:
        """The messages to send now; each is due again an interval later."""
        if now_us < self.next_us:
            return []
        due_us = self._due
        due = [message_id for message_id, at_us in due_us.items() if at_us <= now_us]
        for message_id in due:
            # From when it was due, so that the mean rate is right; but what was missed is not made up for.
            interval = self._interval[message_id]
            following = due_us[message_id] + interval
            due_us[message_id] = following if following > now_us else now_us + interval
        self.next_us = min(due_us.values(), default=now_us)
        return due


ALWAYS = frozenset({"HEARTBEAT", "SYSTEM_TIME", "TIMESYNC"})
"""What does not hold a measurement, and goes on when the others are frozen."""
_STAMPS: Mapping[str, int] = {"time_boot_ms": 1_000, "time_usec": 1}
"""The fields that tell when, since the start, and how many microseconds one of each is."""


class Reports:
    """Builds the messages of one autopilot by their numbers. A fault may silence one, or let it stick, or freeze all,
    or delay all at the source.

    `clock` tells the microseconds since the start.
    """

    def __init__(self, build: Mapping[int, Callable[[], Message | None]], clock: Callable[[], int]) -> None:
        self._build = build
        self._clock = clock
        self._silent: set[int] = set()
        self._stuck: dict[int, Message | None] = {}
        self._old: dict[int, Message | None] | None = None
        self._delay_us = 0
        self._made: dict[int, deque[tuple[int, Message | None]]] = {}
        self.builders = self._build
        """What builds each message as it is told now; what it gives is None if there is nothing to tell."""

    def __contains__(self, number: int) -> bool:
        return number in self._build

    def message(self, number: int) -> Message | None:
        """The message of this number with what is known now; None if there is nothing to tell."""
        return self.builders[number]()

    def _faulty(self, number: int) -> Message | None:
        if number in self._silent:
            return None
        if self._old is not None and number in self._old:
            return self._old[number]
        if self._stuck and number in self._stuck:
            return self._with_new_stamps(self._stuck[number])
        if self._delay_us and number in self._made:
            return self._delayed(number)
        return self._build[number]()

    def is_silent(self, number: int) -> bool:
        """Whether a fault keeps this message from coming, as a report or as an answer."""
        return number in self._silent

    def silence(self, number: int, silent: bool) -> None:
        """From now on this message does not come, or comes again."""
        (self._silent.add if silent else self._silent.discard)(number)
        self._choose()

    def stick(self, number: int, stuck: bool) -> None:
        """From now on this message keeps its values, with new time stamps; or tells what is again."""
        if stuck:
            self._stuck[number] = self._build[number]() if number in self._build else None
        else:
            self._stuck.pop(number, None)
        self._choose()

    def freeze(self, frozen: bool) -> None:
        """From now on all measurements are those of now, time stamps included; or fresh ones again."""
        self._old = self._measured() if frozen else None
        self._choose()

    def delay(self, delay_us: int) -> None:
        """From now on all measurements are as old as this when they are sent, and say so; or fresh ones again, at 0."""
        self._delay_us = delay_us
        now_us = self._clock()
        self._made = {number: deque([(now_us, m)]) for number, m in self._measured().items()} if delay_us else {}
        self._choose()

    def restart(self) -> None:
        """The clock begins anew: what was made before is not known any more."""
        self.delay(self._delay_us)

    def _choose(self) -> None:
        """A fault has begun or ended: as long as there is none, messages are built without asking for one."""
        faults = self._silent or self._stuck or self._old is not None or self._delay_us
        self.builders = {number: partial(self._faulty, number) for number in self._build} if faults else self._build

    def _measured(self) -> dict[int, Message | None]:
        now = {number: build() for number, build in self._build.items()}
        return {number: m for number, m in now.items() if m is None or m.get_type() not in ALWAYS}

    def _delayed(self, number: int) -> Message | None:
        made, now_us = self._made[number], self._clock()
        made.append((now_us, self._build[number]()))
        while len(made) > 1 and made[1][0] <= now_us - self._delay_us:
            made.popleft()
        return made[0][1]

    def _with_new_stamps(self, message: Message | None) -> Message | None:
        if message is None:
            return None
        renewed, now_us = copy(message), self._clock()
        for name, unit_us in _STAMPS.items():
            if hasattr(renewed, name):
                setattr(renewed, name, now_us // unit_us)
        return renewed
