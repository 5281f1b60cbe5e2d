"""E0620: even when every step before took all the energy that it may, a step finds the charge that it needs.

The flight begins with a full charge. A step that may be skipped counts as flown, for it may be; that it itself is
refused for want of charge is what its `skip` is for. Needed is what step 7 asks for (the step's own bound, the way home
from the farthest planned place, the reserve), and that no clause about the battery, and no rule, then refuses it.
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.places import Place, planned
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display

#: so many steps before the one that lacks charge are told of
_TOLD = 6


def prove(
    ground: Ground,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    starts: Sequence[Sequence[Place]],
) -> None:
    """Report the first step that may find too little; `starts` are the places where each may begin."""
    left = FULL
    spent: list[tuple[str, int]] = []
    for step, invocation, places in zip(steps, invocations, starts, strict=True):
        flat = invocation.invocation
        if flat.on_inadmissible != OnInadmissible.SKIP:
            why = next(_lacks(ground, invocation, places, left), None)
            if why is not None:
                _report(ground, step, left, why, spent)
                return
        left = max(left - flat.contract.energy, 0)
        spent.append((flat.contract.name, left))


_Why = tuple[str, tuple[tuple[Span, str], ...]]


def _lacks(ground: Ground, invocation: PreparedInvocation, places: Sequence[Place], left: int) -> Iterator[_Why]:
    """Why a step is refused with this charge and would not be with a full one: in words, and where that is written."""
    battery = ground.prepared.tables.known.battery
    for place in places:
        at, volume = planned(ground, invocation, place)
        needed = invocation.energy.needed(volume.farthest[1], volume.height[:2])
        if needed > left:
            yield _needs(ground, invocation, needed), ((ground.lowered.vehicle.reserve.span, "what must be left"),)
        slots = list(at.slots)
        slots[battery] = point(left)
        worst = at.over(slots, None, 0)
        slots = list(at.slots)
        slots[battery] = point(FULL)
        full = at.over(slots, None, 0)
        yield from _refused(ground, invocation, worst, full)


def _needs(ground: Ground, invocation: PreparedInvocation, needed: int) -> str:
    own = invocation.invocation.contract.energy
    words = f"it needs {_percent(needed)}: {_percent(own)} for itself"
    if needed > own:
        reserve = ground.prepared.policy.vehicle.reserve
        words += f", {_percent(needed - own - reserve)} for the way home and {_percent(reserve)} in reserve"
    return words


def _refused(ground: Ground, invocation: PreparedInvocation, worst: Environment, full: Environment) -> Iterator[_Why]:
    """What refuses a step whatever else the state is."""
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(worst) & TRUE and condition(full) & TRUE:
            yield f"`{clause.text}` does not hold then", ((ground.span(clause), "the contract asks for this"),)
    for degrade in invocation.candidates.degrades:
        if degrade.condition(worst) == TRUE != degrade.condition(full):
            yield "a rule of the policy then sends it home", ((ground.span(degrade.rule), "this rule"),)
    for forbid in invocation.candidates.forbids:
        if forbid.condition(worst) == TRUE != forbid.condition(full):
            yield "a rule of the policy then forbids it", ((ground.span(forbid.rule), "this rule"),)
    permits = [permit for permit in invocation.candidates.permits if permit.condition(full) & TRUE]
    if permits and not any(permit.condition(worst) & TRUE for permit in permits):
        yield "no rule then permits it", tuple((ground.span(permit.rule), "this rule does not") for permit in permits)


def _report(ground: Ground, step: Step, left: int, why: _Why, spent: Sequence[tuple[str, int]]) -> None:
    told = [f"{_percent(charge)} after `{name}`" for name, charge in spent[-_TOLD:]]
    from_ = ["..."] if len(spent) > _TOLD else ["full at the start"]
    ground.context.report.add(
        codes.SHORT_OF_ENERGY,
        step.span,
        f"{_percent(left)} of the charge may be left when this step begins, and {why[0]}",
        help="what is left when each step takes all that it may: " + ", ".join([*from_, *told]),
        labels=why[1],
    )


def _percent(charge: int) -> str:
    return display(charge, Dimension.RATIO)
