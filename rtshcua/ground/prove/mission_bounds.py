"""Upper bounds of a mission's steps, time and energy (E0809 to E0812), and the charge for each step (E0620).

The time runs from the issue to the end: the start window, the approval, deadline and duration of each step, and the
longest chain that may follow a step. The energy is the most that the contracts of the steps may use up to an aborted
step, plus the chain that then flies; a return needs at least the way home from the farthest planned place. A mission
that may need more than a full charge is refused.

For E0620 a mission begins with a full charge, or with the present one if it begins in flight, and every earlier step
used all that it may. A step that may be skipped counts as flown, but is not checked itself. A step needs the charge
that step 7 of the decision requires (its own bound, the way home from the farthest planned place, and the reserve), and
no clause about the battery and no rule may refuse it with the remaining charge.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import isqrt
from typing import NamedTuple

from rtshcua.decision.contracts import longest
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.flying import charge, home_us
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_starts import StartPlace, may_be_skipped, planned
from rtshcua.ground.prove.step_time_and_energy import StepBound
from rtshcua.ground.prove.step_times import START_WINDOW_US, MissionStep, approval
from rtshcua.model.flat.contract import Contract, Link, MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.quantity import Dimension, display

#: the number of earlier steps that a message lists
_SHOWN_STEPS = 6


def prove_charge(
    proof: ProofContext, steps: Sequence[MissionStep], starts: Sequence[Sequence[StartPlace]], charge: int
) -> None:
    """Report the first step that may lack charge. `starts` are the places where each step may begin; the first begins
    with this `charge`.
    """
    left = charge
    spent: list[tuple[str, int]] = []
    for step, places in zip(steps, starts, strict=True):
        if not may_be_skipped(step.prepared):
            reason = next(_shortages(proof, step.prepared, places, left), None)
            if reason is not None:
                at_first = "full at the start" if charge == FULL else f"{_percent_text(charge)} at the start"
                _report_short(proof, step, left, reason, spent, at_first)
                return
        left = max(left - step.contract.energy, 0)
        spent.append((step.contract.name, left))


#: a reason as text, and its labels
_Reason = tuple[str, tuple[tuple[Span, str], ...]]


def _shortages(
    proof: ProofContext, invocation: PreparedInvocation, places: Sequence[StartPlace], left: int
) -> Iterator[_Reason]:
    """Yield the reasons why a step is refused with this charge but not with a full one."""
    battery = proof.prepared.tables.known.battery
    for place in places:
        at, volume = planned(proof, invocation, place)
        needed = invocation.energy.needed(volume.farthest[1], volume.height[:2])
        if needed > left:
            yield _needs(proof, invocation, needed), ((proof.lowered.vehicle.reserve.span, "the reserve"),)
        slots = list(at.slots)
        slots[battery] = point(left)
        worst = at.over(slots, None, 0)
        slots = list(at.slots)
        slots[battery] = point(FULL)
        full = at.over(slots, None, 0)
        yield from _refusals(proof, invocation, worst, full)


def _needs(proof: ProofContext, invocation: PreparedInvocation, needed: int) -> str:
    own = invocation.invocation.contract.energy
    text = f"it needs {_percent_text(needed)}: {_percent_text(own)} for itself"
    if needed > own:
        reserve = proof.policy.vehicle.reserve
        text += f", {_percent_text(needed - own - reserve)} for the way home and {_percent_text(reserve)} in reserve"
    return text


def _refusals(
    proof: ProofContext, invocation: PreparedInvocation, worst: Environment, full: Environment
) -> Iterator[_Reason]:
    """Yield what refuses a step in every state with the worst charge, but not with a full one."""
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(worst) & TRUE and condition(full) & TRUE:
            yield f"`{clause.text}` does not hold then", ((proof.span(clause), "the contract contains this condition"),)
    for degrade in invocation.candidates.degrades:
        if degrade.condition(worst) == TRUE != degrade.condition(full):
            yield "a rule of the policy then replaces it", ((proof.span(degrade.rule), "this rule"),)
    for forbid in invocation.candidates.forbids:
        if forbid.condition(worst) == TRUE != forbid.condition(full):
            yield "a rule of the policy then forbids it", ((proof.span(forbid.rule), "this rule"),)
    permits = [permit for permit in invocation.candidates.permits if permit.condition(full) & TRUE]
    if permits and not any(permit.condition(worst) & TRUE for permit in permits):
        yield "no rule then permits it", tuple((proof.span(permit.rule), "this rule does not") for permit in permits)


def _report_short(
    proof: ProofContext, step: MissionStep, left: int, reason: _Reason, spent: Sequence[tuple[str, int]], at_first: str
) -> None:
    listed = [f"{_percent_text(charge)} after `{name}`" for name, charge in spent[-_SHOWN_STEPS:]]
    from_ = ["..."] if len(spent) > _SHOWN_STEPS else [at_first]
    proof.report.add(
        codes.SHORT_OF_ENERGY,
        step.span,
        f"only {_percent_text(left)} of the charge may be left when this step begins, and {reason[0]}",
        help="the charge left if each step uses as much as it may: " + ", ".join([*from_, *listed]),
        labels=reason[1],
    )


def _percent_text(charge: int) -> str:
    return display(charge, Dimension.RATIO)


SECOND_US = 1_000_000

#: motions after which only the step's own chain follows, never the contingency, since they already end on the ground
_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)
#: motions that end at a planned height
_ALOFT = (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)

#: the number of largest contributions that a message lists
_SHOWN = 3


class Bounds(NamedTuple):
    """The bounds of a mission: invocations, us from the issue to the end, energy in 1/10000 of a full charge.

    `steps` are the proved bounds of each step.
    """

    invocations: int
    time_us: int
    energy: int
    steps: tuple[StepBound, ...] = ()


def greatest(one: Bounds, other: Bounds | None) -> Bounds:
    """Return the larger of two bounds, field by field."""
    if other is None:
        return one
    steps = one.steps
    if [each.skill for each in one.steps] == [each.skill for each in other.steps]:
        pairs = zip(one.steps, other.steps, strict=True)
        steps = tuple(StepBound(a.skill, max(a.time_us, b.time_us), max(a.energy, b.energy)) for a, b in pairs)
    return Bounds(
        max(one.invocations, other.invocations), max(one.time_us, other.time_us), max(one.energy, other.energy), steps
    )


def bounds_of(
    proof: ProofContext, declared: MissionDecl, mission: Mission, flown: tuple[StepBound, ...] = ()
) -> Bounds:
    """Return the bounds of a mission, and report those above its declaration. `flown` are the bounds of its steps."""
    policy = proof.policy
    steps = [step for phase in declared.phases for step in phase.steps]
    times = [_step_time(proof, mission, invocation) for invocation in mission.invocations]
    energies = [invocation.contract.energy for invocation in mission.invocations]
    chains = {policy.contingency, *(each.contract.fallback for each in mission.invocations)}
    found = Bounds(
        len(mission.invocations),
        START_WINDOW_US + sum(times) + max(_chain_time(chain, policy) for chain in chains),
        _mission_energy(proof, mission),
        flown,
    )
    _count(proof, declared, found.invocations)
    _within(proof, declared, found, steps, times, energies)
    return found


def _step_time(proof: ProofContext, mission: Mission, invocation: Invocation) -> int:
    """Return the longest time in us from a step's turn to its end."""
    contract, vehicle = invocation.contract, proof.policy.vehicle
    prepared = proof.prepare(invocation, mission.phases)
    waits = 0 if isinstance(prepared, Refusal) else approval(proof, prepared)  # the proofs report a refusal
    return waits + contract.deadline_us + longest(contract, vehicle)


