"""The decision (paper: `admissible(I, S_t, t)`, eta): one pure function for the runtime, the tests and the audit.

The steps are those of design 4.1, and the first that does not pass decides. They judge sets of situations. The
checker passes sets to learn which verdicts are possible; the runtime passes one situation, a set with exactly one
verdict.

1: the request is for this vehicle, for the policy in force, and within the ranges of its skill. Signatures were
verified once, at load; this step compares the digest that they cover.

2: the invocation was not used before, was not issued in the future, and is still valid (paper symbol `vw`). UTC is
known within an error, so each comparison can also be undetermined.

3: the source may use the timing class, no `forbid` matches, and some `permit` does. An unknown `forbid` may match,
so it defers. An unknown `permit` does not count.

3b: a `confirm` rule that matches, or may match, needs an approval by its role, or by two different people, one in
each of its two roles. The approval (of two, the later one) moves the release (design 4.3). A refusal denies; so
does a missing approval once the rule's time after the release is over.

4: the invocation is valid in the mission's current phase (`vw`).

5: the remaining work fits before the deadline, `L_rem <= ddl - t`, with t since the release.

6: the preconditions (`require`, paper symbol `pre`) and the assumptions (`assume`, `sc`) hold now.

7: the vehicle's envelope, airspace and invariants over the planned volume, energy, and `degrade` rules. The
invariants (`maintain`, `inv`) are evaluated with position and height ranging over the planned volume, with zones
as they exist from now to the end of the contract's longest duration, and everything else as it is now. A temporal
monitor has its present value.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.fallbacks import START, fallbacks
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, is_situation, ranging, situation
from rtshcua.decision.values import EVERYWHERE, FALSE, NOT, TRUE, UNKNOWN, Sets, Span, Truth
from rtshcua.model.decision import Decision, Decisive
from rtshcua.model.flat.contract import Link, SourceKind, TimingClass
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome, Reason

#: the `step` of a decision in which all steps passed
_PASSED_ALL = 8


class RuleVerdict(NamedTuple):
    """An outcome with its reason and the clause that decided."""

    outcome: Outcome
    reason: Reason
    clause: Decisive


#: Verdicts of a step in the order of the rule; `PASS`, if passing is possible, comes last.
Found: TypeAlias = tuple[RuleVerdict, ...]

PASS = RuleVerdict(Outcome.ALLOW, Reason.ADMITTED, None)
PASSED: Found = (PASS,)


class Possible(NamedTuple):
    """One decision that is possible for some situation of a set."""

    outcome: Outcome
    reason: Reason
    target: Link | None


def decide(
    invocation: PreparedInvocation, state: State, policy: PreparedPolicy, context: Context, now: Now
) -> Decision:
    """Decide on an invocation in one situation. Every state, context and time has exactly one outcome."""
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    for step, found in steps(invocation, policy, context, sets, at, exact=True):
        if found is not PASSED and found[0] is not PASS:
            outcome, reason, clause = found[0]
            choice = (
                next(fallbacks(invocation, sets, policy, START, exact=True)) if outcome is Outcome.FALLBACK else None
            )
            link, target = (None, None) if choice is None else (choice.index, choice.link)
            return Decision(outcome, reason, step, clause, link, target, now.monotonic_us, context.consumed)
    until_us = valid_until(invocation, state, context, sets, at)
    return Decision(Outcome.ALLOW, Reason.ADMITTED, _PASSED_ALL, None, None, None, until_us, context.consumed)


def possible(
    invocation: PreparedInvocation, sets: Sets, policy: PreparedPolicy, context: Context
) -> frozenset[Possible]:
    """Every (outcome, reason, target) that is possible for a situation of the sets. The result may contain impossible
    ones.
    """
    exact, at = is_situation(sets, policy), environment(sets, policy, invocation.arguments, invocation.phase)
    found: set[Possible] = set()
    for _, verdicts in steps(invocation, policy, context, sets, at, exact):
        for verdict in verdicts:
            if verdict.outcome is Outcome.FALLBACK:
                for choice in fallbacks(invocation, sets, policy, START, exact):
                    found.add(Possible(Outcome.FALLBACK, verdict.reason, None if choice is None else choice.link))
            elif verdict is not PASS:
                found.add(Possible(verdict.outcome, verdict.reason, None))
        if verdicts[-1] is not PASS:
            break
    else:
        found.add(Possible(Outcome.ALLOW, Reason.ADMITTED, None))
    return frozenset(found)


def steps(
    invocation: PreparedInvocation, policy: PreparedPolicy, context: Context, sets: Sets, at: Environment, exact: bool
) -> Iterator[tuple[int, Found]]:
    """Each step's number with its verdicts, computed lazily. Step 3b has the number 3 and reasons of its own.

    `at` is the set of situations as conditions read it; `exact` is true if it has one situation only.
    """
    yield 1, integrity(invocation, policy, context)
    yield 2, freshness(invocation, context, sets)
    yield 3, authority(invocation, at)
    yield 3, confirmation(invocation, context, at, sets.monotonic_us)
    yield 4, phase(invocation, context)
    yield 5, timing(invocation, context, at, sets.monotonic_us)
    yield 6, state(invocation, at, exact)
    yield 7, safety(invocation, at, exact)


def concluded(verdicts: list[RuleVerdict], doubt: RuleVerdict | None, passes: bool) -> Found:
    """The verdicts of a step: the certain ones, then `doubt`, then a pass."""
    if doubt is not None:
        verdicts.append(doubt)
    if passes:
        verdicts.append(PASS)
    return PASSED if passes and len(verdicts) == 1 else tuple(verdicts)


# ---------------------------------------------------------------- 1: integrity

_BINDING = (RuleVerdict(Outcome.DENY, Reason.BINDING_MISMATCH, None),)
_VEHICLE = (RuleVerdict(Outcome.DENY, Reason.WRONG_VEHICLE, None),)
_VERSION = (RuleVerdict(Outcome.DENY, Reason.POLICY_VERSION, None),)
_ARGUMENT = (RuleVerdict(Outcome.DENY, Reason.ARGUMENT_RANGE, None),)


def integrity(invocation: PreparedInvocation, policy: PreparedPolicy, context: Context) -> Found:
    """Denies a request that differs from what was signed. An invocation that was prepared under another policy has
    the wrong version.
    """
    if context.binding != invocation.invocation.binding:
        return _BINDING
    if context.vehicle != policy.policy.vehicle.identity:
        return _VEHICLE
    if context.policy_version != policy.policy.version or invocation.policy is not policy:
        return _VERSION
    return PASSED if invocation.misfit is None else _ARGUMENT


# ---------------------------------------------------------------- 2: freshness

_REPLAYED = RuleVerdict(Outcome.DENY, Reason.REPLAYED, None)
_FUTURE = RuleVerdict(Outcome.DENY, Reason.ISSUED_IN_FUTURE, None)
_EXPIRED = RuleVerdict(Outcome.DENY, Reason.EXPIRED, None)
_UNCERTAIN = RuleVerdict(Outcome.DEFER, Reason.CLOCK_UNCERTAIN, None)


def freshness(invocation: PreparedInvocation, context: Context, sets: Sets) -> Found:
    """Checks the validity, from the moment of issue to its end, both included."""
    issued = invocation.invocation.issued_at_us
    end = issued + invocation.invocation.contract.validity_us
    utc, (least, most) = sets.utc_us, sets.utc_error_us
    low, high = utc[0] if len(utc) == 1 else (min(first for first, _ in utc), max(last for _, last in utc))
    if context.consumed:
        return (_REPLAYED,)
    if issued <= low - most and high + most <= end:
        return PASSED
    verdicts: list[RuleVerdict] = []
    if issued > low + least:
        verdicts.append(_FUTURE)
        if issued > high + most:
            return tuple(verdicts)
    if high - least > end:
        verdicts.append(_EXPIRED)
        if low - most > end:
            return tuple(verdicts)
    if most:
        verdicts.append(_UNCERTAIN)
    if issued <= high - least and low + least <= end:
        verdicts.append(PASS)
    return tuple(verdicts)


# ---------------------------------------------------------------- 3: authority

#: the timing classes that a source may use: an agent may not request reflexes, and a reflex may only react
CLASSES: dict[int, frozenset[int]] = {
    SourceKind.AGENT: frozenset({TimingClass.SEMANTIC, TimingClass.TACTICAL}),
    SourceKind.OPERATOR: frozenset({TimingClass.SEMANTIC, TimingClass.TACTICAL}),
    SourceKind.ONBOARD: frozenset({TimingClass.TACTICAL}),
    SourceKind.REFLEX: frozenset({TimingClass.REFLEX}),
}

_CLASS = (RuleVerdict(Outcome.DENY, Reason.CLASS_NOT_PERMITTED, None),)
_NOT_PERMITTED = RuleVerdict(Outcome.DENY, Reason.NOT_PERMITTED, None)


def authority(invocation: PreparedInvocation, at: Environment) -> Found:
    """Denied when a `forbid` is true or no `permit` is; a `forbid` that is unknown defers."""
    if invocation.invocation.contract.timing_class not in CLASSES[invocation.invocation.source]:
        return _CLASS
    candidates = invocation.candidates
    verdicts: list[RuleVerdict] = []
    doubt: RuleVerdict | None = None
    unforbidden = True
    for rule in candidates.forbids:
        truth = rule.condition(at)
        if truth == FALSE:
            continue
        if truth & TRUE:
            verdicts.append(RuleVerdict(Outcome.DENY, Reason.FORBIDDEN, rule.rule))
            if truth == TRUE:
                return tuple(verdicts)
        if truth & UNKNOWN and doubt is None:
            doubt = RuleVerdict(Outcome.DEFER, Reason.FORBID_UNKNOWN, rule.rule)
        unforbidden = unforbidden and truth & FALSE != 0
    permitted = False
    for rule in candidates.permits:
        truth = rule.condition(at)
        if truth == TRUE:
            break
        permitted = permitted or truth & TRUE != 0
    else:
        rules = candidates.permits  # no rule names this skill, role and source, or no condition is true
        verdicts.append(RuleVerdict(Outcome.DENY, Reason.OUT_OF_SCOPE, rules[0].rule) if rules else _NOT_PERMITTED)
        if not permitted:
            return tuple(verdicts)
    if unforbidden and not verdicts and doubt is None:
        return PASSED
    return concluded(verdicts, doubt, unforbidden)


# ---------------------------------------------------------------- 3b: confirmation


class ConfirmState(NamedTuple):
    """The state of a `confirm` rule that may match: whether it certainly matches, how long an answer is awaited
    (monotonic us), whether somebody refused, and when enough grants had arrived in time.
    """

    rule: Rule
    certain: bool
    end_us: int
    refused: bool
    granted_us: int | None


def _asked(invocation: PreparedInvocation, context: Context, at: Environment) -> list[ConfirmState]:
    """The `confirm` rules that may match."""
    asked: list[ConfirmState] = []
    for rule, number, condition in invocation.candidates.confirms:
        truth = condition(at)
        if truth == FALSE:
            continue
        end_us, roles = context.released_us + rule.within_us, (rule.approver, rule.second)
        answers = [each for each in context.approvals if each.rule == number and each.role in roles]
        refused = not all(each.granted for each in answers)
        times = [] if refused else _granted(rule, [each for each in answers if each.monotonic_us <= end_us])
        asked.append(ConfirmState(rule, not truth & FALSE, end_us, refused, min(times, default=None)))
    return asked


def _granted(rule: Rule, answers: Sequence[ConfirmAnswer]) -> list[int]:
    """When enough grants had arrived in time, monotonic us: one of the role, or one of each of two people."""
    first = [each for each in answers if each.role == rule.approver]
    if rule.second == -1:
        return [each.monotonic_us for each in first]
    return [
        max(one.monotonic_us, other.monotonic_us)
        for one in first
        for other in answers
        if other.role == rule.second and other.person != one.person
    ]


def confirmation(invocation: PreparedInvocation, context: Context, at: Environment, monotonic_us: Span) -> Found:
    """Denied when the answer to any rule denies, else deferred while any answer is awaited."""
    verdicts: list[RuleVerdict] = []
    doubt: RuleVerdict | None = None
    passes = True
    earliest, latest = monotonic_us
    for rule, certain, end_us, refused, granted_us in _asked(invocation, context, at):
        if granted_us is not None:
            continue
        awaited = not refused and earliest <= end_us
        if refused:
            verdicts.append(RuleVerdict(Outcome.DENY, Reason.APPROVAL_REFUSED, rule))
        elif latest > end_us:
            verdicts.append(RuleVerdict(Outcome.DENY, Reason.APPROVAL_TIMED_OUT, rule))
        if not awaited and certain:
            return tuple(verdicts)
        if awaited and doubt is None:
            doubt = RuleVerdict(Outcome.DEFER, Reason.AWAITING_APPROVAL, rule)
        passes = passes and not certain
    if passes and not verdicts and doubt is None:
        return PASSED
    return concluded(verdicts, doubt, passes)


def release(invocation: PreparedInvocation, context: Context, at: Environment) -> Span:
    """The release of the step, monotonic us. An approval moves it."""
    first = last = context.released_us
    if not invocation.candidates.confirms:
        return first, last
    for _, certain, _, _, granted_us in _asked(invocation, context, at):
        if granted_us is not None:
            first, last = max(first, granted_us) if certain else first, max(last, granted_us)
    return first, last


# ---------------------------------------------------------------- 4: phase

_EARLY = (RuleVerdict(Outcome.DEFER, Reason.PHASE_NOT_REACHED, None),)
_LATE = (RuleVerdict(Outcome.DENY, Reason.PHASE_PASSED, None),)


def phase(invocation: PreparedInvocation, context: Context) -> Found:
    """Deferred while one of the invocation's phases is still to come, denied when none is left."""
    current = max(context.phase, -1) + 1  # the phases from the current one on; before the first phase, all are to come
    coming = invocation.invocation.phases << 1 >> current
    if coming & 1:
        return PASSED
    return _EARLY if coming >> 1 else _LATE


