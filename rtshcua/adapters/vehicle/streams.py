"""Telemetry streams: planned within the capacity of the link, requested one by one, measured, requested again when they
stop or are too slow, and left out where the vehicle lacks them.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.address import BAUDS, BITS_OF_AN_OCTET
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.codec.frames import kind_of
from rtshcua.decision.rates import AT_LEAST, Rate
from rtshcua.mavlink.framing import CHECKSUM, HEADER, SIGNATURE

#: How long a request waits for its acknowledgement; doubled after each failure, up to the second value.
ANSWER_US = 500_000
LATEST_US = 4_000_000
QUIET_US = 3_000_000  # a stream that is silent for this long is requested again
#: How long readiness waits for needed streams; for one that the autopilot lacks but another component may send
#: (RADIO_STATUS comes from the radio).
PATIENCE_US = 5_000_000
PATIENCE_REFUSED_US = 2_000_000
#: the same in the air, after the requests, while the way down waits
PATIENCE_ALOFT_US = 500_000
#: A stream is measured over this time, and is too slow at less than one `SLOW`th of the requested rate.
MEASURE_US = 5_000_000
SLOW = 2

#: Messages that are sent at times only, whatever was requested: PX4 has no target on the ground, ArduCopter has one
#: only in GUIDED.
AT_TIMES: Mapping[str, Rate] = {"POSITION_TARGET_GLOBAL_INT": Rate(100_000, 500_000)}

#: The share of a link for streams, in 1/100: the rest is for answers, texts and retries.
SHARE: Final = 80
_SECOND: Final = 1_000_000
_POSITION: Final = "GLOBAL_POSITION_INT"
#: messages whose first report does not count by itself (`telemetry.Batteries`)
_COUNT_TWICE: Final = frozenset({"BATTERY_STATUS"})
_NEVER_US: Final = -1
#: Answers and events, which are not streams: they are not turned off.
_ANSWERS: Final = frozenset({
    "AUTOPILOT_VERSION", "CAMERA_CAPTURE_STATUS", "CAMERA_FEEDBACK", "CAMERA_IMAGE_CAPTURED", "COMMAND_ACK",
    "HEARTBEAT", "HOME_POSITION", "MISSION_ACK", "MISSION_COUNT",
    "MISSION_ITEM_INT", "MISSION_REQUEST", "MISSION_REQUEST_INT", "PARAM_VALUE", "STATUSTEXT", "SYSTEM_TIME",
    "TIMESYNC",
})  # fmt: skip


def frame_octets(message: str, *, signed: bool) -> int:
    """The maximum size of a message on the wire: header, full payload, checksum and signature."""
    number = messages.number_of(message)
    kind = None if number is None else kind_of(number)
    payload = 0 if kind is None else kind.fields.size
    return HEADER + payload + CHECKSUM + (SIGNATURE if signed else 0)


class StreamPlan(NamedTuple):
    """The requests on a link: the interval of each message in us. `octets`: their total in octets a second; `least`:
    the total at the slowest sufficient rates; `capacity`: that of the link, None if unknown.
    """

    intervals: Mapping[str, int]
    octets: int
    least: int
    capacity: int | None

    @property
    def fits(self) -> bool:
        """Whether the link carries the needed streams with room for the rest."""
        return self.capacity is None or self.least <= self.capacity * SHARE // 100

    @property
    def shortfall(self) -> str | None:
        """That the link cannot carry the needed streams, and which one could, in words."""
        if self.fits:
            return None
        would = next((baud for baud in BAUDS if baud // BITS_OF_AN_OCTET * SHARE // 100 >= self.least), None)
        better = f"; {would} baud would" if would is not None else ""
        return (
            f"the link carries {self.capacity} octets a second, {SHARE} % of them for streams; the program needs at "
            f"least {self.least}{better}"
        )


def plan_streams(rates: Mapping[str, Rate], capacity: int | None, *, signed: bool) -> StreamPlan:
    """Plan the fastest rates for the link: all are slowed by the same factor, none below its sufficient rate."""
    sizes = {name: frame_octets(name, signed=signed) for name in rates}

    def load(intervals: Mapping[str, int]) -> int:
        return sum(-(-sizes[name] * _SECOND // interval) for name, interval in intervals.items())

    def slowed(percent: int) -> dict[str, int]:
        return {name: min(rate.asked * percent // 100, max(rate.asked, rate.suffices)) for name, rate in rates.items()}

    least = load({name: max(rate.asked, rate.suffices) for name, rate in rates.items()})
    percent, most = 100, max((100 * rate.suffices // rate.asked + 1 for rate in rates.values()), default=100)
    budget = None if capacity is None else capacity * SHARE // 100
    while budget is not None and percent < most and load(slowed(percent)) > budget:
        percent += 5
    intervals = slowed(percent)
    return StreamPlan(intervals, load(intervals), least, capacity)


#: Messages that come in the air only, so that nothing waits for them on the ground: wind estimates.
IN_THE_AIR = frozenset({"WIND", "WIND_COV"})


class StreamRequests:
    """Sends SET_MESSAGE_INTERVAL for each message of the plan, one request at a time.

    Messages of `AT_TIMES` are requested like others, but not missed. `needed` holds groups of messages of which one is
    enough: the sources of one signal. A position counts once it comes after a report of the `estimator`, if one is
    given. `notes` collects texts for the operator: which streams are too slow, when they recover, and once the measured
    total. On a link of known capacity, streams that nobody requested here are turned off if there is no room for them.
    """

    def __init__(self, plan: StreamPlan, needed: Iterable[frozenset[str]], estimator: str = "") -> None:
        self.plan = plan
        self._estimator = estimator
        self._needed = [*needed, *[frozenset({name}) for name in AT_LEAST]]
        self._at_times, self._wanted = _sorted(plan)
        self._queue = [*self._wanted, *self._at_times]
        self._refused: set[str] = set()
        self._heard_us: dict[str, int] = {}
        self._first: set[str] = set()  # heard once, which does not count yet
        self._asking: str | None = None
        self._asked_us = self._looked_us = 0
        #: `due` returns nothing before this time
        self.due_us = 0
        self._answer_us = ANSWER_US
        self._late_us: deque[int] = deque()  # when requests were given up whose answers may still come
        self._once_us: int | None = None  # when missing messages were last requested once
        self._since_us: int | None = None
        self._counts = dict.fromkeys(self._wanted, 0)
        self._measured_us: int | None = None
        self._slow: set[str] = set()
        self._octets = 0  # the octets received since the last measurement
        self._others: dict[str, int] = {}  # those of streams that were not requested
        self._off: set[str] = set()  # streams that were turned off
        #: the received octets a second, and the interval in us of each requested message; None before the measurement
        self.measured: tuple[int, Mapping[str, int]] | None = None
        self.notes: list[str] = []

    def replan(self, plan: StreamPlan) -> None:
        """Change the plan: the rates that differ are requested and measured anew."""
        before, self.plan = {**self._wanted, **self._at_times}, plan
        self._at_times, self._wanted = _sorted(plan)
        self._queue += [name for name, us in {**self._wanted, **self._at_times}.items() if before.get(name) != us]
        self._measured_us, self.due_us = None, 0
        if plan.shortfall is not None:
            self.notes.append(plan.shortfall)

    def heard(self, name: str, now_us: int, octets: int = 0) -> None:
        """Count a message, in a frame of this size."""
        if name in _COUNT_TWICE and name not in self._first:
            self._first.add(name)
        elif name != _POSITION or not self._estimator or self._estimator in self._heard_us:
            self._heard_us[name] = now_us
        self._octets += octets
        counts = self._counts
        if name in counts:
            counts[name] += 1
        elif octets and name not in self._at_times and name not in _ANSWERS:
            self._others[name] = self._others.get(name, 0) + octets

    def answered(self, accepted: bool, now_us: int) -> None:
        """Take in an acknowledgement, which does not say which message it is about."""
        while self._late_us and now_us - self._late_us[0] > LATEST_US:
            self._late_us.popleft()
        if self._late_us:  # it belongs to an earlier request: its refusal must not count for the present one
            self._late_us.popleft()
            return
        if self._asking is not None:
            if not accepted:
                self._refused.add(self._asking)
            self._asking, self.due_us = None, 0

    @property
    def waits(self) -> bool:
        """Whether a request waits for its acknowledgement."""
        return self._asking is not None

    def passed_on(self, now_us: int) -> None:
        """Note that somebody else's request was sent: the next acknowledgement is its own."""
        self._late_us.append(now_us)

    def slowest_us(self, message: int) -> int | None:
        """The longest interval of a message, by its number, that is still enough here; None where any is. 0 for answers
        and events, whose rates are not changed.
        """
        for name in _ANSWERS:
            if messages.number_of(name) == message:
                return 0
        return next((us for name, us in self.plan.intervals.items() if messages.number_of(name) == message), None)

    def due(self, system: int, now_us: int) -> list[Message]:
        """The request to send now, if due. A request without an answer goes to the end of the queue."""
        if self._since_us is None:
            self._since_us = now_us
        if self._asking is not None:
            if now_us - self._asked_us < self._answer_us:
                self.due_us = self._asked_us + self._answer_us
                return []
            self._queue.append(self._asking)
            self._asking = None
            self._late_us.append(now_us)
            self._answer_us = min(2 * self._answer_us, LATEST_US)
        if not self._queue:
            if self._measured_us is None or now_us - self._measured_us >= MEASURE_US:
                self._measure(now_us)
            if now_us - self._looked_us >= ANSWER_US:
                self._looked_us = now_us
                self._queue += [name for name in self._wanted if self._is_quiet(name, now_us)]
        if not self._queue:
            self.due_us = min((self._measured_us or 0) + MEASURE_US, self._looked_us + ANSWER_US)
            return []
        self._asking, self._asked_us, self.due_us = self._queue.pop(0), now_us, 0
        if self._asking in self._off:
            interval_us = _NEVER_US
        else:
            interval_us = self._wanted.get(self._asking) or self._at_times[self._asking]
        return [messages.message_interval(system, self._asking, interval_us)]

    @property
    def slow(self) -> Sequence[str]:
        """The present streams that come at less than half of the requested rate."""
        return sorted(self._slow)

    def interrupted(self) -> None:
        """Note a silence of the link: rates are measured anew."""
        self._measured_us, self.due_us = None, 0

    def renew(self, now_us: int) -> None:
        """Forget which messages were heard."""
        self._heard_us.clear()
        self._first.clear()
        self._since_us, self._once_us = now_us, None

    def due_once(self, system: int, now_us: int) -> list[Message]:
        """The requests for one message of each group that was not heard since `renew`, if due: a stream may take a
        second to deliver one.
        """
        if self._since_us is None or (self._once_us is not None and now_us - self._once_us < ANSWER_US):
            return []
        self._once_us = now_us
        names = {name for group in self._missing for name in group}
        if _POSITION in names and self._estimator and self._estimator not in self._heard_us:
            names.add(self._estimator)
        ordered = sorted(names, key=lambda name: (name == _POSITION, name))  # after the messages that confirm it
        ordered += sorted(names & _COUNT_TWICE)
        return [messages.request(system, name) for name in ordered if messages.number_of(name) is not None]

    @property
    def _missing(self) -> list[frozenset[str]]:
        return [group for group in self._needed if not group & self._heard_us.keys()]

    def settled(self, now_us: int, *, aloft: bool = False) -> bool:
        """Whether one message of each group was heard, or waited for long enough; `aloft`: in the air."""
        if self._since_us is None:
            return False
        missing = self._missing
        refused_us = PATIENCE_ALOFT_US if aloft else PATIENCE_REFUSED_US
        patience_us = refused_us if all(group <= self._refused for group in missing) else PATIENCE_US
        return not missing or now_us - self._since_us > patience_us

    def _measure(self, now_us: int) -> None:
        """Compare the received rates with the requested ones, once every request was answered."""
        if self._measured_us is not None:
            self._compare(now_us - self._measured_us)
        self._measured_us, self._counts = now_us, dict.fromkeys(self._wanted, 0)
        self._octets, self._others = 0, {}

    def _compare(self, passed_us: int) -> None:
        came = {name: passed_us // count for name, count in self._counts.items() if count}
        first, octets = self.measured is None, self._octets * _SECOND // passed_us
        self.measured = octets, came
        self._compare_each(passed_us)
        if first:
            self.notes.append(self._delivery(octets))
        self._make_room(octets)

    def _delivery(self, octets: int) -> str:
        """The requested and the received total, in words."""
        capacity = self.plan.capacity
        of = "" if capacity is None else f" of {capacity} that the link carries"
        slow = f"; too seldom: {', '.join(self.slow)}" if self._slow else ""
        return f"streams: {self.plan.octets} bytes/s requested{of}, {octets} bytes/s received in all{slow}"

    def _make_room(self, octets: int) -> None:
        """Turn off streams that were not requested if they take the room of those that were."""
        capacity = self.plan.capacity
        if capacity is None or not self._others or not (self._slow or octets > capacity * SHARE // 100):
            return
        names = sorted(set(self._others) - self._off, key=lambda name: -self._others[name])
        names = [name for name in names if messages.number_of(name) is not None]
        if names:
            self._off.update(names)
            self._queue += names
            self.notes.append(f"turned off on this link for lack of capacity: {', '.join(names)}")

    def _compare_each(self, passed_us: int) -> None:
        for name, asked_us in self._wanted.items():
            count = self._counts[name]
            if name in self._refused or not count:
                continue  # a silent stream shows in the age of its signals
            came_us = passed_us // count
            if (came_us > SLOW * asked_us) == (name in self._slow):
                continue
            self._slow ^= {name}
            if name in self._slow:
                self._queue.append(name)  # somebody may have changed the rate since
                self.notes.append(f"{name} comes every {came_us // 1_000} ms, requested every {asked_us // 1_000} ms")
            else:
                self.notes.append(f"{name} comes at the requested rate again")

    def _is_quiet(self, name: str, now_us: int) -> bool:
        last_us = max(self._heard_us.get(name, 0), self._since_us or 0)
        return name not in self._refused and now_us - last_us > QUIET_US


def _sorted(plan: StreamPlan) -> tuple[dict[str, int], dict[str, int]]:
    """The intervals of the messages that come at times only, and of the others in the dialect."""
    known = {name: us for name, us in plan.intervals.items() if messages.number_of(name) is not None}
    at_times = {name: us for name, us in known.items() if name in AT_TIMES}
    return at_times, {name: us for name, us in known.items() if name not in AT_TIMES}
