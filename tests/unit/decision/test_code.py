"""Code is refused unless it is well-typed, shallow and in range; and windows of the day by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import BATTERY, FIX, GOTO, HOVER, INSPECT, POSITION_X, apply, argument, const, scaled, signal
from reference.naive_code import daytime
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.times import Daytime
from rtshcua.decision.tree import parse, scope_of, slots_read
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, interval, maybe, members, point
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Op
from rtshcua.model.flat.limits import DAY, MAX_VALUE
from virtual.rows import rows

SCOPE = scope_of(flat.POLICY)
INSPECTING = SCOPE.about(flat.CONTRACTS[INSPECT])
T, F, U = TRUE, FALSE, UNKNOWN
YES = apply(Op.LE, const(0), const(0))
BOTH_NUMBERS = "the instruction needs two numbers on the stack"

LARGEST = apply(Op.ADD, scaled(signal(BATTERY), 512), const(512))  # at most 2**62

REFUSED = [
    (apply(Op.ADD, scaled(signal(BATTERY), 512), const(513)), "instruction 3: the number may exceed 64 bits"),
    (apply(Op.LE, scaled(signal(BATTERY), 512), const(513)), "instruction 3: the number may exceed 64 bits"),
    ((), "0 integers; expected 3 for each of 1 to 128 instructions"),
    ((Op.CONST, 1), "2 integers; expected 3 for each of 1 to 128 instructions"),
    (YES * 50, "450 integers; expected 3 for each of 1 to 128 instructions"),
    ((99, 0, 0), "instruction 0: unknown instruction 99"),
    ((4, 0, 0), "instruction 0: unknown instruction 4"),
    ((-1, 0, 0), "instruction 0: unknown instruction -1"),
    (const(1), "the code does not leave exactly one truth value on the stack"),
    (YES + YES, "the code does not leave exactly one truth value on the stack"),
    (YES + const(1), "the code does not leave exactly one truth value on the stack"),
    ((Op.AND, 0, 0), "instruction 0: the instruction needs two truth values on the stack"),
    ((*YES, Op.AND, 0, 0), "instruction 3: the instruction needs two truth values on the stack"),
    (apply(Op.OR, YES, const(1)), "instruction 4: the instruction needs two truth values on the stack"),
    (apply(Op.OR, const(1), YES), "instruction 4: the instruction needs two truth values on the stack"),
    ((Op.NOT, 0, 0), "instruction 0: the instruction needs one truth value on the stack"),
    (apply(Op.NOT, const(1)), "instruction 1: the instruction needs one truth value on the stack"),
    ((Op.LT, 0, 0), f"instruction 0: {BOTH_NUMBERS}"),
    (apply(Op.LT, const(1)), f"instruction 1: {BOTH_NUMBERS}"),
    (apply(Op.EQ, YES, const(1)), f"instruction 4: {BOTH_NUMBERS}"),
    (apply(Op.EQ, const(1), YES), f"instruction 4: {BOTH_NUMBERS}"),
    ((Op.ADD, 0, 0), f"instruction 0: {BOTH_NUMBERS}"),
    (apply(Op.ADD, const(1)), f"instruction 1: {BOTH_NUMBERS}"),
    (apply(Op.SUB, YES, const(1)), f"instruction 4: {BOTH_NUMBERS}"),
    (apply(Op.SUB, const(1), YES), f"instruction 4: {BOTH_NUMBERS}"),
    ((Op.SCALE, 2, 0), "instruction 0: the instruction needs one number on the stack"),
    (scaled(YES, 2), "instruction 3: the instruction needs one number on the stack"),
    (const(MAX_VALUE + 1), f"instruction 0: constant {MAX_VALUE + 1} is out of range"),
    (scaled(const(0), -MAX_VALUE - 1), f"instruction 1: factor {-MAX_VALUE - 1} is out of range"),
    (scaled(const(MAX_VALUE), MAX_VALUE), "instruction 1: the number may exceed 64 bits"),
    (scaled(signal(BATTERY), 1_000), "instruction 1: the number may exceed 64 bits"),
    (scaled(scaled(signal(BATTERY), 500), 2), "instruction 2: the number may exceed 64 bits"),
    (
        apply(Op.LT, scaled(signal(BATTERY), 400), scaled(signal(BATTERY + 1), 400)),
        "instruction 4: the number may exceed 64 bits",
    ),
    (signal(flat.SLOTS), f"instruction 0: there is no slot {flat.SLOTS}"),
    (signal(-1), "instruction 0: there is no slot -1"),
    (signal(POSITION_X), f"instruction 0: slot {POSITION_X} is a position, not a number"),
    (signal(POSITION_X + 1), f"instruction 0: slot {POSITION_X + 1} is a position, not a number"),
    (argument(0), "instruction 0: argument cell 0 is not a number"),
    (argument(9), "instruction 0: argument cell 9 is not a number"),
    ((Op.SIGNAL_IN, BATTERY, 0), f"instruction 0: slot {BATTERY} is not an enumeration"),
    ((Op.SIGNAL_IN, -1, 0), "instruction 0: slot -1 is not an enumeration"),
    ((Op.KNOWN, -1, 0), "instruction 0: there is no slot -1"),
    ((Op.KNOWN, 99, 0), "instruction 0: there is no slot 99"),
    ((Op.KNOWN, FIX, 1), "instruction 0: an unused operand is not 0"),
    ((Op.SIGNAL_IN, FIX, 2), "instruction 0: there is no set 2"),
    ((Op.SIGNAL_IN, FIX, -1), "instruction 0: there is no set -1"),
    ((Op.ARGUMENT_IN, 1, 0), "instruction 0: argument cell 1 is not a choice and no zone"),
    ((Op.ARGUMENT_IN, 0, 2), "instruction 0: there is no set 2"),
    ((Op.POSITION_IN, 6, 0), "instruction 0: there is no zone 6"),
    ((Op.POSITION_IN, -1, 0), "instruction 0: there is no zone -1"),
    ((Op.POSITION_IN, 0, 1), "instruction 0: an unused operand is not 0"),
    ((Op.POSITION_IN_ARGUMENT, 1, 0), "instruction 0: argument cell 1 is not a zone"),
    ((Op.POSITION_IN_ARGUMENT, 0, 1), "instruction 0: there is no table 1"),
    ((Op.ARGUMENT_POINT_IN, 0, 0), "instruction 0: argument cell 0 is not a place"),
    ((Op.TIME_IN, DAY, 0), f"instruction 0: {DAY}..0 us is not a time of day"),
    ((Op.TIME_IN, 0, DAY + 1), f"instruction 0: 0..{DAY + 1} us is not a time of day"),
    ((Op.TIME_IN, -1, 0), "instruction 0: -1..0 us is not a time of day"),
    ((Op.CONST, 1, 1), "instruction 0: an unused operand is not 0"),
    ((*YES, Op.NOT, 0, 1), "instruction 3: an unused operand is not 0"),
    ((*YES, *YES, Op.OR, 7, 0), "instruction 6: an unused operand is not 0"),
    ((*const(1), Op.SCALE, 2, 3), "instruction 1: an unused operand is not 0"),
    ((*const(1), *const(1), Op.ADD, 0, 3), "instruction 2: an unused operand is not 0"),
    ((*const(1), *const(1), Op.EQ, 0, 3), "instruction 2: an unused operand is not 0"),
    (const(1) * (MAX_STACK + 1), f"instruction {MAX_STACK}: more than {MAX_STACK} values on the stack"),
]


@rows(("code", "problem"), REFUSED)
def test_refused(code: tuple[int, ...], problem: str) -> None:
    assert parse(code, INSPECTING) == problem


@rows(
    "code",
    [
        YES,
        (*YES, *(Op.NOT, 0, 0) * (MAX_INSTRUCTIONS - 3)),
        apply(Op.LE, scaled(signal(BATTERY), 500), const(0)),
        apply(Op.GE, signal(FIX), const(3)),
        apply(Op.GE, argument(2), const(1)),
        (Op.ARGUMENT_IN, 2, 0),
        (Op.TIME_IN, 0, DAY),
        apply(Op.LE, LARGEST, const(0)),
        apply(Op.GE, scaled(signal(BATTERY), 512), const(-512)),
        apply(Op.LE, const(-MAX_VALUE), scaled(const(1), -MAX_VALUE)),
        apply(Op.LE, const(MAX_VALUE), scaled(const(1), MAX_VALUE)),
    ],
)
def test_accepted(code: tuple[int, ...]) -> None:
    assert not isinstance(parse(code, INSPECTING), str)


def test_a_stack_that_is_just_deep_enough() -> None:
    code = const(0) * (MAX_STACK - 1)
    for _ in range(MAX_STACK - 2):
        code = (*code, Op.ADD, 0, 0)
    assert not isinstance(parse((*code, *const(0), Op.LE, 0, 0), SCOPE), str)


def test_arguments_need_a_skill_that_has_them() -> None:
    inspect, goto, hover = (flat.CONTRACTS[skill] for skill in (INSPECT, GOTO, HOVER))
    altitude, place = apply(Op.LE, argument(1), const(0)), (Op.ARGUMENT_POINT_IN, 0, 0)
    assert parse(altitude, SCOPE) == "instruction 0: an argument is named outside of a skill"
    assert not isinstance(parse(place, SCOPE.about(goto)), str)
    assert isinstance(parse(place, SCOPE.about(inspect)), str)
    assert not isinstance(parse(altitude, SCOPE.about(inspect, inspect)), str)
    assert parse(altitude, SCOPE.about(inspect, hover)) == "instruction 0: argument cell 1 is not a number"


@given(st.lists(st.integers(-2, 45) | st.integers(), max_size=24))
def test_garbage_is_refused_or_runs(code: list[int]) -> None:
    node = parse(tuple(code), INSPECTING)
    if not isinstance(node, str):
        assert evaluated(node) in range(1, 8)


POLICY = prepare(flat.POLICY)
assert isinstance(POLICY, PreparedPolicy)


def evaluated(node: object, slots: dict[int, Value] | None = None, arguments: dict[int, Value] | None = None) -> int:
    values = [(slots or {}).get(n, point(flat.NOMINAL[n])) for n in range(flat.SLOTS)]
    nominal = {0: flat.BRIDGE, 1: 20_000, 2: 0, 3: 4_000}
    cells = tuple((arguments or {}).get(n, point(nominal[n])) for n in range(4))
    utc = flat.NOW.utc_us
    return build(node, POLICY.tables)(Environment([*values, MISSING], cells, ((utc, utc),), (0, 0)))


B = {BATTERY: interval(2, 5)}


@rows(
    ("code", "slots", "truth"),
    [
        (apply(Op.LE, signal(BATTERY), const(5)), B, T),
        (apply(Op.LE, signal(BATTERY), const(4)), B, T | F),
        (apply(Op.LT, signal(BATTERY), const(2)), B, F),
        (apply(Op.GE, signal(BATTERY), const(2)), B, T),
        (apply(Op.GT, signal(BATTERY), const(4)), B, T | F),
        (apply(Op.GT, signal(BATTERY), const(5)), B, F),
        (apply(Op.EQ, signal(BATTERY), const(5)), B, T | F),
        (apply(Op.EQ, signal(BATTERY), const(6)), B, F),
        (apply(Op.NE, signal(BATTERY), const(1)), B, T),
        (apply(Op.EQ, signal(BATTERY), const(5)), {BATTERY: point(5)}, T),
        (apply(Op.LE, scaled(signal(BATTERY), -2), const(-4)), B, T),
        (apply(Op.LE, scaled(signal(BATTERY), -2), const(-5)), B, T | F),
        (apply(Op.LE, apply(Op.ADD, signal(BATTERY), signal(BATTERY)), const(9)), B, T | F),
        (apply(Op.LE, apply(Op.SUB, signal(BATTERY), signal(BATTERY)), const(0)), B, T),
        (apply(Op.LE, apply(Op.SUB, signal(BATTERY), signal(BATTERY)), const(0)), {BATTERY: MISSING}, U),
        (apply(Op.LE, signal(BATTERY), const(5)), {BATTERY: maybe(interval(2, 5))}, T | U),
        (apply(Op.GE, signal(BATTERY), const(5)), {BATTERY: MISSING}, U),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: members({3, 4})}, T),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: members({3, 4, 5, 6})}, T),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: members({2, 4})}, T | F),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: members({0, 7})}, F),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: interval(3, 6)}, T),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: interval(3, 7)}, T | F),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: interval(0, 2)}, F),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: maybe(members({3}))}, T | U),
        ((Op.SIGNAL_IN, FIX, flat.GOOD_FIX), {FIX: MISSING}, U),
        ((Op.KNOWN, FIX, 0), {FIX: members({0, 7})}, T),
        ((Op.KNOWN, FIX, 0), {FIX: maybe(members({3}))}, T | U),
        ((Op.KNOWN, FIX, 0), {FIX: MISSING}, U),
    ],
)
def test_over_sets(code: tuple[int, ...], slots: dict[int, Value], truth: int) -> None:
    assert evaluated(parse(code, INSPECTING), slots) == truth


@pytest.mark.parametrize(
    ("areas", "truth"),
    [
        (point(flat.BRIDGE), T),
        (point(flat.SCHOOL), F),
        (interval(flat.CITY, flat.BRIDGE), T),
        (interval(flat.CITY, flat.SCHOOL), T | F),
        (members({flat.CITY, flat.SCHOOL}), T | F),
    ],
)
def test_a_set_of_zones_as_argument(areas: Value, truth: int) -> None:
    assert evaluated(parse((Op.POSITION_IN_ARGUMENT, 0, 0), INSPECTING), arguments={0: areas}) == truth


def test_a_set_of_places_as_argument() -> None:
    node = parse((Op.ARGUMENT_POINT_IN, 0, flat.BRIDGE), SCOPE.about(flat.CONTRACTS[GOTO]))
    for x, truth in ((interval(110_000, 190_000), T), (interval(90_000, 110_000), T | F), (interval(0, 9), F)):
        assert evaluated(node, arguments={0: x, 1: interval(-9, 9)}) == truth


def test_slots_read_by_code() -> None:
    code = apply(Op.AND, (Op.SIGNAL_IN, FIX, 0), apply(Op.LE, signal(BATTERY), argument(1)))
    asks = (Op.POSITION_IN, 0, 0)
    vehicle = flat.POLICY.vehicle
    assert slots_read([flat.clause("", code)], vehicle) == (BATTERY, FIX)
    assert slots_read([flat.clause("", asks)], vehicle) == (flat.HEIGHT, POSITION_X, POSITION_X + 1)
    assert slots_read([flat.clause("", asks)], replace(vehicle, position=-1)) == (flat.HEIGHT,)
    assert slots_read([flat.clause("", asks)], replace(vehicle, height=-1)) == (POSITION_X, POSITION_X + 1)


# ------------------------------------------------------------------------------------------------------ daytime

H = flat.H


@rows(
    ("window", "spans", "error", "truth"),
    [
        ((8 * H, 18 * H), [(8 * H, 8 * H)], (0, 0), T),
        ((8 * H, 18 * H), [(8 * H - 1, 8 * H - 1)], (0, 0), F),
        ((8 * H, 18 * H), [(18 * H, 18 * H)], (0, 0), T),
        ((8 * H, 18 * H), [(18 * H + 1, 18 * H + 1)], (0, 0), F),
        ((8 * H, 18 * H), [(8 * H, 8 * H)], (1, 1), U),
        ((8 * H, 18 * H), [(8 * H + 1, 8 * H + 1)], (1, 1), T),
        ((8 * H, 18 * H), [(18 * H + 1, 18 * H + 1)], (1, 1), U),
        ((8 * H, 18 * H), [(18 * H + 2, 18 * H + 2)], (1, 1), F),
        ((8 * H, 18 * H), [(12 * H, 12 * H)], (DAY, DAY), U),
        ((18 * H, 8 * H), [(23 * H, 23 * H)], (0, 0), T),
        ((18 * H, 8 * H), [(12 * H, 12 * H)], (0, 0), F),
        ((18 * H, 8 * H), [(2 * H, 2 * H)], (0, 0), T),
        ((8 * H, 8 * H - 1), [(12 * H, 12 * H)], (DAY, DAY), T),  # the whole day
        ((0, DAY), [(0, DAY)], (0, 0), T),
        ((8 * H, 18 * H), [(9 * H, 17 * H)], (0, 0), T),
        ((8 * H, 18 * H), [(9 * H, 19 * H)], (0, 0), T | F),
        ((8 * H, 18 * H), [(0, 40 * H)], (0, 0), T | F),
        ((8 * H, 18 * H), [(9 * H, 9 * H), (20 * H, 20 * H)], (0, 0), T | F),
        ((8 * H, 18 * H), [(7 * H, 9 * H)], (0, 1), T | F | U),
        ((8 * H, 18 * H), [(33 * H, 33 * H)], (0, 0), T),  # another day
        ((8 * H, 18 * H), [(-12 * H, -12 * H)], (0, 0), T),
    ],
)
def test_daytime(window: tuple[int, int], spans: list[tuple[int, int]], error: tuple[int, int], truth: int) -> None:
    assert Daytime(*window, 0).truth(tuple(spans), error) == truth


TIMES = st.integers(0, 24).map(lambda hours: hours * H)
NEAR = st.tuples(st.integers(-30, 60), st.integers(-3, 3)).map(lambda t: t[0] * H + t[1])


@given(
    TIMES.filter(lambda t: t < DAY),
    TIMES,
    st.sampled_from([-5 * H, 0, 2 * H]),
    NEAR,
    st.sampled_from([0, 1, 2, DAY // 2]),
)
def test_a_moment_by_definition(start: int, end: int, offset: int, utc: int, error: int) -> None:
    (letter,) = daytime(utc, error, offset, start, end)
    assert Daytime(start, end, offset).truth(((utc, utc),), (error, error)) == {"T": T, "F": F, "U": U}[letter]


@given(TIMES.filter(lambda t: t < DAY), TIMES, NEAR, st.integers(0, 30 * H), st.integers(0, 30 * H), st.integers(0, 3))
def test_a_span_holds_its_moments(start: int, end: int, low: int, width: int, within: int, error: int) -> None:
    window = Daytime(start, end, 0)
    moment = low + min(within, width)
    assert window.truth(((moment, moment),), (error, error)) & window.truth(((low, low + width),), (0, 3))
