"""Bounds of conditions contain every situation, and the alternatives are equivalent to the condition."""

from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, Tables, build
from rtshcua.decision.times import LocalTime
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Truth, Value, point
from rtshcua.decision.zones import PreparedZone, WellKnown
from rtshcua.ground.analysis.extent import PHASE, Bounds, Conjunction, EnclosingBoxes, Extents, alternatives
from rtshcua.model.flat.zone import AREA, CIRCLE, POLYGON, Zone

ZONES = (
    Zone("round", CIRCLE, -10, 10, (3, 3, 7)),
    Zone("square", POLYGON, -10, 10, (0, 0, 4, 0, 4, 4, 0, 4)),
    Zone("ring", AREA, -10, 10, (2, 4, 4, 0, 0, 9, 0, 9, 9, 0, 9, 2, 2, 2, 6, 6, 6, 6, 2)),
)
TABLES = Tables(
    tuple(PreparedZone(number, zone) for number, zone in enumerate(ZONES)),
    (),
    (frozenset((1, 3)), frozenset()),
    WellKnown(2, 3, 4, 4, 4, 4, 4),
    LocalTime(0),
)
SMALL = st.integers(-3, 9)
TERMS = st.lists(
    st.builds(tree.LinearTerm, st.booleans(), st.integers(0, 1), st.integers(-3, 3)),
    max_size=2,
    unique_by=lambda term: term[:2],
).map(tuple)
ATOMS = st.one_of(
    st.builds(tree.AtMost, TERMS, SMALL),
    st.builds(tree.Equal, TERMS, SMALL),
    st.builds(tree.Member, st.booleans(), st.integers(0, 1), st.integers(0, 1)),
    st.builds(tree.PhaseIn, st.integers(0, 1)),
    st.builds(tree.PointInside, st.just(0), st.integers(0, 2)),
    st.builds(tree.InsideZone, st.integers(0, 2)),
    st.builds(tree.SlotKnown, st.integers(0, 1)),
)
NODES = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.builds(tree.Both, inner, inner), st.builds(tree.Either, inner, inner), st.builds(tree.Negation, inner)
    ),
    max_leaves=6,
)
ARGUMENT = SMALL.map(point)
SLOT = st.one_of(SMALL.map(point), st.just(MISSING))
SITUATIONS = st.tuples(
    st.tuples(ARGUMENT, ARGUMENT),
    st.tuples(SLOT, SLOT, SLOT, SLOT, st.just(point(0)), st.just(MISSING)),
    st.integers(-1, 3),
)


def environment(situation: tuple[tuple[Value, ...], tuple[Value, ...], int]) -> Environment:
    arguments, slots, phase = situation
    return Environment(slots, arguments, ((0, 0),), (0, 0), None, (), phase)


def kept(bounds: Bounds, at: Environment) -> Truth:
    truth = TRUE
    for cell, (low, high) in bounds.items():
        value = point(at.phase) if cell == PHASE else (at.arguments if cell[0] else at.slots)[cell[1]]
        if value[2]:
            truth = UNKNOWN if truth == TRUE else truth
        elif not low <= value[0] <= high:
            truth = FALSE
    return truth


def held(each: Conjunction, at: Environment) -> Truth:
    truths = {kept(each.bounds, at), *(build(other.node, TABLES)(at) for other in each.others)}
    return FALSE if FALSE in truths else UNKNOWN if UNKNOWN in truths else TRUE


@settings(max_examples=settings().max_examples * 4)
@given(NODES, SITUATIONS)
def test_bounds_and_alternatives_agree_with_the_condition(
    node: tree.Node, situation: tuple[tuple[Value, ...], tuple[Value, ...], int]
) -> None:
    at = environment(situation)
    truth = build(node, TABLES)(at)
    parts = {kept(part, at) for part in Extents(TABLES, ZONES).parts(node)}
    if truth == TRUE:
        assert TRUE in parts
    alike = {held(each, at) for each in alternatives(node)}
    assert truth == next(each for each in (TRUE, UNKNOWN, FALSE) if each in alike)


ROWS = st.lists(st.tuples(st.integers(0, 20), st.tuples(*[st.integers(0, 4)] * 3)), max_size=60)


@given(ROWS, st.sets(st.integers(0, 20)), st.tuples(*[st.integers(0, 5)] * 3), st.integers(-1, 20))
def test_enclosing_boxes_are_found_in_order(
    rows: list[tuple[int, tuple[int, ...]]], removed: set[int], row: tuple[int, ...], after: int
) -> None:
    found = EnclosingBoxes(rows)
    for number in removed:
        found.remove(number)
    expected = {
        number
        for number, each in rows
        if number not in removed and number > after and all(a >= b for a, b in zip(each, row, strict=True))
    }
    assert list(found.around(row, after)) == sorted(expected)
