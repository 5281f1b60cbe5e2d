"""Conditions on temporal monitors or the mission's phase: refusals, slots that are read, truths, and validity."""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import STEP, loaded, ready
from reference.flat_case import BATTERY, HEIGHT, HOVER, INSPECT, NOW, WIND, M, S, apply, argument, clause, const
from rtshcua.decision.decide import decide, possible
from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.fallbacks import choose_contingency, choose_fallback, link_admissible
from rtshcua.decision.nearest import nearest
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare
from rtshcua.decision.running_conditions import watch
from rtshcua.decision.situation import is_situation, situation
from rtshcua.decision.tree import CodeScope, MonitorSays, PhaseIn, monitored, parse, scope_of, slots_read
from rtshcua.decision.values import Sets
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.limits import MAX_GAP, MAX_MONITORS, MAX_PHASE_NAMES, MAX_WINDOW
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy, RuleKind
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

T, F, U = 1, 2, 4
FOR, WITHIN, RISING, FALLING = MonitorKind
CALM = clause("wind.speed < 8 m/s", apply(Op.LT, flat.signal(WIND), const(8 * M)))
HIGH = clause("height > 10 m", apply(Op.GT, flat.signal(HEIGHT), const(10 * M)))


def asks(number: int) -> Clause:
    return clause(f"monitor {number}", (Op.MONITOR, number, 0))


def in_phases(members: int) -> Clause:
    return clause(f"phase in set {members}", (Op.PHASE_IN, 0, members))


CALM_FOR_3_S = Monitor(FOR, 3 * S, CALM)
MONITORS = (CALM_FOR_3_S, Monitor(WITHIN, S, asks(0)), Monitor(RISING, 0, HIGH))
NAMES = ("departure", "inspection", "elsewhere")
#: sets 2, 3 and 4: the phases `inspection`; `departure` and `elsewhere`; none
SETS = (*flat.POLICY.sets, (1,), (0, 2), ())
P = replace(flat.POLICY, monitors=MONITORS, phases=NAMES, sets=SETS)

# -------------------------------------------------------------------------------------------------------- code

SCOPE = scope_of(P)
INNER = SCOPE.about(flat.CONTRACTS[INSPECT]).inside_monitor(1)


@rows(
    ("code", "scope", "found"),
    [
        ((Op.MONITOR, 2, 0), SCOPE, MonitorSays(2)),
        ((Op.MONITOR, 3, 0), SCOPE, "instruction 0: there is no monitor 3 here"),
        ((Op.MONITOR, -1, 0), SCOPE, "instruction 0: there is no monitor -1 here"),
        ((Op.MONITOR, 0, 1), SCOPE, "instruction 0: an unused operand is not 0"),
        ((Op.MONITOR, 0, 0), INNER, MonitorSays(0)),
        ((Op.MONITOR, 1, 0), INNER, "instruction 0: there is no monitor 1 here"),
        ((Op.PHASE_IN, 0, 2), SCOPE, PhaseIn(2)),
        ((Op.PHASE_IN, 0, 3), SCOPE, PhaseIn(3)),
        ((Op.PHASE_IN, 0, 4), SCOPE, PhaseIn(4)),
        ((Op.PHASE_IN, 0, 1), SCOPE, "instruction 0: set 1 is not a set of phases"),
        ((Op.PHASE_IN, 0, 5), SCOPE, "instruction 0: there is no set 5"),
        ((Op.PHASE_IN, 0, -1), SCOPE, "instruction 0: there is no set -1"),
        ((Op.PHASE_IN, 1, 2), SCOPE, "instruction 0: an unused operand is not 0"),
        ((Op.PHASE_IN, 0, 2), INNER, "instruction 0: the phase is not available here"),
        (apply(Op.LE, argument(1), const(0)), INNER, "instruction 0: an argument is named outside of a skill"),
        ((Op.MONITOR, 0, 0), scope_of(flat.POLICY), "instruction 0: there is no monitor 0 here"),
    ],
)
def test_code(code: tuple[int, ...], scope: CodeScope, found: object) -> None:
    assert parse(code, scope) == found