# ---------------------------------------------------------------- 5: timing

_NO_SLACK = RuleVerdict(Outcome.FALLBACK, Reason.NO_SLACK, None)


def timing(invocation: PreparedInvocation, context: Context, at: Environment, monotonic_us: Span) -> Found:
    """Checks that the step can end before its deadline; otherwise the vehicle falls back. A later release does not
    help.
    """
    spare = invocation.invocation.contract.deadline_us - context.remaining_us
    (earliest, latest), (released_first, released_last) = monotonic_us, release(invocation, context, at)
    if max(latest - released_first, 0) <= spare:
        return PASSED
    return (_NO_SLACK, PASS) if max(earliest - released_last, 0) <= spare else (_NO_SLACK,)


def valid_until(invocation: PreparedInvocation, state: State, context: Context, sets: Sets, at: Environment) -> int:
    """The earliest of deadline, end of validity and the moment when a value that was read becomes stale, monotonic
    us. Values that a temporal monitor read count too, and its result stays valid for `MAX_GAP` after its
    observation.

    The end of validity is mapped from UTC and reduced by the clock's error.
    """
    contract = invocation.invocation.contract
    (now, _), ((utc, _),), (error, _) = sets.monotonic_us, sets.utc_us, sets.utc_error_us
    end = invocation.invocation.issued_at_us + contract.validity_us
    (released, _), valid = release(invocation, context, at), end - utc - error
    left = min(min(released - now, 0) + contract.deadline_us, valid, invocation.rests_us)
    values, ages = state.values, state.ages
    for slot, stale in invocation.reads:
        if 0 <= stale - ages[slot] < left and values[slot] is not None:
            left = stale - ages[slot]
    return now + left


