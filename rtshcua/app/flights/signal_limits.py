"""The limits that a policy and a mission compare each signal with, for the drawings of a flight's signals."""

from collections.abc import Iterator, Sequence

from rtshcua.decision.tree import AtMost, Both, CodeScope, Either, Negation, Node, parse, scope_of
from rtshcua.ground.flight.flight_content import SignalLimit
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy, Rule, RuleKind


def signal_limits(policy: Policy, steps: Sequence[Invocation]) -> dict[int, tuple[SignalLimit, ...]]:
    """The limits by state slot: of a comparison of one signal with a constant, the side on which the condition that has
    to hold is false. `steps` are all that were ever in force; conditions of skills that none of them has are left out.
    """
    found: dict[int, dict[tuple[int, bool], SignalLimit]] = {}
    scope = scope_of(policy)
    for clause, holds, told, of in _clauses(policy, steps, scope):
        node = parse(clause.code, of)
        if isinstance(node, str):
            continue
        for slot, limit, low in _compared(node, holds=holds):
            text = f"{told}: {' '.join(clause.text.split())}"
            found.setdefault(slot, {}).setdefault((limit, low), SignalLimit(limit, low, text))
    return {slot: tuple(limits.values()) for slot, limits in found.items()}


def _clauses(
    policy: Policy, steps: Sequence[Invocation], scope: CodeScope
) -> Iterator[tuple[Clause, bool, str, CodeScope]]:
    """Yield conditions, whether they have to hold or must not hold, whose they are, and their scope."""
    skills = {each.skill for each in steps}
    permits = [each for each in policy.rules if each.kind == RuleKind.PERMIT]
    for one in steps:
        contract = one.contract
        for clause in (*contract.require, *contract.assume, *contract.maintain):
            yield clause, True, contract.name, scope.about(contract)
    for number, rule in enumerate(policy.rules):
        about = [at for at in rule.skills or range(len(policy.contracts)) if at in skills]
        if rule.when is not None and about and all(0 <= at < len(policy.contracts) for at in about):
            of = scope.about(*(policy.contracts[at] for at in rule.skills))
            kind = RuleKind(rule.kind)
            if kind is RuleKind.PERMIT and not any(sum(_is_about(each, at) for each in permits) == 1 for at in about):
                continue  # another rule permits the same skills: it need not hold
            yield rule.when, kind is RuleKind.PERMIT, f"rule {number + 1}, {kind.name.lower()}", of


def _is_about(rule: Rule, skill: int) -> bool:
    return not rule.skills or skill in rule.skills


def _compared(node: Node, *, holds: bool) -> Iterator[tuple[int, int, bool]]:
    """Yield slot, limit, and whether it is a lower limit. A branch of an `or` that has to hold, or of an `and` that
    must not hold, is no limit alone.
    """
    match node:
        case Both(left, right) if holds:
            yield from _compared(left, holds=holds)
            yield from _compared(right, holds=holds)
        case Either(left, right) if not holds:
            yield from _compared(left, holds=holds)
            yield from _compared(right, holds=holds)
        case Negation(operand):
            yield from _compared(operand, holds=not holds)
        case AtMost(((argument, slot, factor),), bound) if not argument and abs(factor) == 1:
            # the signal is at most `bound`, or at least `-bound`
            yield slot, factor * bound, (factor < 0) == holds
