"""How long a run may take at most, whatever happens: computed from the policy, and held against every path of small
runs by a search (docs/model-checking.md).

Each wait of the runtime has a limit of its own. It is noticed at the next step of the loop, at most `period_us` later,
and when the link was lost only on fresh state, at most `flapping_us` after it was back. Time in which the vehicle is
not heard is not counted here: a silence lasts no longer than the vehicle can fly and `silent_us`, then the run stands
down.
"""

from collections.abc import Iterable

from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.onboard.runtime.flight import Limits, link_us


def falling_us(policy: Policy, contract: Contract | None, limits: Limits, period_us: int) -> int:
    """From the moment a skill's chain begins (None: the contingency) until the run has ended, in us of time with a
    link.

    That it ended means: landed, stood down from, or given up after the last tries. A degrade rule's target, each link
    of the chain and each of the contingency fly once; the last link is sent again, `tries` times. A run that is left
    alone meanwhile (`Runtime.leave`, once) begins with the last link once more.
    """
    slack_us = limits.flapping_us + period_us
    chain = contract.fallback if contract is not None else ()
    targets = [rule.target for rule in policy.rules if contract is not None and rule.target is not None]
    degraded = max((_link_us(policy, target) + slack_us for target in targets), default=0)
    flown = sum(_link_us(policy, link) + slack_us for link in (*chain, *policy.contingency))
    last_us = _link_us(policy, policy.contingency[-1]) + slack_us
    insisting = limits.tries * (limits.retry_us + slack_us + last_us) + slack_us
    return degraded + flown + insisting + last_us + insisting


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
    return total + max(falling_us(policy, contract, limits, period_us) for contract in _and_none(contracts))


def _and_none(contracts: Iterable[Contract]) -> list[Contract | None]:
    return [None, *contracts]


def _link_us(policy: Policy, link: Link) -> int:
    return link_us(link, policy.contracts[link.skill], policy.vehicle.endurance_us)