# ---------------------------------------------------------------- 6 and 7: state and safety

_TOO_FAST = (RuleVerdict(Outcome.FALLBACK, Reason.ENVELOPE, None),)


class ConditionTally:
    """Collects the conditions of a step, which passes when all of them are true: false falls back, else unknown
    defers.

    With `exact`, one situation is judged. A mixed truth then ranges over the places of one volume, where the
    condition must hold everywhere. Otherwise it ranges over many situations, each with a volume of its own.
    """

    __slots__ = ("_doubt", "_exact", "_passes", "_unknown", "_verdicts")

    def __init__(self, unknown: Reason, exact: bool) -> None:
        self._unknown, self._exact = unknown, exact
        self._verdicts: list[RuleVerdict] = []
        self._doubt: RuleVerdict | None = None
        self._passes = True

    def fails(self, truth: Truth, reason: Reason, clause: Decisive) -> bool:
        """Count a condition that is not TRUE. Return whether the step certainly fails, so that the other conditions
        need no evaluation.
        """
        if self._exact:
            truth = EVERYWHERE[truth]
        if truth & FALSE:
            self._verdicts.append(RuleVerdict(Outcome.FALLBACK, reason, clause))
        if truth & UNKNOWN and self._doubt is None:
            self._doubt = RuleVerdict(Outcome.DEFER, self._unknown, clause)
        self._passes = self._passes and truth & TRUE != 0
        return truth == FALSE

    def found(self, failed: bool) -> Found:
        """The verdicts, given whether some condition certainly fails."""
        if failed:
            return tuple(self._verdicts)
        if self._passes and not self._verdicts and self._doubt is None:
            return PASSED
        return concluded(self._verdicts, self._doubt, self._passes)


