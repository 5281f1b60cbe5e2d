"""What is known before the flight: all of a step's arguments, and nothing of the vehicle's state."""

from dataclasses import dataclass, field

from rtshcua.decision.case import Case
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.values import MISSING, Sets, Value, interval, maybe, members
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.questions import Questions
from rtshcua.ground.checker.context import Context
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.limits import DAY, FULL, MAX_VALUE
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.situation import Context as Standing
from rtshcua.model.flat.zone import MAX_COORDINATE

#: us since the epoch: later than any flight
EVER = 1 << 53


@dataclass(frozen=True, slots=True)
class Ground:
    """A lowered policy, prepared as on board, and any state that its vehicle may be in; `questions` are asked of it.

    `kept` are the ways that were found to keep its airspace (`ways`): the missions of one policy share many.
    """

    context: Context
    lowered: LoweredPolicy
    prepared: PreparedPolicy
    anything: tuple[Value, ...]
    questions: Questions
    kept: set[tuple[object, ...]] = field(default_factory=set)

    def sets(self, at_us: int = 0) -> Sets:
        """Any state, at any time within a day from a UTC time; at any time at all where that is not known (0)."""
        return Sets(self.anything, (0, 0), ((at_us, at_us + DAY - 1 if at_us else EVER),), (0, 0))

    def case(self, invocation: PreparedInvocation) -> Case:
        """A step in any state."""
        flat = invocation.invocation
        policy = self.prepared.policy
        standing = Standing(flat.binding, policy.vehicle.identity, policy.version, 0, 0, flat.phase, 0, ())
        return Case(invocation, self.prepared, standing, self.sets(flat.issued_at_us), exact=False)

    def environment(self, arguments: tuple[Value, ...]) -> Environment:
        """Known arguments in any state, for a condition."""
        sets = self.sets()
        return Environment((*sets.values, MISSING), arguments, sets.utc_us, sets.utc_error_us)

    def span(self, part: Clause | Rule | Link | Airspace) -> Span:
        """Where a part of the policy is written."""
        return self.lowered.files.span(part.source, part.start, part.end)


def anything(policy: Policy) -> tuple[Value, ...]:
    """One value a slot: whatever its signal may report, or nothing."""
    values: list[Value] = [MISSING] * policy.slots
    for signal in policy.signals:
        if signal.kind == POSITION:
            values[signal.slot] = values[signal.slot + 1] = maybe(interval(-MAX_COORDINATE, MAX_COORDINATE))
        elif signal.kind == ENUMERATION:
            values[signal.slot] = maybe(members(value for value, _ in signal.labels))
        elif signal.slot == policy.vehicle.battery:
            values[signal.slot] = maybe(interval(0, FULL))
        else:
            values[signal.slot] = maybe(interval(-MAX_VALUE, MAX_VALUE))
    return tuple(values)
