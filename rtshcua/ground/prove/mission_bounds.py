"""E0809 to E0812: what a mission takes at most in steps, time and energy. E0620: each step finds the charge it needs.

Time runs from the issue to the end: the start window, each step's approval, deadline and duration, and the longest
chain that may follow one of them. Energy is what the contracts of the steps may take up to one that is given up, and of
the chain that is then flown, whichever step that is; a return takes no less than the way home from the farthest planned
place. A mission whose bound exceeds a full charge is refused: no battery that is put in would be enough.

For E0620 the flight begins with a full charge, and every step before took all that it may. A step that may be skipped
counts as flown, and is not asked itself: its `skip` is for that. Needed is what step 7 of the decision asks for (the
step's own bound, the way home from the farthest planned place, the reserve), and that no clause about the battery, and
no rule, then refuses the step.
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
from rtshcua.ground.prove.step_bounds import StepBound
from rtshcua.ground.prove.step_starts import StartPlace, may_be_skipped, planned
from rtshcua.ground.prove.step_times import START_WINDOW_US, MissionStep, approval
from rtshcua.model.flat.contract import Contract, Link, MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl, Step
from rtshcua.model.quantity import Dimension, display

#: so many steps before the one that lacks charge are told of
_SHOWN_STEPS = 6


def prove_charge(proof: ProofContext, steps: Sequence[MissionStep], starts: Sequence[Sequence[StartPlace]]) -> None:
    """Report the first step that may find too little; `starts` are the places where each may begin."""
    left = FULL
    spent: list[tuple[str, int]] = []
    for step, places in zip(steps, starts, strict=True):
        if not may_be_skipped(step.prepared):
            why = next(_wants(proof, step.prepared, places, left), None)
            if why is not None:
                _report_short(proof, step, left, why, spent)
                return
        left = max(left - step.contract.energy, 0)
        spent.append((step.contract.name, left))


_Why = tuple[str, tuple[tuple[Span, str], ...]]


def _wants(
    proof: ProofContext, invocation: PreparedInvocation, places: Sequence[StartPlace], left: int
) -> Iterator[_Why]:
    """Why a step is refused with this charge and would not be with a full one: in words, and where that is written."""
    battery = proof.prepared.tables.known.battery
    for place in places:
        at, volume = planned(proof, invocation, place)
        needed = invocation.energy.needed(volume.farthest[1], volume.height[:2])
        if needed > left:
            yield _needs(proof, invocation, needed), ((proof.lowered.vehicle.reserve.span, "what must be left"),)
        slots = list(at.slots)
        slots[battery] = point(left)
        worst = at.over(slots, None, 0)
        slots = list(at.slots)
        slots[battery] = point(FULL)
        full = at.over(slots, None, 0)
        yield from _refusals(proof, invocation, worst, full)


def _needs(proof: ProofContext, invocation: PreparedInvocation, needed: int) -> str:
    own = invocation.invocation.contract.energy
    words = f"it needs {_percent_text(needed)}: {_percent_text(own)} for itself"
    if needed > own:
        reserve = proof.policy.vehicle.reserve
        words += f", {_percent_text(needed - own - reserve)} for the way home and {_percent_text(reserve)} in reserve"
    return words


def _refusals(
    proof: ProofContext, invocation: PreparedInvocation, worst: Environment, full: Environment
) -> Iterator[_Why]:
    """What refuses a step whatever else the state is."""
    for clause, condition in (*invocation.require, *invocation.assume):
        if not condition(worst) & TRUE and condition(full) & TRUE:
            yield f"`{clause.text}` does not hold then", ((proof.span(clause), "the contract asks for this"),)
    for degrade in invocation.candidates.degrades:
        if degrade.condition(worst) == TRUE != degrade.condition(full):
            yield "a rule of the policy then sends it home", ((proof.span(degrade.rule), "this rule"),)
    for forbid in invocation.candidates.forbids:
        if forbid.condition(worst) == TRUE != forbid.condition(full):
            yield "a rule of the policy then forbids it", ((proof.span(forbid.rule), "this rule"),)
    permits = [permit for permit in invocation.candidates.permits if permit.condition(full) & TRUE]
    if permits and not any(permit.condition(worst) & TRUE for permit in permits):
        yield "no rule then permits it", tuple((proof.span(permit.rule), "this rule does not") for permit in permits)


def _report_short(
    proof: ProofContext, step: MissionStep, left: int, why: _Why, spent: Sequence[tuple[str, int]]
) -> None:
    told = [f"{_percent_text(charge)} after `{name}`" for name, charge in spent[-_SHOWN_STEPS:]]
    from_ = ["..."] if len(spent) > _SHOWN_STEPS else ["full at the start"]
    proof.report.add(
        codes.SHORT_OF_ENERGY,
        step.span,
        f"{_percent_text(left)} of the charge may be left when this step begins, and {why[0]}",
        help="what is left when each step takes all that it may: " + ", ".join([*from_, *told]),
        labels=why[1],
    )


def _percent_text(charge: int) -> str:
    return display(charge, Dimension.RATIO)


SECOND_US = 1_000_000

#: what brings the vehicle down is not given up for the contingency: only its own chain follows
_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)
#: what leads to a height
_ALOFT = (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)

#: so many of the largest contributions are shown
_SHOWN = 3


class Bounds(NamedTuple):
    """At most so many invocations, so long from the issue to the end (us), and so much energy (1/10000); and what each
    step is proved to take of its own.
    """

    invocations: int
    time_us: int
    energy: int
    steps: tuple[StepBound, ...] = ()


def greatest(one: Bounds, other: Bounds | None) -> Bounds:
    """What is within both."""
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
    """The bounds of a mission, of which `flown` is what each step is proved to take; reports where they exceed what it
    says.
    """
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
    """How long a step takes from its turn to its end, in us."""
    contract, vehicle = invocation.contract, proof.policy.vehicle
    prepared = proof.prepare(invocation, mission.phases)
    waits = 0 if isinstance(prepared, Refusal) else approval(proof, prepared)  # the proofs report a refusal
    return waits + contract.deadline_us + longest(contract, vehicle)


def _chain_time(chain: Iterable[Link], policy: Policy) -> int:
    return sum(longest(policy.contracts[link.skill], policy.vehicle, link.limit_us) for link in chain)


def _taken(contract: Contract, way_home: int) -> int:
    """What a contract takes; one that flies home no less than the way there."""
    return max(contract.energy, way_home) if contract.motion.kind == MotionKind.HOME else contract.energy


def _mission_energy(proof: ProofContext, mission: Mission) -> int:
    """What the steps take up to the one that a chain follows, and that chain: after it no step is flown."""
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
        given_up = own if invocation.contract.motion.kind in _HOMEWARD else max(own, contingency)
        largest = max(largest, denied, spent + given_up)
    return largest


def _way_home(proof: ProofContext, mission: Mission) -> int:
    """The energy of the way home from the farthest and highest planned place, rounded up; low it is only near home."""
    vehicle, plans = proof.policy.vehicle, [invocation.plan for invocation in mission.invocations]
    speeds = proof.speeds
    squares = (x * x + y * y for plan in plans for x, y in zip(plan.path[::2], plan.path[1::2], strict=True))
    distance = isqrt(max(squares, default=0)) + 1 + vehicle.position_error
    slowest = min((plan.speed for plan in plans if plan.speed), default=0)
    heights = [plan.altitude for plan in plans if plan.kind in _ALOFT] or [0]
    near = home_us(vehicle, speeds, vehicle.position_error, (0, max(heights)), slowest)
    far = home_us(vehicle, speeds, distance, (min(heights), max(heights)), slowest)
    return charge(speeds, max(near, far))


def _count(proof: ProofContext, declared: MissionDecl, steps: int) -> None:
    if declared.most_steps is None or steps <= declared.most_steps:
        return
    proof.report.add(
        codes.MISSION_STEPS,
        declared.name.span,
        f"the mission `{declared.name.text}` has {steps} steps, and says that it has at most {declared.most_steps}",
        help=f"leave steps out, or write `steps at most {steps}`",
        labels=[(phase.name.span, f"these are {len(phase.steps)}") for phase in declared.phases if phase.steps][
            :_SHOWN
        ],
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
            f"the mission may last {rounded_time(found.time_us)} from its issue, and says that it lasts at most "
            f"{display(declared.most_time.value, Dimension.DURATION)}",
            help=f"{start} to the start, {rounded_time(sum(times))} for the approvals, deadlines and durations of all "
            f"steps, and {rounded_time(found.time_us - START_WINDOW_US - sum(times))} for the longest chain; give "
            "steps shorter times of their own, or the mission more",
            labels=_largest(steps, times, rounded_time),
        )
    limit = declared.most_energy
    over = found.energy > FULL and not _short_already(proof, steps)
    if not over and (limit is None or found.energy <= limit.value):
        return
    spent, advice = sum(energies), ""
    if limit is not None and not over:
        code, span = codes.MISSION_ENERGY, limit.span
        against = f"says that it needs at most {display(limit.value, Dimension.RATIO)}"
    else:
        code, span, against = codes.OVER_CHARGE, declared.name.span, "a battery has 100 %"
        advice = "; leave steps out, or make two missions of it"
    report.add(
        code,
        span,
        f"the mission may need {rounded_energy(found.energy)} of a full charge, and {against}",
        help=f"{rounded_energy(spent)} for all steps, as their contracts allow, and "
        f"{rounded_energy(found.energy - spent)} more where one of them is given up and a chain flies{advice}",
        labels=_largest(steps, energies, rounded_energy),
    )


def _short_already(proof: ProofContext, steps: Sequence[Step]) -> bool:
    """Whether one of the steps was found to lack charge: that says more."""
    spans = {step.span for step in steps}
    return any(each.code is codes.SHORT_OF_ENERGY and each.span in spans for each in proof.report.found)


def _largest(steps: Sequence[Step], amounts: Sequence[int], words: Callable[[int], str]) -> list[tuple[Span, str]]:
    """The places that contribute most, those of a repeated step together."""
    sums: dict[Span, list[int]] = {}
    for step, amount in zip(steps, amounts, strict=True):
        sums.setdefault(step.span, []).append(amount)
    largest = sorted(sums.items(), key=lambda item: (-sum(item[1]), item[0]))[:_SHOWN]
    return [
        (span, f"up to {words(sum(parts))}" + (f", {len(parts)} times {words(parts[0])}" if len(parts) > 1 else ""))
        for span, parts in largest
    ]


def rounded_time(us: int) -> str:
    """A time for a person, rounded up to the second."""
    minutes, seconds = divmod(-(-us // SECOND_US), 60)
    return (f"{minutes} min" + (f" {seconds} s" if seconds else "")) if minutes else f"{seconds} s"


def rounded_energy(energy: int) -> str:
    """A part of a full charge for a person, rounded up to the percent."""
    return f"{-(-energy // (FULL // 100))} %"
