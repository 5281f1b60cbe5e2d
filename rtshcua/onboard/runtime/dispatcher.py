"""The dispatcher: passes permits to the executor, tracks the one flying command, and measures the latency."""

from collections import deque
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement import executor
from rtshcua.onboard.enforcement.executor import Executor
from rtshcua.onboard.enforcement.isolated import IsolatedExecutor
from rtshcua.onboard.ports import Command, Frozen, Hindered, Obeyed, PayloadOutcome, Release
from rtshcua.onboard.runtime.journal import Detail, Journal
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import FALLBACK_LINK, NOTHING, STEP, Ref

#: The default until enough was measured, in us: ten times more than measured on the development machines.
CONSERVATIVE_US = 20_000
WINDOW = 128
_ENOUGH = 8
#: the vehicle was observed to obey the dispatched command; the detail is its reported target, if any
OBEYED: Final = "obeyed"
#: the effect that ends a running step because another step of the mission was admitted in its place
SUPERSEDED: Final = "superseded"
#: the record of a fallback that was sent to fly home or land, and ended without a report of a landing
UNCONFIRMED: Final = "sent but not confirmed: no landing was observed"
_UNCONFIRMED = ("time-over", "released")
#: why a permit was not turned into a command in time
_OVERDUE: Final = (executor.LATE.slug, "time-apart")


