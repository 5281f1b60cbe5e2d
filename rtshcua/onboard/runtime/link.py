"""Supervision of the link: while it is down nothing is judged, and when it is back fresh state is awaited first.

            lost                      back
       UP ---------> DOWN ---------------------> AWAITING ----> UP   all was reported again, or the time for it is
       over
                       ^-------------------------- |
                                  lost again

The state of a vehicle that was silent is old. Values that were current when the link was lost, and are stale when
it is back, must be reported again, measured after the loss, before any decision on them. The wait is bounded,
because they may never come. Signals that were stale or missing before are not awaited.

A computer that stood still is like a silence: its state is old when it continues, and what it reads first was sent
meanwhile. Fresh state is awaited in the same way.

The state of a vehicle that is heard, but answers nothing, is judged as usual, because commands may still arrive.
It is awaited no longer than a silent one.
"""

from enum import Enum, auto
from typing import Final

from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Frozen
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.monitor import StateMonitor

#: the effect that records that this computer stood still, and for how long: nothing was read, judged or sent
#: meanwhile
STOOD_STILL: Final = "stood-still"
#: the name, among those of signals, of the vehicle's report on whether it flies
AIR_STATE = "whether it is in the air"


class EndedSilence(Frozen):
    """A silence that is over, or a stall of this computer: how long the vehicle was not heard (0 for a mere stall),
    how long fresh state was then awaited, both in us, and what was not reported again in time.
    """

    lasted_us: int
    awaited_us: int
    missing: tuple[str, ...]


class LinkState(Enum):
    """Whether the vehicle is heard, and if so, whether fresh state may still be awaited."""

    UP = auto()
    DOWN = auto()
    AWAITING = auto()


