"""Steps 1 to 5, by hand: integrity, freshness, authority, confirmation, phase, timing."""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import POLICY, STEP, ask, loaded, ready, with_contract, with_rules
from reference.flat_case import BATTERY, INSPECT, MIN, NOW, OPERATOR, SUPERVISOR, S, clause, rule
from rtshcua.decision.decide import Possible, decide, possible
from rtshcua.decision.prepare import prepare_invocation
from rtshcua.decision.values import MISSING, Sets, interval, maybe, point
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import SourceKind, TimingClass
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

ALLOW, DENY, DEFER, FALLBACK = Outcome

# -------------------------------------------------------------------------------------------------- 1 integrity


@pytest.mark.parametrize(
    ("context", "reason"),
    [
        ({"binding": b""}, Reason.BINDING_MISMATCH),
        ({"vehicle": "quad-08"}, Reason.WRONG_VEHICLE),
        ({"policy_version": 8}, Reason.POLICY_VERSION),
        ({"binding": b"", "vehicle": "quad-08", "policy_version": 8, "consumed": 1}, Reason.BINDING_MISMATCH),
    ],
)
def test_integrity(context: dict[str, Any], reason: Reason) -> None:
    decision = ask(**context)
    assert (decision.outcome, decision.reason, decision.step) == (DENY, reason, 1)


@pytest.mark.parametrize("arguments", [(3, 20_000, 0, 4_000), (-1, 20_000, 0, 4_000), (1, 20_000, 3, 4_000)])
def test_an_argument_out_of_range(arguments: tuple[int, ...]) -> None:
    assert ask(replace(STEP, arguments=arguments)).reason is Reason.ARGUMENT_RANGE


def test_a_place_out_of_all_coordinates() -> None:
    far = 1 << 29
    step = flat.INVOCATIONS[1]
    there = replace(step, arguments=(far + 1, 0, 20_000))
    found = prepare_invocation(there, POLICY, flat.MISSION.phases)
    assert found == Refusal("malformed", "plan: the path does not match the arguments")
    edge = replace(step, arguments=(far, 0, 20_000), plan=replace(step.plan, path=(far, 0)))
    assert ask(edge).reason is Reason.AIRSPACE


def test_an_invocation_prepared_under_another_policy_is_of_another_version() -> None:
    prepared = ready(STEP, loaded())
    decision = decide(prepared, flat.state(), POLICY, flat.context(), NOW)
    assert decision.reason is Reason.POLICY_VERSION


# -------------------------------------------------------------------------------------------------- 2 freshness

E = 20_000  # the clock's error


@rows(
    ("utc", "outcome", "reason"),
    [
        (flat.ISSUED - E - 1, DENY, Reason.ISSUED_IN_FUTURE),
        (flat.ISSUED - E, DEFER, Reason.CLOCK_UNCERTAIN),
        (flat.ISSUED + E - 1, DEFER, Reason.CLOCK_UNCERTAIN),
        (flat.ISSUED + E, ALLOW, Reason.ADMITTED),
        (flat.ISSUED + 10 * MIN - E, ALLOW, Reason.ADMITTED),
        (flat.ISSUED + 10 * MIN - E + 1, DEFER, Reason.CLOCK_UNCERTAIN),
        (flat.ISSUED + 10 * MIN + E, DEFER, Reason.CLOCK_UNCERTAIN),
        (flat.ISSUED + 10 * MIN + E + 1, DENY, Reason.EXPIRED),
    ],
)
def test_freshness(utc: int, outcome: Outcome, reason: Reason) -> None:
    decision = ask(now=replace(NOW, utc_us=utc, utc_error_us=E))
    assert (decision.outcome, decision.reason) == (outcome, reason)
    assert decision.step == (8 if reason is Reason.ADMITTED else 2)


def test_a_replay_comes_before_the_clock() -> None:
    assert ask(consumed=1, now=replace(NOW, utc_us=0)).reason is Reason.REPLAYED


def test_negative_clock_error_counts_as_zero() -> None:
    assert ask(now=replace(NOW, utc_us=flat.ISSUED - 1, utc_error_us=-E)).reason is Reason.ISSUED_IN_FUTURE


# -------------------------------------------------------------------------------------------------- 3 authority


