"""The oracle of `boundary/enforcement/clock.c`: the time of day that a boundary apart holds to, its own, never what the
runtime names. Written apart from it; only tests use it.

Its sources, the first that tells: the machine's clock, where the kernel says that it is synchronised; the vehicle's
SYSTEM_TIME, in frames of which the boundary verified the link's signature itself; what an operator stated when the
boundary began. Once one was taken nothing moves any more: UTC is carried on by monotonic time, and its error grows. A
boundary in the runtime's own process has no other clock than that: there the caller's counts (`SHARED`).

The vehicle's time is taken in answer to a challenge, so that nobody hands in an hour that is past: the boundary draws a
number, the vehicle sends it back (TIMESYNC), and a SYSTEM_TIME that the vehicle signed after that was made after the
number was drawn. Time is an argument everywhere, monotonic and in us.
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
    """The clock of a boundary with a process of its own. UTC is what was taken first, carried on."""

    def __init__(self, machine: Now, stated_us: int | None = None) -> None:
        """`machine` is the machine's clock, its error as the kernel says it (`UTC_UNKNOWN_US` where it is not
        synchronised); `stated_us` what an operator says that it is off by at most.
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
        """The machine's clock, once more: it is taken where it is synchronised, and nothing was taken before."""
        if self.source is ClockSource.UNKNOWN and machine.utc_error_us < UTC_UNKNOWN_US:
            self._take(
                ClockSource.KERNEL, machine.utc_us - machine.monotonic_us, machine.utc_error_us, machine.monotonic_us
            )

    def settle(self, monotonic_us: int) -> None:
        """No more is waited for: what the operator stated holds, if nothing better was told."""
        if self.source is ClockSource.UNKNOWN and self._stated_us is not None:
            self._take(ClockSource.OPERATOR, self._ahead_us, self._stated_us, monotonic_us)

    def asks(self, monotonic_us: int) -> bool:
        """Whether a number is to be drawn for the next challenge."""
        return self.source is ClockSource.UNKNOWN and (
            self._challenge is None or monotonic_us - self._challenge.drawn_us > CHALLENGE_US
        )

    def challenge(self, number: int, monotonic_us: int) -> None:
        """From now on the vehicle is asked to send this number back; above 0, and not to be guessed."""
        self._challenge = _Challenge(number, monotonic_us)

    @property
    def number(self) -> int:
        """The number that the vehicle is to send back; 0 where none is."""
        return 0 if self._challenge is None or self.source is not ClockSource.UNKNOWN else self._challenge.number

    def hear(self, frame: bytes, link: int, vehicle_us: int, monotonic_us: int) -> None:
        """A frame of which the link's signature was verified came in by a link of this id; its signature is off. The
        vehicle's own UTC may be off by `vehicle_us`.

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
    """Message and first octets of a whole frame of an autopilot, with the zeros that are not sent; none of another."""
    if len(frame) < HEADER or frame[0] != MARKER or frame[6] != AUTOPILOT:
        return -1, b""
    if len(frame) != HEADER + frame[1] + CHECKSUM:
        return -1, b""
    body = frame[HEADER : HEADER + frame[1]][:_TIMES]
    return int.from_bytes(frame[7:10], "little"), body.ljust(_TIMES, b"\0")
