"""E0801, E0805: even on the slowest way through the mission, no step comes after its validity is over.

The validity counts from the issue. Up to its start the mission may wait for `START_WINDOW_US`; each step may wait for
its approval, then for its deadline, and last as long as its contract allows.
"""

from collections.abc import Sequence

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE
from rtshcua.diagnostics import codes
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display

#: how long after its issue a mission may begin
START_WINDOW_US = 300 * 1_000_000


def prove(ground: Ground, steps: Sequence[Step], invocations: Sequence[PreparedInvocation]) -> None:
    """Report every step whose decision may mean nothing any more when its turn comes."""
    latest = START_WINDOW_US
    for step, invocation in zip(steps, invocations, strict=True):
        contract = invocation.invocation.contract
        skill = ground.context.symbols.skills[step.skill.text]
        if not contract.duration_us:
            ground.context.report.add(
                codes.ENDLESS_STEP,
                step.span,
                f"`{contract.name}` does not end, so nothing after this step would ever begin",
                help="add `lasts at most` to the skill",
                labels=[(skill.name.span, "declared here, without `lasts at most`")],
            )
            return
        latest += approval(ground, invocation) + contract.deadline_us
        if latest > contract.validity_us:
            own = None if step.overrides is None else step.overrides.validity
            validity = own or skill.validity
            assert validity is not None
            ground.context.report.add(
                codes.VALIDITY_TOO_SHORT,
                step.span,
                f"this step may begin {display(latest, Dimension.DURATION)} after the mission was issued, and "
                f"`{contract.name}` is valid for {display(contract.validity_us, Dimension.DURATION)}",
                help=f"{display(START_WINDOW_US, Dimension.DURATION)} to the start, then all deadlines, approvals and "
                "durations before it count; move the step forward, or shorten those before it",
                labels=[(validity.span, "declared here")],
            )
            return
        latest += contract.duration_us


def approval(ground: Ground, invocation: PreparedInvocation) -> int:
    """How long a step may wait for approvals."""
    at = ground.around(invocation)
    waits = [rule.rule.within_us for rule in invocation.candidates.confirms if rule.condition(at) & TRUE]
    return max(waits, default=0)
