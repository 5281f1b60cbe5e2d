"""The inputs of a decision as a log's record holds them."""

from rtshcua.evidence.records import DecisionRecord
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State


def state_of(record: DecisionRecord) -> State:
    """The state that was read."""
    return State(record.state.values, record.state.ages, record.state.monitors)


def now_of(record: DecisionRecord) -> Now:
    """The moment of the decision."""
    return Now(record.at_us, record.utc_us, record.utc_error_us)


def context_of(record: DecisionRecord) -> Context:
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
        tuple(ConfirmAnswer(*approval) for approval in given.approvals),
    )
