"""From evidence lines and the loaded bundle to what the view is told, and to the counts of the summary."""

from collections.abc import Iterator

import msgspec

from rtshcua.adapters.preparation import PERMITTED
from rtshcua.cli.live.story import Happening, Plan, Signal, Step
from rtshcua.cli.showing.log import detail_of
from rtshcua.cli.showing.words import call, duration
from rtshcua.cli.unconfirmed import is_unconfirmed
from rtshcua.evidence.chain import BOUNDARY
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import POSITION
from rtshcua.model.step_number import step_words
from rtshcua.wire.request import CONTINGENCY_LINK, STEP

#: the effect that puts another mission into force
REPLACED = "replacement"
#: what flies instead of a step that is not admitted before anything flew
NOTHING_FLIES = "nothing: it has not left the ground, and nothing is sent"
#: what the boundary makes of what was told anyway
_UNTOLD = frozenset({BOUNDARY, PERMITTED})
_OUTCOMES = ("allow", "deny", "defer", "fallback")


class _Line(msgspec.Struct):
    """What is read of an evidence line; the rest of it is not looked at."""

    type: str
    at_us: int
    kind: int = -1
    step: int = -1
    link: int = -1
    event: str = ""
    outcome: str = ""
    reason: str = ""
    clause: str | None = None
    target: str | None = None
    detail: str = ""


_read = msgspec.json.Decoder(_Line).decode


def plan_of(policy: Policy, mission: Mission, *, mode: str, speed: float) -> Plan:
    """The plan of a loaded bundle."""
    paths = [invocation.plan.path for invocation in mission.invocations if invocation.plan.kind != MotionKind.HOME]
    return Plan(
        mission=mission.name,
        intent=mission.intent,
        policy=f"{policy.name}@{policy.version}",
        vehicle=policy.vehicle.identity,
        mode=mode,
        speed=speed,
        phases=mission.phases,
        steps=tuple(Step(call(policy, invocation), invocation.phase) for invocation in mission.invocations),
        signals=tuple(Signal(signal.name, signal.dimension, dict(signal.labels)) for signal in policy.signals),
        position=next((signal.name for signal in policy.signals if signal.kind == POSITION), ""),
        path=tuple(point for path in paths for point in zip(path[::2], path[1::2], strict=True)),
    )


class Teller:
    """Reads each evidence line once, counts, and says what happened.

    `outcomes` counts every decision of the log, on steps and on links alike: as `rtshcua verify-log` does.
    `unconfirmed` names the fallbacks of which no landing was seen.
    """

    def __init__(self, policy: Policy, mission: Mission, start_us: int) -> None:
        self._policy = policy
        self._mission = mission
        self._start_us = start_us
        self._flown = False  # something was sent that may have lifted it off
        self.outcomes = dict.fromkeys(_OUTCOMES, 0)
        self.done: set[int] = set()
        self.unconfirmed: list[str] = []

    def replace(self, mission: Mission) -> None:
        """From now on this is the mission."""
        self._mission = mission

    def tell(self, line: bytes) -> Happening | None:
        """What a line says, if it is a decision or an effect."""
        record = _read(line)
        t_us = record.at_us - self._start_us
        subject = self._subject(record)
        if record.type == "decision":
            if record.outcome in self.outcomes:
                self.outcomes[record.outcome] += 1
            clause, target = record.clause or "", record.target or ""
            if target and not self._flown:
                target = NOTHING_FLIES
            waits = self._waits(clause, t_us) if record.outcome == "defer" else ""
            return Happening(
                "decision", t_us, record.step, subject, record.outcome, record.reason, clause, target, record.detail,
                waits,
            )  # fmt: skip
        if record.type != "effect" or record.event in _UNTOLD:
            return None
        self._flown = (self._flown or record.event == "dispatched") and record.event != "landed"
        if record.event == "succeeded" and record.kind == STEP:
            self.done.add(record.step)
        if is_unconfirmed(record.kind, record.detail):
            self.unconfirmed.append(subject)
        if record.event == REPLACED:
            return Happening(record.event, t_us, record.step, detail=f"from {step_words(record.step)} on")
        detail = detail_of(record.event, record.detail)
        return Happening(record.event, t_us, record.step, subject, detail=detail)

    def _waits(self, text: str, t_us: int) -> str:
        """What is said of a clause over time, by its text, that was not observed for as long as it looks back."""
        window_us = max((self._looks_back(code) for code in self._codes(text)), default=0)
        if window_us <= t_us:
            return ""
        return f"it looks back {duration(window_us)}, and observation began with the run"

    def _codes(self, text: str) -> Iterator[tuple[int, ...]]:
        """The codes of the rules and clauses of the policy and the mission that are written so."""
        contracts = (*self._policy.contracts, *(each.contract for each in self._mission.invocations))
        clauses = (each for one in contracts for each in (*one.require, *one.assume, *one.maintain))
        yield from (each.code for each in clauses if each.text == text)
        yield from (each.when.code for each in self._policy.rules if each.when is not None and each.text == text)

    def _looks_back(self, code: tuple[int, ...]) -> int:
        """How far, in us, with what it looks at in turn."""
        monitors = [self._policy.monitors[a] for op, a in zip(code[::3], code[1::3], strict=True) if op == Op.MONITOR]
        return max((each.window_us + self._looks_back(each.when.code) for each in monitors), default=0)

    def _subject(self, record: _Line) -> str:
        """The step or link that a record is about, as it was written."""
        if record.kind == CONTINGENCY_LINK:
            return f"contingency: {self._policy.contingency[record.link].text}"
        if record.kind < 0 or record.step < 0:
            return ""
        if record.step >= len(self._mission.invocations):
            return ""  # of a mission that is only just put into force
        invocation = self._mission.invocations[record.step]
        if record.kind == STEP:
            return call(self._policy, invocation)
        if record.link >= 0:
            return f"fallback: {invocation.contract.fallback[record.link].text}"
        targets = {rule.target.text for rule in self._policy.rules if rule.target is not None}
        return f"fallback: {targets.pop()}" if len(targets) == 1 else "fallback: what the policy degrades to"
