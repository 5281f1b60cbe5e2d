"""The order of dispatches: what the executor refuses whatever was decided, no log may hold (design 4.5).

One step runs at a time and none comes back, but for one that was withdrawn, of which nothing was sent; no step follows
a return or a landing that a fallback began; chains go forward only, and a chain lapses when another step was sent. A
dispatch names a skill of the bundle, where it stands.
"""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.cover import DISPATCHED
from rtshcua.ground.audit.named import ref_words
from rtshcua.ground.audit.trust import Basis
from rtshcua.model.flat.contract import Link, MotionKind
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref

#: effects that show that a command was sent
_SHOWS = ("obeyed", "succeeded")
_REPLACED = "replaced"  # how a command ends in whose place another is sent; no step is sent in the place of a step
_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)


class Turns:
    """Follows the commands of one log; what it keeps does not grow."""

    def __init__(self, basis: Basis) -> None:
        self._basis = basis
        self._step = -1  # the last that was sent,
        self._running: int | None = None  # and its token, while it runs
        self._before = -1  # the one that was sent before it
        self._last: Ref | None = None  # what was dispatched last,
        self._shown = False  # and whether anything shows that it was sent
        self._fallback = (-1, DEGRADE - 1)  # the step whose chain was last in use, and the last link sent
        self._contingency = -1
        self._homeward = False  # a link began a return or a landing,
        self._final = False  # and it was one of the contingency

    def check(self, record: Effect) -> Flaw | None:
        """What is wrong with an effect, or None."""
        if record.event != DISPATCHED:
            if record.token == self._running and record.event != _REPLACED:
                self._running = None
            if record.event in _SHOWS and record.ref == self._last:
                self._shown = True
            return None
        if record.detail not in self._skills(record):
            text = "what was sent is not what stands there in the bundle"
            return Flaw("dispatch/other-skill", text, record.detail, " or ".join(self._skills(record)) or "nothing")
        flaw = self._check_step(record) if record.kind == STEP else self._check_link(record)
        if flaw is None:
            self._follow(record)
        return flaw

    def withdrawn(self, record: Effect) -> Flaw | None:
        """What is wrong with an effect that says that nothing was sent of a step, or None: then it may come again."""
        dispatched = record.ref == self._last
        unsent = not self._shown and self._running is None if dispatched else record.step > self._step
        if record.kind != STEP or not unsent:
            text = "a step may come again of which something may have been sent"
            return Flaw("dispatch/was-sent", text, _name(record))
        if dispatched:
            self._step, self._last = self._before, None
        return None

    def _check_step(self, record: Effect) -> Flaw | None:
        if self._homeward:
            return Flaw("dispatch/mission-over", "a step was sent after a return or a landing began", _name(record))
        if self._running is not None or record.step <= self._step:
            return Flaw("dispatch/out-of-turn", "a step was sent while another ran, or before it", _name(record))
        return None

    def _check_link(self, record: Effect) -> Flaw | None:
        if record.kind == CONTINGENCY_LINK:
            backwards = self._final and record.link < self._contingency
        elif record.step < self._step:
            return Flaw("dispatch/lapsed", "a link was sent whose step was over", _name(record))
        else:
            step, last = self._fallback
            backwards = self._final or (record.step == step and record.link <= last)
        text = "a link was sent after one that stands behind it"
        return Flaw("dispatch/backwards", text, _name(record)) if backwards else None

    def _follow(self, record: Effect) -> None:
        self._last, self._shown = record.ref, False
        if record.kind == STEP:
            self._before, self._step, self._running = self._step, record.step, record.token
            return
        self._running = None
        kinds = [each.motion.kind for each in self._basis.policy.policy.contracts if each.name == record.detail]
        homeward = kinds[0] in _HOMEWARD
        self._homeward = self._homeward or homeward
        if record.kind == CONTINGENCY_LINK:
            self._contingency = record.link
            self._final = self._final or homeward
        else:
            self._fallback = (record.step, record.link)

    def _skills(self, record: Effect) -> tuple[str, ...]:
        """The names of the skills that may be sent as this step or link."""
        policy, invocations = self._basis.policy.policy, self._basis.invocations
        if record.kind == CONTINGENCY_LINK:
            links = _nth(policy.contingency, record.link) if record.step == -1 else ()
        elif not 0 <= record.step < len(invocations):
            return ()
        else:
            contract = invocations[record.step].invocation.contract
            if record.kind == STEP:
                return (contract.name,) if record.link == -1 else ()
            if record.kind != FALLBACK_LINK:
                return ()
            targets = tuple(rule.target for rule in policy.rules if rule.target is not None)
            links = targets if record.link == DEGRADE else _nth(contract.fallback, record.link)
        return tuple(policy.contracts[link.skill].name for link in links)


def _nth(chain: tuple[Link, ...], number: int) -> tuple[Link, ...]:
    return chain[number : number + 1] if number >= 0 else ()


def _name(record: Effect) -> str:
    return ref_words(record.ref)
