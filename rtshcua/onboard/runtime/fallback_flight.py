"""Flies a fallback: one chain, then the contingency, link after link and never backwards, until the vehicle is down."""

import msgspec

from rtshcua.decision.fallbacks import START, LinkChoice, choose_contingency, choose_fallback
from rtshcua.model.flat.contract import Link, MotionKind
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.runtime.admission import Admission
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.limits import Limits, link_us
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, Ref


class _Chain(msgspec.Struct):
    """A chain in flight: its kind, the step that it belongs to (-1: the contingency), and the last link used.

    `holds`: its links that hold fly too. The last link was repeated `tried` times, and is repeated at
    `wait_until_us` (0: no wait). Links of it were too late `late` times, and repeated for that.
    """

    kind: int
    step: int
    after: int
    holds: bool
    tried: int = 0
    wait_until_us: int = 0
    late: int = 0

    def ref(self, index: int) -> Ref:
        """The link of this index."""
        return Ref(self.kind, self.step, index)


class Fallback:
    """Flies chains. Each link is requested and recorded like a step.

    If the boundary does not answer, the standing permit of the link is used: a fallback never waits.
    """

    def __init__(self, loaded: Loaded, admission: Admission, dispatcher: Dispatcher, limits: Limits) -> None:
        self._loaded = loaded
        self._policy = loaded.bundle.policy
        self._admission = admission
        self._dispatcher = dispatcher
        self._limits = limits
        self._chain = _Chain(CONTINGENCY_LINK, -1, START, True)
        self._overdue = False  # the last link to fly had a permit, which came too late

    def begin(self, kind: int, step: int, *, holds: bool = True) -> None:
        """Start a step's chain, or the contingency (`step` is -1); `holds`: including the links that hold."""
        self._chain = _Chain(kind, step, START, holds)

    def land(self) -> None:
        """Start the contingency at its last link, which has no condition and brings the vehicle down where it is."""
        self._chain = _Chain(CONTINGENCY_LINK, -1, len(self._policy.contingency) - 2, True)

    def late(self) -> None:
        """This computer was too late to send the last dispatched link: it is requested again, a bounded number of
        times, because a link that brings the vehicle home must not be skipped for that reason. The boundary lets
        no link of a step's chain fly twice, so the contingency flies instead.
        """
        chain = self._chain
        if chain.late == self._limits.tries:
            return
        if chain.kind == FALLBACK_LINK:
            self.begin(CONTINGENCY_LINK, -1, holds=chain.holds)
        else:
            chain.after -= 1
        self._chain.late = chain.late + 1

    def hold(self, now: Now, state: State) -> bool:
        """Fly the first hold of the contingency, if there is one, which continues until another command replaces it.

        False if its permit came too late: it may be tried again.
        """
        for index, link in enumerate(self._policy.contingency):
            if self._holds(link):
                ref = Ref(CONTINGENCY_LINK, -1, index)
                answer = self._admission.ask(now, state, ref)
                if answer is not None and answer.permit:
                    return self._dispatcher.fly(now, answer.permit, ref, None) or not self._dispatcher.overdue
                break
        return True

    def turn(self, now: Now, state: State) -> bool:
        """Fly the next link, unless one flies within its time. False if no attempt is left: the last link failed
        repeatedly.
        """
        active, chain = self._dispatcher.active, self._chain
        if active is not None and active.ref == chain.ref(chain.after):
            if active.until_us is None or now.monotonic_us < active.until_us:
                return True
            self._dispatcher.end(now, "time-over")
        while (choice := self._choose(state, now)) is not None:
            before, chain.after = chain.after, choice.index
            if not chain.holds and self._holds(choice.link):
                continue
            if self._fly(now, state, choice.index, choice.link, insist=False):
                return True
            if self._overdue and chain.late < self._limits.tries:
                chain.after, chain.late = before, chain.late + 1
                return True
        if chain.kind == FALLBACK_LINK:
            self.begin(CONTINGENCY_LINK, -1, holds=chain.holds)
            return self.turn(now, state)
        return self._insist(now, state)

    def _holds(self, link: Link) -> bool:
        return self._policy.contracts[link.skill].motion.kind == MotionKind.HOLD

    def _choose(self, state: State, now: Now) -> LinkChoice | None:
        policy, chain = self._loaded.policy, self._chain
        if chain.kind == CONTINGENCY_LINK:
            return choose_contingency(state, policy, now, chain.after)
        return choose_fallback(self._loaded.invocations[chain.step], state, policy, now, chain.after)

    def _insist(self, now: Now, state: State) -> bool:
        """The chain is used up and the vehicle is not down: repeat the last link, a bounded number of times."""
        chain, limits = self._chain, self._limits
        if chain.tried == limits.tries:
            return False
        if chain.wait_until_us == 0:
            chain.wait_until_us = now.monotonic_us + limits.retry_us
        elif now.monotonic_us >= chain.wait_until_us:
            chain.wait_until_us = 0
            chain.tried += 1
            contingency = self._policy.contingency
            self._fly(now, state, len(contingency) - 1, contingency[-1], insist=True)
        return True

    def _fly(self, now: Now, state: State, index: int, link: Link, *, insist: bool) -> bool:
        """Request a link and fly it. `insist` flies it by its standing permit even if it was not admitted."""
        ref, lasting_us = self._chain.ref(index), link_us(self._policy, link)
        answer = self._admission.ask(now, state, ref)
        self._overdue = False
        if answer is not None and answer.permit:
            if self._dispatcher.fly(now, answer.permit, ref, lasting_us):
                return True
            self._overdue = self._dispatcher.overdue
        return (answer is None or insist) and self._dispatcher.stand_in(now, ref, lasting_us)
