"""The nearest passing changes: by hand, and tried in random worlds."""

from random import Random
from typing import Any

from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.asking import POLICY, STEP, ask, loaded, ready, with_contract
from reference.flat_case import BATTERY, FIX, GOTO, HEIGHT, INSPECT, NOW, POSITION_X, WIND, M, clause, rule
from rtshcua.decision.decide import decide
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.nearest import ChangeSearch, NearestChange, nearest, nearest_in
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.situation import situation
from rtshcua.decision.tree import parse, scope_of
from rtshcua.decision.values import MISSING, point
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import PLACE, MotionKind, Parameter
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.mission import Invocation, Plan
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows


def found(
    invocation: Invocation = STEP, values: dict[int, int | None] | None = None, policy: Any = POLICY, **given: Any
) -> tuple[Reason, list[tuple[Any, ...]]]:
    decision = ask(invocation, values=values, policy=policy, **given)
    answers = nearest(decision, ready(invocation, policy), flat.state(values), policy, given.get("now", NOW))
    return decision.reason, [tuple(answer) for answer in answers]


def inspect(area: int = flat.BRIDGE, altitude: int = 20 * M, pattern: int = 0) -> Invocation:
    return replace(STEP, arguments=(area, altitude, pattern, 4 * M), plan=replace(STEP.plan, altitude=altitude))


NIGHT = replace(NOW, utc_us=flat.ISSUED - 10 * flat.H)  # 07:06:40 local time
EARLY = replace(STEP, issued_at_us=NIGHT.utc_us - flat.S)
AT_NIGHT = replace(NOW, utc_us=flat.ISSUED + 4 * flat.H)  # 21:06:40
LATE = replace(STEP, issued_at_us=AT_NIGHT.utc_us - flat.S)


@rows(
    ("given", "reason", "answers"),
    [
        ({}, Reason.ADMITTED, []),
        ({"invocation": inspect(altitude=40 * M)}, Reason.OUT_OF_SCOPE, [("altitude", "altitude", 30 * M, ())]),
        (
            {"invocation": inspect(area=flat.CITY, altitude=40 * M)},
            Reason.OUT_OF_SCOPE,
            [("area", "", flat.BRIDGE, ("bridge_a",)), ("altitude", "altitude", 30 * M, ())],
        ),
        ({"invocation": EARLY, "now": NIGHT}, Reason.OUT_OF_SCOPE, [("local time", "daytime", 8 * flat.H, ())]),
        ({"invocation": LATE, "now": AT_NIGHT}, Reason.OUT_OF_SCOPE, [("local time", "daytime", 18 * flat.H, ())]),
        ({"invocation": inspect(altitude=70 * M)}, Reason.ARGUMENT_RANGE, [("altitude", "altitude", 60 * M, ())]),
        ({"invocation": inspect(altitude=4 * M)}, Reason.ARGUMENT_RANGE, [("altitude", "altitude", 5 * M, ())]),
        ({"values": {BATTERY: 3_000}}, Reason.STATE_VIOLATED, [("battery", "ratio", 3_501, ())]),
        ({"values": {WIND: 12 * M}}, Reason.STATE_VIOLATED, [("wind.speed", "speed", 10 * M - 1, ())]),
        (
            {"values": {FIX: 2}},
            Reason.STATE_VIOLATED,
            [("gps.fix", "GPS_FIX_TYPE", 3, ("fix_3d",))],
        ),
        ({"values": {FIX: None}}, Reason.STATE_UNKNOWN, []),
        ({"values": {HEIGHT: 40 * M}}, Reason.INVARIANT, [("altitude", "altitude", 35 * M, ())]),
        ({"values": {POSITION_X: 0}}, Reason.INVARIANT, []),
        ({"binding": b""}, Reason.BINDING_MISMATCH, []),
        ({"released_us": 0}, Reason.NO_SLACK, []),
    ],
)
def test_nearest(given: dict[str, Any], reason: Reason, answers: list[Any]) -> None:
    assert found(**given) == (reason, answers)


def goto(x: int = 200 * M) -> Invocation:
    return flat.invocation(1, 1, GOTO, Plan(MotionKind.FLY, (x, 0), 20 * M, 0), x, 0, 20 * M)


def test_degrade_and_energy() -> None:
    assert found(goto(), {BATTERY: 2_400}) == (Reason.DEGRADED, [("battery", "ratio", 2_500, ())])
    assert found(goto(), {BATTERY: 1_600}) == (Reason.ENERGY, [("battery", "ratio", 1_655, ())])