def _chain_time(chain: Iterable[Link], policy: Policy) -> int:
    return sum(longest(policy.contracts[link.skill], policy.vehicle, link.limit_us) for link in chain)


def _taken(contract: Contract, way_home: int) -> int:
    """Return the energy of a contract; for a return, at least that of the way home."""
    return max(contract.energy, way_home) if contract.motion.kind == MotionKind.HOME else contract.energy


def _mission_energy(proof: ProofContext, mission: Mission) -> int:
    """Return the most energy of the steps up to one that a chain follows, plus the chain, which ends the mission."""
    policy = proof.policy
    way_home = _way_home(proof, mission)

    def chain_energy(chain: Iterable[Link]) -> int:
        return sum(_taken(policy.contracts[link.skill], way_home) for link in chain)

    contingency = chain_energy(policy.contingency)
    spent = largest = 0
    for invocation in mission.invocations:
        denied = spent + contingency
        spent += _taken(invocation.contract, way_home)
        own = chain_energy(invocation.contract.fallback)
        aborted = own if invocation.contract.motion.kind in _HOMEWARD else max(own, contingency)
        largest = max(largest, denied, spent + aborted)
    return largest


def _way_home(proof: ProofContext, mission: Mission) -> int:
    """Return the energy of the way home from the farthest and highest planned place, rounded up.

    The way home is low only near home.
    """
    vehicle, plans = proof.policy.vehicle, [invocation.plan for invocation in mission.invocations]
    speeds = proof.speeds
    squares = (x * x + y * y for plan in plans for x, y in zip(plan.path[::2], plan.path[1::2], strict=True))
    distance = isqrt(max(squares, default=0)) + 1 + vehicle.position_error
    slowest = min((plan.speed for plan in plans if plan.speed), default=0)
    heights = [height for plan in plans if plan.kind in _ALOFT for height in (plan.lowest, plan.altitude)] or [0]
    near = home_us(vehicle, speeds, vehicle.position_error, (0, max(heights)), slowest)
    far = home_us(vehicle, speeds, distance, (min(heights), max(heights)), slowest)
    return charge(speeds, max(near, far))


