"""What is known before the flight: all of a step's arguments, and nothing of the vehicle's state."""

from dataclasses import dataclass

from rtshcua.decision.case import Case
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.values import MISSING, Sets, Value, interval, maybe, members
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Context
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.limits import DAY, FULL, MAX_VALUE
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.situation import Context as Standing
from rtshcua.model.flat.zone import MAX_COORDINATE


@dataclass(frozen=True, slots=True)
class Ground:
    """A lowered policy, prepared as on board, and any state that its vehicle may be in."""

    context: Context
    lowered: LoweredPolicy
    prepared: PreparedPolicy
    anything: tuple[Value, ...]

    def sets(self, at_us: int = 0) -> Sets:
        """Any state, at any time within a day from a UTC time."""
        return Sets(self.anything, (0, 0), ((at_us, at_us + DAY - 1),), (0, 0))

    def case(self, invocation: PreparedInvocation) -> Case:
        """A step in any state."""
        flat = invocation.invocation
        policy = self.prepared.policy
        standing = Standing(flat.binding, policy.vehicle.identity, policy.version, 0, 0, flat.phase, 0, ())
        return Case(invocation, self.prepared, standing, self.sets(flat.issued_at_us), exact=False)

    def environment(self, arguments: tuple[Value, ...]) -> Environment:
        """Known arguments in any state, for a condition."""
        values, _, utc, error = self.sets()
        return Environment((*values, MISSING), arguments, utc, error)

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
