"""Which messages are sent unasked, and how often."""

from collections.abc import Mapping


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
