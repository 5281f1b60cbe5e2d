"""The inputs of a decision as a log's record holds them."""

from rtshcua.evidence.records import Decision
from rtshcua.model.flat.situation import Approval, Context, Now, State


def state_of(record: Decision) -> State:
    """The state that was read."""
    return State(record.state.values, record.state.ages, record.state.monitors)


def now_of(record: Decision) -> Now:
    """The moment of the decision."""
    return Now(record.at_us, record.utc_us, record.utc_error_us)


def context_of(record: Decision) -> Context:
    """Where the mission stood. Raises ValueError where the binding is not hexadecimal."""
    given = record.context
    return Context(
        bytes.fromhex(record.binding),
        given.vehicle,
        given.policy_version,
        given.consumed,
        given.released_us,
        given.phase,
        given.remaining_us,
        tuple(Approval(*approval) for approval in given.approvals),
    )
