"""The dispatcher: hands permits to the executor, keeps the one command that flies, and measures how long that takes."""

from collections import deque
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement import executor
from rtshcua.onboard.enforcement.executor import Executor
from rtshcua.onboard.enforcement.isolated import IsolatedExecutor
from rtshcua.onboard.ports import Command, Frozen, Hindered, Obeyed, Release
from rtshcua.onboard.runtime.journal import Detail, Journal
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import FALLBACK_LINK, STEP, Ref

#: Assumed until enough was measured, in us: an order above anything seen on the machines this was built on.
CONSERVATIVE_US = 20_000
WINDOW = 128
_ENOUGH = 8
#: that the vehicle was seen to do what was dispatched; the detail is the target that it named, if it did
OBEYED: Final = "obeyed"
#: what is recorded of a fallback that was sent home or down, and ended without word of a landing
UNCONFIRMED: Final = "it was sent, and not confirmed: no landing was seen"
_UNCONFIRMED = ("time-over", "released")
#: why no command came of a permit in time
_OVERDUE: Final = (executor.LATE.slug, "time-apart")


class RemainingLatency:
    """`L_rem`, paper symbol: what validation and dispatch still take, as a measured high quantile.

    The 99th percentile of the last `WINDOW` measurements, integers only; conservative until there are a few. The
    quantile is the nearest rank, so with few measurements it is their maximum. `us` is the latency to count with now.
    """

    def __init__(self) -> None:
        self._latest: deque[int] = deque(maxlen=WINDOW)
        self.us = CONSERVATIVE_US

    def measured(self, took_us: int) -> None:
        """Note how long one admission took, from the moment it was decided at to the moment its command was sent."""
        self._latest.append(max(took_us, 0))
        ordered = sorted(self._latest)
        high = ordered[-(-len(ordered) * 99 // 100) - 1]
        self.us = high if len(ordered) >= _ENOUGH else max(high, CONSERVATIVE_US)


class Active(Frozen):
    """A command that was dispatched and has not ended; `ref` is what its permit is for. A link's time is over at
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
    """A step's permit, and how it was before that was dispatched."""

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
        self.done = False  # and was seen to be obeyed,
        self.used = False  # and in this run, as its log tells: it stays after a landing
        self.hindrance = ""  # what is known to keep the command that flies from getting on
        self._standing: tuple[int, bytes] | None = None  # the last step that was sent, and its permit
        self._tried: _Tried | None = None  # the last step that was to be sent
        self.overdue = False  # nothing was sent by the last permit, for it came too late

    def fly(self, now: Now, permit: bytes, ref: Ref, lasting_us: int | None) -> bool:
        """Dispatch what the permit is for, for at most `lasting_us` (None: until it succeeds or fails).

        False if the executor refused, and then nothing is sent.
        """
        if ref.kind == STEP:
            self._tried = _Tried(ref, permit, self._standing, self.dispatched)
        sent = self._send(now, self._executor.dispatch(permit, now.monotonic_us), ref, lasting_us)
        if sent and ref.kind == STEP:
            self._standing = (ref.step, permit)
        return sent

    def withdraw(self, now: Now) -> bool:
        """Give the permit of the last step up, which came too late: whether the boundary found that nothing was sent by
        it. Then all is as before, and the step may be asked for again.
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
        """As `fly`, for a link, by the permit of the last step that was sent, which stands for it."""
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
        """The first frame of a command went out: one measurement of `L_rem`."""
        active = self.flying(token)
        if active is not None:
            self._remaining.measured(at_us - active.since_us)

    def obeyed(self, now: Now, event: Obeyed) -> None:
        """A command was seen to be done: whoever goes on after this process knows that nothing before it is in force.

        The record names no token, for one that does says how a command ended.
        """
        active = self.flying(event.token)
        if active is not None:
            self.done = True
            self._journal.effect(now, OBEYED, active.ref, detail=" ".join(map(str, event.target or ())))

    def hindered(self, now: Now, event: Hindered) -> None:
        """Note what hinders the command that flies: where its time is over, that is why."""
        if self.flying(event.token) is not None:
            self._journal.note(now, event.text)
            self.hindrance = event.text

    def flying(self, token: int) -> Active | None:
        """The command that flies, if it is this one: a late word about another one means nothing any more."""
        return self.active if self.active is not None and self.active.command.token == token else None

    @property
    def homeward(self) -> bool:
        """Whether what flies brings the vehicle home or down."""
        return self.active is not None and self.active.homeward

    def end(self, now: Now, event: str, detail: Detail = "") -> None:
        """The command that flies ended: record how."""
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
