"""What must hold while a vehicle waits in the air for its next step (design 4.4: holding is bounded by energy)."""

from typing import NamedTuple

from rtshcua.decision.ahead import ahead
from rtshcua.decision.airspace import keeps
from rtshcua.decision.case import environment, situation
from rtshcua.decision.energy import SECOND
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.truth import EVERYWHERE, FALSE, NOT, TRUE, UNKNOWN, Truth
from rtshcua.decision.values import PRESENT
from rtshcua.decision.volume import Volume
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.situation import Now, State

WAY_HOME = "the reserve and the way home"


class Unkept(NamedTuple):
    """The text of something that should hold, and is FALSE or UNKNOWN."""

    text: str
    truth: Truth


def holding(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> tuple[Unkept, ...]:
    """What stands against waiting for `invocation` here: the airspace, its `degrade` rules, the charge to come home.

    The place is every place that it may be at before it stands still, see `ahead`.
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    volume, lasts_us = ahead(at.slots, state.ages, policy)
    checks = [Unkept(rule.rule.text, NOT[rule.condition(at)]) for rule in invocation.candidates.degrades]
    if policy.airspace is not None:
        truth = keeps(volume.place, policy.airspace, at, lasts_us)
        checks.append(Unkept(policy.airspace.airspace.text, EVERYWHERE[truth]))
    checks.append(Unkept(WAY_HOME, way_home(at, volume, policy)))
    return tuple(check for check in checks if check.truth != TRUE)


def way_home(at: Environment, volume: Volume, policy: PreparedPolicy) -> Truth:
    """Whether the battery holds the reserve and the way home from anywhere in a volume, position error aside.

    The way is counted as when a skill is admitted (`energy`): its length at the vehicle's speed, rounded up.
    """
    vehicle = policy.policy.vehicle
    charge, _, gap, _ = at.slots[policy.tables.known.battery]
    if gap != PRESENT or volume.height[2] != PRESENT:
        return UNKNOWN
    home = -(-volume.farthest[1] * SECOND * FULL // (vehicle.speed * vehicle.endurance_us))
    return TRUE if charge >= vehicle.reserve + home else FALSE
