"""The limits that a policy and a mission compare each signal with, for the drawings of a flight's signals."""

from collections.abc import Iterator

from rtshcua.decision.tree import AtMost, Both, CodeScope, Either, Negation, Node, parse, scope_of
from rtshcua.ground.flight.flight_content import SignalLimit
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind


def signal_limits(policy: Policy, mission: Mission) -> dict[int, tuple[SignalLimit, ...]]:
    """The limits by state slot: of a comparison of one signal with a constant, the side on which the condition that has
    to hold is false. Conditions of skills that the mission does not have are left out.
    """
    found: dict[int, dict[tuple[int, bool], SignalLimit]] = {}
    scope = scope_of(policy)
    for clause, holds, told, of in _clauses(policy, mission, scope):
        node = parse(clause.code, of)
        if isinstance(node, str):
            continue
        for slot, limit, low in _compared(node, holds=holds):
            text = f"{told}: {' '.join(clause.text.split())}"
            found.setdefault(slot, {}).setdefault((limit, low), SignalLimit(limit, low, text))
    return {slot: tuple(limits.values()) for slot, limits in found.items()}


def _clauses(policy: Policy, mission: Mission, scope: CodeScope) -> Iterator[tuple[Clause, bool, str, CodeScope]]:
    """Yield conditions, whether they have to hold, whose they are, and their scope."""
    skills = {each.skill for each in mission.invocations}
    for one in mission.invocations:
        contract = one.contract
        for clause in (*contract.require, *contract.assume, *contract.maintain):
            yield clause, True, contract.name, scope.about(contract)
    for number, rule in enumerate(policy.rules):
        about = [at for at in rule.skills or range(len(policy.contracts)) if at in skills]
        if rule.when is not None and about and all(0 <= at < len(policy.contracts) for at in about):
            of = scope.about(*(policy.contracts[at] for at in rule.skills))
            kind = RuleKind(rule.kind)
            yield rule.when, kind is RuleKind.PERMIT, f"rule {number + 1}, {kind.name.lower()}", of


def _compared(node: Node, *, holds: bool) -> Iterator[tuple[int, int, bool]]:
    """Yield slot, limit, and whether it is a lower limit."""
    match node:
        case Both(left, right) | Either(left, right):
            yield from _compared(left, holds=holds)
            yield from _compared(right, holds=holds)
        case Negation(operand):
            yield from _compared(operand, holds=not holds)
        case AtMost(((argument, slot, factor),), bound) if not argument and abs(factor) == 1:
            # the signal is at most `bound`, or at least `-bound`
            yield slot, factor * bound, (factor < 0) == holds
