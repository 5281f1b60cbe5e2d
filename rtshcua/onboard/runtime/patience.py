"""Whether a step that was not admitted may be waited for."""

from rtshcua.decision.holding import holding
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.runtime.supervisor import Grace
from rtshcua.wire.response import Answer

_TIMING = 5  # the step of section 4.1 that holds a decision against its deadline


class Patience:
    """How long one step is waited for, on the ground or in the air."""

    def __init__(self, loaded: Loaded) -> None:
        self._loaded = loaded
        self._grace = Grace()

    def renew(self) -> None:
        """Another step is waited for from now on."""
        self._grace = Grace()

    def stood(self, us: int) -> None:
        """For so long nothing was judged: no grace ran meanwhile. The step's deadline did."""
        self._grace.stood(us)

    def may_wait(self, invocation: Invocation, answer: Answer, released_us: int, now_us: int) -> bool:
        """Whether asking again can help: not past the deadline, but for an approval, which has a time of its own.

        What passed the timing step is in time, also by a release that an approval moved.
        """
        if answer.reason is Reason.AWAITING_APPROVAL:
            return True
        holds = invocation.on_inadmissible == OnInadmissible.HOLD and answer.reason is not Reason.NO_SLACK
        in_time = answer.rule_step > _TIMING or now_us < released_us + invocation.contract.deadline_us
        return in_time and (answer.outcome is Outcome.DEFER or holds)

    def unkept(self, invocation: Invocation, state: State, now: Now) -> str | None:
        """What forbids waiting on in the air; UNKNOWN has the step's grace."""
        unkept = holding(self._loaded.invocations[invocation.step], state, self._loaded.policy, now)
        return self._grace.over(unkept, now.monotonic_us, invocation.contract.grace_us)
