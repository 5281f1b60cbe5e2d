"""When the vehicle measured the contents of a frame, on our monotonic clock: the earliest possible time.

A frame with a time stamp was measured at its stamp, converted to our clock by `VehicleClock`. A frame of the autopilot
without a stamp (HEARTBEAT, SYS_STATUS, BATTERY_STATUS, ...) was sent after every frame with a lower sequence number, so
it is no older than the latest stamp among those. Sequence numbers give the order of sending, whatever the order of
arrival. The clock of another component (a radio, a companion computer) is not known: its frame counts as no younger
than the latest stamp that came before it and, where the link lets frames overtake others, as delayed as long as the
slowest of those within the last second or two.

No frame counts as younger than its arrival. Without a bound there is no time.

Stamps are found by field name. `time_boot_ms` counts ms since boot in 32 bits, and wraps after 49 days. `time_usec` is
us since boot, or UNIX time when it is that large; the last SYSTEM_TIME of the autopilot holds both, and converts
between them. In GPS_RAW_INT it is the time of the fix (ArduPilot: `last_fix_time_ms`), in HOME_POSITION the time at
which home was set. 0 means unknown: PX4 sends it until its receiver has UTC (streams/GPS_RAW_INT.hpp). A stamp that
does not advance belongs to the same measurement, and keeps its first time.

WIND has no stamp, and ArduPilot repeats the last estimate of a flight for ever after it (vehicles.md, section 5). An
estimate of three floating-point numbers never repeats while it is updated, so an unchanged one is the same measurement,
too.
"""

from collections import deque
from collections.abc import Callable
from operator import attrgetter
from statistics import median_low
from typing import Any, Final, NamedTuple

from rtshcua.codec.frames import ReceivedFrame
from rtshcua.mavlink import dialect
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.onboard.enforcement.frames import OURS
from rtshcua.wire.clock import UNIX_US

# ---------------------------------------------------------------- the vehicle's clock

#: Intervals of TIMESYNC requests in us: before the first answers, afterwards, and while answers are missing.
FIRST_US, FIRST_ANSWERS = 100_000, 5
EACH_US: Final = 1_000_000
RETRY_US: Final = 200_000
#: an answer that is older than this was followed by requests that were lost
MISSED_US: Final = 1_500_000

#: How much faster than ours the vehicle's clock may run, as the us that the bound loses in each `STEP_US`: 1 %. The
#: crystals of flight controllers keep to 0.01 %; simulated autopilots (PX4 SIH, ArduPilot SITL) were recorded 3 % slow
#: to 0.6 % fast over seconds. A slow clock needs no allowance: it makes ages too old until the next answer.
STEP_US, DRIFT_US = 250_000, 2_500
#: How many requests may still be answered. At `RETRY_US` that is a round trip of 12 s.
_OUTSTANDING: Final = 64
#: A doubt has to wait this long after an answer, so that a message with wrong stamps cannot cause endless requests.
_REST_US: Final = 500_000
#: A bound that is wrong by no more than this shows that the clocks drifted apart; by more, that one of them was set.
APART_US: Final = 500_000
#: Without the UART's rate (SITL over TCP) ArduPilot's stamp is some ms early.
_NOTABLE_US: Final = 20_000
#: requests that may be outstanding at first; with more, the interval grows
_HASTE: Final = 20
_TRIPS: Final = 8


