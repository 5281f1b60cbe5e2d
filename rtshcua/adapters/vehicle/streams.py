"""Telemetry streams: asked for one by one, measured, asked again when they stop or come too seldom, left alone when the
vehicle has none such.
"""

from collections import deque
from collections.abc import Iterable, Mapping

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message

#: How long one request waits for its acknowledgement; twice as long after each that came to nothing, up to the latter.
ANSWER_US = 500_000
LATEST_US = 4_000_000
QUIET_US = 3_000_000  # a stream that is silent for so long is asked for again
#: Readiness waits no longer than this for what is needed; and for what the autopilot itself does not have, but somebody
#: else may send (RADIO_STATUS comes from the radio).
PATIENCE_US = 5_000_000
PATIENCE_REFUSED_US = 2_000_000
#: A stream is measured over this long, and too slow when it comes at less than one `SLOW`th of the rate asked for.
MEASURE_US = 5_000_000
SLOW = 2

#: What effects are seen by, and how often, in us; mode and landed state too, for a takeover must not be seen late.
ALWAYS: Mapping[str, int] = {
    "HEARTBEAT": 100_000,
    "GLOBAL_POSITION_INT": 100_000,
    "EXTENDED_SYS_STATE": 100_000,
    "ATTITUDE": 100_000,
    "GPS_RAW_INT": 500_000,
    "SYS_STATUS": 500_000,
}
#: What is sent at times only, whatever is asked for: PX4 has no target before it flies, ArduCopter in GUIDED alone.
AT_TIMES: Mapping[str, int] = {"POSITION_TARGET_GLOBAL_INT": 100_000}


class StreamRequests:
    """SET_MESSAGE_INTERVAL for each message of `wanted` (its interval in us), one request outstanding at a time.

    Those `at_times` are asked for like the others, and not missed when they do not come. `needed` holds groups of
    messages of which one is enough: the sources of one signal. `notes` collects what an operator should know: which
    streams come too seldom, and when they are right again.
    """

    def __init__(
        self, wanted: Mapping[str, int], needed: Iterable[frozenset[str]], at_times: Mapping[str, int] | None = None
    ) -> None:
        self._at_times = at_times or {}
        self._needed = [*needed, *[frozenset({name}) for name in ALWAYS]]
        self._wanted = {name: us for name, us in wanted.items() if messages.number_of(name) is not None}
        self._queue = [*self._wanted, *self._at_times]
        self._refused: set[str] = set()
        self._heard_us: dict[str, int] = {}
        self._asking: str | None = None
        self._asked_us = self._looked_us = 0
        self._answer_us = ANSWER_US
        self._late_us: deque[int] = deque()  # when requests were given up whose answers may come yet
        self._since_us: int | None = None
        self._counts = dict.fromkeys(self._wanted, 0)
        self._measured_us: int | None = None
        self._slow: set[str] = set()
        self.notes: list[str] = []

    def heard(self, name: str, now_us: int) -> None:
        """A message came."""
        self._heard_us[name] = now_us
        if name in self._counts:
            self._counts[name] += 1

    def answered(self, accepted: bool, now_us: int) -> None:
        """A request was acknowledged. An acknowledgement does not say of which message it is."""
        while self._late_us and now_us - self._late_us[0] > LATEST_US:
            self._late_us.popleft()
        if self._late_us:  # of an earlier one, then: a refusal must not be taken for one of what is asked now
            self._late_us.popleft()
            return
        if self._asking is not None:
            if not accepted:
                self._refused.add(self._asking)
            self._asking = None

    def due(self, system: int, now_us: int) -> list[Message]:
        """The request to send now, if one is due. One that is not answered goes to the end of the queue."""
        if self._since_us is None:
            self._since_us = now_us
        if self._asking is not None:
            if now_us - self._asked_us < self._answer_us:
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
            return []
        self._asking, self._asked_us = self._queue.pop(0), now_us
        interval_us = self._wanted.get(self._asking) or self._at_times[self._asking]
        return [messages.message_interval(system, self._asking, interval_us)]

    def interrupted(self) -> None:
        """The link was silent: rates are measured anew."""
        self._measured_us = None

    def renew(self, now_us: int) -> None:
        """What was heard so far does not count as heard."""
        self._heard_us.clear()
        self._since_us = now_us

    def settled(self, now_us: int) -> bool:
        """Whether one message of each group was heard, or was waited for long enough."""
        if self._since_us is None:
            return False
        missing = [group for group in self._needed if not group & self._heard_us.keys()]
        patience_us = PATIENCE_REFUSED_US if all(group <= self._refused for group in missing) else PATIENCE_US
        return not missing or now_us - self._since_us > patience_us

    def _measure(self, now_us: int) -> None:
        """Once every request was answered: compare what came since with what was asked for."""
        if self._measured_us is not None:
            self._compare(now_us - self._measured_us)
        self._measured_us, self._counts = now_us, dict.fromkeys(self._wanted, 0)

    def _compare(self, passed_us: int) -> None:
        for name, asked_us in self._wanted.items():
            count = self._counts[name]
            if name in self._refused or not count:
                continue  # silence is told by the age of what it carries
            came_us = passed_us // count
            if (came_us > SLOW * asked_us) == (name in self._slow):
                continue
            self._slow ^= {name}
            if name in self._slow:
                self._queue.append(name)  # somebody may have asked for another rate since
                self.notes.append(f"{name} comes every {came_us // 1_000} ms, asked for every {asked_us // 1_000} ms")
            else:
                self.notes.append(f"{name} comes as often as asked for again")

    def _is_quiet(self, name: str, now_us: int) -> bool:
        last_us = max(self._heard_us.get(name, 0), self._since_us or 0)
        return name not in self._refused and now_us - last_us > QUIET_US
