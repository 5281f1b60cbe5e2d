"""The supervisor: what must hold all the while a skill runs, at every update of the state (`decision.watch`)."""

from collections.abc import Iterable

from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.truth import FALSE, Truth
from rtshcua.decision.watch import watch
from rtshcua.model.flat.situation import Now, State

_DURATION = "lasts longer than it may"


class Grace:
    """Bears with UNKNOWN for a while: then it counts as FALSE (design 4.2)."""

    def __init__(self) -> None:
        self._since: dict[str, int] = {}

    def stood(self, us: int) -> None:
        """For so long nothing was judged: that time does not count."""
        self._since = {text: since_us + us for text, since_us in self._since.items()}

    def over(self, broken: Iterable[tuple[str, Truth]], at_us: int, grace_us: int) -> str | None:
        """The first text that is FALSE, or was UNKNOWN at each call for longer than `grace_us`; else None.

        Which of the two it was is said, for they ask for different things of whoever reads the log.
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
    """Watches one running skill. UNKNOWN that lasts longer than the contract's grace counts as FALSE (design 4.2)."""

    def __init__(self, prepared: PreparedInvocation, policy: PreparedPolicy, started_us: int) -> None:
        self._prepared = prepared
        self._policy = policy
        self._started_us = started_us
        self._grace = Grace()

    def stood(self, us: int) -> None:
        """For so long nothing was judged: no grace ran meanwhile. The skill's own time did."""
        self._grace.stood(us)

    def violated(self, state: State, now: Now) -> str | None:
        """The text of what does not hold any more, or None while all does."""
        contract = self._prepared.invocation.contract
        at_us = now.monotonic_us
        if 0 < contract.duration_us < at_us - self._started_us:
            return _DURATION
        return self._grace.over(watch(self._prepared, state, self._policy, now), at_us, contract.grace_us)