def test_nearest_change_never_exceeds_a_full_battery() -> None:
    policy, contract = with_contract(GOTO, energy=9_000)
    assert found(replace(goto(), contract=contract), {BATTERY: 10_000}, policy) == (Reason.ENERGY, [])


def test_speed() -> None:
    slow = loaded(replace(flat.POLICY, vehicle=replace(flat.POLICY.vehicle, speed=3 * M)))
    assert found(STEP, policy=slow) == (Reason.ENVELOPE, [("speed", "speed", 3 * M, ())])
    slower = loaded(replace(flat.POLICY, vehicle=replace(flat.POLICY.vehicle, speed=999)))
    assert found(STEP, policy=slower) == (Reason.ENVELOPE, [])  # the skill flies at 1 m/s at least


def test_a_place_has_no_nearest() -> None:
    via = Parameter("via", PLACE, "", 3, 0, 0, ())
    policy, contract = with_contract(GOTO, parameters=(*flat.CONTRACTS[GOTO].parameters, via), fallback=())
    beyond = replace(goto(), contract=contract, arguments=(*goto().arguments, 0, 1 << 30))
    assert found(beyond, policy=policy) == (Reason.ARGUMENT_RANGE, [])
    far = replace(goto(), arguments=((1 << 29), 0, 20 * M), plan=replace(goto().plan, path=(1 << 29, 0)))
    assert found(far) == (Reason.AIRSPACE, [])


def below(value: int) -> Any:
    return clause("altitude <= ...", flat.apply(Op.LE, flat.argument(1), flat.const(value)))


def test_nearest_change_is_that_of_the_closest_permit() -> None:
    both = clause("", flat.apply(Op.AND, below(9 * M).code, flat.apply(Op.GE, flat.signal(BATTERY), flat.const(9_500))))
    rules = (
        rule(RuleKind.PERMIT, INSPECT, when=both),
        rule(RuleKind.PERMIT, INSPECT, when=below(8 * M)),
        rule(RuleKind.PERMIT, INSPECT, when=below(1 * M)),  # the skill flies at 5 m at least
    )
    policy = loaded(replace(flat.POLICY, rules=rules))
    assert found(policy=policy) == (Reason.OUT_OF_SCOPE, [("altitude", "altitude", 8 * M, ())])


def test_forbidden() -> None:
    permit = rule(RuleKind.PERMIT)
    low = rule(RuleKind.FORBID, INSPECT, when=below(25 * M))
    policy = loaded(replace(flat.POLICY, rules=(permit, low)))
    assert found(policy=policy) == (Reason.FORBIDDEN, [("altitude", "altitude", 25 * M + 1, ())])
    always = loaded(replace(flat.POLICY, rules=(permit, rule(RuleKind.FORBID, INSPECT))))
    assert found(policy=always) == (Reason.FORBIDDEN, [])


# --------------------------------------------------------------------------------------------------- conditions

SCOPE = scope_of(flat.POLICY).about(flat.CONTRACTS[INSPECT])
A, N, SIG = flat.argument, flat.const, flat.signal
FALSE_NOW = flat.apply(Op.LT, SIG(WIND), N(0))
TIME = (Op.TIME_IN, 1 * flat.H, 2 * flat.H)


def changes(
    code: tuple[int, ...], goal: bool = True, values: dict[int, int | None] | None = None, signals_only: bool = False
) -> Any:
    node = parse(code, SCOPE)
    assert not isinstance(node, str), node
    sets = situation(flat.state(values), POLICY, NOW)
    at = Environment([*sets.values, MISSING], tuple(map(point, STEP.arguments)), sets.utc_us, sets.utc_error_us)
    return ChangeSearch(at, POLICY.tables, signals_only=signals_only).find(node, goal)


def bounds(code: tuple[int, ...], goal: bool = True, **given: Any) -> Any:
    answer = changes(code, goal, **given)
    return answer and [
        (c.argument, c.at, c.low if c.low > -(1 << 52) else None, c.high if c.high < 1 << 52 else None) for c in answer
    ]


def test_signals_only_search_changes_the_signal() -> None:
    code = flat.apply(Op.LE, SIG(WIND), flat.apply(Op.SUB, A(1), N(19_000)))  # altitude is 20 m
    assert bounds(code) == [(True, 1, 23_000, None)]
    assert bounds(code, signals_only=True) == [(False, WIND, None, 1_000)]