@rows("source", SourceKind)
@rows("timing_class", TimingClass)
def test_timing_classes_of_sources(source: SourceKind, timing_class: TimingClass) -> None:
    may = {
        SourceKind.AGENT: {TimingClass.SEMANTIC, TimingClass.TACTICAL},
        SourceKind.OPERATOR: {TimingClass.SEMANTIC, TimingClass.TACTICAL},
        SourceKind.ONBOARD: {TimingClass.TACTICAL},
        SourceKind.REFLEX: {TimingClass.REFLEX},
    }
    _, contract = with_contract(INSPECT, timing_class=timing_class)
    contracts = tuple(contract if n == INSPECT else c for n, c in enumerate(flat.CONTRACTS))
    policy = loaded(replace(flat.POLICY, contracts=contracts, rules=(rule(RuleKind.PERMIT),)))
    decision = ask(replace(STEP, contract=contract, source=source), policy=policy)
    assert decision.reason is (Reason.ADMITTED if timing_class in may[source] else Reason.CLASS_NOT_PERMITTED)


YES = None
NO = clause("battery < 0 %", flat.apply(Op.LT, flat.signal(BATTERY), flat.const(0)))
MAYBE = clause("wind.speed < 0", flat.apply(Op.LT, flat.signal(flat.WIND), flat.const(0)))
WITHOUT_WIND = {flat.WIND: None}  # makes MAYBE unknown
PERMIT, FORBID, CONFIRM = RuleKind.PERMIT, RuleKind.FORBID, RuleKind.CONFIRM


@rows(
    ("rules", "outcome", "reason", "deciding"),
    [
        ([(PERMIT, YES)], DEFER, Reason.STATE_UNKNOWN, None),  # authority passed; the wind is then missed in step 6
        ([(PERMIT, NO), (PERMIT, YES)], DEFER, Reason.STATE_UNKNOWN, None),
        ([(PERMIT, MAYBE), (PERMIT, YES)], DEFER, Reason.STATE_UNKNOWN, None),
        ([(FORBID, NO), (PERMIT, YES)], DEFER, Reason.STATE_UNKNOWN, None),
        ([], DENY, Reason.NOT_PERMITTED, None),
        ([(FORBID, NO)], DENY, Reason.NOT_PERMITTED, None),
        ([(PERMIT, NO)], DENY, Reason.OUT_OF_SCOPE, 0),
        ([(PERMIT, MAYBE)], DENY, Reason.OUT_OF_SCOPE, 0),
        ([(PERMIT, YES), (FORBID, YES)], DENY, Reason.FORBIDDEN, 1),
        ([(FORBID, MAYBE), (FORBID, YES), (PERMIT, YES)], DENY, Reason.FORBIDDEN, 1),
        ([(FORBID, MAYBE), (PERMIT, YES)], DEFER, Reason.FORBID_UNKNOWN, 0),
        ([(FORBID, MAYBE), (FORBID, MAYBE), (PERMIT, YES)], DEFER, Reason.FORBID_UNKNOWN, 0),
        ([(FORBID, MAYBE), (PERMIT, NO)], DENY, Reason.OUT_OF_SCOPE, 1),  # false and unknown together are false
        ([(FORBID, MAYBE)], DENY, Reason.NOT_PERMITTED, None),
    ],
)
def test_authority(rules: list[Any], outcome: Outcome, reason: Reason, deciding: int | None) -> None:
    made = [rule(kind, INSPECT, when=when, text=str(n)) for n, (kind, when) in enumerate(rules)]
    decision = ask(values=WITHOUT_WIND, policy=with_rules(*made))
    assert (decision.outcome, decision.reason) == (outcome, reason)
    if reason is not Reason.STATE_UNKNOWN:
        assert decision.clause == (None if deciding is None else made[deciding])
        assert decision.step == 3


@rows(
    ("fields", "reason"),
    [
        ({"skills": (INSPECT,)}, Reason.ADMITTED),
        ({"skills": ()}, Reason.ADMITTED),
        ({"skills": (flat.GOTO,)}, Reason.NOT_PERMITTED),
        ({"skills": (flat.GOTO, INSPECT)}, Reason.ADMITTED),
        ({"roles": (OPERATOR,)}, Reason.ADMITTED),
        ({"roles": (SUPERVISOR,)}, Reason.NOT_PERMITTED),
        ({"roles": (OPERATOR, SUPERVISOR)}, Reason.ADMITTED),
        ({"sources": (SourceKind.AGENT,)}, Reason.ADMITTED),
        ({"sources": (SourceKind.OPERATOR,)}, Reason.NOT_PERMITTED),
        ({"skills": (INSPECT,), "roles": (OPERATOR,), "sources": (SourceKind.AGENT,)}, Reason.ADMITTED),
        ({"skills": (), "roles": (SUPERVISOR,)}, Reason.NOT_PERMITTED),
        ({"skills": (INSPECT,), "sources": (SourceKind.REFLEX,)}, Reason.NOT_PERMITTED),
    ],
)
def test_rule_matches_skill_role_and_source(fields: dict[str, Any], reason: Reason) -> None:
    assert ask(policy=with_rules(replace(rule(PERMIT), **fields))).reason is reason