def _count(proof: ProofContext, declared: MissionDecl, steps: int) -> None:
    if declared.most_steps is None or steps <= declared.most_steps:
        return
    proof.report.add(
        codes.MISSION_STEPS,
        declared.name.span,
        f"the mission `{declared.name.text}` has {steps} steps, but declares `steps at most {declared.most_steps}`",
        help=f"remove steps, or write `steps at most {steps}`",
        labels=[(phase.name.span, f"{len(phase.steps)} steps") for phase in declared.phases if phase.steps][:_SHOWN],
    )


def _within(
    proof: ProofContext,
    declared: MissionDecl,
    found: Bounds,
    steps: Sequence[Step],
    times: Sequence[int],
    energies: Sequence[int],
) -> None:
    report = proof.report
    start = display(START_WINDOW_US, Dimension.DURATION)
    if declared.most_time is not None and found.time_us > declared.most_time.value:
        report.add(
            codes.MISSION_TIME,
            declared.most_time.span,
            f"the mission may last {rounded_time(found.time_us)} from its issue, but declares at most "
            f"{display(declared.most_time.value, Dimension.DURATION)}",
            help=f"the time is {start} to the start, {rounded_time(sum(times))} for the approvals, deadlines and "
            f"durations of all steps, and {rounded_time(found.time_us - START_WINDOW_US - sum(times))} for the longest "
            "chain; shorten the times of steps, or raise the mission's limit",
            labels=_largest(steps, times, rounded_time),
        )
    limit = declared.most_energy
    over = found.energy > FULL and not _short_already(proof, steps)
    if not over and (limit is None or found.energy <= limit.value):
        return
    spent, advice = sum(energies), ""
    if limit is not None and not over:
        code, span = codes.MISSION_ENERGY, limit.span
        against = f"but declares at most {display(limit.value, Dimension.RATIO)}"
    else:
        code, span, against = codes.OVER_CHARGE, declared.name.span, "more than a battery holds"
        advice = "; remove steps, or split the mission in two"
    report.add(
        code,
        span,
        f"the mission may need {rounded_energy(found.energy)} of a full charge, {against}",
        help=f"the contracts of all steps allow {rounded_energy(spent)}, and an aborted step with the chain after it "
        f"may need {rounded_energy(found.energy - spent)} more{advice}",
        labels=_largest(steps, energies, rounded_energy),
    )


def _short_already(proof: ProofContext, steps: Sequence[Step]) -> bool:
    """Whether a step is already reported to lack charge, which is more precise."""
    spans = {step.span for step in steps}
    return any(each.code is codes.SHORT_OF_ENERGY and each.span in spans for each in proof.report.found)


def _largest(steps: Sequence[Step], amounts: Sequence[int], words: Callable[[int], str]) -> list[tuple[Span, str]]:
    """Return labels for the steps that contribute most. Repetitions of a step are added up."""
    sums: dict[Span, list[int]] = {}
    for step, amount in zip(steps, amounts, strict=True):
        sums.setdefault(step.span, []).append(amount)
    largest = sorted(sums.items(), key=lambda item: (-sum(item[1]), item[0]))[:_SHOWN]
    return [
        (span, f"up to {words(sum(parts))}" + (f", {len(parts)} times {words(parts[0])}" if len(parts) > 1 else ""))
        for span, parts in largest
    ]


def rounded_time(us: int) -> str:
    """Format a time in us, rounded up to the second."""
    minutes, seconds = divmod(-(-us // SECOND_US), 60)
    return (f"{minutes} min" + (f" {seconds} s" if seconds else "")) if minutes else f"{seconds} s"


def rounded_energy(energy: int) -> str:
    """Format an energy in 1/10000 of a full charge, rounded up to the percent."""
    return f"{-(-energy // (FULL // 100))} %"
