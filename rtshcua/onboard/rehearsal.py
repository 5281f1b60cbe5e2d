"""A dry run of a mission before its flight. Nothing is sent or used.

`rehearse` decides every step of a loaded bundle in the present state. The first step is decided as it would be
now. A later one is decided as if the earlier ones had flown: position and height are those at the end of their
plans, everything else is as it is now. Each is assumed to be released at this moment, in its own phase, under the
conservative `L_rem`, with no approval given.

A condition over time is unknown until it was observed for as long as it looks back, and observation begins with
the run. A step that waits for that is decided once more, as if the state had been the same for so long.

`unheard` are the signals that cannot arrive on a link, and `stranded` the steps at which a mission would wait for
ever or abort because of them.
"""

from collections.abc import Container
from typing import Final, NamedTuple

from rtshcua.decision.decide import decide
from rtshcua.decision.nearest import Nearest, nearest
from rtshcua.decision.temporal import lasting
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import UNKNOWN
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Mission, Plan
from rtshcua.model.flat.policy import Policy, RuleKind, VehicleLimits
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US

#: a deferral that ends by itself once the mission is under way,
_COMES: Final = frozenset({Reason.AWAITING_APPROVAL, Reason.PHASE_NOT_REACHED})
#: and in a later step also a value that is unknown before the vehicle flies
_COMES_LATER: Final = _COMES | {Reason.STATE_UNKNOWN, Reason.SAFETY_UNKNOWN}


class Rehearsed(NamedTuple):
    """One step, its decision, and the change with which it would have passed. `hopeful`: admitted, or waits for
    something that will come.

    `observing`: it waits until a condition was observed for long enough.
    """

    step: int
    decision: Decision
    nearest: tuple[Nearest, ...]
    hopeful: bool
    observing: bool = False


def rehearse(loaded: Loaded, state: State, now: Now, unheard: frozenset[int] = frozenset()) -> tuple[Rehearsed, ...]:
    """Decide every step of the mission in force. Changes nothing.

    `unheard` are slots that nothing can fill: a step that needs one waits in vain.
    """
    policy = loaded.policy
    found: list[Rehearsed] = []
    vain = {each.step for each in stranded(policy.policy, loaded.bundle.mission, unheard)}
    for prepared in loaded.invocations:
        invocation = prepared.invocation
        context = Context(
            invocation.binding,
            loaded.vehicle,
            policy.policy.version,
            0,
            now.monotonic_us,
            invocation.phase,
            CONSERVATIVE_US,
            (),
        )
        decision = decide(prepared, state, policy, context, now)
        would = () if decision.outcome is Outcome.ALLOW else nearest(decision, prepared, state, policy, now)
        comes = _COMES_LATER if invocation.step else _COMES
        hopeful = _flies(decision, comes) and invocation.step not in vain
        observing = False
        if not hopeful and UNKNOWN in state.monitors and (invocation.step or decision.outcome is Outcome.DEFER):
            then = decide(prepared, lasting(state, policy, now), policy, context, now)
            hopeful = observing = _flies(then, comes) and invocation.step not in vain
        found.append(Rehearsed(invocation.step, decision, would, hopeful, observing))
        state = flown(state, invocation.plan, policy.policy.vehicle)
    return tuple(found)


def _flies(decision: Decision, comes: Container[Reason]) -> bool:
    """Whether a step is admitted, or waits for something that comes by itself."""
    return decision.outcome is Outcome.ALLOW or (decision.outcome is Outcome.DEFER and decision.reason in comes)


def flown(state: State, plan: Plan, vehicle: VehicleLimits) -> State:
    """The state with position and height at the end of a plan, fresh; values that were never reported stay unknown."""
    there: dict[int, int] = {}
    match plan.kind:
        case MotionKind.CLIMB:
            there[vehicle.height] = plan.altitude
        case MotionKind.FLY | MotionKind.COVER:
            there |= _at(vehicle, plan.path[-2], plan.path[-1], plan.last_height)
        case MotionKind.HOME:
            there |= _at(vehicle, 0, 0, 0)
        case MotionKind.LAND:
            there[vehicle.height] = 0
    known = {slot: value for slot, value in there.items() if slot >= 0 and state.values[slot] is not None}
    values = tuple(known.get(slot, value) for slot, value in enumerate(state.values))
    ages = tuple(0 if slot in known else age for slot, age in enumerate(state.ages))
    return State(values, ages, state.monitors)


def _at(vehicle: VehicleLimits, x: int, y: int, height: int) -> dict[int, int]:
    east = vehicle.position
    return {east: x, east + 1: y, vehicle.height: height} if east >= 0 else {vehicle.height: height}


def unheard(policy: Policy, messages: Container[str]) -> frozenset[int]:
    """The state slots of the signals that only these messages carry."""
    slots: set[int] = set()
    for signal in policy.signals:
        if signal.sources and all(source.message in messages for source in signal.sources):
            slots.update(signal.slots)
    return frozenset(slots)


def needed(policy: Policy, invocation: Invocation) -> frozenset[int]:
    """The slots without which a step is held up: those of its contract, of the rules that may apply to it, and those
    that every permit which may cover it reads.
    """
    contract = invocation.contract
    clauses = [*contract.require, *contract.assume, *contract.maintain]
    permits: list[set[int]] = []
    for rule in policy.rules:
        if rule.skills and invocation.skill not in rule.skills:
            continue
        if rule.kind == RuleKind.PERMIT:
            read = () if rule.when is None else slots_read((rule.when,), policy.vehicle, policy.monitors)
            permits.append(set(read))
        elif rule.when is not None:
            clauses.append(rule.when)
    every = set.intersection(*permits) if permits else set[int]()
    return frozenset({*contract.reads, *slots_read(clauses, policy.vehicle, policy.monitors), *every})


def stranded(policy: Policy, mission: Mission, slots: frozenset[int]) -> tuple[Invocation, ...]:
    """The steps of a mission that need one of these slots."""
    return tuple(each for each in mission.invocations if slots and not slots.isdisjoint(needed(policy, each)))