def test_candidates_come_in_the_order_of_the_policy_and_once() -> None:
    rules = (
        rule(PERMIT, text="any"),
        rule(PERMIT, INSPECT, text="skill"),
        rule(PERMIT, flat.GOTO, text="other"),
        rule(PERMIT, roles=(OPERATOR,), text="role"),
        rule(PERMIT, flat.GOTO, INSPECT, roles=(OPERATOR, SUPERVISOR), text="both"),
        rule(FORBID, text="forbid"),
    )
    index = with_rules(*rules).rules
    found = index.candidates(INSPECT, OPERATOR, SourceKind.AGENT)
    assert [one.rule.text for one in found.permits] == ["any", "skill", "role", "both"]
    assert [one.number for one in found.permits] == [0, 1, 3, 4]
    assert [one.rule.text for one in found.forbids] == ["forbid"]
    assert index.candidates(INSPECT, OPERATOR, SourceKind.AGENT) is found


def test_a_rule_that_degrades_to_the_skill_itself_does_not_refuse_it() -> None:
    home = flat.INVOCATIONS[3]
    assert ask(home, values={BATTERY: 2_000}).outcome is ALLOW


# --------------------------------------------------------------------------------------------- 3b confirmation

LOW = replace(STEP, arguments=(flat.BRIDGE, 8_000, 0, 4_000), plan=replace(STEP.plan, altitude=8_000))
AT = NOW.monotonic_us
RELEASED = AT - 100_000
EARLY = RELEASED + 50_000


def low(**given: Any) -> Any:
    return ask(LOW, values=given.pop("values", None) or {flat.HEIGHT: 8_000}, **given)


