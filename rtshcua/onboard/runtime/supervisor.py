"""The conditions that must hold while a skill runs, and while a step is awaited (`decision.running_conditions`)."""

from collections.abc import Iterable
from functools import partial

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.running_conditions import holding, watch
from rtshcua.decision.session import may_ask_again
from rtshcua.decision.values import FALSE, Truth
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.runtime.journal import Detail
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.seen import seen

DURATION = "exceeded its maximum duration"
_TIMING = 5  # the step of section 4.1 that compares a decision with its deadline


class Grace:
    """Tolerates UNKNOWN for a grace time, after which it counts as FALSE (design 4.2)."""

    def __init__(self) -> None:
        self._since: dict[str, int] = {}

    def stood(self, us: int) -> None:
        """Nothing was judged for this time, which does not count."""
        self._since = {text: since_us + us for text, since_us in self._since.items()}

    def over(self, broken: Iterable[tuple[str, Truth]], at_us: int, grace_us: int) -> str | None:
        """The first text that is FALSE, or was UNKNOWN at each call for longer than `grace_us`; else None.

        The text says which of the two it was, because they call for different actions.
        """
        since: dict[str, int] = {}
        for text, truth in broken:
            since[text] = self._since.get(text, at_us)
            if truth & FALSE:
                return text
            if at_us - since[text] > grace_us:
                return f"{text}: unknown for longer than its grace of {grace_us // 1_000} ms"
        self._since = since
        return None


class Supervisor:
    """Watches one running skill. UNKNOWN that lasts longer than the contract's grace counts as FALSE (design 4.2).

    While nothing is judged neither grace nor the skill's own time runs: the flight time counts only time with a
    link. `away_us` is the total time without a link so far (`LinkSupervision.away_us`).
    """

    def __init__(self, prepared: PreparedInvocation, policy: PreparedPolicy, started_us: int, away_us: int = 0) -> None:
        self._prepared = prepared
        self._policy = policy
        self._started_us = started_us
        self._away_us = away_us  # when it started
        self.grace = Grace()

    def lasted_us(self, at_us: int, away_us: int) -> int:
        """How long the skill has run, in time with a link."""
        return at_us - self._started_us - (away_us - self._away_us)

    def violated(self, state: State, now: Now, away_us: int = 0, hindrance: str = "") -> Detail | None:
        """The text of the condition that does not hold any more, with the values that it read, or None while all
        hold. `hindrance` is the known cause of a delay, as text.
        """
        contract = self._prepared.invocation.contract
        at_us = now.monotonic_us
        if 0 < contract.duration_us < self.lasted_us(at_us, away_us):
            away_ms = (away_us - self._away_us) // 1_000
            besides = f", excluding {away_ms} ms without a link" if away_ms else ""
            return f"{DURATION}{besides}: {hindrance}" if hindrance else f"{DURATION}{besides}"
        text = self.grace.over(watch(self._prepared, state, self._policy, now), at_us, contract.grace_us)
        return None if text is None else partial(_with_values, text, self._prepared, self._policy, state)


def _with_values(text: str, prepared: PreparedInvocation, policy: PreparedPolicy, state: State) -> str:
    """Made when it is recorded, after the fallback was sent."""
    values = seen(text, prepared, policy, state)
    return f"{text}: {values}" if values else text


class IdleTime:
    """How long a live mission waits in the air for its next step, after the last one (`idle_us`; None: not at all)."""

    def __init__(self, idle_us: int | None) -> None:
        self.idle_us = idle_us
        self._since_us: int | None = None

    @property
    def is_live(self) -> bool:
        """Whether the mission is live: it waits for further steps, and a new step may supersede the running one."""
        return self.idle_us is not None

    def begins(self, now_us: int) -> bool:
        """Count the time from now on; False if it is counted already."""
        began, self._since_us = self._since_us is None, now_us if self._since_us is None else self._since_us
        return began

    def stood(self, us: int) -> None:
        """Nothing was judged for this time, which does not count."""
        if self._since_us is not None:
            self._since_us += us

    def stop(self) -> None:
        """A step was handed in."""
        self._since_us = None

    def over(self, now_us: int) -> bool:
        """Whether the time is over."""
        return self._since_us is not None and self.idle_us is not None and now_us - self._since_us >= self.idle_us


class RetryPolicy:
    """Whether and when a step that was not admitted is requested again, and how long it is awaited.

    While nothing is judged no grace runs, but the step's deadline does.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.grace = Grace()
        self._news = True  # something was received, or began, since the step was last requested
        self._asked_us = 0  # the time of the last request
        self._held = False  # a hold for the step was tried,
        self._late = 0  # and how often it was too late
        self._called = False  # a replacement of it was requested

    def renew(self, now_us: int, *, at_once: bool) -> None:
        """Another step is awaited from now on; it is requested `at_once`, or when something was received."""
        self.grace = Grace()
        self._news, self._asked_us, self._held, self._called = at_once, now_us, False, False
        self._late = 0

    def news(self) -> None:
        """Something was received, so the next answer may differ."""
        self._news = True

    def is_due(self, now_us: int) -> bool:
        """Whether to request the step now; True counts as a request."""
        if not self._news and now_us - self._asked_us < self._limits.again_us:
            return False
        self._news, self._asked_us = False, now_us
        return True

    @staticmethod
    def may_wait(invocation: Invocation, answer: Decision, released_us: int, now_us: int) -> bool:
        """Whether another request can help: not past the deadline, except for an approval, which has a time of its
        own.

        A decision that passed the timing step is in time, also by a release that an approval moved.
        """
        if answer.reason is Reason.AWAITING_APPROVAL:
            return True
        in_time = answer.step > _TIMING or now_us < released_us + invocation.contract.deadline_us
        return in_time and may_ask_again(invocation, answer.outcome, answer.reason)

    def may_hold(self) -> bool:
        """Whether to try a hold while the step is awaited: once, because a hold that was sent continues."""
        held, self._held = self._held, True
        return not held

    def hold_again(self) -> bool:
        """The hold was not sent, because this computer was too late: whether to try again, which is bounded."""
        self._held = self._late == self._limits.tries
        self._late += not self._held
        return not self._held

    def may_call(self, invocation: Invocation, answer: Decision) -> bool:
        """Whether to request a replacement of the step, once: its mission says so, and it was not admitted."""
        called, wanted = self._called, invocation.on_inadmissible == OnInadmissible.REPLAN
        self._called = called or (wanted and answer.outcome is Outcome.FALLBACK)
        return self._called and not called

    def unkept(self, prepared: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> str | None:
        """The condition that prevents waiting in the air; UNKNOWN has the step's grace."""
        grace_us = prepared.invocation.contract.grace_us
        return self.grace.over(holding(prepared, state, policy, now), now.monotonic_us, grace_us)