class VehicleClock:
    """The vehicle's boot clock against ours, bounded by round trips of TIMESYNC: the least that ours may be ahead of
    it. Times are ours, monotonic, in us; never raises.

    We send `ts1` = our monotonic time with `tc1` = 0; the vehicle answers with `ts1` as it came and `tc1` = its time
    since boot, both in ns. The vehicle read its clock after we sent, so the offset (ours minus its) is at least the
    time of sending minus `tc1`, and at most the time of the answer minus `tc1`. Only the first of these is kept: it
    makes ages too old, by the time of the way up, and never too young. The second shows when the vehicle's clock was
    set forward.

    Both autopilots read `tc1` from the clock of which their other stamps are made. PX4: `hrt_absolute_time()` where the
    message is handled (src/modules/mavlink/mavlink_timesync.cpp); `time_boot_ms` and `time_usec` of its telemetry are
    `timestamp` of the topic, of the same clock (streams/GLOBAL_POSITION_INT.hpp, GPS_RAW_INT.hpp). ArduPilot:
    `timesync_receive_timestamp_ns()`, which is `AP_HAL::micros64()`, moved back to when the frame began to come in
    where the UART can tell (`receive_time_constraint_us`; GCS_Common.cpp); `time_boot_ms` is `AP_HAL::millis()` at
    sending. Both also send requests of their own (`tc1` = 0), which need no answer.

    The bound is the best of all answers so far, less what the clocks may have drifted apart since. It goes down in
    steps, so that equal stamps mean equal times in between.
    """

    def __init__(self) -> None:
        self._asked: dict[int, int] = {}  # ts1 to when it was sent
        self._asked_us: int | None = None
        self.due_us = 0
        """Before then `due` gives nothing, so nobody need call it."""
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
    def round_trip_us(self) -> int | None:
        """The median of the last round trips; None before the first."""
        return median_low(self._trips) if self._trips else None

    def due(self, now_us: int) -> int | None:
        """Return the `ts1` to send now, in ns; None when nothing is due. It ends in our component id, as ArduPilot's
        ends in its system id, so that answers to another program on this machine are not taken for ours.
        """
        if self._asked_us is not None:
            wait_us = self._wait_us(now_us)
            if now_us - self._asked_us < wait_us:
                self.due_us = self._asked_us + wait_us
                if self.answered_us is not None and wait_us == EACH_US:  # but sooner, where an answer is missed
                    self.due_us = min(self.due_us, self.answered_us + MISSED_US)
                return None
        self._asked_us, self._doubted, self.due_us = now_us, False, 0
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
        """Take in an answer. Return whether the vehicle's clock was set forward, which invalidates earlier times."""
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
        """The lower bound of our clock minus the vehicle's; None before the first answer."""
        if self._least_us is None:
            return None
        return self._least_us - _drift_us(now_us - self._since_us)

    def next_step_us(self, now_us: int) -> int:
        """When the bound decreases next."""
        return now_us + STEP_US - (now_us - self._since_us) % STEP_US

    def reduce(self, by_us: int, now_us: int) -> None:
        """Correct the bound by a stamp that lay ahead of our time: the clocks drift faster than assumed."""
        if self._least_us is not None:
            self._least_us -= by_us
        if by_us > _NOTABLE_US:
            self.doubt(now_us)

    def doubt(self, now_us: int) -> None:
        """Note evidence against the bound: ask soon."""
        self._doubted, self.due_us = self.answered_us is not None and now_us - self.answered_us > _REST_US, 0