def observing(*monitors: Monitor) -> Policy:
    return replace(flat.POLICY, monitors=monitors)


@rows(
    ("policy", "what"),
    [
        (observing(*[CALM_FOR_3_S] * (MAX_MONITORS + 1)), "number of monitors 33 is not in 0..32"),
        (observing(Monitor(4, S, CALM)), "monitor 0: kind 4 is not in 0..3"),
        (observing(Monitor(-1, S, CALM)), "monitor 0: kind -1 is not in 0..3"),
        (observing(Monitor(FOR, 0, CALM)), f"monitor 0: window 0 is not in 1..{MAX_WINDOW}"),
        (observing(Monitor(WITHIN, MAX_WINDOW + 1, CALM)), f"monitor 0: window {MAX_WINDOW + 1} is not in 1.."),
        (observing(Monitor(RISING, 1, CALM)), "monitor 0: window 1 is not in 0..0"),
        (observing(CALM_FOR_3_S, Monitor(FALLING, -1, CALM)), "monitor 1: window -1 is not in 0..0"),
        (observing(Monitor(FOR, S, asks(0))), "monitor 0: instruction 0: there is no monitor 0 here"),
        (observing(Monitor(FOR, S, asks(1)), CALM_FOR_3_S), "monitor 0: instruction 0: there is no monitor 1 here"),
        (
            replace(observing(Monitor(FOR, S, in_phases(2))), phases=NAMES, sets=SETS),
            "monitor 0: instruction 0: the phase is not available here",
        ),
        (
            observing(Monitor(FOR, S, clause("altitude", apply(Op.LE, argument(1), const(0))))),
            "monitor 0: instruction 0: an argument is named outside of a skill",
        ),
        (
            replace(flat.POLICY, phases=tuple(map(str, range(MAX_PHASE_NAMES + 1)))),
            "number of phase names 65 is not in 0..64",
        ),
        (replace(flat.POLICY, phases=("a", "b", "a")), "two phases have the same name"),
        (
            replace(flat.POLICY, rules=(flat.rule(RuleKind.PERMIT, when=asks(0)),)),
            "rule 0: when: instruction 0: there is no monitor 0 here",
        ),
    ],
)
def test_a_malformed_policy(policy: Policy, what: str) -> None:
    found = prepare(policy)
    assert isinstance(found, Refusal)
    assert found.text.startswith(what)


def test_the_largest_monitors_are_well_formed() -> None:
    monitors = (Monitor(FOR, 1, CALM), Monitor(WITHIN, MAX_WINDOW, CALM), Monitor(FALLING, 0, CALM))
    assert isinstance(prepare(observing(*monitors, *[CALM_FOR_3_S] * (MAX_MONITORS - 3))), PreparedPolicy)


# ------------------------------------------------------------------------------------------------------- reads


def test_a_clause_reads_what_its_monitors_look_at() -> None:
    vehicle = P.vehicle
    assert slots_read([asks(1)], vehicle, MONITORS) == (WIND,)
    assert slots_read([asks(1), asks(2)], vehicle, MONITORS) == (HEIGHT, WIND)
    doubled = clause("", apply(Op.AND, (Op.MONITOR, 0, 0), (Op.MONITOR, 0, 0)))
    chain = (CALM_FOR_3_S, *(Monitor(FOR, S, replace(doubled, code=_at(doubled, n))) for n in range(31)))
    assert slots_read([asks(31)], vehicle, chain) == (WIND,), "each is looked at once"
    assert monitored([CALM, asks(0)])
    assert not monitored([CALM, clause("", apply(Op.GT, flat.signal(0), const(Op.MONITOR)))])


def _at(when: Clause, number: int) -> tuple[int, ...]:
    return (Op.MONITOR, number, 0) * 2 + when.code[-3:]


