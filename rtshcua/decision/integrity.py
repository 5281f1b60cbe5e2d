"""Step 1: the request is the one that was signed, for this vehicle and the policy in force, within its own ranges.

Signatures were verified once, at load; what is compared here is the digest that they cover.
"""

from rtshcua.decision.case import Case
from rtshcua.decision.verdict import PASSED, Found, Verdict
from rtshcua.model.outcome import Outcome, Reason

_BINDING = (Verdict(Outcome.DENY, Reason.BINDING_MISMATCH, None),)
_VEHICLE = (Verdict(Outcome.DENY, Reason.WRONG_VEHICLE, None),)
_VERSION = (Verdict(Outcome.DENY, Reason.POLICY_VERSION, None),)
_ARGUMENT = (Verdict(Outcome.DENY, Reason.ARGUMENT_RANGE, None),)


def integrity(case: Case) -> Found:
    """Denies what differs from what was signed. An invocation prepared under another policy is of another version."""
    context, invocation, policy = case.context, case.invocation, case.policy
    if context.binding != invocation.invocation.binding:
        return _BINDING
    if context.vehicle != policy.policy.vehicle.identity:
        return _VEHICLE
    if context.policy_version != policy.policy.version or invocation.policy is not policy:
        return _VERSION
    return PASSED if invocation.misfit is None else _ARGUMENT
