"""The dispatches of a log: evidence before effect, and their order (design 4.5, 6).

Every dispatch needs an earlier record that permits it. A log must also not contain a dispatch that the executor always
refuses. One step runs at a time. A step is sent once, unless it was withdrawn and nothing of it was sent. No step
follows a return or landing of a fallback. Chains only go forward, and a chain lapses when the next step is sent. The
skill of a dispatch is that of its step or link in the bundle.
"""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.ground.audit.trust import Basis
from rtshcua.model.flat.contract import Link, MotionKind
from rtshcua.model.step_number import step_words
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref


def ref_words(ref: Ref) -> str:
    """Describe a step or link; the bare fields of the record if they are neither."""
    match ref:
        case Ref(kind=kind, step=step, link=-1) if kind == STEP and step >= 0:
            return step_words(step)
        case Ref(kind=kind, step=step, link=link) if kind == FALLBACK_LINK and step >= 0 and link >= 0:
            return f"link {link + 1} of the fallback of {step_words(step)}"
        case Ref(kind=kind, step=step, link=link) if kind == FALLBACK_LINK and step >= 0 and link == DEGRADE:
            return f"the target of a degrade rule, at {step_words(step)}"
        case Ref(kind=kind, step=-1, link=link) if kind == CONTINGENCY_LINK and link >= 0:
            return f"link {link + 1} of the contingency"
        case _:
            return f"neither a step nor a link: kind {ref.kind}, index {ref.step}, link {ref.link}"


def is_withdrawn(record: Effect) -> bool:
    """Whether an effect records that nothing was sent of an admitted step, so that the step may be sent later."""
    return record.event == "refused" and record.detail == WITHDRAWN


DISPATCHED = "dispatched"


class DispatchCover:
    """Checks that each dispatch of a log has a permit. Its memory is bounded by the steps and links of the bundle.

    An `allow` covers one dispatch of its step or link, up to its `valid_until_us`. The `allow` of a step also covers
    the links of its fallback chain and of the contingency: these are standing permits.
    """

    def __init__(self) -> None:
        self.recalled = False  # then no step may be sent any more
        self.cancelled = False  # likewise
        self.dispatches = 0
        self._until_us: dict[Ref, int] = {}
        self._standing: set[int] = set()

    def decided(self, record: DecisionRecord) -> None:
        """Record a decision that was derived again."""
        key = record.ref
        if record.outcome != "allow":
            self._until_us.pop(key, None)
            return
        self._until_us[key] = record.valid_until_us
        if record.kind == STEP:
            self._standing.add(record.step)

    def withdrawn(self, record: Effect) -> None:
        """Record that a step was withdrawn: its permit is void."""
        self._until_us.pop(record.ref, None)
        self._standing.discard(record.step)

    def check(self, record: Effect) -> Flaw | None:
        """Return a flaw if an effect is a dispatch without a valid permit, else None."""
        if record.event != DISPATCHED:
            return None
        self.dispatches += 1
        if self.recalled and record.kind == STEP:
            return Flaw("dispatch/recalled", "a step was sent after the mission was recalled", step_words(record.step))
        if self.cancelled and record.kind == STEP:
            return Flaw(
                "dispatch/cancelled", "a step was sent after the mission was cancelled", step_words(record.step)
            )
        until_us = self._until_us.pop(record.ref, None)
        if until_us is not None:
            if record.at_us <= until_us or self._stands(record):
                return None
            text = "the command was sent after its permit expired"
            return Flaw("dispatch/late", text, f"{record.at_us} us", f"at most {until_us} us")
        if self._stands(record):
            return None
        text = "the command was sent without an earlier record that permits it"
        return Flaw("dispatch/not-permitted", text, ref_words(record.ref))

    def _stands(self, record: Effect) -> bool:
        if record.kind == FALLBACK_LINK:
            return record.step in self._standing and record.link != DEGRADE
        return record.kind == CONTINGENCY_LINK and bool(self._standing)


#: effects that prove that a command was sent
_SHOWS = ("obeyed", "succeeded")
_REPLACED = "replaced"  # a command that another one replaces; a step never replaces a step
_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)


class DispatchOrder:
    """Checks the order of the dispatches of one log, in constant memory."""

    def __init__(self, basis: Basis) -> None:
        self._basis = basis
        self._step = -1  # the last step that was sent
        self._running: int | None = None  # its token, while it runs
        self._before = -1  # the step that was sent before it
        self._last: Ref | None = None  # the last dispatch
        self._shown = False  # whether an effect proves that the last dispatch was sent
        self._fallback = (-1, DEGRADE - 1)  # the step whose chain was last in use, and the last link sent
        self._contingency = -1
        self._homeward = False  # a link began a return or a landing
        self._final = False  # a link of the contingency did

    def check(self, record: Effect) -> Flaw | None:
        """Return a flaw if an effect is a dispatch of the wrong skill or out of order, else None."""
        if record.event != DISPATCHED:
            if record.token == self._running and record.event != _REPLACED:
                self._running = None
            if record.event in _SHOWS and record.ref == self._last:
                self._shown = True
            return None
        if record.detail not in self._skills(record):
            text = "the skill that was sent is not that of the bundle"
            return Flaw("dispatch/other-skill", text, record.detail, " or ".join(self._skills(record)) or "nothing")
        flaw = self._check_step(record) if record.kind == STEP else self._check_link(record)
        if flaw is None:
            self._follow(record)
        return flaw

    def withdrawn(self, record: Effect) -> Flaw | None:
        """Return a flaw if a withdrawn step may have been sent; else None, and the step may be sent later."""
        dispatched = record.ref == self._last
        unsent = not self._shown and self._running is None if dispatched else record.step > self._step
        if record.kind != STEP or not unsent:
            text = "a step was withdrawn although it may have been sent"
            return Flaw("dispatch/was-sent", text, _name(record))
        if dispatched:
            self._step, self._last = self._before, None
        return None

    def _check_step(self, record: Effect) -> Flaw | None:
        if self._homeward:
            return Flaw("dispatch/mission-over", "a step was sent after a return or a landing began", _name(record))
        if self._running is not None or record.step <= self._step:
            return Flaw("dispatch/out-of-turn", "a step was sent out of order or while another ran", _name(record))
        return None

    def _check_link(self, record: Effect) -> Flaw | None:
        if record.kind == CONTINGENCY_LINK:
            backwards = self._final and record.link < self._contingency
        elif record.step < self._step:
            return Flaw("dispatch/lapsed", "a link was sent after its step had ended", _name(record))
        else:
            step, last = self._fallback
            backwards = self._final or (record.step == step and record.link <= last)
        text = "a link was sent after a later link of its chain"
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
        """The skills that may be sent as this step or link."""
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
