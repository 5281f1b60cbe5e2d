"""The supervisor: what must hold all the while a skill runs, `assume`, `maintain`, airspace and degrade rules."""

from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.truth import FALSE
from rtshcua.decision.watch import watch
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import Now, State

_DURATION = "lasts longer than it may"


class Supervisor:
    """Watches one running skill. UNKNOWN that lasts longer than the contract's grace counts as FALSE (design 4.2)."""

    def __init__(self, prepared: PreparedInvocation, policy: PreparedPolicy, started_us: int) -> None:
        self._prepared = prepared
        self._policy = policy
        self._started_us = started_us
        self._unknown_since: dict[Clause | Rule | Airspace, int] = {}

    def violated(self, state: State, now: Now) -> str | None:
        """The text of what does not hold any more, or None while all does."""
        contract = self._prepared.invocation.contract
        at_us = now.monotonic_us
        if 0 < contract.duration_us < at_us - self._started_us:
            return _DURATION
        unknown: dict[Clause | Rule | Airspace, int] = {}
        for broken in watch(self._prepared, state, self._policy, now):
            since_us = self._unknown_since.get(broken.clause, at_us)
            if broken.truth & FALSE or at_us - since_us > contract.grace_us:
                return broken.clause.text
            unknown[broken.clause] = since_us
        self._unknown_since = unknown
        return None
