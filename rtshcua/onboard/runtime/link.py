"""Supervision of the link: while it is down nothing is judged, and when it is back fresh state is awaited first.

            lost                      back
      UP ---------> DOWN ---------------------> AWAITING ----> UP   all was reported again, or the time for it is over
                      ^-------------------------- |
                                 lost again

What is known of a vehicle that was silent is old. What was current when the link was lost, and is stale when it is
back, has to be reported again, measured after the loss, before anything is decided on it; for a bounded time, for it
may never be. Signals that were stale or missing before are not waited for: their absence is no news.

A computer that stood still is a silence of our own: what was known when it goes on is as old, and what it reads first
was said meanwhile. Fresh state is awaited in the same way.

A vehicle that is heard, but answers nothing, is judged as ever: what is sent may arrive yet. It is waited for no longer
than one that is silent.
"""

from enum import Enum, auto
from typing import Final

from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import Frozen
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.monitor import StateMonitor

#: the effect that says that this computer stood still, and for how long: nothing was read, judged or sent meanwhile
STOOD_STILL: Final = "stood-still"
#: what stands for the vehicle's word on whether it flies, among the names of signals
AIR_STATE = "whether it is in the air"


class EndedSilence(Frozen):
    """A silence that is over, or a stall of this computer: how long the vehicle was not heard (0 if there was only a
    stall), how long fresh state was then waited for, both in us, and what was not reported again in time.
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
    """Whether the vehicle is heard, and whether what is known of it may be judged. Times are monotonic, in us.

    One silence goes on until state was judged again: a link that comes and goes within it begins no new one.
    """

    def __init__(self, policy: Policy, monitor: StateMonitor, limits: Limits) -> None:
        self._policy = policy
        self._monitor = monitor
        self._limits = limits
        self.state = LinkState.UP
        self._since_us: int | None = None  # start of the current silence, or None
        self._waits_us: int | None = None  # and is waited out since then
        self._mute_us: int | None = None  # it answers nothing, and that is waited out since then
        self._lost_us = 0  # the link was lost last
        self._first_back_us: int | None = None  # the link was back first in this silence,
        self._back_us = 0  # and last
        self._resumed_us = 0  # this computer last went on that had stood still (0: it is not known to have)
        self._until_us = 0  # fresh state is awaited until then, at the latest
        self._standing_us: int | None = None  # since then nothing is judged
        self._awaited: frozenset[int] = frozenset()
        self._awaits_air = False
        self._away_us = 0  # how long the link was not up, in stretches that are over,
        self._away_since_us: int | None = None  # and when the present one began

    def away_us(self, now_us: int) -> int:
        """How long, in sum so far, the vehicle was silent, not judged yet after that, or answered nothing: what flies
        a step counts none of it.
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
        """Whether the vehicle answers nothing: what is sent does not seem to arrive."""
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

        Fresh state is waited for `fresh_us` from now, and `flapping_us` from when it was back first in this silence.
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
        """This computer stood still from `before_us` to `now_us`: nothing that was known is current because of that.

        `takes_off` as for `lost`. What the vehicle said meanwhile may be read at once; where that is too old, fresh
        state is awaited as after a silence. But for `stalled_us` of it, the time of the stall is none in which that was
        waited for, nor one in which the vehicle had a link: a computer that does nothing but stall judges all the same.
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
        """The vehicle said whether it is in the air."""
        self._awaits_air = False

    def hurry(self, now_us: int) -> None:
        """Somebody waits for the end from now on: a silence that is under way is waited out anew, of either kind."""
        self._waits_us = None if self._since_us is None else now_us
        self._mute_us = None if self._mute_us is None else now_us

    def waited_us(self, now_us: int) -> int:
        """How long a silence that is under way was waited out, or that it answers nothing; 0 if neither is."""
        return max((now_us - us for us in (self._waits_us, self._mute_us) if us is not None), default=0)

    def awaits(self, now_us: int) -> bool:
        """Whether nothing may be judged now, for fresh state may still come. To be asked while it is awaited."""
        if now_us < self._until_us and self._missing(now_us):
            self._standing_us = now_us if self._standing_us is None else self._standing_us
            self._count_away(now_us)
            return True
        return False

    def judged(self, now_us: int) -> tuple[int, EndedSilence | None]:
        """State is judged now, though some may still be awaited: for how long it was not, and the silence if that is
        over with it.

        Until the time for fresh state is over, what is stale only now and was not reported again is waited for too.
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
        """All that was awaited has come, or is not awaited any more."""
        self.state = LinkState.UP
        self._until_us = 0
        self._lost_us = self._back_us = self._resumed_us = 0
        self._awaited = frozenset()
        self._awaits_air = False

    @property
    def _pending(self) -> frozenset[int]:
        return self._monitor.unreported(self._awaited, max(self._lost_us, self._resumed_us))

    def _missing(self, now_us: int) -> tuple[str, ...]:
        """The names of what is not known any more, and was awaited in vain so far."""
        slots = self._pending - self._monitor.current(now_us)
        names = [signal.name for signal in self._policy.signals if not slots.isdisjoint(signal.slots)]
        return (*names, AIR_STATE) if self._awaits_air else tuple(names)
