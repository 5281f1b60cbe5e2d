"""When the incidents of a scenario happen: at a time, after a step was sent, once a condition was true.

Where a scenario leaves a time open, incident `number` (from 0) happens after a delay that
`Random(f"{scenario.name} {number} {seed}")` draws from its range: the same seed draws the same.
"""

from collections.abc import Iterable, Iterator, Sequence
from random import Random  # noqa: TID251  seeded
from typing import Any, NamedTuple

import msgspec

from rtshcua.decision.evaluate import NO_PHASE, Condition, build
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import TRUE
from rtshcua.model.flat.situation import Now
from rtshcua.model.scenario import AfterStep, AtTime, OnCondition, Scenario
from rtshcua.onboard.ports import Action, Append, Event, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.wire.request import STEP


class Due(NamedTuple):
    """An incident, by its number, and when it is to happen, in us since the start of the run."""

    number: int
    at_us: int


class Triggers:
    """What the incidents of a scenario wait for; `chances` is the source of what each of them draws."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.chances = [Random(f"{scenario.name} {number} {seed}") for number in range(len(scenario.incidents))]
        self._whens = dict(enumerate(each.when for each in scenario.incidents))

    def begin(self, policy: PreparedPolicy) -> None:
        """A process of the runtime begins, under this policy: what it knows, it has to hear first."""
        self._policy = policy
        self._monitor = StateMonitor(policy)
        self._conditions: dict[int, Condition] = {}

    def start(self) -> Iterator[Due]:
        """What waits for nothing but the time."""
        yield from [self._due(number, 0) for number, when in list(self._whens.items()) if isinstance(when, AtTime)]

    def turned(self, now: Now, events: Sequence[Event], actions: Iterable[Action], at_us: int) -> Iterator[Due]:
        """What waited for what came in a turn of the loop."""
        if not self._whens:
            return
        for action in actions:
            if isinstance(action, Append) and b'"event":"dispatched"' in action.line:
                yield from self._sent(msgspec.json.decode(action.line), at_us)
        if any(isinstance(when, OnCondition) for when in self._whens.values()):
            yield from self._look(now, events, at_us)

    def _due(self, number: int, since_us: int) -> Due:
        when = self._whens.pop(number)
        return Due(number, since_us + self.chances[number].randint(when.from_us, when.to_us))

    def _sent(self, record: dict[str, Any], at_us: int) -> Iterator[Due]:
        for number, when in list(self._whens.items()):
            if isinstance(when, AfterStep) and record["kind"] == STEP and record["step"] == when.step:
                yield self._due(number, at_us)

    def _look(self, now: Now, events: Sequence[Event], at_us: int) -> Iterator[Due]:
        """Which conditions are true in the state that the runtime knows."""
        monitor, policy = self._monitor, self._policy
        for event in events:
            if isinstance(event, Readings):
                monitor.update(event)
        monitor.observe(now)
        at = environment(situation(monitor.state(now.monotonic_us), policy, now), policy, (), NO_PHASE)
        for number, when in list(self._whens.items()):
            if not isinstance(when, OnCondition):
                continue
            condition = self._conditions.get(number)
            if condition is None:
                compiler = policy.compiler
                condition = self._conditions[number] = build(compiler.node(when.condition), compiler.tables)
            if condition(at) == TRUE:
                yield self._due(number, at_us)