def test_the_reads_of_a_contract_count_its_monitors() -> None:
    def hovering(reads: tuple[int, ...]) -> PreparedPolicy | Refusal:
        hover = replace(P.contracts[HOVER], assume=(asks(0),), reads=reads)
        return prepare(replace(P, contracts=(*P.contracts[:HOVER], hover, *P.contracts[HOVER + 1 :])))

    assert hovering((flat.FIX,)) == Refusal("malformed", "skill `hover`: `reads` differs from what the clauses read")
    assert isinstance(hovering((WIND, flat.FIX)), PreparedPolicy)


# ---------------------------------------------------------------------------------------------------- decisions


def requiring(*clauses: Clause, skill: int = INSPECT, policy: Policy = P, **fields: Any) -> PreparedPolicy:
    """The policy, with further preconditions of a skill."""
    contract = policy.contracts[skill]
    require = (*contract.require, *clauses)
    reads = slots_read((*require, *contract.assume, *contract.maintain), policy.vehicle, policy.monitors)
    changed = replace(contract, require=require, reads=reads)
    contracts = tuple(changed if n == skill else other for n, other in enumerate(policy.contracts))
    return loaded(replace(policy, contracts=contracts, **fields))


def step(policy: PreparedPolicy, phase: int = flat.INSPECTION) -> PreparedInvocation:
    contract = policy.policy.contracts[INSPECT]
    return ready(replace(STEP, contract=contract, phase=phase), policy)


def asked(policy: PreparedPolicy, said: tuple[int, ...] = (T, T, T), **state: Any) -> Decision:
    invocation = step(policy)
    at = replace(flat.state(**state), monitors=said)
    decision = decide(invocation, at, policy, flat.context(), NOW)
    same = possible(invocation, situation(at, policy, NOW), policy, flat.context())
    assert same == {(decision.outcome, decision.reason, decision.target)}
    return decision


@rows(
    ("said", "outcome", "reason"),
    [
        ((T, F, U), Outcome.ALLOW, Reason.ADMITTED),
        ((F, T, T), Outcome.FALLBACK, Reason.STATE_VIOLATED),
        ((U, T, T), Outcome.DEFER, Reason.STATE_UNKNOWN),
        # too few, too many, or invalid truths are all ignored
        ((), Outcome.DEFER, Reason.STATE_UNKNOWN),
        ((T, T), Outcome.DEFER, Reason.STATE_UNKNOWN),
        ((T, T, T, T), Outcome.DEFER, Reason.STATE_UNKNOWN),
        ((T, T, 0), Outcome.DEFER, Reason.STATE_UNKNOWN),
        ((T, T, T | F), Outcome.DEFER, Reason.STATE_UNKNOWN),
        ((T, T, 8), Outcome.DEFER, Reason.STATE_UNKNOWN),
    ],
)
def test_monitor_truth_decides(said: tuple[int, ...], outcome: Outcome, reason: Reason) -> None:
    decision = asked(requiring(asks(0)), said)
    assert (decision.outcome, decision.reason) == (outcome, reason)
    if reason is not Reason.ADMITTED:
        assert decision.clause == asks(0)


def test_permit_and_forbid_rules_follow_a_monitor() -> None:
    def ruled(kind: RuleKind, said: int) -> Reason:
        rules = (flat.rule(RuleKind.PERMIT),) if kind == RuleKind.FORBID else ()
        policy = loaded(replace(P, rules=(*rules, flat.rule(kind, when=asks(0)))))
        return asked(policy, (said, T, T)).reason

    assert [ruled(RuleKind.PERMIT, said) for said in (T, F, U)] == [
        Reason.ADMITTED,
        Reason.OUT_OF_SCOPE,
        Reason.OUT_OF_SCOPE,
    ]
    assert [ruled(RuleKind.FORBID, said) for said in (T, F, U)] == [
        Reason.FORBIDDEN,
        Reason.ADMITTED,
        Reason.FORBID_UNKNOWN,
    ]


