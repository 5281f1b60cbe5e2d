"""Decisions of a log: the inputs in a record, and the trace of a decision on a link of a fallback or the contingency.

A link skips most steps of design 4.1 (`decision.fallbacks`): only its own `require` and the airspace of its motion are
checked.
"""

from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.fallbacks import DEGRADE, choose_fallback, link_admissible
from rtshcua.decision.prepare import PreparedInvocation, PreparedLink, PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import EVERYWHERE
from rtshcua.evidence.records import DecisionRecord
from rtshcua.ground.why.trace import ConditionCheck, TriedLink
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.wire.request import CONTINGENCY_LINK


def state_of(record: DecisionRecord) -> State:
    """The state of a decision record."""
    return State(record.state.values, record.state.ages, record.state.monitors)


def now_of(record: DecisionRecord) -> Now:
    """The time of a decision record."""
    return Now(record.at_us, record.utc_us, record.utc_error_us)


def context_of(record: DecisionRecord) -> Context:
    """The context of a decision record. Raises ValueError if the binding is not hexadecimal."""
    context = record.context
    return Context(
        bytes.fromhex(record.binding),
        context.vehicle,
        context.policy_version,
        context.consumed,
        context.released_us,
        context.phase,
        context.remaining_us,
        tuple(ConfirmAnswer(*approval) for approval in context.approvals),
    )


class LinkTrace(NamedTuple):
    """The decision on a link: the `degrade` rule whose target it is (None: a link of a chain), its conditions with
    their truths, whether it may fly, and every link of its chain.
    """

    link: PreparedLink
    rule: Rule | None
    checks: tuple[ConditionCheck, ...]
    admissible: bool
    chain: tuple[TriedLink, ...]


def trace_link(
    record: DecisionRecord, invocation: PreparedInvocation | None, policy: PreparedPolicy
) -> LinkTrace | None:
    """Derive the decision on a link again from its record; None if the bundle does not have the link.

    `invocation` is the step whose fallback it is, None for a link of the contingency.
    """
    state, now = state_of(record), now_of(record)
    chain: Sequence[PreparedLink] = policy.contingency if invocation is None else invocation.chain
    phase = NO_PHASE if invocation is None else invocation.phase
    rule: Rule | None = None
    if invocation is not None and record.link == DEGRADE:
        choice = choose_fallback(invocation, state, policy, now)
        rules = [
            each for each in invocation.candidates.degrades if choice is not None and each.target.link is choice.link
        ]
        if choice is None or choice.index != DEGRADE or not rules:
            return None
        link, rule = rules[0].target, rules[0].rule
    elif 0 <= record.link < len(chain):
        link = chain[record.link]
    else:
        return None
    at = environment(situation(state, policy, now), policy, link.arguments, phase)
    checks = tuple(ConditionCheck("require", clause, EVERYWHERE[condition(at)]) for clause, condition in link.require)
    tried = tuple(TriedLink(each.link.text, link_admissible(each, state, policy, now, phase)) for each in chain)
    return LinkTrace(link, rule, checks, link_admissible(link, state, policy, now, phase), tried)


def of_contingency(record: DecisionRecord) -> bool:
    """Whether a decision is about a link of the contingency, not about a step."""
    return record.kind == CONTINGENCY_LINK
