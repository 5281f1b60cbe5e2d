"""A state to begin from: where the plan has the vehicle before a step, and signals as the contract wants them."""

from collections.abc import Iterator, Sequence

from rtshcua.decision.nearest import ChangeSearch, nearest_in
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.temporal import lasting
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import CELL, ENUMERATION, POSITION
from rtshcua.model.flat.situation import Now, State

#: one clause may undo what another was content with, so they are gone through again, a few times
_ROUNDS = 4

#: what a full cell of a lithium battery gives, mV
_FULL_CELL = 4_200


def nominal(invocations: Sequence[PreparedInvocation], step: int, policy: PreparedPolicy, now: Now) -> State:
    """A fresh state in which the step's own clauses hold, as far as changes of single signals can bring that about."""
    invocation, flat = invocations[step], policy.policy
    values = _start(flat)
    x, y, height = place_before(invocations, step)
    for slot, value in ((flat.vehicle.position, x), (flat.vehicle.position + 1, y), (flat.vehicle.height, height)):
        values[slot] = value
    values[flat.vehicle.battery] = FULL
    for signal in flat.signals:
        if signal.name == CELL:
            values[signal.slot] = _FULL_CELL
    fixed = {flat.vehicle.position, flat.vehicle.position + 1, flat.vehicle.height}
    for _ in range(_ROUNDS):
        for clause in _clauses(invocation):
            _content(clause, invocation, policy, now, values, fixed)
    return lasting(_state(values), policy, now)


def place_before(invocations: Sequence[PreparedInvocation], step: int) -> tuple[int, int, int]:
    """Where the plans of the steps before have taken the vehicle: local x, y and height, mm; at home to begin with."""
    x, y, height = 0, 0, 0
    for invocation in invocations[:step]:
        plan = invocation.invocation.plan
        if plan.path:
            x, y = plan.path[-2:]
        if plan.kind in (MotionKind.HOME, MotionKind.LAND):
            height = 0
        elif plan.kind != MotionKind.HOLD:
            height = plan.altitude
    return x, y, height


def _start(policy: Policy) -> list[int | None]:
    values: list[int | None] = [0] * policy.slots
    for signal in policy.signals:
        if signal.kind == ENUMERATION and signal.labels:
            known = {unknown for source in signal.sources for unknown in source.unknown}
            values[signal.slot] = next((value for value, _ in signal.labels if value not in known), signal.labels[0][0])
        elif signal.kind == POSITION:
            values[signal.slot + 1] = 0
    return values


def _state(values: Sequence[int | None]) -> State:
    return State(tuple(values), (0,) * len(values))


def _clauses(invocation: PreparedInvocation) -> Iterator[Clause]:
    for guards in (invocation.require, invocation.assume, invocation.maintain):
        yield from (clause for clause, _ in guards)


def _content(
    clause: Clause,
    invocation: PreparedInvocation,
    policy: PreparedPolicy,
    now: Now,
    values: list[int | None],
    fixed: set[int],
) -> None:
    """Change the signals that a clause reads, but for where the vehicle is, so that it is true."""
    sets = situation(_state(values), policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    node = policy.compiler.node(clause, invocation.invocation.contract)
    for change in ChangeSearch(at, policy.tables, signals_only=True).find(node, True) or ():
        if change.argument or change.at is None or change.at in fixed:
            continue
        choices = change.choices
        values[change.at] = min(choices) if choices else nearest_in(change, at.slots[change.at])
