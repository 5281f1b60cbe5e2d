"""Falling back: one chain, then the contingency, link after link and never backwards, until the vehicle is down."""

from enum import Enum, auto

from rtshcua.decision.links import START, Choice, choose_contingency, choose_fallback
from rtshcua.model.flat.contract import Link, MotionKind
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.runtime.admission import Admission
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.flight import Chain, Limits, link_us
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, Ref


class Progress(Enum):
    """How a turn of the fallback left things."""

    ON_ITS_WAY = auto()
    STRANDED = auto()  # the last link failed again and again: there is nothing left to try


class Fallback:
    """Flies chains. Each link is asked for and recorded like a step.

    If the boundary does not answer, the standing permit of the link is used: a fallback never waits.
    """

    def __init__(self, loaded: Loaded, admission: Admission, dispatcher: Dispatcher, limits: Limits) -> None:
        self._loaded = loaded
        self._admission = admission
        self._dispatcher = dispatcher
        self._limits = limits
        self._chain = Chain(CONTINGENCY_LINK, -1, START)
        self._holds = True

    def begin(self, kind: int, step: int, holds: bool = True) -> None:
        """Start a step's chain, or the contingency (`step` is -1); `holds`: also the links of it that hold."""
        self._chain = Chain(kind, step, START)
        self._holds = holds

    def land(self) -> None:
        """Start the contingency at its last link, which needs nothing and brings the vehicle down where it is."""
        self._chain = Chain(CONTINGENCY_LINK, -1, len(self._loaded.bundle.policy.contingency) - 2)
        self._holds = True

    def hold(self, now: Now, state: State) -> None:
        """Fly the first hold of the contingency, which goes on until another command replaces it; if there is one."""
        policy = self._loaded.bundle.policy
        for index, link in enumerate(policy.contingency):
            if self._motion(link) == MotionKind.HOLD:
                ref = Ref(CONTINGENCY_LINK, -1, index)
                answer = self._admission.ask(now, state, ref)
                if answer is not None and answer.permit:
                    self._dispatcher.fly(now, answer.permit, ref, None)
                return

    def turn(self, now: Now, state: State) -> Progress:
        """Fly the next link, unless one flies whose time is not over."""
        active, chain = self._dispatcher.active, self._chain
        if active is not None and active.ref == chain.ref(chain.after):
            if active.until_us is None or now.monotonic_us < active.until_us:
                return Progress.ON_ITS_WAY
            self._dispatcher.end(now, "time-over")
        while (choice := self._choose(state, now)) is not None:
            self._chain.after = choice.index
            if not self._holds and self._motion(choice.link) == MotionKind.HOLD:
                continue
            if self._fly(now, state, choice.index, choice.link, insist=False):
                return Progress.ON_ITS_WAY
        if self._chain.kind == FALLBACK_LINK:
            self.begin(CONTINGENCY_LINK, -1, self._holds)
            return self.turn(now, state)
        return self._insist(now, state)

    def _motion(self, link: Link) -> int:
        return self._loaded.bundle.policy.contracts[link.skill].motion.kind

    def _choose(self, state: State, now: Now) -> Choice | None:
        policy, chain = self._loaded.policy, self._chain
        if chain.kind == CONTINGENCY_LINK:
            return choose_contingency(state, policy, now, chain.after)
        return choose_fallback(self._loaded.invocations[chain.step], state, policy, now, chain.after)

    def _insist(self, now: Now, state: State) -> Progress:
        """The chain is used up and the vehicle is not down: the last link again, a bounded number of times."""
        chain, limits = self._chain, self._limits
        if chain.tried == limits.tries:
            return Progress.STRANDED
        if chain.wait_until_us == 0:
            chain.wait_until_us = now.monotonic_us + limits.retry_us
        elif now.monotonic_us >= chain.wait_until_us:
            chain.wait_until_us = 0
            chain.tried += 1
            contingency = self._loaded.bundle.policy.contingency
            self._fly(now, state, len(contingency) - 1, contingency[-1], insist=True)
        return Progress.ON_ITS_WAY

    def _fly(self, now: Now, state: State, index: int, link: Link, *, insist: bool) -> bool:
        """Ask for a link and fly it. `insist` flies it by its standing permit even if it was not admitted."""
        ref = self._chain.ref(index)
        policy = self._loaded.bundle.policy
        lasting_us = link_us(link, policy.contracts[link.skill], policy.vehicle.endurance_us)
        answer = self._admission.ask(now, state, ref)
        if answer is not None and answer.permit and self._dispatcher.fly(now, answer.permit, ref, lasting_us):
            return True
        return (answer is None or insist) and self._dispatcher.stand_in(now, ref, lasting_us)
