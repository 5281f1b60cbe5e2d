"""The values behind a condition that did not hold, for readers of the log: those of the signals that it reads."""

from collections.abc import Iterator

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.tree import slots_read, where
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.situation import State
from rtshcua.model.quantity import Dimension, display


def seen(text: str, prepared: PreparedInvocation, policy: PreparedPolicy, state: State) -> str:
    """`wind.speed = 12 m/s`: the signals that the clause, rule or airspace of this text reads, with their values.

    Empty if it reads none.
    """
    slots = _slots(text, prepared, policy)
    return ", ".join(
        f"{signal.name} = {value_in_words(signal, state)}"
        for signal in policy.policy.signals
        if slots.intersection(signal.slots)
    )


def _slots(text: str, prepared: PreparedInvocation, policy: PreparedPolicy) -> frozenset[int]:
    flat = policy.policy
    if flat.airspace is not None and text == flat.airspace.text:
        return frozenset(where(flat.vehicle))
    clauses = [clause for of, clause in _clauses(prepared, flat) if of == text]
    return frozenset(slots_read(clauses, flat.vehicle, flat.monitors))


def _clauses(prepared: PreparedInvocation, policy: Policy) -> Iterator[tuple[str, Clause]]:
    contract = prepared.invocation.contract
    for clause in (*contract.require, *contract.assume, *contract.maintain):
        yield clause.text, clause
    for rule in policy.rules:
        if rule.when is not None:
            yield rule.text, rule.when


def value_in_words(signal: Signal, state: State) -> str:
    """A signal's value as in a source; `unknown` where no valid value was received."""
    values = [state.values[slot] for slot in signal.slots]
    first = values[0]
    if first is None or None in values:
        return "unknown"
    if signal.kind == POSITION:
        x, y = (display(value or 0, Dimension.LENGTH) for value in values)
        return f"{x} east and {y} north of home"
    if signal.kind == ENUMERATION:
        return dict(signal.labels).get(first, str(first))
    return display(first, Dimension(signal.dimension))
