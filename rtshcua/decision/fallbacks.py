"""Selects the link that flies after a refusal (paper symbol `f_b`, design 4.4).

A link skips steps 2 to 5 and `degrade`, because a vehicle in trouble must always have an answer. The link's own
`require` must be true now, and it must not lead out of the airspace. Holding and landing do not leave the place. A
vehicle that is already outside the airspace, as far as its position error can tell, may always go home.
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision.contracts import longest
from rtshcua.decision.evaluate import NO_PHASE, Environment
from rtshcua.decision.prepare import LinkChoice as LinkChoice
from rtshcua.decision.prepare import PreparedInvocation, PreparedLink, PreparedPolicy
from rtshcua.decision.situation import environment, remembered, situation
from rtshcua.decision.values import AND, EVERYWHERE, FALSE, TRUE, UNKNOWN, Sets, Truth
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now, State

#: the index of the link that a `degrade` rule flies, and the index that means that no link was tried yet
DEGRADE = -1
START = -2


def choose_fallback(
    invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now, after: int = START
) -> LinkChoice | None:
    """The target of a matching `degrade` rule, else the first link of the chain after `after` that may fly now.

    `after` is the index of the link that failed or ran out of time: the choice never goes backwards.
    """
    seen = remembered(state, policy, now)
    for known, known_after, choice in seen.choices:
        if known is invocation and known_after == after:
            return choice
    choice = next(fallbacks(invocation, seen.sets, policy, after, exact=True))
    seen.choices.append((invocation, after, choice))
    return choice


def choose_contingency(state: State, policy: PreparedPolicy, now: Now, after: int = START) -> LinkChoice | None:
    """The first link of the policy's contingency after `after` that may fly now."""
    return next(_chosen(policy.contingency, situation(state, policy, now), policy, after, True, NO_PHASE))


def look_ahead(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> None:
    """Evaluate in advance every link that may have to follow an invocation. Results that depend on the place alone
    are remembered (`Planner`, `Place`), so that a later fallback is chosen faster.
    """
    sets = situation(state, policy, now)
    for rule in invocation.candidates.degrades:
        admissible(rule.target, sets, policy, True, invocation.phase)
    for link in invocation.chain:
        admissible(link, sets, policy, True, invocation.phase)
    for link in policy.contingency:
        admissible(link, sets, policy, True, NO_PHASE)


def link_admissible(link: PreparedLink, state: State, policy: PreparedPolicy, now: Now, phase: int = NO_PHASE) -> bool:
    """Whether a link of a prepared chain may fly now. `phase` is the phase of the invocation whose chain it belongs
    to.
    """
    return admissible(link, situation(state, policy, now), policy, True, phase) == TRUE


def fallbacks(
    invocation: PreparedInvocation, sets: Sets, policy: PreparedPolicy, after: int, exact: bool
) -> Iterator[LinkChoice | None]:
    """The links that may be chosen, in order, and None if possibly none may fly. A single situation has one answer."""
    phase = invocation.phase
    if after < DEGRADE:
        at = environment(sets, policy, invocation.arguments, phase)
        for rule in invocation.candidates.degrades:
            matches = rule.condition(at)
            truth = AND[matches][admissible(rule.target, sets, policy, exact, phase)] if matches & TRUE else FALSE
            if truth & TRUE:
                yield LinkChoice(DEGRADE, rule.target.link)
            if truth == TRUE:
                return
    yield from _chosen(invocation.chain, sets, policy, after, exact, phase)


def _chosen(
    chain: Sequence[PreparedLink], sets: Sets, policy: PreparedPolicy, after: int, exact: bool, phase: int
) -> Iterator[LinkChoice | None]:
    for index in range(max(after + 1, 0), len(chain)):
        truth = admissible(chain[index], sets, policy, exact, phase)
        if truth & TRUE:
            yield LinkChoice(index, chain[index].link)
        if truth == TRUE:
            return
    yield None


def admissible(link: PreparedLink, sets: Sets, policy: PreparedPolicy, exact: bool, phase: int) -> Truth:
    """Whether a link may fly, over a set of situations."""
    seen = policy.seen
    if not exact or seen is None or seen.sets is not sets:
        return _admissible(link, sets, policy, exact, phase)
    for known, its_phase, truth in seen.links:
        if known is link and its_phase == phase:
            return truth
    truth = _admissible(link, sets, policy, exact, phase)
    seen.links.append((link, phase, truth))
    return truth


def _admissible(link: PreparedLink, sets: Sets, policy: PreparedPolicy, exact: bool, phase: int) -> Truth:
    at = environment(sets, policy, link.arguments, phase)
    truth = TRUE
    for _, condition in link.require:
        truth = AND[truth][condition(at)]
    if truth == FALSE or policy.airspace is None or link.motion in (MotionKind.HOLD, MotionKind.LAND):
        return truth
    return AND[truth][_deepens_no_breach(link, at, policy, exact)]


def _deepens_no_breach(link: PreparedLink, at: Environment, policy: PreparedPolicy, exact: bool) -> Truth:
    """Whether a link that moves the vehicle stays in the airspace, or returns it home from outside."""
    airspace, known = policy.airspace, policy.tables.known
    assert airspace is not None
    through = longest(policy.policy.contracts[link.link.skill], policy.policy.vehicle, link.link.limit_us)
    along = airspace.keeps(link.planner.volume(at.slots, known).place, at, through)
    if exact:
        along = EVERYWHERE[along]
    if link.motion != MotionKind.HOME:
        return along
    now = airspace.keeps(policy.still.volume(at.slots, known).place, at, 0)
    if exact:
        now = EVERYWHERE[now]
    return (TRUE if now & FALSE else 0) | (along if now & TRUE else 0) | now & UNKNOWN
