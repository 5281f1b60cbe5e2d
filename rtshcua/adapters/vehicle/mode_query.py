"""The flight mode, known before anything moves the vehicle.

PX4 sends its HEARTBEAT once a second, whatever interval is asked for, and a pilot who takes over in between would be
flown over. Both autopilots answer REQUEST_MESSAGE of HEARTBEAT within milliseconds, so the mode is asked for: again
and again while something of ours flies, and once more right before a frame that begins a motion (docs/adr/0034).
"""

from typing import Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Message
from rtshcua.adapters.vehicle.observed import Observed

#: An unanswered question is put again after this long.
AGAIN_US: Final = 100_000
#: While nothing of ours flies it is asked this often, to know that it answers at all;
IDLE_US: Final = 1_000_000
#: and while something does, where the mode is streamed fast enough.
STREAMED_US: Final = 300_000


class ModeQuery:
    """Asks for HEARTBEAT. `within_us`: no frame that moves the vehicle leaves on an older mode report."""

    def __init__(self, within_us: int) -> None:
        self._within_us = within_us
        self._asked_us: int | None = None
        self._wanted_beats: int | None = None  # how many heartbeats had come when a frame began to wait

    def is_young(self, seen: Observed, now_us: int) -> bool:
        """Whether the last mode report will do for a frame that stops the vehicle, or brings it home or down."""
        return seen.heartbeat_us is not None and now_us - seen.heartbeat_us <= self._within_us

    def is_newer(self, seen: Observed) -> bool:
        """Whether a mode report came since this was first asked for one frame: it will do for any."""
        if self._wanted_beats is None:
            self._wanted_beats = seen.beats
            self._asked_us = None  # ask at once
        return seen.beats > self._wanted_beats

    def sent(self) -> None:
        """The frame left, or is not wanted any more: the next one asks anew."""
        self._wanted_beats = None

    def due(self, system: int, seen: Observed, now_us: int, *, flies: bool) -> list[Message]:
        """The question to put now, if one is due. `flies`: something of ours does, or the vehicle is in the air."""
        if self._wanted_beats is not None:
            every_us = AGAIN_US
        elif not flies:
            every_us = IDLE_US
        elif seen.heartbeat_us is not None and now_us - seen.heartbeat_us < self._within_us // 2:
            every_us = STREAMED_US
        else:
            every_us = self._within_us // 2
        if self._asked_us is not None and now_us - self._asked_us < every_us:
            return []
        self._asked_us = now_us
        return [messages.request(system, "HEARTBEAT")]
