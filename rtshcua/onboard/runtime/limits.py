"""The runtime's time limits for its environment, and the greatest duration of a run.

The bounds are computed from the policy, and a search compares them with every path of small runs
(docs/model-checking.md). Each wait of the runtime has a limit of its own. Its end is noticed at the next step of
the loop, at most `period_us` later, and, if the link was lost or this computer stood still, only on fresh state,
at most `flapping_us` after that ended. Time in which the vehicle is not heard, or answers nothing, or in which
this computer stands still, does not count: a silence lasts no longer than the vehicle can fly plus `silent_us`,
and then the run stands down.
"""

from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.onboard.ports import Frozen
from rtshcua.wire.permit import LINK_VALID_US


class Limits(Frozen):
    """The runtime's time limits, in us.

    `ready_us` for the vehicle to become ready. `silent_us` for a lost link to return, or for an unresponsive
    vehicle to answer: on the ground, or once somebody asked this program to stop; in the air that, plus the time
    that the vehicle can fly. When the link is back, `fresh_us` for fresh state: longer than the silence that
    counts as a loss, so that one single message leads to no judgement. A link that comes and goes is awaited for
    `flapping_us` in all, from its first return.

    If two steps of the runtime are more than `stalled_us` apart, this computer stood still, and fresh state is
    awaited in the same way.

    The last link of the contingency has no successor: it is tried `tries` times, `retry_us` apart. `again_us` is
    the longest interval between requests of a deferred step when nothing was received.
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
    """The longest duration of a link: its own limit, else its skill's, else the longest of any flight."""
    return link.limit_us or policy.contracts[link.skill].duration_us or policy.vehicle.endurance_us


def falling_us(policy: Policy, contract: Contract | None, limits: Limits, period_us: int) -> int:
    """The time from the beginning of a skill's chain (None: the contingency) to the end of the run, in us of time
    with a link.

    The end is a landing, standing down, or giving up after the last attempt. A degrade rule's target, each link of
    the chain and each of the contingency fly once; the last link is repeated, `tries` times. A run that is left
    unattended meanwhile (`Runtime.leave`, once) begins with the last link once more. A link that could not be sent
    within its permit's time is repeated, `tries` times in a chain.
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
    """The time from the start of a run to its end, in us of time with a link; None if a step has no time limit of its
    own.

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