def test_a_running_skill_is_watched_through_its_monitors() -> None:
    contract = replace(P.contracts[HOVER], assume=(asks(0),), reads=(WIND, flat.FIX))
    policy = loaded(replace(P, contracts=(*P.contracts[:HOVER], contract, *P.contracts[HOVER + 1 :])))
    hover = flat.invocation(0, 0, HOVER, flat.Plan(0, (), 0, 0), contract=contract)
    for said, broken in (((T, T, T), []), ((F, T, T), [F]), ((U, T, T), [U]), ((T,), [U])):
        state = replace(flat.state(), monitors=said)
        assert [one.truth for one in watch(ready(hover, policy), state, policy, NOW)] == broken


def test_possible_outcomes_over_monitor_truths() -> None:
    policy = requiring(asks(0))
    invocation, one = step(policy), situation(replace(flat.state(), monitors=(T, T, T)), policy, NOW)

    def outcomes(monitors: tuple[int, ...]) -> set[Outcome]:
        sets = one._replace(monitors=monitors)
        return {found.outcome for found in possible(invocation, sets, policy, flat.context())}

    assert outcomes((T, 7, 7)) == {Outcome.ALLOW}
    assert outcomes((F | U, 7, 7)) == {Outcome.FALLBACK, Outcome.DEFER}
    assert outcomes((T | F, T, T)) == {Outcome.FALLBACK, Outcome.ALLOW}
    anything = {Outcome.ALLOW, Outcome.FALLBACK, Outcome.DEFER}
    assert outcomes((7, 7, 7)) == outcomes(()) == outcomes((T,)) == anything


def test_a_single_situation_says_one_thing_of_each_monitor() -> None:
    policy = loaded(P)
    one = situation(replace(flat.state(), monitors=(T, F, U)), policy, NOW)
    assert is_situation(one, policy)
    for monitors in ((), (T, F), (T, F, U | T)):
        assert not is_situation(one._replace(monitors=monitors), policy)
    bare: Sets = situation(flat.state(), loaded(), NOW)
    assert is_situation(bare, loaded())


# ------------------------------------------------------------------------------------------- how long it holds


def test_admission_expires_with_its_observation() -> None:
    """Deadline 2 s; the battery, the wind and the rest are fresh for 10 s and more."""
    signals = tuple(replace(signal, stale_us=10 * S) for signal in P.signals)
    policy = requiring(policy=replace(P, signals=signals))
    until_us = NOW.monotonic_us + 1_900_000
    assert asked(policy).valid_until_us == until_us
    policy = requiring(asks(0), policy=replace(P, signals=signals))
    assert asked(policy).valid_until_us == NOW.monotonic_us + MAX_GAP
    ruled = requiring(policy=replace(P, signals=signals), rules=(flat.rule(RuleKind.PERMIT, when=asks(0)),))
    assert asked(ruled).valid_until_us == NOW.monotonic_us + MAX_GAP


def test_an_admission_ends_when_what_a_monitor_looked_at_is_stale() -> None:
    """Only monitor 2 reads the obstacle's distance."""
    near = clause("obstacle", apply(Op.GT, flat.signal(flat.OBSTACLE), const(0)))
    monitors = (CALM_FOR_3_S, Monitor(WITHIN, S, near), Monitor(RISING, 0, asks(1)))
    contract = replace(P.contracts[INSPECT], assume=(), maintain=())
    contracts = (*P.contracts[:INSPECT], contract, *P.contracts[INSPECT + 1 :])
    plain = replace(P, monitors=monitors, contracts=contracts)
    ages = {flat.OBSTACLE: S - 100_000}
    unread = asked(requiring(policy=plain), ages=ages).valid_until_us
    assert unread == NOW.monotonic_us + S // 2 - 10_000
    assert asked(requiring(asks(2), policy=plain), ages=ages).valid_until_us == NOW.monotonic_us + 100_000


# ------------------------------------------------------------------------------------------------- explanations


def offered(policy: PreparedPolicy, said: tuple[int, ...], **state: Any) -> list[tuple[str, int]]:
    at = replace(flat.state(**state), monitors=said)
    invocation = step(policy)
    decision = decide(invocation, at, policy, flat.context(), NOW)
    assert decision.outcome is Outcome.FALLBACK
    return [(one.subject, one.value) for one in nearest(decision, invocation, at, policy, NOW)]


