"""The mission protocol for a fence: upload, then download, and the two must be the same.

An acknowledged upload says little (docs/adr/0019-what-a-vehicle-says.md), so what the vehicle holds is read back.
Source: https://mavlink.io/en/services/mission.html; PX4 asks with MISSION_REQUEST_INT, and at times with both,
ArduCopter with the older MISSION_REQUEST and takes MISSION_ITEM_INT for an answer (recorded).
"""

from enum import Enum, auto
from math import isclose
from typing import Any, Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.fence import FenceItem
from rtshcua.adapters.vehicle.flavour import Message

RETRY_US: Final = 1_000_000
RETRIES: Final = 8
#: Between two requests of the vehicle; ArduCopter itself gives up after 8 s.
SILENCE_US: Final = 8_000_000

_RESULTS: Final = {
    1: "error", 2: "unsupported frame", 4: "no space", 5: "invalid", 13: "invalid sequence", 14: "denied",
    15: "cancelled",
}  # fmt: skip
_ACCEPTED, _UNSUPPORTED = 0, 3


class Step(Enum):
    """Where it stands."""

    IDLE = auto()
    SENDING = auto()
    COUNTING = auto()
    READING = auto()
    DONE = auto()
    UNSUPPORTED = auto()
    FAILED = auto()


class Upload:
    """One fence, to one vehicle. `problem` says what went wrong when it FAILED."""

    def __init__(self, items: tuple[FenceItem, ...], frame: int, slack: int = 1) -> None:
        self._slack = slack
        self._items = items
        self._frame = frame
        self.step = Step.IDLE
        self.problem = ""
        self._tries = 0
        self._sent_us = 0
        self._asked = False
        self._read: list[FenceItem] = []

    def due(self, system: int, now_us: int) -> list[Message]:
        """What to send now: the beginning, or again what was not answered."""
        if self.step is Step.IDLE:
            return self._begin(Step.SENDING, system, now_us)
        if self.step not in (Step.SENDING, Step.COUNTING, Step.READING):
            return []
        if now_us - self._sent_us < (SILENCE_US if self._asked else RETRY_US) * self._slack:
            return []
        self._tries += 1
        if self._tries > RETRIES:
            return self._fail("does not answer")
        self._sent_us, self._asked = now_us, False
        return [self._request(system)]

    def take(self, name: str, message: Any, system: int, now_us: int) -> list[Message]:
        """A message of the mission protocol, about fences and for us; what answers it."""
        match name, self.step:
            case (("MISSION_REQUEST" | "MISSION_REQUEST_INT"), Step.SENDING):
                if message.seq >= len(self._items):
                    return self._fail(f"asks for item {message.seq} of {len(self._items)}")
                self._sent_us, self._asked, self._tries = now_us, True, 0
                return [messages.fence_item(system, message.seq, self._frame, self._items[message.seq])]
            case "MISSION_ACK", Step.SENDING:
                if message.type == _ACCEPTED:
                    return self._begin(Step.COUNTING, system, now_us)
                if message.type == _UNSUPPORTED:
                    self.step = Step.UNSUPPORTED
                    return []
                return self._fail(f"refuses it ({_RESULTS.get(message.type, f'result {message.type}')})")
            case "MISSION_COUNT", Step.COUNTING:
                if message.count != len(self._items):
                    return self._fail(f"holds {message.count} items instead of {len(self._items)}")
                return self._begin(Step.READING, system, now_us)
            case "MISSION_ITEM_INT", Step.READING:
                return self._compare(message, system, now_us)
        return []

    def _compare(self, message: Any, system: int, now_us: int) -> list[Message]:
        number = len(self._read)
        if message.seq != number:
            return []  # of an earlier request
        item = FenceItem(message.command, message.x, message.y, message.param1)
        if item[:3] != self._items[number][:3] or not isclose(
            item.parameter, self._items[number].parameter, abs_tol=0.01
        ):
            return self._fail(f"holds another item {number} than it was sent")
        self._read.append(item)
        if len(self._read) < len(self._items):
            return self._begin(Step.READING, system, now_us)
        self.step = Step.DONE
        return [messages.fence_received(system)]

    def _begin(self, step: Step, system: int, now_us: int) -> list[Message]:
        self.step, self._sent_us, self._tries, self._asked = step, now_us, 0, False
        return [self._request(system)]

    def _request(self, system: int) -> Message:
        if self.step is Step.SENDING:
            return messages.fence_count(system, len(self._items))
        if self.step is Step.COUNTING:
            return messages.fence_list(system)
        return messages.fence_request(system, len(self._read))

    def _fail(self, problem: str) -> list[Message]:
        self.step, self.problem = Step.FAILED, problem
        return []