class RemainingLatency:
    """`L_rem`, paper symbol: the remaining time for validation and dispatch, as a measured high quantile.

    The 99th percentile of the last `WINDOW` measurements, integers only; conservative until there are a few. The
    quantile is the nearest rank, so with few measurements it is their maximum. `us` is the present latency.
    """

    def __init__(self) -> None:
        self._latest: deque[int] = deque(maxlen=WINDOW)
        self.us = CONSERVATIVE_US

    def measured(self, took_us: int) -> None:
        """Add a measurement: the time from the decision to the sending of its command."""
        self._latest.append(max(took_us, 0))
        ordered = sorted(self._latest)
        high = ordered[-(-len(ordered) * 99 // 100) - 1]
        self.us = high if len(ordered) >= _ENOUGH else max(high, CONSERVATIVE_US)


class Active(Frozen):
    """A command that was dispatched and has not ended; `ref` is the subject of its permit. A link's time is over at
    `until_us`; a step has None.
    """

    ref: Ref
    command: Command
    since_us: int
    until_us: int | None

    @property
    def homeward(self) -> bool:
        """Whether its success is a landing."""
        return self.command.kind in (MotionKind.HOME, MotionKind.LAND)


class _Tried(NamedTuple):
    """A step's permit, and the state before its dispatch."""

    ref: Ref
    permit: bytes
    standing: tuple[int, bytes] | None
    dispatched: bool


class Dispatcher:
    """At most one command flies; a new one replaces it."""

    def __init__(self, executor: Executor | IsolatedExecutor, journal: Journal, remaining: RemainingLatency) -> None:
        self._executor = executor
        self._journal = journal
        self._remaining = remaining
        self.active: Active | None = None
        self.dispatched = False  # something was sent in this flight,
        self.done = False  # and was observed to be obeyed,
        self.used = False  # and in this run, according to its log: it stays after a landing
        self.hindrance = ""  # the known cause that slows the flying command down
        self._standing: tuple[int, bytes] | None = None  # the last step that was sent, and its permit
        self._tried: _Tried | None = None  # the last step that was to be sent
        self.overdue = False  # nothing was sent by the last permit, because it came too late

    def fly(self, now: Now, permit: bytes, ref: Ref, lasting_us: int | None) -> bool:
        """Dispatch the command of the permit, for at most `lasting_us` (None: until it succeeds or fails).

        False if the executor refused; then nothing is sent.
        """
        if ref.kind == STEP:
            self._tried = _Tried(ref, permit, self._standing, self.dispatched)
        sent = self._send(now, self._executor.dispatch(permit, now.monotonic_us), ref, lasting_us)
        if sent and ref.kind == STEP:
            self._standing = (ref.step, permit)
        return sent

    def withdraw(self, now: Now) -> bool:
        """Withdraw the permit of the last step, which came too late. True if the boundary confirmed that nothing was
        sent by it: then the state is as before, and the step may be requested again.
        """
        tried, self._tried = self._tried, None
        if tried is None:
            return False
        refused = self._executor.withdraw(tried.permit, now.monotonic_us)
        self._journal.effect(now, "refused", tried.ref, detail=refused.slug)
        if refused.slug != WITHDRAWN:
            return False
        self._standing, self.dispatched, self.used = tried.standing, tried.dispatched, True
        return True

    def stand_in(self, now: Now, ref: Ref, lasting_us: int) -> bool:
        """As `fly`, for a link, by the standing permit of the last step that was sent."""
        if self._standing is None or (ref.kind == FALLBACK_LINK and self._standing[0] != ref.step):
            return False
        permit = self._standing[1]
        return self._send(now, self._executor.stand_in(permit, ref.kind, ref.link, now.monotonic_us), ref, lasting_us)

    def _send(self, now: Now, command: Command | Refusal, ref: Ref, lasting_us: int | None) -> bool:
        self.overdue = isinstance(command, Refusal) and command.slug in _OVERDUE
        if isinstance(command, Refusal):
            self._journal.effect(now, "refused", ref, detail=command.slug)
            return False
        at_us = now.monotonic_us
        self.end(now, "replaced")
        self._journal.add(command)
        self.hindrance = ""
        self.active = Active(ref, command, at_us, None if lasting_us is None else at_us + lasting_us)
        self.dispatched = self.used = True
        self._journal.effect(now, "dispatched", ref, token=command.token, detail=command.skill)
        return True

    def sent(self, token: int, at_us: int) -> None:
        """The first frame of a command was sent: one measurement of `L_rem`."""
        active = self.flying(token)
        if active is not None:
            self._remaining.measured(at_us - active.since_us)

    def obeyed(self, now: Now, event: Obeyed) -> None:
        """A command was observed to be obeyed: a later process knows that no earlier one is in force.

        The record contains no token, because one with a token reports how a command ended.
        """
        active = self.flying(event.token)
        if active is not None:
            self.done = True
            self._journal.effect(now, OBEYED, active.ref, detail=" ".join(map(str, event.target or ())))

    def hindered(self, now: Now, event: Hindered) -> None:
        """Record what slows the flying command down: the cause if its time runs out."""
        if self.flying(event.token) is not None:
            self._journal.note(now, event.text)
            self.hindrance = event.text

    def told_of_payload(self, now: Now, event: PayloadOutcome) -> None:
        """Record what became of a command to payload, of the flying command or of one before it."""
        active = self.flying(event.token)
        ref = NOTHING if active is None else active.ref
        self._journal.effect(now, f"payload.{event.what}", ref, detail=event.text)

    def flying(self, token: int) -> Active | None:
        """The flying command, if it is this one: a late report about another one is ignored."""
        return self.active if self.active is not None and self.active.command.token == token else None

    @property
    def homeward(self) -> bool:
        """Whether the flying command brings the vehicle home or down."""
        return self.active is not None and self.active.homeward

    def end(self, now: Now, event: str, detail: Detail = "") -> None:
        """The flying command ended: record how."""
        active = self.active
        if active is None:
            return
        if event in _UNCONFIRMED and active.ref.kind != STEP and active.homeward:
            detail = UNCONFIRMED
        self._journal.effect(now, event, active.ref, token=active.command.token, detail=detail)
        self._executor.ended(active.command.token)
        self.active = None

    def landed(self) -> None:
        """The flight is over: standing permits lapse."""
        self.dispatched = self.done = False
        self._executor.landed()

    def release(self, now: Now) -> None:
        """Stand down: send nothing more."""
        self.end(now, "released")
        self._executor.release()
        self._journal.add(Release())
