"""The known state of the vehicle: its signals (the paper's `S_t`), and whether it is ready, armed and in the air."""

from dataclasses import dataclass
from typing import cast

from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.temporal import initial, observe
from rtshcua.decision.tree import where
from rtshcua.decision.values import UNKNOWN
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.ports import Readings
from rtshcua.onboard.runtime.view import SignalReading
from rtshcua.wire.request import MAX_AGE_US


class StateMonitor:
    """Keeps the state: values by slot, the time of the last report of each, and the truths of the policy's temporal
    monitors.

    A value reported as unknown, or outside 64 bits, is None. A report older than the stored one is dropped,
    because a delayed frame must not make the state younger. Slots that the policy does not have are ignored.
    """

    def __init__(self, policy: PreparedPolicy) -> None:
        self._policy = policy
        self._where = frozenset(where(policy.policy.vehicle))
        self._moved = False  # position or height changed since the last call of `moved`
        self._values: list[int | None] = [None] * policy.policy.slots
        self._stamps: list[int | None] = [None] * policy.policy.slots
        self._held: tuple[int | None, ...] | None = None  # the values, until one of them changes
        self._state: tuple[int, State] | None = None  # the last result, and its time
        self._unseen: set[int] = set()  # slots with a value that came after the last observation
        self._memory = initial(policy)
        self._truths: tuple[int, ...] = (UNKNOWN,) * len(policy.monitors)

    def update(self, readings: Readings) -> None:
        """Store the values of one frame, measured at `readings.at_us`."""
        self._state = None
        values, stamps, unseen, at_us = self._values, self._stamps, self._unseen, readings.at_us
        slots = len(values)
        for slot, value in readings.values:
            if not 0 <= slot < slots:
                continue
            stamp = stamps[slot]
            if stamp is not None and at_us < stamp:
                continue
            stamps[slot] = at_us
            unseen.add(slot)
            if value != values[slot]:
                self._held = None
                if slot in self._where:
                    self._moved = True
                values[slot] = value if value is None or -MAX_VALUE <= value <= MAX_VALUE else None

    def moved(self) -> bool:
        """Whether position or height changed since the last call."""
        moved, self._moved = self._moved, False
        return moved

    def current(self, now_us: int) -> frozenset[int]:
        """The slots with a value that is known and not stale."""
        limits, values = self._policy.limits, self._values
        return frozenset(
            slot
            for slot, stamp in enumerate(self._stamps)
            if stamp is not None and values[slot] is not None and now_us - stamp <= limits[slot].stale_us
        )

    def unreported(self, slots: frozenset[int], since_us: int) -> frozenset[int]:
        """The slots of `slots` without a value measured after `since_us`.

        "Unknown" is not a value: after a silence an estimator reports the unknown position before the position.
        """
        return frozenset(slot for slot in slots if self._values[slot] is None or (self._stamps[slot] or 0) <= since_us)

    def hides(self, readings: Readings) -> bool:
        """Whether these readings replace a value that was not observed yet: frames came faster than steps were made."""
        unseen = self._unseen
        if unseen:
            for slot, _ in readings.values:
                if slot in unseen:
                    return True
        return False

    def seen(self) -> None:
        """All stored values were observed."""
        self._unseen.clear()

    def observe(self, now: Now) -> None:
        """Let the temporal monitors observe the state, once a turn: an edge lasts from one observation to the next."""
        self.seen()
        if self._policy.monitors:
            self._memory, self._truths = observe(self._memory, self._policy, self.state(now.monotonic_us), now)
            self._state = None

    def state(self, now_us: int) -> State:
        """The state at `now_us`, with the truths of the last observation. Ages saturate at 0 and `MAX_AGE_US`, and
        are 0 for values that were never reported.
        """
        if self._state is not None and self._state[0] == now_us:
            return self._state[1]
        stamps, oldest_us = cast("list[int]", self._stamps), now_us - MAX_AGE_US
        if None not in stamps and oldest_us <= min(stamps, default=now_us) and max(stamps, default=now_us) <= now_us:
            ages = tuple([now_us - stamp for stamp in stamps])  # the common case, found sooner
        else:
            ages = tuple(
                [
                    0 if stamp is None or stamp > now_us else MAX_AGE_US if stamp < oldest_us else now_us - stamp
                    for stamp in self._stamps
                ]
            )
        if self._held is None:
            self._held = tuple(self._values)
        state = State(self._held, ages, self._truths)
        self._state = (now_us, state)
        return state

    def readings(self, at_us: int) -> tuple[SignalReading, ...]:
        """The policy's signals at a monotonic time, for a display."""
        state = self.state(at_us)
        readings = []
        for signal in self._policy.policy.signals:
            values = tuple(state.values[slot] for slot in signal.slots)
            age_us = max(state.ages[slot] for slot in signal.slots)
            readings.append(SignalReading(signal.name, values, age_us, age_us > signal.stale_us))
        return tuple(readings)


@dataclass(slots=True)
class VehicleStatus:
    """Whether the vehicle is ready, armed and in the air (None: not reported), and whether it flew under our command.

    `others`: how it flew when it was ready, if no command of ours explains it.
    """

    ready: bool = False
    others: str = ""
    armed: bool | None = None
    airborne: bool | None = None
    flown: bool = False

    def is_ready(self, others: str) -> None:
        """It is ready to fly, or flies already."""
        self.ready, self.others = True, others

    def report(self, *, armed: bool, airborne: bool, ours: bool) -> bool:
        """Store a report of the vehicle; `ours`: a command of this run was sent. Returns whether it came to rest with
        that.
        """
        was_airborne, self.armed, self.airborne = self.airborne, armed, airborne
        self.flown = self.flown or (airborne and ours)
        return bool(was_airborne) and self.at_rest

    def landed(self) -> None:
        """A landing was observed."""
        self.armed = self.airborne = False

    @property
    def at_rest(self) -> bool:
        """On the ground and disarmed, according to its own report."""
        return self.armed is False and self.airborne is False

    @property
    def last_seen(self) -> str:
        """The last report on whether it was in the air, for whoever has to look for it."""
        if self.airborne is None:
            return "the vehicle never reported whether it was in the air"
        return "last seen in the air" if self.airborne else "last seen on the ground"
