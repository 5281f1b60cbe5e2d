"""What an autopilot's messages are built from, and what faults make of them: old values, or none."""

from collections.abc import Callable, Mapping

from rtshcua.codec.frames import Message

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
        if silent:
            self._silent.add(number)
        else:
            self._silent.discard(number)

    def freeze(self, frozen: bool) -> None:
        """From now on all measurements are those of now, time stamps included; or fresh ones again."""
        self._old = None
        if frozen:
            now = {number: build() for number, build in self._build.items()}
            self._old = {number: m for number, m in now.items() if m is None or m.get_type() not in ALWAYS}
