"""The message streams of an autopilot, and faults in its messages: old values, or silence."""

from collections import deque
from collections.abc import Callable, Mapping
from copy import copy
from functools import partial
from random import Random

from rtshcua.codec.frames import Message


class Streams:
    """The intervals of a vehicle's streams, in microseconds. `default` holds the streams that run from boot.

    `phases` draws the start of each stream within its interval; without it all start together.
    """

    def __init__(self, default: Mapping[int, int], phases: Random | None = None) -> None:
        self._default = dict(default)
        self._interval = dict(default)
        self._due = {number: phases.randrange(every) if phases else 0 for number, every in default.items()}
        self.next_us = 0
        """No stream is due before this time."""

    def set(self, message_id: int, interval_us: int) -> None:
        """Set an interval as in SET_MESSAGE_INTERVAL: 0 is the default, negative is never.

        Setting the current interval changes nothing, not even when the next message is due.
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
        """Return the interval of a message, -1 if it is not streamed."""
        return self._interval.get(message_id, -1)

    def due(self, now_us: int) -> list[int]:
        """Return the ids of the messages to send now; each is due again an interval later."""
        if now_us < self.next_us:
            return []
        due_us = self._due
        due = [message_id for message_id, at_us in due_us.items() if at_us <= now_us]
        for message_id in due:
            # Count from the due time to keep the mean rate, but do not catch up on missed messages.
            interval = self._interval[message_id]
            following = due_us[message_id] + interval
            due_us[message_id] = following if following > now_us else now_us + interval
        self.next_us = min(due_us.values(), default=now_us)
        return due


ALWAYS = frozenset({"HEARTBEAT", "SYSTEM_TIME", "TIMESYNC"})
"""Messages without measurements, which continue while the others are frozen."""
_STAMPS: Mapping[str, int] = {"time_boot_ms": 1_000, "time_usec": 1}
"""The time stamp fields, and their units in microseconds."""


class Reports:
    """Builds the messages of one autopilot by id. Faults can silence or stick one message, or freeze or delay all.

    `clock` returns the microseconds since the start.
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
        """The current builder of each message, with faults applied."""

    def __contains__(self, number: int) -> bool:
        return number in self._build

    def message(self, number: int) -> Message | None:
        """Build the message of this id; None if there is nothing to report."""
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
        """Return whether a fault suppresses this message, as a stream or as an answer."""
        return number in self._silent

    def silence(self, number: int, silent: bool) -> None:
        """Suppress a message from now on, or send it again."""
        (self._silent.add if silent else self._silent.discard)(number)
        self._choose()

    def stick(self, number: int, stuck: bool) -> None:
        """Let a message keep its values with new time stamps from now on, or update again."""
        if stuck:
            self._stuck[number] = self._build[number]() if number in self._build else None
        else:
            self._stuck.pop(number, None)
        self._choose()

    def freeze(self, frozen: bool) -> None:
        """Freeze all measurements, time stamps included, or update again."""
        self._old = self._measured() if frozen else None
        self._choose()

    def delay(self, delay_us: int) -> None:
        """Delay all measurements by this long at the source, with their old time stamps; 0 ends the delay."""
        self._delay_us = delay_us
        now_us = self._clock()
        self._made = {number: deque([(now_us, m)]) for number, m in self._measured().items()} if delay_us else {}
        self._choose()

    def restart(self) -> None:
        """Forget delayed messages after a restart of the clock."""
        self.delay(self._delay_us)

    def _choose(self) -> None:
        """Choose the builders after a fault began or ended. Without faults there is no overhead."""
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