class LinkSupervision:
    """Whether the vehicle is heard, and whether its state may be judged. Times are monotonic, in us.

    One silence lasts until state was judged again: a link that comes and goes within it begins no new one.
    """

    def __init__(self, policy: Policy, monitor: StateMonitor, limits: Limits) -> None:
        self._policy = policy
        self._monitor = monitor
        self._limits = limits
        self.state = LinkState.UP
        self._since_us: int | None = None  # start of the current silence, or None
        self._waits_us: int | None = None  # and of the wait for its end
        self._mute_us: int | None = None  # start of the wait for an answer
        self._lost_us = 0  # time of the last loss of the link
        self._first_back_us: int | None = None  # first return of the link in this silence,
        self._back_us = 0  # and the last one
        self._resumed_us = 0  # when this computer last continued after a stall (0: no stall is known)
        self._until_us = 0  # the latest end of the wait for fresh state
        self._standing_us: int | None = None  # nothing is judged since then
        self._awaited: frozenset[int] = frozenset()
        self._awaits_air = False
        self._away_us = 0  # how long the link was not up, in intervals that are over,
        self._away_since_us: int | None = None  # and the start of the present one

    def away_us(self, now_us: int) -> int:
        """The total time in which the vehicle was silent, not judged yet after that, or answered nothing. It does not
        count for a flying step.
        """
        return self._away_us + (0 if self._away_since_us is None else now_us - self._away_since_us)

    def _count_away(self, now_us: int) -> None:
        away = self._standing_us is not None or self._mute_us is not None
        if away and self._away_since_us is None:
            self._away_since_us = now_us
        elif not away and self._away_since_us is not None:
            self._away_us += now_us - self._away_since_us
            self._away_since_us = None

    @property
    def down(self) -> bool:
        """Whether the vehicle is not heard: nothing that is sent would arrive."""
        return self.state is LinkState.DOWN

    @property
    def mute(self) -> bool:
        """Whether the vehicle answers nothing: commands do not seem to arrive."""
        return self._mute_us is not None

    def answering(self, now_us: int, *, answers: bool) -> None:
        """The vehicle is found to answer nothing, or it answers again."""
        if answers:
            self._mute_us = None
        elif self._mute_us is None:
            self._mute_us = now_us
        self._count_away(now_us)

    def lost(self, now_us: int, heard_us: int, *, takes_off: bool) -> bool:
        """The link is lost: the vehicle was last heard at `heard_us`, and what was current then will be awaited.

        `takes_off`: it was on the ground, under a command. False if the link was down already.
        """
        if self.down:
            return False
        self.state = LinkState.DOWN
        self._lost_us = heard_us
        if self._since_us is None:
            self._since_us = self._waits_us = heard_us
        self._standing_us = now_us if self._standing_us is None else self._standing_us
        self._awaited |= self._monitor.current(heard_us)
        self._awaits_air = self._awaits_air or takes_off
        self._count_away(now_us)
        return True

    def back(self, now_us: int) -> int | None:
        """The link is back: how long it was down. None if it was not down.

        Fresh state is awaited for `fresh_us` from now, and `flapping_us` from the first return in this silence.
        """
        if not self.down:
            return None
        self._back_us = now_us
        self._await(now_us)
        return now_us - self._lost_us

    def _await(self, now_us: int) -> None:
        self.state = LinkState.AWAITING
        self._first_back_us = now_us if self._first_back_us is None else self._first_back_us
        self._until_us = min(now_us + self._limits.fresh_us, self._first_back_us + self._limits.flapping_us)

    def stalled(self, before_us: int, now_us: int, *, takes_off: bool) -> None:
        """This computer stood still from `before_us` to `now_us`: none of the known state is current.

        `takes_off` as for `lost`. What the vehicle sent meanwhile may be read at once; where that is too old,
        fresh state is awaited as after a silence. Except for `stalled_us` of it, the stall counts neither as
        waiting time nor as time with a link: a computer that stalls repeatedly still judges.
        """
        self._awaited |= self._monitor.current(before_us)
        self._awaits_air = self._awaits_air or takes_off
        self._resumed_us = now_us
        since_us = before_us + self._limits.stalled_us
        self._standing_us = since_us if self._standing_us is None else self._standing_us
        if self._first_back_us is not None:
            self._first_back_us += now_us - since_us
        if not self.down:
            self._await(now_us)
        self._count_away(since_us)

    def air_reported(self) -> None:
        """The vehicle reported whether it is in the air."""
        self._awaits_air = False

    def hurry(self, now_us: int) -> None:
        """Somebody waits for the end from now on: the wait for the end of a silence, of either kind, restarts."""
        self._waits_us = None if self._since_us is None else now_us
        self._mute_us = None if self._mute_us is None else now_us

    def waited_us(self, now_us: int) -> int:
        """The duration of the present wait for the end of a silence, or for an answer; 0 if there is none."""
        return max((now_us - us for us in (self._waits_us, self._mute_us) if us is not None), default=0)

    def awaits(self, now_us: int) -> bool:
        """Whether nothing may be judged now, because fresh state may still come. For use while fresh state is
        awaited.
        """
        if now_us < self._until_us and self._missing(now_us):
            self._standing_us = now_us if self._standing_us is None else self._standing_us
            self._count_away(now_us)
            return True
        return False

    def judged(self, now_us: int) -> tuple[int, EndedSilence | None]:
        """State is judged now, even if some is still awaited. Returns for how long it was not judged, and the silence
        if that ends with it.

        Until the time for fresh state is over, values that became stale only now and were not reported again are
        awaited too.
        """
        stood_us = 0 if self._standing_us is None else now_us - self._standing_us
        self._standing_us = None
        self._count_away(now_us)
        silence = None
        if self._first_back_us is not None:
            lasted_us = 0 if self._since_us is None else self._back_us - self._since_us
            awaited_us = now_us - max(self._back_us, self._resumed_us)
            silence = EndedSilence(lasted_us, awaited_us, self._missing(now_us))
            self._since_us = self._waits_us = self._first_back_us = None
        if now_us >= self._until_us or not (self._awaits_air or self._pending):
            self._forget()
        return stood_us, silence

    def _forget(self) -> None:
        """Everything that was awaited has come, or is no longer awaited."""
        self.state = LinkState.UP
        self._until_us = 0
        self._lost_us = self._back_us = self._resumed_us = 0
        self._awaited = frozenset()
        self._awaits_air = False

    @property
    def _pending(self) -> frozenset[int]:
        return self._monitor.unreported(self._awaited, max(self._lost_us, self._resumed_us))

    def _missing(self, now_us: int) -> tuple[str, ...]:
        """The names of the values that are unknown now and were awaited in vain so far."""
        slots = self._pending - self._monitor.current(now_us)
        names = [signal.name for signal in self._policy.signals if not slots.isdisjoint(signal.slots)]
        return (*names, AIR_STATE) if self._awaits_air else tuple(names)
