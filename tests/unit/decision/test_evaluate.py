"""Compiled conditions against the naive interpreter: the same on single situations, sound on sets."""

from random import Random

from hypothesis import assume, given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.naive_code import Leg, TooNear, World, truths
from rtshcua.decision.evaluate import Condition, build
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.tree import parse, scope_of
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Sets, point
from rtshcua.model.flat.situation import Now, State

MONITORS, PHASE = 2, 1
POLICY = prepare(
    replace(
        flat.POLICY,
        monitors=worlds.monitors(Random(1), MONITORS),
        phases=flat.MISSION.phases,
        sets=(*flat.POLICY.sets, (0, PHASE)),
    )
)
assert isinstance(POLICY, PreparedPolicy)


def question(of: Random) -> tuple[tuple[int, ...], tuple[int, ...], Condition]:
    """Code, arguments that are in range, and the compiled condition."""
    skill = of.choice([flat.INSPECT, flat.GOTO])
    contract = flat.CONTRACTS[skill]
    code = worlds.condition(of, contract, depth=3, reach=worlds.Reach(MONITORS, phased=True))
    node = parse(code, scope_of(POLICY.policy).about(contract))
    assert not isinstance(node, str), node
    area = of.randrange(flat.DECLARED)
    arguments = worlds.arguments(of, skill)
    return code, (area, *arguments[1:]) if skill == flat.INSPECT else arguments, build(node, POLICY.tables)


def naive(code: tuple[int, ...], arguments: tuple[int, ...], state: State, now: Now) -> int:
    known = [value[0] if value[2] == 0 else None for value in situation(state, POLICY, now).values]
    x, y, z = known[flat.POSITION_X], known[flat.POSITION_Y], known[flat.HEIGHT]
    at = None if x is None or y is None else (x, y)
    legs: list[Leg] = [(at, at, (0, 0, 0, 0), z, z)]
    said = "".join({TRUE: "T", FALSE: "F", UNKNOWN: "U"}[truth] for truth in situation(state, POLICY, now).monitors)
    about = (POLICY.policy, known, arguments, now.utc_us, now.utc_error_us, legs)
    (letter,) = truths(code, World(*about, monitors=said, phase=PHASE))
    return {"T": TRUE, "F": FALSE, "U": UNKNOWN}[letter]


def compiled(condition: Condition, arguments: tuple[int, ...], sets: Sets) -> int:
    return condition(environment(sets, POLICY, tuple(map(point, arguments)), PHASE))


@settings(max_examples=settings().max_examples * 4)
@given(worlds.CHANCES)
def test_a_single_situation(of: Random) -> None:
    code, arguments, condition = question(of)
    state, now = worlds.state(of, MONITORS), worlds.now(of)
    assert compiled(condition, arguments, situation(state, POLICY, now)) == naive(code, arguments, state, now)


@settings(max_examples=settings().max_examples * 4)
@given(worlds.CHANCES)
def test_sets_hold_the_truth_of_each_of_their_situations(of: Random) -> None:
    code, arguments, condition = question(of)
    sets = worlds.sets(of, MONITORS)
    abstract = compiled(condition, arguments, sets)
    assert abstract in range(1, 8)
    for _ in range(4):
        state, now = worlds.situation(of, sets, MONITORS)
        try:
            truth = naive(code, arguments, state, now)
        except TooNear:
            assume(False)
        assert truth & abstract
