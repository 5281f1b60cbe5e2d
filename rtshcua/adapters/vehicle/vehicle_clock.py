"""The vehicle's boot clock against ours, bounded by round trips of TIMESYNC.

We send `ts1` = our monotonic time with `tc1` = 0; the vehicle answers with `ts1` as it came and `tc1` = its time since
boot, both in ns. The vehicle read its clock after we sent, so the offset (ours minus its) is at least the time of
sending minus `tc1`, and at most the time of the answer minus `tc1`. Only the first of these is kept: it makes ages too
old, by the time of the way up, and never too young. The second shows when the vehicle's clock was set forward.

Both autopilots read `tc1` from the clock of which their other stamps are made. PX4: `hrt_absolute_time()` where the
message is handled (src/modules/mavlink/mavlink_timesync.cpp); `time_boot_ms` and `time_usec` of its telemetry are
`timestamp` of the topic, of the same clock (streams/GLOBAL_POSITION_INT.hpp, GPS_RAW_INT.hpp). ArduPilot:
`timesync_receive_timestamp_ns()`, which is `AP_HAL::micros64()`, moved back to when the frame began to come in where
the UART can tell (`receive_time_constraint_us`; GCS_Common.cpp); `time_boot_ms` is `AP_HAL::millis()` at sending. Both
also send requests of their own (`tc1` = 0), which need no answer.
"""

from collections import deque
from statistics import median_low
from typing import Final

from rtshcua.onboard.enforcement.frames import OURS

#: How often it is asked, in us: until so many answers came, then, and while answers fail to come.
FIRST_US, FIRST_ANSWERS = 100_000, 5
EACH_US: Final = 1_000_000
RETRY_US: Final = 200_000
#: an answer that is older than this was followed by requests that got lost
MISSED_US: Final = 1_500_000

#: How much faster than ours the vehicle's clock may run, as the us that the bound loses in each `STEP_US`: 1 %. The
#: crystals of flight controllers keep to 0.01 %; simulated autopilots (PX4 SIH, ArduPilot SITL) were recorded 3 % slow
#: to 0.6 % fast over seconds. A slow clock needs no allowance: it makes ages too old until the next answer.
STEP_US, DRIFT_US = 250_000, 2_500
#: Requests of which an answer is still taken. At `RETRY_US` that is a round trip of 12 s.
_OUTSTANDING: Final = 64
#: A doubt that follows an answer so soon has to wait, lest a message whose stamps are wrong has us ask without end.
_REST_US: Final = 500_000
#: A bound that proves wrong by no more than this shows that the clocks ran apart, by more that one of them was set.
APART_US: Final = 500_000
#: ArduPilot reckons with the UART's rate where there is none (SITL over TCP), and is early by some ms.
_NOTABLE_US: Final = 20_000
#: requests under way at first; with more the link is not asked any faster for it
_HASTE: Final = 20
_TRIPS: Final = 8


class VehicleClock:
    """The least that our clock may be ahead of the vehicle's. Times are ours, monotonic, in us; never raises.

    The bound is the best of all answers so far, less what the clocks may have drifted apart since. It goes down in
    steps, so that equal stamps mean equal times in between.
    """

    def __init__(self) -> None:
        self._asked: dict[int, int] = {}  # ts1 to when it was sent
        self._asked_us: int | None = None
        self._answers = 0
        self._least_us: int | None = None
        self._since_us = 0
        self._doubted = False
        self._trips: deque[int] = deque(maxlen=_TRIPS)
        self.answered_us: int | None = None
        """When the last answer came; None before the first."""
        self.error_us: int | None = None
        """The width of the bounds at the last answer: no stamp is taken for older than it is by more, but for drift."""

    @property
    def round_trips_us(self) -> tuple[int, ...]:
        """How long the last answers took, there and back, oldest first."""
        return tuple(self._trips)

    @property
    def round_trip_us(self) -> int | None:
        """The median of the last round trips; None before the first."""
        return median_low(self._trips) if self._trips else None

    def due(self, now_us: int) -> int | None:
        """The `ts1` to send now, in ns; None when nothing is due. It ends in our component id, as ArduPilot's do in its
        system id, so that answers to another program on this machine are not taken for ours.
        """
        if self._asked_us is not None and now_us - self._asked_us < self._wait_us(now_us):
            return None
        self._asked_us, self._doubted = now_us, False
        ts1_ns = now_us * 1_000 + OURS
        self._asked[ts1_ns] = now_us
        if len(self._asked) > _OUTSTANDING:
            del self._asked[next(iter(self._asked))]
        return ts1_ns

    def _wait_us(self, now_us: int) -> int:
        if self._doubted or (self._answers < FIRST_ANSWERS and len(self._asked) < _HASTE):
            return FIRST_US
        if self.answered_us is None or now_us - self.answered_us > MISSED_US:
            return RETRY_US
        return EACH_US

    def answer(self, tc1_ns: int, ts1_ns: int, now_us: int) -> bool:
        """An answer came. True if nothing holds any more that was concluded before: its clock was set forward."""
        sent_us = self._asked.pop(ts1_ns, None)
        if sent_us is None or tc1_ns <= 0 or now_us < sent_us:
            return False
        self._answers += 1
        self.answered_us = now_us
        self._trips.append(now_us - sent_us)
        held_us = self.offset_us(now_us)
        least_us, most_us = sent_us + -tc1_ns // 1_000, now_us + 1 - tc1_ns // 1_000
        wrong_us = 0 if held_us is None else held_us - most_us
        if held_us is None or wrong_us > 0 or least_us - _drift_us(now_us - sent_us) > held_us:
            self._least_us, self._since_us = least_us, sent_us
        self.error_us = most_us - (self.offset_us(now_us) or 0)
        return wrong_us > APART_US

    def offset_us(self, now_us: int) -> int | None:
        """Ours minus the vehicle's, at the least; None before the first answer."""
        if self._least_us is None:
            return None
        return self._least_us - _drift_us(now_us - self._since_us)

    def next_step_us(self, now_us: int) -> int:
        """When the bound goes down next."""
        return now_us + STEP_US - (now_us - self._since_us) % STEP_US

    def reduce(self, by_us: int, now_us: int) -> None:
        """A stamp lay ahead of us by so much: the clocks ran apart faster than is allowed for."""
        if self._least_us is not None:
            self._least_us -= by_us
        if by_us > _NOTABLE_US:
            self.doubt(now_us)

    def doubt(self, now_us: int) -> None:
        """Something speaks against the bound: ask soon."""
        self._doubted = self.answered_us is not None and now_us - self.answered_us > _REST_US


def _drift_us(passed_us: int) -> int:
    return DRIFT_US * (passed_us // STEP_US + 1)
