"""What an autopilot sends unasked, and what faults make of its messages: old values, or none."""

from collections.abc import Callable, Mapping

from rtshcua.codec.frames import Message


class Streams:
    """The intervals of a vehicle's streams, in microseconds. `default` holds those that run from boot."""

    def __init__(self, default: Mapping[int, int]) -> None:
        self._default = dict(default)
        self._interval = dict(default)
        self._due = dict.fromkeys(default, 0)
        self._next_us = 0  # nothing is due before

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
            self._due[message_id] = self._next_us = 0

    def interval(self, message_id: int) -> int:
        """The interval of a message, -1 if it is not streamed."""
        return self._interval.get(message_id, -1)

    def due(self, now_us: int) -> list[int]:
        """The messages to send now; each is due again an interval later."""
        if now_us < self._next_us:
            return []
        due = [message_id for message_id, at_us in self._due.items() if at_us <= now_us]
        for message_id in due:
            # From when it was due, so that the mean rate is right; but what was missed is not made up for.
            interval = self._interval[message_id]
            following = self._due[message_id] + interval
            self._due[message_id] = following if following > now_us else now_us + interval
        self._next_us = min(self._due.values(), default=now_us)
        return due


ALWAYS = frozenset({"HEARTBEAT", "SYSTEM_TIME", "TIMESYNC"})
"""What does not hold a measurement, and goes on when the others are frozen."""


class Reports:
    """Builds the messages of one autopilot by their numbers. A fault may silence one, or freeze all."""

    def __init__(self, build: Mapping[int, Callable[[], Message | None]]) -> None:
        self._build = build
        self._silent: set[int] = set()
        self._old: dict[int, Message | None] | None = None

    def __contains__(self, number: int) -> bool:
        return number in self._build

    def message(self, number: int) -> Message | None:
        """The message of this number with what is known now; None if there is nothing to tell."""
        if number in self._silent:
            return None
        if self._old is not None and number in self._old:
            return self._old[number]
        return self._build[number]()

    def silence(self, number: int, silent: bool) -> None:
        """From now on this message does not come, or comes again."""
        (self._silent.add if silent else self._silent.discard)(number)

    def freeze(self, frozen: bool) -> None:
        """From now on all measurements are those of now, time stamps included; or fresh ones again."""
        self._old = None
        if frozen:
            now = {number: build() for number, build in self._build.items()}
            self._old = {number: m for number, m in now.items() if m is None or m.get_type() not in ALWAYS}