@rows(
    ("code", "goal", "answer"),
    [
        (flat.apply(Op.LE, A(1), N(30)), True, [(True, 1, None, 30)]),
        (flat.apply(Op.GE, A(1), N(30)), False, [(True, 1, None, 29)]),
        (flat.apply(Op.LE, flat.scaled(A(1), 3), N(100)), True, [(True, 1, None, 33)]),
        (flat.apply(Op.GE, flat.scaled(A(1), 3), N(100_000)), True, [(True, 1, 33_334, None)]),
        (flat.apply(Op.LE, flat.scaled(A(1), -3), N(-100_000)), True, [(True, 1, 33_334, None)]),
        (flat.apply(Op.GE, flat.scaled(A(1), -3), N(-100)), True, [(True, 1, None, 33)]),
        (flat.apply(Op.LE, SIG(WIND), flat.apply(Op.SUB, A(1), N(19_000))), True, [(True, 1, 23_000, None)]),
        (flat.apply(Op.EQ, A(1), N(7)), True, [(True, 1, 7, 7)]),
        (flat.apply(Op.EQ, flat.scaled(A(1), 2), N(7)), True, None),
        (flat.apply(Op.NE, A(1), N(20_000)), True, None),
        (flat.apply(Op.EQ, N(1), N(2)), True, None),
        (flat.apply(Op.LE, N(2), N(1)), True, None),
        (flat.apply(Op.LE, flat.scaled(A(1), 0), N(-1)), True, None),
        ((Op.POSITION_IN, flat.SCHOOL, 0), True, None),
        ((Op.ARGUMENT_IN, 0, flat.IN_BRIDGE), False, None),
        (TIME, True, [(False, None, 1 * flat.H, 2 * flat.H)]),
        ((*TIME, Op.NOT, 0, 0), True, ()),
        ((Op.TIME_IN, 1 * flat.H, 20 * flat.H, Op.NOT, 0, 0), True, None),
        (flat.apply(Op.AND, FALSE_NOW, TIME), True, [(False, WIND, None, -1), (False, None, 1 * flat.H, 2 * flat.H)]),
        (flat.apply(Op.OR, FALSE_NOW, (Op.POSITION_IN, flat.SCHOOL, 0)), True, [(False, WIND, None, -1)]),
        (flat.apply(Op.OR, (Op.POSITION_IN, flat.SCHOOL, 0), (Op.POSITION_IN, flat.SCHOOL, 0)), True, None),
        (flat.apply(Op.AND, (Op.POSITION_IN, flat.SCHOOL, 0), FALSE_NOW), True, None),
        # one subject, two bounds
        (flat.apply(Op.AND, flat.apply(Op.LE, A(1), N(9)), flat.apply(Op.LE, A(1), N(5))), True, [(True, 1, None, 5)]),
        (flat.apply(Op.AND, flat.apply(Op.LE, A(1), N(9)), flat.apply(Op.EQ, A(1), N(11))), True, None),
        (flat.apply(Op.AND, TIME, (Op.TIME_IN, 3 * flat.H, 4 * flat.H)), True, None),
        # not (a and b): one of the two changes suffices
        (
            (*flat.apply(Op.AND, flat.apply(Op.GE, A(1), N(9)), flat.apply(Op.GE, SIG(WIND), N(0))), Op.NOT, 0, 0),
            True,
            [(True, 1, None, 8)],
        ),
        (
            (*flat.apply(Op.OR, flat.apply(Op.GE, A(1), N(9)), flat.apply(Op.GE, SIG(WIND), N(0))), Op.NOT, 0, 0),
            True,
            [(True, 1, None, 8), (False, WIND, None, -1)],
        ),
    ],
)
def test_changes(code: tuple[int, ...], goal: bool, answer: Any) -> None:
    assert bounds(code, goal) == answer


def test_sets_of_choices_are_cut() -> None:
    both = flat.apply(Op.AND, (Op.SIGNAL_IN, FIX, flat.GOOD_FIX), (Op.SIGNAL_IN, FIX, flat.IN_BRIDGE))
    assert changes(both, values={FIX: 0}) is None
    same = flat.apply(Op.AND, (Op.SIGNAL_IN, FIX, flat.GOOD_FIX), (Op.SIGNAL_IN, FIX, flat.GOOD_FIX))
    assert changes(same, values={FIX: 0}) == (NearestChange(False, FIX, 0, 0, frozenset({3, 4, 5, 6})),)
    mixed = flat.apply(Op.AND, (Op.SIGNAL_IN, FIX, flat.GOOD_FIX), flat.apply(Op.GE, SIG(FIX), N(3)))
    assert changes(mixed, values={FIX: 0}) is None


def test_missing_term_gives_no_change() -> None:
    code = flat.apply(Op.LE, flat.apply(Op.ADD, A(1), SIG(WIND)), N(5))
    assert changes(code, values={WIND: None}) is None