def state(invocation: PreparedInvocation, at: Environment, exact: bool) -> Found:
    """Falls back on the first clause that is false, else defers on the first that is unknown."""
    tally = ConditionTally(Reason.STATE_UNKNOWN, exact)
    for guards in (invocation.require, invocation.assume):
        for clause, condition in guards:
            truth = condition(at)
            if truth != TRUE and tally.fails(truth, Reason.STATE_VIOLATED, clause):
                return tally.found(failed=True)
    return tally.found(failed=False)


def safety(invocation: PreparedInvocation, at: Environment, exact: bool) -> Found:
    """Falls back on the first condition that is false, else defers on the first that is unknown."""
    tally = ConditionTally(Reason.SAFETY_UNKNOWN, exact)
    policy, known = invocation.policy, invocation.policy.tables.known
    if invocation.invocation.plan.speed > policy.policy.vehicle.speed:
        return _TOO_FAST
    volume = invocation.planner.volume(at.slots, known)
    if policy.airspace is not None:
        truth = policy.airspace.keeps(volume.place, at, invocation.lasts_us)
        if truth != TRUE and tally.fails(truth, Reason.AIRSPACE, policy.airspace.airspace):
            return tally.found(failed=True)
    if invocation.maintain:
        over = ranging(at, volume, known.height, invocation.lasts_us)
        for clause, condition in invocation.maintain:
            truth = condition(over)
            if truth != TRUE and tally.fails(truth, Reason.INVARIANT, clause):
                return tally.found(failed=True)
    truth = invocation.energy.suffices(at.slots[known.battery], volume, at.slots[known.drain])
    if truth != TRUE and tally.fails(truth, Reason.ENERGY, None):
        return tally.found(failed=True)
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE and tally.fails(truth, Reason.DEGRADED, rule.rule):
            return tally.found(failed=True)
    return tally.found(failed=False)