def _drift_us(passed_us: int) -> int:
    return DRIFT_US * (passed_us // STEP_US + 1)


# ---------------------------------------------------------------- the time of a frame

#: After a gap of this length, in arrivals or in stamps, the next frame counts as sent after all earlier ones, whatever
#: its number.
GAP_US: Final = 500_000
#: The delay of the link is the longest within this time, and at most twice as long.
WINDOW_US: Final = 1_000_000

_WRAP, _HALF = 1 << 32, 1 << 31
_NUMBERS, _AHEAD = 256, 128
#: how many consecutive frames must continue the numbers from before a jump, for the jump to count as another sender's
_GOES_ON: Final = 6
_FIELDS: Final = ("time_boot_ms", "time_boot_us", "time_usec")
_LENGTHS: Final = {"ms": 1_000, "us": 1}


class _Stamp(NamedTuple):
    """A message's time field, its unit in us, and whether it has 32 bits."""

    read: Callable[[Any], int]
    us: int
    short: bool


class SourceTime:
    """Dates every frame of the vehicle's system, in the order of arrival. Uses constant memory; never raises."""

    def __init__(self) -> None:
        self.clock = VehicleClock()
        self.stepped = False
        """Whether the last frame showed that the vehicle's clock was set: times from before it mean nothing."""
        self._stamps: dict[str, _Stamp | None] = {}
        self._offset_us: int | None = None
        self._until_us = 0  # until when the offset holds
        self._unix_us: int | None = None  # UNIX time minus time since boot
        self._told: dict[str, tuple[int, int]] = {}  # the last stamp of each message of the autopilot, and its time
        self._others_told: dict[tuple[int, str], tuple[int, int]] = {}  # the same for other components
        self._wind: tuple[tuple[float, ...], int | None] = (), None  # the last estimate and its time
        self._sent_us: int | None = None  # the last frame was sent at this time or later
        self._came_us = 0
        self._newest = 0
        self._count = 0
        #: the last frame's place in the order of sending: its sequence number without wrapping
        self.place = 0
        # the earliest time of sending, for each number of the last round
        self._order: list[int | None] = [None] * _NUMBERS
        # the number that would continue from before the last jump, and how many have
        self._aside: tuple[int, int] | None = None
        self._held_us = self._held_before_us = 0  # the largest delay of an overtaken frame, in this window and the last
        self._window_us = 0

    @property
    def unready(self) -> str | None:
        """Why no age can be trusted, in words."""
        return "the vehicle's clock is not known yet: no TIMESYNC answer" if self.clock.answered_us is None else None

    def utc(self, now_us: int) -> tuple[int, int] | None:
        """The vehicle's UTC minus our monotonic time, and the uncertainty from the round trip, in us.

        None until the vehicle has reported its time (SYSTEM_TIME) and answered a request for its clock.
        """
        least_us, open_us = self.clock.offset_us(now_us), self.clock.error_us
        if self._unix_us is None or least_us is None or open_us is None:
            return None
        half_us = (open_us + 1) // 2
        return self._unix_us - least_us - half_us, half_us

    def of(self, frame: ReceivedFrame, now_us: int) -> int | None:
        """The earliest time at which the contents of a frame may have been measured, at most `now_us`; None without a
        bound. To be called once for every frame of the vehicle's system.
        """
        message, name, _, component, number, _, _ = frame
        self.stepped = False
        stamp = self._stamps[name] if name in self._stamps else self._find(name)
        if component != AUTOPILOT:
            return self._of_another(name, message, component, stamp, now_us)
        if now_us >= self._until_us:
            self._refresh(now_us)
        at_us: int | None = None
        if stamp is not None:
            at_us = self._at(name, message, stamp, now_us)
            if name == "SYSTEM_TIME" and message.time_unix_usec >= UNIX_US and message.time_boot_ms:
                self._unix_us = message.time_unix_usec - message.time_boot_ms * 1_000
        elif name == "WIND":
            return self._of_unstamped(message, self._follow(number, None, now_us))
        elif name == "TIMESYNC":
            self._synchronise(message, now_us)
            if self._offset_us is not None:  # a request of its own holds its time in `ts1`
                at_us = self._checked(self._offset_us + (message.tc1 or message.ts1) // 1_000, now_us)
        sent_us = self._follow(number, at_us, now_us)
        return sent_us if at_us is None else at_us

    def _of_unstamped(self, wind: Any, sent_us: int | None) -> int | None:
        """The time of the first report of this estimate."""
        told = wind.direction, wind.speed, wind.speed_z
        if told != self._wind[0] or self._wind[1] is None:
            self._wind = told, sent_us
        return self._wind[1]

    def _of_another(self, name: str, message: Any, component: int, stamp: _Stamp | None, now_us: int) -> int | None:
        """The time of a frame of another component. Its stamps are of an unknown clock: they only show a new
        measurement.
        """
        if self._sent_us is None:
            return None
        at_us = min(self._sent_us, now_us - max(self._held_us, self._held_before_us))
        raw = 0 if stamp is None else stamp.read(message)
        if raw:
            told = self._others_told.get((component, name))
            if told is not None and told[0] == raw:
                return told[1]
            self._others_told[component, name] = (raw, at_us)
        return at_us

    def _at(self, name: str, message: Any, stamp: _Stamp, now_us: int) -> int | None:
        """The time of a stamp of the autopilot on our clock; None if it cannot be converted."""
        read, us, short = stamp
        offset_us, raw = self._offset_us, read(message)
        if offset_us is None or not raw:
            return None
        told = self._told.get(name)
        if told is not None and told[0] == raw:
            return told[1]
        boot = raw
        if not short and raw >= UNIX_US:
            if self._unix_us is None:
                return None
            boot, us, short = (raw - self._unix_us) // 1_000 % _WRAP, 1_000, True
        if short:
            up = (now_us - offset_us) // us
            ago = (up - boot) % _WRAP
            boot = up - (ago if ago < _HALF else ago - _WRAP)
        at_us = offset_us + boot * us
        if at_us > now_us:
            checked_us = self._checked(at_us, now_us)
            if checked_us is None:
                return None
            at_us = checked_us
        if told is not None and at_us < told[1]:
            if not 0 < (raw - told[0]) % _WRAP < _HALF:
                return at_us  # overtaken
            at_us = told[1]  # measured later, though the clocks were seen to run apart
        self._told[name] = (raw, at_us)
        return at_us

    def _checked(self, at_us: int, now_us: int) -> int | None:
        """Correct a stamp that lies in the future: it contradicts the offset, or is meaningless."""
        ahead_us = at_us - now_us
        if ahead_us <= 0:
            return at_us
        if ahead_us > APART_US:  # none of this clock's
            self.clock.doubt(now_us)
            return None
        self.clock.reduce(ahead_us, now_us)
        self._refresh(now_us)
        return now_us

    def _synchronise(self, message: Any, now_us: int) -> None:
        self.stepped = self.clock.answer(message.tc1, message.ts1, now_us)
        if self.stepped:
            self._told.clear()
            self._others_told.clear()
            self._wind = (), None
            self._sent_us = None
            self._order = [None] * _NUMBERS
        self._refresh(now_us)

    def _refresh(self, now_us: int) -> None:
        self._offset_us = self.clock.offset_us(now_us)
        self._until_us = self.clock.next_step_us(now_us)
        if now_us - self._window_us >= WINDOW_US:
            recent = now_us - self._window_us < 2 * WINDOW_US
            self._held_before_us = self._held_us if recent else 0
            self._held_us, self._window_us = 0, now_us

    def _goes_on(self, number: int) -> bool:
        """Whether enough numbers continue from before the last jump for the jump to be another sender's: one frame with
        a number far ahead must not make all later frames count as overtaken.
        """
        if self._aside is None or number != self._aside[0]:
            return False
        times = self._aside[1] + 1
        self._aside = (number + 1) % _NUMBERS, times
        if times < _GOES_ON:
            return False
        self._newest, self._aside = number, None
        return True

    def _follow(self, number: int, at_us: int | None, now_us: int) -> int | None:
        """Keep the order of sending by frame numbers; return the earliest time at which this frame was sent."""
        if (number - self._newest) % _NUMBERS == 1:  # the next one, as nearly all are
            sent_us = self._sent_us
            if at_us is not None and (sent_us is None or at_us > sent_us):
                self._sent_us = sent_us = at_us
            self._order[number] = sent_us
            self._newest, self._came_us = number, now_us
            self.place = self._count = self._count + 1
            self._aside = None
            return sent_us
        if self._goes_on(number):
            self.place = self._count = self._count + 1
            return self._sent_us
        sent_us, ahead = self._sent_us, (number - self._newest) % _NUMBERS
        later_us = at_us if at_us is not None and (sent_us is None or at_us > sent_us) else None
        # frames that waited while nobody read them come just before the first one after a gap: only its stamp shows it
        resumed = later_us is not None and sent_us is not None and later_us - sent_us > GAP_US
        if 0 < ahead < _AHEAD or resumed or now_us - self._came_us > GAP_US:
            sent_us = self._jump(number, ahead, later_us)
        else:
            sent_us = self._overtaken(number, at_us, later_us, now_us)
        self._came_us = now_us
        return sent_us

    def _jump(self, number: int, ahead: int, later_us: int | None) -> int | None:
        """Take in a frame that was sent after all before; `later_us` is its stamp if no frame had a later one."""
        newest, sent_us = self._newest, self._sent_us
        if ahead > 1:
            self._aside = (newest + 1) % _NUMBERS, 0
            for skipped in range(newest + 1, newest + ahead):
                self._order[skipped % _NUMBERS] = sent_us
        self._sent_us = self._order[number] = sent_us if later_us is None else later_us
        self._newest = number
        self.place = self._count = self._count + (ahead or _NUMBERS)
        return self._sent_us

    def _overtaken(self, number: int, at_us: int | None, later_us: int | None, now_us: int) -> int | None:
        """Take in a frame that others overtook: sent after the frame before its number and before the one after."""
        order, behind = self._order, (self._newest - number) % _NUMBERS
        self._sent_us = self._sent_us if later_us is None else later_us
        self.place, sent_us = self._count - behind, order[number]
        if at_us is not None and (sent_us is None or at_us > sent_us):
            sent_us = at_us
            for later in range(number, number + 1 + behind):
                order[later % _NUMBERS] = max(order[later % _NUMBERS] or at_us, at_us)
        if sent_us is not None:
            self._held_us = max(self._held_us, now_us - sent_us)
        return sent_us

    def _find(self, name: str) -> _Stamp | None:
        """Find the time field of a message by name. An addressed message holds a time of its requester (PING)."""
        fields = dialect.load().messages[name].fields
        found: _Stamp | None = None
        if "target_system" not in fields:
            for each in _FIELDS:
                field = fields.get(each)
                if field is not None and not field.length and field.unit in _LENGTHS:
                    found = _Stamp(attrgetter(each), _LENGTHS[field.unit], field.type == "uint32_t")
                    break
        self._stamps[name] = found
        return found