@rows(
    ("change", "value", "answer"),
    [
        (NearestChange(False, 0, 5, 9, None), point(7), 9),
        (NearestChange(False, 0, 5, 9, None), point(3), 5),
        (NearestChange(False, 0, 5, 9, None), point(11), 9),
        (NearestChange(False, 0, 5, (1 << 53) - 1, None), MISSING, 5),
        (NearestChange(False, 0, -((1 << 53) - 1), 9, None), MISSING, 9),
        (NearestChange(False, None, 100, 200, None), point(50), 100),
        (NearestChange(False, None, 100, 200, None), point(250), 200),
        (NearestChange(False, None, 100, 200, None), point(DAY - 10), 100),
    ],
)
def test_nearest_allowed_value(change: NearestChange, value: Any, answer: int) -> None:
    assert nearest_in(change, value) == answer


@settings(max_examples=settings().max_examples * 2)
@given(worlds.CHANCES)
def test_made_together_the_changes_help(of: Random) -> None:
    """For any condition of the permit: an invocation and a state that are changed as offered are permitted."""
    when = clause("", worlds.condition(of, flat.CONTRACTS[INSPECT], depth=3))
    policy = loaded(replace(flat.POLICY, rules=(rule(RuleKind.PERMIT, INSPECT, when=when),)))
    now, state = replace(NOW, utc_error_us=0), worlds.state(of)
    arguments = [flat.BRIDGE, *worlds.arguments(of, INSPECT)[1:]]

    def decided() -> tuple[Decision, PreparedInvocation]:
        plan = replace(STEP.plan, altitude=arguments[1], speed=arguments[3])
        issued = now.utc_us - flat.S
        invocation = ready(replace(STEP, arguments=tuple(arguments), plan=plan, issued_at_us=issued), policy)
        return decide(invocation, state, policy, flat.context(), now), invocation

    decision, invocation = decided()
    answers = nearest(decision, invocation, state, policy, now) if decision.reason is Reason.OUT_OF_SCOPE else ()
    if not answers:
        return
    names = {p.name: p.cell for p in flat.CONTRACTS[INSPECT].parameters}
    slots = {s.name: s.slot for s in flat.SIGNALS}
    for answer in answers:
        if answer.subject in names:
            arguments[names[answer.subject]] = answer.value
        elif answer.subject in slots:
            at = slots[answer.subject]
            state = flat.State(
                (*state.values[:at], answer.value, *state.values[at + 1 :]),
                (*state.ages[:at], 0, *state.ages[at + 1 :]),
            )
        else:
            now = replace(now, utc_us=answer.value + 100 * DAY - flat.POLICY.vehicle.utc_offset_us)
    assert decided()[0].step > 3


def test_change_that_breaks_another_part_is_not_offered() -> None:
    """The pattern should be 1 or 2 for the one part, and may not be 2 for the other."""
    some = clause("", flat.apply(Op.AND, flat.apply(Op.GE, A(2), N(1)), flat.apply(Op.NE, A(2), N(1))))
    policy = loaded(replace(flat.POLICY, rules=(rule(RuleKind.PERMIT, INSPECT, when=some),)))
    assert found(policy=policy) == (Reason.OUT_OF_SCOPE, [("pattern", "", 2, ("orbit",))])
    none = clause("", flat.apply(Op.AND, some.code, flat.apply(Op.NE, A(2), N(2))))
    policy = loaded(replace(flat.POLICY, rules=(rule(RuleKind.PERMIT, INSPECT, when=none),)))
    assert found(policy=policy) == (Reason.OUT_OF_SCOPE, [])


def test_an_ordinal_is_offered_by_its_names() -> None:
    code = flat.apply(Op.GE, A(2), N(1))
    policy = loaded(replace(flat.POLICY, rules=(rule(RuleKind.PERMIT, INSPECT, when=clause("", code)),)))
    assert found(policy=policy) == (Reason.OUT_OF_SCOPE, [("pattern", "", 1, ("perimeter", "orbit"))])
    code = flat.apply(Op.GE, A(2), N(7))
    policy = loaded(replace(flat.POLICY, rules=(rule(RuleKind.PERMIT, INSPECT, when=clause("", code)),)))
    assert found(policy=policy) == (Reason.OUT_OF_SCOPE, [])


def test_the_outcome_of_an_offer_is_admission() -> None:
    decision = ask(inspect(altitude=40 * M))
    (offer,) = nearest(decision, ready(inspect(altitude=40 * M), POLICY), flat.state(), POLICY, NOW)
    assert ask(inspect(altitude=offer.value), values={HEIGHT: offer.value}).outcome is Outcome.ALLOW