def test_no_value_is_offered_for_what_a_monitor_says() -> None:
    assert offered(requiring(asks(0)), (F, T, T)) == []
    assert offered(requiring(clause("", (*asks(0).code, Op.NOT, 0, 0))), (T, T, T)) == []


def test_nearest_change_is_offered_beside_a_monitor() -> None:
    charge = apply(Op.GT, flat.signal(BATTERY), const(9_500))
    either = requiring(clause("", apply(Op.OR, asks(0).code, charge)))
    both = requiring(clause("", apply(Op.AND, asks(0).code, charge)))
    assert offered(either, (F, T, T)) == [("battery", 9_501)]
    assert offered(both, (T, T, T)) == [("battery", 9_501)]
    assert offered(both, (F, T, T)) == []


def test_an_offer_is_made_in_the_phase_of_the_invocation() -> None:
    charge = apply(Op.GT, flat.signal(BATTERY), const(9_500))
    assert offered(requiring(clause("", apply(Op.AND, in_phases(2).code, charge))), (T, T, T)) == [("battery", 9_501)]
    assert offered(requiring(in_phases(3)), (T, T, T)) == []


# ------------------------------------------------------------------------------------------------------- phases


@pytest.mark.parametrize(
    ("phase", "number"),
    [(flat.DEPARTURE, 0), (flat.INSPECTION, 1), (flat.RECOVERY, NO_PHASE), (-1, NO_PHASE), (3, NO_PHASE)],
)
def test_the_phase_of_an_invocation(phase: int, number: int) -> None:
    assert step(loaded(P), phase).phase == number


@pytest.mark.parametrize(("members", "admitted"), [(2, True), (3, False), (4, False)])
def test_a_condition_on_the_phase(members: int, admitted: bool) -> None:
    decision = asked(requiring(in_phases(members)))
    assert (decision.outcome is Outcome.ALLOW) == admitted
    negated = clause("", (*in_phases(members).code, Op.NOT, 0, 0))
    assert (asked(requiring(negated)).outcome is Outcome.ALLOW) != admitted


def test_links_use_phase_of_step_and_contingency_has_none() -> None:
    """Hovering is for the inspection only."""
    policy = requiring(in_phases(2), skill=HOVER)
    hover = policy.policy.contracts[HOVER]
    state = replace(flat.state(), monitors=(T, T, T))
    for phase, first in ((flat.INSPECTION, 0), (flat.DEPARTURE, 1), (flat.RECOVERY, 1)):
        invocation = step(policy, phase)
        chosen = choose_fallback(invocation, state, policy, NOW)
        assert chosen is not None
        assert chosen.index == first
        link = invocation.chain[0]
        assert policy.policy.contracts[link.link.skill] == hover
        assert link_admissible(link, state, policy, NOW, invocation.phase) == (first == 0)
    contingency = choose_contingency(state, policy, NOW)
    assert contingency is not None
    assert contingency.index == 1
    assert not link_admissible(policy.contingency[0], state, policy, NOW)


def test_the_target_of_a_degrade_rule_is_judged_in_the_phase_of_the_step() -> None:
    rules = (flat.rule(RuleKind.PERMIT), flat.rule(RuleKind.DEGRADE, when=in_phases(2), target=flat.link(HOVER)))
    policy = requiring(in_phases(2), skill=HOVER, rules=rules)
    decision = asked(policy)
    assert (decision.reason, decision.target) == (Reason.DEGRADED, flat.link(HOVER))


def test_the_phase_does_not_depend_on_what_a_request_says() -> None:
    """The invocation's own phase counts; the mission's current phase only decides whether the step is due."""
    invocation = step(requiring(in_phases(2)))
    state = replace(flat.state(), monitors=(T, T, T))
    context = flat.context(phase=flat.DEPARTURE)
    assert decide(invocation, state, invocation.policy, context, NOW).reason is Reason.PHASE_NOT_REACHED
