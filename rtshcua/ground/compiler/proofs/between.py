"""E0703, E0704: a mission's parameters may have values between those that it is checked with, and no step is refused
for any of them.

Arguments are sums of parameters, so between two instances of a mission that differ in numbers alone, each step's
arguments lie on the straight line from the one's to the other's.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, interval
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.solve import Goal
from rtshcua.ground.analysis.words import words
from rtshcua.ground.compiler.proofs.hopeful import refused
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.contract import QUANTITY
from rtshcua.model.ir.missions import MissionDecl, Step

#: to how many earlier instances of a mission one is compared
_COMPARED: Final = 8


def prove(
    ground: Ground, mission: MissionDecl, steps: Sequence[Step], invocations: Sequence[PreparedInvocation]
) -> None:
    """Report the first value between this instance and an earlier one with which a step is refused."""
    now = tuple((one.invocation.skill, one.invocation.arguments) for one in invocations)
    earlier = ground.questions.instances.setdefault(mission.name.text, [])
    for before in earlier[:_COMPARED]:
        if len(before) != len(now):
            continue
        for step, invocation, (skill, low), (other, high) in zip(steps, invocations, before, now, strict=True):
            if skill == other and low != high and _refused(ground, step, invocation, low, high):
                return
    earlier.append(now)


def _refused(
    ground: Ground, step: Step, invocation: PreparedInvocation, low: tuple[int, ...], high: tuple[int, ...]
) -> bool:
    contract = invocation.invocation.contract
    numbers = {parameter.cell for parameter in contract.parameters if parameter.kind == QUANTITY}
    moving = [cell for cell, (a, b) in enumerate(zip(low, high, strict=True)) if a != b]
    if not numbers.issuperset(moving):
        return False
    space = ground.questions.space(invocation.invocation.skill)._replace(
        arguments=tuple(interval(min(ends), max(ends)) for ends in zip(low, high, strict=True)),
        phases=frozenset((invocation.phase,)),
    )
    given: list[Goal] = []
    for one, other in pairwise(moving):
        # the two points of the line, and any third one, are on it together
        rise, run = high[other] - low[other], high[one] - low[one]
        terms = (tree.Term(True, one, rise), tree.Term(True, other, -run))
        given.append((tree.Equal(terms, rise * low[one] - run * low[other]), TRUE))
    for witness, forbid in refused(ground, invocation, space, tuple(given)):
        policy = ground.prepared.policy
        situation = words(witness, policy, contract)
        rules = [each.rule for each in invocation.candidates.permits] if forbid is None else [forbid]
        ground.context.report.add(
            codes.OUT_OF_SCOPE if forbid is None else codes.FORBIDDEN,
            step.span,
            f"with {situation}, which the mission's parameters allow, this step is "
            + (f"outside of what `{policy.name}` permits" if forbid is None else f"forbidden by `{policy.name}`"),
            help="narrow the range of the mission's parameter",
            labels=[
                (ground.span(rule), "this does not permit it" if forbid is None else "by this rule") for rule in rules
            ],
        )
        return True
    return False
