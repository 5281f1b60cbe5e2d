"""How long the runtime waits for the world, and how long a run may take at most, whatever happens.

The bounds are computed from the policy, and held against every path of small runs by a search (docs/model-checking.md).
Each wait of the runtime has a limit of its own. It is noticed at the next step of the loop, at most `period_us` later,
and when the link was lost, or this computer stood still, only on fresh state, at most `flapping_us` after that was
over. Time in which the vehicle is not heard, or answers nothing, or in which this computer stands still, is not counted
here: a silence lasts no longer than the vehicle can fly and `silent_us`, then the run stands down.
"""

from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.onboard.ports import Frozen
from rtshcua.wire.permit import LINK_VALID_US


class Limits(Frozen):
    """How long the runtime waits for the world, in us.

    `ready_us` for a vehicle that is ready. `silent_us` for a lost link to come back, or for a vehicle that answers
    nothing to answer: on the ground, or once somebody asked this program to stop; in the air that, and as long as the
    vehicle can fly. When the link is back, `fresh_us` for fresh state: longer than a link must be silent to count as
    lost, so that nothing is judged after one message and no more. A link that comes and goes is waited for
    `flapping_us` in all, from when it was back first.

    Where two steps of the runtime are more than `stalled_us` apart, this computer stood still, and fresh state is
    waited for in the same way.

    The last link of the contingency has nothing after it: it is tried `tries` times, `retry_us` apart. `again_us`
    bounds how long a deferred step is left without asking again when nothing was received.
    """

    ready_us: int = 120_000_000
    silent_us: int = 30_000_000
    fresh_us: int = 1_500_000
    flapping_us: int = 5_000_000
    stalled_us: int = 1_000_000
    retry_us: int = 2_000_000
    tries: int = 5
    again_us: int = 100_000


def link_us(policy: Policy, link: Link) -> int:
    """How long a link may take: its own limit, else its skill's, else as long as anything can fly."""
    return link.limit_us or policy.contracts[link.skill].duration_us or policy.vehicle.endurance_us


def falling_us(policy: Policy, contract: Contract | None, limits: Limits, period_us: int) -> int:
    """From the moment a skill's chain begins (None: the contingency) until the run has ended, in us of time with a
    link.

    That it ended means: landed, stood down from, or given up after the last tries. A degrade rule's target, each link
    of the chain and each of the contingency fly once; the last link is sent again, `tries` times. A run that is left
    alone meanwhile (`Runtime.leave`, once) begins with the last link once more. A link that could not be sent in its
    permit's time is tried again, `tries` times in a chain.
    """
    slack_us = limits.flapping_us + period_us
    chain = contract.fallback if contract is not None else ()
    targets = [rule.target for rule in policy.rules if contract is not None and rule.target is not None]
    degraded = max((link_us(policy, target) + slack_us for target in targets), default=0)
    flown = sum(link_us(policy, link) + slack_us for link in (*chain, *policy.contingency))
    last_us = link_us(policy, policy.contingency[-1]) + slack_us
    insisting = limits.tries * (limits.retry_us + slack_us + last_us) + slack_us
    late_us = limits.tries * (LINK_VALID_US + slack_us)
    return degraded + flown + insisting + last_us + insisting + 2 * late_us


def run_us(policy: Policy, mission: Mission, limits: Limits, period_us: int) -> int | None:
    """From the start of a run to its end, in us of time with a link; None if a step has no time limit of its own.

    A step waits for its deadline, or for an approval and then for its deadline again, and flies for its duration.
    """
    slack_us = limits.flapping_us + period_us
    approval_us = max((rule.within_us for rule in policy.rules if rule.kind == RuleKind.CONFIRM), default=0)
    total = limits.ready_us + slack_us
    contracts = [invocation.contract for invocation in mission.invocations]
    if any(contract.duration_us == 0 for contract in contracts):
        return None
    for contract in contracts:
        waited = approval_us + 2 * contract.deadline_us if approval_us else contract.deadline_us
        total += waited + contract.duration_us + 2 * slack_us
    return total + max(falling_us(policy, contract, limits, period_us) for contract in (None, *contracts))