@rows(
    ("approvals", "released", "outcome", "reason"),
    [
        ((), RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        ((flat.approval(1, EARLY),), RELEASED, ALLOW, Reason.ADMITTED),
        ((flat.approval(1, EARLY, role=OPERATOR),), RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        ((flat.approval(1, EARLY, rule=4),), RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        ((flat.approval(0, EARLY),), RELEASED, DENY, Reason.APPROVAL_REFUSED),
        ((flat.approval(0, EARLY, role=OPERATOR),), RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        ((flat.approval(1, EARLY), flat.approval(0, EARLY + 1)), RELEASED, DENY, Reason.APPROVAL_REFUSED),
        ((), AT - 30 * S, DEFER, Reason.AWAITING_APPROVAL),
        ((), AT - 30 * S - 1, DENY, Reason.APPROVAL_TIMED_OUT),
        ((flat.approval(1, AT),), AT - 30 * S, ALLOW, Reason.ADMITTED),  # the approval moves the release
        ((flat.approval(1, AT),), AT - 30 * S - 1, DENY, Reason.APPROVAL_TIMED_OUT),  # it came too late
        ((flat.approval(1, AT - 3 * S),), AT - 20 * S, FALLBACK, Reason.NO_SLACK),
        ((flat.approval(1, AT - 3 * S), flat.approval(1, AT)), AT - 20 * S, FALLBACK, Reason.NO_SLACK),
        ((flat.approval(1, AT - 31 * S),), RELEASED, ALLOW, Reason.ADMITTED),  # before the release: nothing moves
    ],
)
def test_confirmation(approvals: Any, released: int, outcome: Outcome, reason: Reason) -> None:
    decision = low(approvals=approvals, released_us=released)
    assert (decision.outcome, decision.reason) == (outcome, reason)
    if reason.value.startswith("approval/"):
        assert (decision.clause, decision.step) == (flat.RULES[flat.CONFIRM_RULE], 3)


ADA, BOB, EVE = range(3)  # people


def says(person: int, at: int, role: int = SUPERVISOR, granted: int = 1) -> Any:
    """A person's answer to the only `confirm` rule of a policy of two rules."""
    return flat.approval(granted, at, role, rule=1, person=person)


@rows(
    ("second", "answers", "released", "outcome", "reason"),
    [
        (SUPERVISOR, [says(ADA, EARLY)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (SUPERVISOR, [says(ADA, EARLY), says(BOB, AT)], RELEASED, ALLOW, Reason.ADMITTED),
        (SUPERVISOR, [says(ADA, EARLY), says(ADA, AT)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (SUPERVISOR, [says(ADA, EARLY), says(BOB, AT, OPERATOR)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (OPERATOR, [says(ADA, EARLY), says(BOB, AT, OPERATOR)], RELEASED, ALLOW, Reason.ADMITTED),
        (OPERATOR, [says(ADA, EARLY), says(ADA, AT, OPERATOR)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (OPERATOR, [says(ADA, EARLY), says(BOB, AT)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (OPERATOR, [says(BOB, EARLY, OPERATOR)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        (OPERATOR, [says(ADA, AT, OPERATOR), says(BOB, AT, OPERATOR)], RELEASED, DEFER, Reason.AWAITING_APPROVAL),
        # either of them refuses for both
        (SUPERVISOR, [says(ADA, EARLY), says(BOB, AT, granted=0)], RELEASED, DENY, Reason.APPROVAL_REFUSED),
        (OPERATOR, [says(ADA, EARLY), says(BOB, AT, OPERATOR, 0)], RELEASED, DENY, Reason.APPROVAL_REFUSED),
        (OPERATOR, [says(ADA, EARLY, granted=0), says(BOB, AT, OPERATOR)], RELEASED, DENY, Reason.APPROVAL_REFUSED),
        # both must come in time
        (SUPERVISOR, [says(ADA, AT - S), says(BOB, AT)], AT - 30 * S, ALLOW, Reason.ADMITTED),
        (SUPERVISOR, [says(ADA, AT - S), says(BOB, AT)], AT - 30 * S - 1, DENY, Reason.APPROVAL_TIMED_OUT),
        # the later of the two moves the release, and a third person does not
        (SUPERVISOR, [says(ADA, AT - 4 * S), says(BOB, AT - 3 * S)], AT - 20 * S, FALLBACK, Reason.NO_SLACK),
        (SUPERVISOR, [says(ADA, AT - 3 * S), says(BOB, AT)], AT - 20 * S, ALLOW, Reason.ADMITTED),
        (OPERATOR, [says(ADA, AT - 3 * S), says(BOB, AT, OPERATOR)], AT - 20 * S, ALLOW, Reason.ADMITTED),
        (OPERATOR, [says(ADA, AT), says(BOB, AT - 3 * S, OPERATOR)], AT - 20 * S, ALLOW, Reason.ADMITTED),
        (
            SUPERVISOR,
            [says(ADA, AT - 4 * S), says(BOB, AT - 3 * S), says(EVE, AT)],
            AT - 20 * S,
            FALLBACK,
            Reason.NO_SLACK,
        ),
    ],
)
def test_two_people_may_answer_in_any_order(
    second: int, answers: list[Any], released: int, outcome: Outcome, reason: Reason
) -> None:
    policy = with_rules(rule(PERMIT), rule(CONFIRM, approver=SUPERVISOR, second=second, within_us=30 * S))
    for ordered in (answers, answers[::-1]):
        decision = ask(policy=policy, approvals=tuple(ordered), released_us=released)
        assert (decision.outcome, decision.reason) == (outcome, reason)


def test_an_approval_moves_the_deadline() -> None:
    late = {"released_us": AT - 20 * S, "approvals": (flat.approval(1, AT - S),)}
    assert low(ages=dict.fromkeys(range(flat.SLOTS), 0), **late).valid_until_us == AT + S // 2
    policy, contract = with_contract(INSPECT, deadline_us=S + 100_000)
    decision = ask(replace(LOW, contract=contract), values={flat.HEIGHT: 8_000}, policy=policy, **late)
    assert decision.valid_until_us == AT + 100_000


def test_a_release_still_to_come_lengthens_no_permit() -> None:
    policy, contract = with_contract(INSPECT, deadline_us=100_000)
    decision = ask(replace(STEP, contract=contract), policy=policy, released_us=AT + S, remaining_us=0)
    assert (decision.outcome, decision.valid_until_us) == (ALLOW, AT + 100_000)


def test_age_of_missing_slot_is_ignored() -> None:
    """No admission rests on a missing value, so its age limits no permit."""
    either = clause("calm or free", (*flat.CALM.code, *flat.FREE.code, Op.OR, 0, 0))
    reads = (*flat.CONTRACTS[flat.GOTO].reads, flat.OBSTACLE)
    policy, contract = with_contract(flat.GOTO, require=(flat.FIX_IS_GOOD, either), reads=reads)
    step = replace(flat.INVOCATIONS[1], contract=contract)
    for value, age, left in ((None, S - 10, 490_000), (9_000, S - 10, 10), (9_000, S, 0)):
        decision = ask(step, values={flat.OBSTACLE: value}, ages={flat.OBSTACLE: age}, policy=policy)
        assert (decision.outcome, decision.valid_until_us) == (ALLOW, AT + left)


def test_an_unknown_confirm_needs_an_approval_too() -> None:
    rules = (rule(PERMIT), rule(CONFIRM, when=MAYBE, approver=SUPERVISOR, within_us=30 * S))
    policy = with_rules(*rules)
    assert ask(values=WITHOUT_WIND, policy=policy).reason is Reason.AWAITING_APPROVAL
    granted = (flat.approval(1, AT, rule=1),)
    assert ask(values=WITHOUT_WIND, policy=policy, approvals=granted).reason is Reason.STATE_UNKNOWN


def test_a_refusal_is_of_its_own_rule() -> None:
    asked, not_asked = (rule(CONFIRM, when=when, approver=SUPERVISOR, within_us=30 * S) for when in (YES, NO))
    policy = with_rules(rule(PERMIT), asked, not_asked)
    answers = (flat.approval(1, AT, rule=1), flat.approval(0, AT, rule=2))
    assert ask(policy=policy, approvals=answers).reason is Reason.ADMITTED


def test_a_refusal_outweighs_what_is_awaited() -> None:
    one = rule(CONFIRM, approver=SUPERVISOR, within_us=30 * S)
    policy = with_rules(rule(PERMIT), one, one)
    assert ask(policy=policy, approvals=(flat.approval(0, AT, rule=2),)).reason is Reason.APPROVAL_REFUSED
    assert ask(policy=policy, approvals=(flat.approval(1, AT, rule=2),)).reason is Reason.AWAITING_APPROVAL


# ------------------------------------------------------------------------------------------------------ 4 phase


@rows(
    ("phases", "current", "outcome", "reason"),
    [
        (0b010, 1, ALLOW, Reason.ADMITTED),
        (0b010, 0, DEFER, Reason.PHASE_NOT_REACHED),
        (0b010, 2, DENY, Reason.PHASE_PASSED),
        (0b101, 1, DEFER, Reason.PHASE_NOT_REACHED),
        (0b101, 0, ALLOW, Reason.ADMITTED),
        (0b101, 2, ALLOW, Reason.ADMITTED),
        (0b111, 3, DENY, Reason.PHASE_PASSED),
        (0b000, 0, DENY, Reason.PHASE_PASSED),
        (0b001, -1, DEFER, Reason.PHASE_NOT_REACHED),
        (0b001, -(1 << 40), DEFER, Reason.PHASE_NOT_REACHED),
        (0b001, 1 << 40, DENY, Reason.PHASE_PASSED),
    ],
)
def test_phase(phases: int, current: int, outcome: Outcome, reason: Reason) -> None:
    decision = ask(replace(STEP, phases=phases), phase=current)
    assert (decision.outcome, decision.reason) == (outcome, reason)
    assert decision.step == (8 if outcome is ALLOW else 4)


# ----------------------------------------------------------------------------------------------------- 5 timing


@rows(
    ("elapsed", "remaining", "outcome"),
    [
        (0, 2 * S, ALLOW),
        (0, 2 * S + 1, FALLBACK),
        (S, S, ALLOW),
        (S, S + 1, FALLBACK),
        (2 * S, 0, ALLOW),
        (-S, 2 * S, ALLOW),
        (-S, 2 * S + 1, FALLBACK),  # a future release has no advantage
    ],
)
def test_timing(elapsed: int, remaining: int, outcome: Outcome) -> None:
    decision = ask(released_us=AT - elapsed, remaining_us=remaining)
    assert decision.outcome is outcome
    assert decision.step == (5 if outcome is FALLBACK else 8)


# -------------------------------------------------------------------------------------------- sets of situations


def all_of(**fields: Any) -> Sets:
    """The nominal situation, with slots (by number) or times replaced by sets."""
    given = fields.pop("values", {})
    values = tuple(given.get(slot, point(flat.NOMINAL[slot])) for slot in range(flat.SLOTS))
    utc = NOW.utc_us
    plain = Sets(values, (AT, AT), ((utc, utc),), (0, 0))
    return plain._replace(**fields)


def answers(sets: Sets, policy: Any = POLICY, invocation: Any = STEP, **context: Any) -> set[tuple[Outcome, Reason]]:
    found = possible(ready(invocation, policy), sets, policy, flat.context(invocation, **context))
    assert all(isinstance(one, Possible) for one in found)
    return {(one.outcome, one.reason) for one in found}


ADMITTED = (ALLOW, Reason.ADMITTED)


@rows(
    ("fields", "expected"),
    [
        ({}, {ADMITTED}),
        ({"monotonic_us": (AT, AT + 3 * S)}, {ADMITTED, (FALLBACK, Reason.NO_SLACK)}),
        ({"monotonic_us": (AT + 3 * S, AT + 4 * S)}, {(FALLBACK, Reason.NO_SLACK)}),
        ({"utc_us": ((flat.ISSUED, flat.ISSUED + 10 * MIN),)}, {ADMITTED}),
        ({"utc_us": ((flat.ISSUED - 1, flat.ISSUED),)}, {ADMITTED, (DENY, Reason.ISSUED_IN_FUTURE)}),
        ({"utc_us": ((flat.ISSUED - 2, flat.ISSUED - 1),)}, {(DENY, Reason.ISSUED_IN_FUTURE)}),
        ({"utc_us": ((flat.ISSUED + 10 * MIN, flat.ISSUED + 11 * MIN),)}, {ADMITTED, (DENY, Reason.EXPIRED)}),
        (  # to pass one step is not to be admitted
            {"utc_us": ((flat.ISSUED - 1, flat.ISSUED),), "values": {BATTERY: point(3_000)}},
            {(DENY, Reason.ISSUED_IN_FUTURE), (FALLBACK, Reason.STATE_VIOLATED)},
        ),
        (
            {"utc_us": ((NOW.utc_us, NOW.utc_us), (NOW.utc_us + 2, NOW.utc_us + 11 * MIN))},
            {ADMITTED, (DENY, Reason.EXPIRED)},
        ),
        (
            {"utc_us": ((flat.ISSUED, flat.ISSUED + 10 * MIN),), "utc_error_us": (0, 5)},
            {ADMITTED, (DEFER, Reason.CLOCK_UNCERTAIN)},
        ),
        (
            {"utc_us": ((flat.ISSUED - 10, flat.ISSUED - 10),), "utc_error_us": (0, 20)},
            {(DENY, Reason.ISSUED_IN_FUTURE), (DEFER, Reason.CLOCK_UNCERTAIN)},
        ),
        (
            {"utc_us": ((flat.ISSUED + 10 * MIN + 10,) * 2,), "utc_error_us": (0, 20)},
            {(DENY, Reason.EXPIRED), (DEFER, Reason.CLOCK_UNCERTAIN)},
        ),
        (  # the greatest error alone reaches the last moment
            {"utc_us": ((flat.ISSUED + 10 * MIN + 20,) * 2,), "utc_error_us": (0, 20)},
            {(DENY, Reason.EXPIRED), (DEFER, Reason.CLOCK_UNCERTAIN)},
        ),
        (
            {"utc_us": ((flat.ISSUED - 20,) * 2,), "utc_error_us": (0, 20)},
            {(DENY, Reason.ISSUED_IN_FUTURE), (DEFER, Reason.CLOCK_UNCERTAIN)},
        ),
        ({"values": {BATTERY: interval(3_000, 9_000)}}, {ADMITTED, (FALLBACK, Reason.STATE_VIOLATED)}),
        (  # sound, not exact: that the charge is known once step 6 has passed is forgotten in step 7
            {"values": {BATTERY: maybe(point(9_000))}},
            {ADMITTED, (DEFER, Reason.STATE_UNKNOWN), (DEFER, Reason.SAFETY_UNKNOWN)},
        ),
        ({"values": {flat.WIND: MISSING}}, {(DEFER, Reason.STATE_UNKNOWN)}),
        (
            {"values": {flat.WIND: MISSING, BATTERY: interval(3_000, 9_000)}},
            {(FALLBACK, Reason.STATE_VIOLATED), (DEFER, Reason.STATE_UNKNOWN)},
        ),
    ],
)
def test_possible_outcomes(fields: dict[str, Any], expected: set[tuple[Outcome, Reason]]) -> None:
    assert answers(all_of(**fields)) == expected


@pytest.mark.parametrize(
    ("monotonic", "expected"),
    [
        ((AT, AT + 2 * S), {ADMITTED}),
        ((AT + 2 * S, AT + 3 * S), {ADMITTED, (FALLBACK, Reason.NO_SLACK)}),
        ((AT + 2 * S + 1, AT + 3 * S), {(FALLBACK, Reason.NO_SLACK)}),
    ],
)
def test_the_last_moment_of_a_deadline(monotonic: tuple[int, int], expected: set[Any]) -> None:
    assert answers(all_of(monotonic_us=monotonic), released_us=AT, remaining_us=0) == expected


@rows(
    ("rules", "wind", "expected"),
    [
        ([(FORBID, MAYBE), (PERMIT, YES)], interval(-1, 1), {ADMITTED, (DENY, Reason.FORBIDDEN)}),
        ([(PERMIT, MAYBE)], interval(-1, 1), {ADMITTED, (DENY, Reason.OUT_OF_SCOPE)}),
        ([(PERMIT, MAYBE), (PERMIT, NO)], interval(-1, 1), {ADMITTED, (DENY, Reason.OUT_OF_SCOPE)}),
        ([(PERMIT, NO), (PERMIT, MAYBE)], interval(-1, 1), {ADMITTED, (DENY, Reason.OUT_OF_SCOPE)}),
        ([(FORBID, MAYBE), (PERMIT, NO)], maybe(point(0)), {(DENY, Reason.OUT_OF_SCOPE)}),
        (
            [(FORBID, MAYBE), (PERMIT, YES)],
            maybe(point(0)),
            {ADMITTED, (DEFER, Reason.FORBID_UNKNOWN), (DEFER, Reason.STATE_UNKNOWN)},
        ),
        ([(FORBID, MAYBE), (FORBID, MAYBE), (PERMIT, YES)], point(-1), {(DENY, Reason.FORBIDDEN)}),
        (
            [(FORBID, MAYBE), (PERMIT, YES)],
            maybe(point(-1)),
            {(DENY, Reason.FORBIDDEN), (DEFER, Reason.FORBID_UNKNOWN)},
        ),
    ],
)
def test_possible_authority_verdicts(rules: list[Any], wind: Any, expected: set[tuple[Outcome, Reason]]) -> None:
    policy = with_rules(*(rule(kind, INSPECT, when=when) for kind, when in rules))
    assert answers(all_of(values={flat.WIND: wind}), policy) == expected


@pytest.mark.parametrize(
    ("wind", "approvals", "monotonic", "expected"),
    [
        (interval(-1, 1), (), (AT, AT), {ADMITTED, (DEFER, Reason.AWAITING_APPROVAL)}),
        (interval(-1, 1), (flat.approval(0, AT, rule=1),), (AT, AT), {ADMITTED, (DENY, Reason.APPROVAL_REFUSED)}),
        (point(-1), (flat.approval(0, AT, rule=1),), (AT, AT), {(DENY, Reason.APPROVAL_REFUSED)}),
        (
            point(-1),
            (),
            (AT, AT + MIN),
            {(DENY, Reason.APPROVAL_TIMED_OUT), (DEFER, Reason.AWAITING_APPROVAL)},
        ),
        (  # where the rule matches, the approval moves the release
            interval(-1, 1),
            (flat.approval(1, AT + S, rule=1),),
            (AT + 2 * S, AT + 2 * S),
            {ADMITTED, (FALLBACK, Reason.NO_SLACK)},
        ),
    ],
)
def test_possible_confirmation_verdicts(wind: Any, approvals: Any, monotonic: Any, expected: set[Any]) -> None:
    policy = with_rules(rule(PERMIT), rule(CONFIRM, when=MAYBE, approver=SUPERVISOR, within_us=30 * S))
    sets = all_of(values={flat.WIND: wind}, monotonic_us=monotonic)
    assert answers(sets, policy, approvals=approvals) == expected
