"""The oracle of `boundary/enforcement/clock.c`: the own clock of a separate boundary process, which never uses the time
that the runtime claims. It is independent of the C code; only tests use it.

The first available source counts: the machine's clock, if the kernel reports it as synchronised; the vehicle's
SYSTEM_TIME, in frames with a signature that the boundary verified itself; the clock error that an operator stated at
the boundary's start. The source is used once: then UTC advances with monotonic time, and its error grows. A boundary in
the runtime's own process has no other clock, so there the caller's time counts (`SHARED`).

The vehicle's time is taken in answer to a challenge, so that a past time cannot be replayed: the boundary draws a
number, the vehicle returns it (TIMESYNC), and a SYSTEM_TIME that the vehicle signed afterwards is later than the draw.
Time is an argument everywhere, monotonic and in us.
"""

from typing import Final, NamedTuple

from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.framing import CHECKSUM, HEADER, MARKER
from rtshcua.mavlink.layouts import SYSTEM_TIME, TIMESYNC
from rtshcua.mavlink.signing import Stream
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.wire.clock import DRIFT_US, UNIX_US, ClockSource

#: how far the vehicle's own UTC may be off, in us (`wire.clock.AUTOPILOT_US`), and a stamp that is in whole ms: of
#: ArduPilot, and the worse of both autopilots
ARDUPILOT_US: Final = 1_001_000
VEHICLE_US: Final = 6_001_000
#: how long a challenge may be answered, in us: the time between is part of the error
CHALLENGE_US: Final = 5_000_000

_TIMES: Final = 16  # the octets of a payload that are looked at
_SECOND_US: Final = 1_000_000


class _Challenge(NamedTuple):
    number: int
    drawn_us: int
    answered: Stream | None = None  # who sent it back


class OwnClock:
    """The clock of a separate boundary process. UTC comes from the first source, and advances with monotonic time."""

    def __init__(self, machine: Now, stated_us: int | None = None) -> None:
        """`machine` is the machine's clock, with the error that the kernel reports (`UTC_UNKNOWN_US` where it is not
        synchronised); `stated_us` is the largest clock error stated by an operator.
        """
        self.source = ClockSource.UNKNOWN
        self._stated_us = stated_us
        self._ahead_us = machine.utc_us - machine.monotonic_us
        self._error_us = UTC_UNKNOWN_US
        self._since_us = 0
        self._challenge: _Challenge | None = None
        self.look(machine)

    def now(self, monotonic_us: int) -> Now:
        """The present moment, by this clock."""
        error_us = self._error_us
        if self.source is not ClockSource.UNKNOWN:
            error_us += max(0, monotonic_us - self._since_us) * DRIFT_US // _SECOND_US
        return Now(monotonic_us, max(0, monotonic_us + self._ahead_us), min(error_us, UTC_UNKNOWN_US))

    def look(self, machine: Now) -> None:
        """Check the machine's clock again: it is used if it is synchronised and no source was used before."""
        if self.source is ClockSource.UNKNOWN and machine.utc_error_us < UTC_UNKNOWN_US:
            self._take(
                ClockSource.KERNEL, machine.utc_us - machine.monotonic_us, machine.utc_error_us, machine.monotonic_us
            )

    def settle(self, monotonic_us: int) -> None:
        """Stop waiting: without a better source, the operator's statement counts."""
        if self.source is ClockSource.UNKNOWN and self._stated_us is not None:
            self._take(ClockSource.OPERATOR, self._ahead_us, self._stated_us, monotonic_us)

    def asks(self, monotonic_us: int) -> bool:
        """Whether the next challenge needs a number."""
        return self.source is ClockSource.UNKNOWN and (
            self._challenge is None or monotonic_us - self._challenge.drawn_us > CHALLENGE_US
        )

    def challenge(self, number: int, monotonic_us: int) -> None:
        """Challenge the vehicle to return this number, which is positive and not predictable."""
        self._challenge = _Challenge(number, monotonic_us)

    @property
    def number(self) -> int:
        """The number that the vehicle must return; 0 without a challenge."""
        return 0 if self._challenge is None or self.source is not ClockSource.UNKNOWN else self._challenge.number

    def hear(self, frame: bytes, link: int, vehicle_us: int, monotonic_us: int) -> None:
        """Receive a frame with a verified signature, which was removed, on a link of this id. `vehicle_us` is the
        possible error of the vehicle's own UTC.

        Frames of one stream are accepted in the order in which they were signed, and in no other.
        """
        asked = self._challenge
        if self.source is not ClockSource.UNKNOWN or asked is None or monotonic_us - asked.drawn_us > CHALLENGE_US:
            return
        message, body = _of_autopilot(frame)
        sender = (frame[5], frame[6], link) if body else None
        if message == TIMESYNC:
            clock_ns, number = (int.from_bytes(body[at : at + 8], "little", signed=True) for at in (0, 8))
            if clock_ns > 0 and number == asked.number:
                self._challenge = asked._replace(answered=sender)
        elif message == SYSTEM_TIME and sender == asked.answered:
            utc_us = int.from_bytes(body[:8], "little")
            if UNIX_US <= utc_us <= MAX_VALUE:
                open_us = max(0, monotonic_us - asked.drawn_us)
                ahead_us = utc_us - monotonic_us + open_us // 2
                self._take(ClockSource.VEHICLE, ahead_us, vehicle_us + open_us - open_us // 2, monotonic_us)

    def _take(self, source: ClockSource, ahead_us: int, error_us: int, since_us: int) -> None:
        self.source, self._ahead_us, self._error_us, self._since_us = source, ahead_us, error_us, since_us


def _of_autopilot(frame: bytes) -> tuple[int, bytes]:
    """The message id and first octets of a frame of an autopilot, with omitted zeros; -1 for other frames."""
    if len(frame) < HEADER or frame[0] != MARKER or frame[6] != AUTOPILOT:
        return -1, b""
    if len(frame) != HEADER + frame[1] + CHECKSUM:
        return -1, b""
    body = frame[HEADER : HEADER + frame[1]][:_TIMES]
    return int.from_bytes(frame[7:10], "little"), body.ljust(_TIMES, b"\0")
