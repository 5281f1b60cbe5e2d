"""The search, compared with an exhaustive search of a small space."""

from collections.abc import Iterator
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, Tables, build
from rtshcua.decision.times import LocalTime
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, interval, maybe, members, point
from rtshcua.decision.zones import PreparedZone, WellKnown
from rtshcua.ground.analysis.plane import Plane
from rtshcua.ground.analysis.solve import No, Undecided, Yes, implies, satisfiable
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, POLYGON, Zone

HOUR = DAY // 24
SIDE = 4
ZONES = (
    Zone("disc", CIRCLE, LOWEST, HIGHEST, (0, 0, 4)),
    Zone("square", POLYGON, 0, 2, (-3, -3, 3, -3, 3, 3, -3, 3)),
    Zone("far", POLYGON, LOWEST, HIGHEST, (3, -3, 6, -3, 6, 3, 3, 3), daily=(6 * HOUR, 12 * HOUR)),
    Zone("bar", POLYGON, LOWEST, HIGHEST, (-4, -1, 5, -1, 5, 1, -4, 1)),
)
PREPARED = tuple(PreparedZone(number, zone) for number, zone in enumerate(ZONES))
TABLES = Tables(
    zones=PREPARED,
    tables=((0, 1, 2, 3), (1, 1, 3, 3)),
    sets=(frozenset({0, 2}), frozenset({1, 7}), frozenset({0})),
    known=WellKnown(2, 3, 1, 4),
    local=LocalTime(HOUR),
)
#: cells: a number, a number, a choice of zones, a place (two)
ARGUMENTS: tuple[Value, ...] = (
    interval(-2, 2),
    interval(0, 3),
    members(range(4)),
    interval(-SIDE, SIDE),
    interval(-SIDE, SIDE),
)
#: slots: a number, the height, the position (two), an enumeration, and the one that is never there
SLOTS: tuple[Value, ...] = (
    maybe(interval(-2, 2)),
    maybe(interval(-1, 3)),
    maybe(interval(-SIDE, SIDE)),
    maybe(interval(-SIDE, SIDE)),
    maybe(members((0, 1, 7))),
    MISSING,
)
SPACE = SituationSpace(
    ARGUMENTS, SLOTS, ((0, DAY - 1),), (0, 0), frozenset((-1, 0)), (7, 7), TABLES, Plane(ZONES, PREPARED)
)

NUMBERS = ((True, 0), (True, 1), (False, 0), (False, 1))
TERMS = st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=3, unique=True).flatmap(
    lambda cells: st.tuples(*(st.builds(tree.LinearTerm, *map(st.just, cell), st.integers(-3, 3)) for cell in cells))
)
NUMERIC = st.one_of(
    st.builds(tree.AtMost, TERMS, st.integers(-7, 7)),
    st.builds(tree.Equal, TERMS, st.integers(-5, 5)),
)
CHOICES = st.one_of(
    st.builds(tree.Member, st.just(False), st.just(4), st.integers(0, 2)),
    st.builds(tree.Member, st.just(True), st.just(2), st.integers(0, 2)),
    st.builds(tree.InWindow, st.integers(0, 23).map(HOUR.__mul__), st.integers(0, 24).map(HOUR.__mul__)),
    st.builds(tree.SlotKnown, st.sampled_from((0, 1, 4))),
    st.builds(tree.PhaseIn, st.just(2)),
    st.builds(tree.MonitorSays, st.integers(0, 1)),
)
PLACES = st.one_of(
    st.builds(tree.InsideZone, st.integers(0, 3)),
    st.builds(tree.InsideArgument, st.just(2), st.integers(0, 1)),
    st.builds(tree.PointInside, st.just(3), st.integers(0, 3)),
    st.just(tree.Both(tree.SlotKnown(2), tree.SlotKnown(3))),  # the lowered form of `position is known`
)


def conditions(atoms: st.SearchStrategy[tree.Node]) -> st.SearchStrategy[tree.Node]:
    """Draw conditions of a few atoms."""

    def grown(inner: st.SearchStrategy[tree.Node]) -> st.SearchStrategy[tree.Node]:
        return st.one_of(
            st.builds(tree.Both, inner, inner), st.builds(tree.Either, inner, inner), st.builds(tree.Negation, inner)
        )

    return st.recursive(atoms, grown, max_leaves=5)


GOALS = st.sampled_from((TRUE, FALSE, UNKNOWN, TRUE | UNKNOWN, FALSE | UNKNOWN))


def each(value: Value) -> list[Value]:
    """Yield every point of a value."""
    low, high, gap, elements = value
    there = [] if gap == 2 else [point(one) for one in (elements or range(low, high + 1))]
    return [*there, MISSING] if gap else there


def situations(numeric: bool, placed: bool) -> Iterator[Environment]:
    """Yield every situation of the space. Cells that the conditions do not read keep one value."""
    first = [each(value) if numeric else each(value)[:1] for value in (*ARGUMENTS[:2], SLOTS[0])]
    height = each(SLOTS[1])
    inner = [point(one) for one in range(-SIDE, SIDE + 1)]
    spots: list[tuple[Value, Value]] = [*product(inner, inner), (MISSING, MISSING)] if placed else [(MISSING, MISSING)]
    for one, two, slot in product(*first):
        for high, (x, y) in product(height, spots):
            slots = [slot, high, x, y, MISSING, MISSING]
            yield Environment(slots, [one, two, point(0), point(0), point(0)], ((0, 0),), (0, 0))


@pytest.mark.slow
@given(st.lists(st.tuples(conditions(NUMERIC), GOALS), min_size=1, max_size=3))
def test_answers_about_numbers_agree_with_exhaustive_search(goals: list[tuple[tree.Node, int]]) -> None:
    built = [(build(node, TABLES), wanted) for node, wanted in goals]
    exists = any(all(run(at) & wanted for run, wanted in built) for at in situations(numeric=True, placed=False))
    answer = satisfiable(goals, SPACE)
    assert isinstance(answer, Yes if exists else No), answer


ALL = st.one_of(NUMERIC, CHOICES, PLACES)
POINTS = st.builds(
    lambda slots, arguments, moment, monitors, phase: Environment(
        [*slots, MISSING], arguments, ((moment, moment),), (0, 0), None, monitors, phase
    ),
    st.tuples(*(st.sampled_from(each(value)) for value in SLOTS[:-1])).map(list),
    st.tuples(*(st.sampled_from(each(value)) for value in ARGUMENTS)).map(list),
    st.integers(0, 23).map(HOUR.__mul__),
    st.tuples(*(st.sampled_from((TRUE, FALSE, UNKNOWN)),) * 2),
    st.sampled_from((-1, 0)),
)


@given(st.lists(st.tuples(conditions(ALL), GOALS), min_size=1, max_size=3), st.lists(POINTS, min_size=1, max_size=20))
def test_no_is_never_wrong_and_yes_has_a_valid_witness(
    goals: list[tuple[tree.Node, int]], points: list[Environment]
) -> None:
    answer = satisfiable(goals, SPACE)
    if isinstance(answer, Yes):
        for node, wanted in goals:
            assert build(node, TABLES)(answer.witness.at) & wanted
    if isinstance(answer, No):
        for at in points:
            at.place = None
            assert not all(build(node, TABLES)(at) & wanted for node, wanted in goals)


@given(st.lists(st.tuples(conditions(st.builds(tree.InsideZone, st.integers(0, 3))), GOALS), min_size=1, max_size=3))
def test_answers_about_places_agree_with_exhaustive_search(goals: list[tuple[tree.Node, int]]) -> None:
    """At midnight. If no place in whole millimetres exists and no relation excludes one, the answer is undecided."""
    space = SPACE._replace(utc=((0, 0),))
    built = [(build(node, TABLES), wanted) for node, wanted in goals]
    exists = any(all(run(at) & wanted for run, wanted in built) for at in situations(numeric=False, placed=True))
    answer = satisfiable(goals, space)
    assert isinstance(answer, (Yes, Undecided) if exists else (No, Undecided)), answer


SUM = (tree.LinearTerm(False, 0, 1), tree.LinearTerm(True, 0, -1))


@pytest.mark.parametrize(("bound", "holds"), [(4, True), (3, True), (-1, False)])
def test_sums_of_the_same_form_share_a_variable(bound: int, holds: bool) -> None:
    """`s - a > 3` excludes `s - a <= 3` for all s and a; bisecting s and a would not terminate."""
    wide = (interval(-(1 << 50), 1 << 50), *ARGUMENTS[1:])
    slots = (interval(-(1 << 50), 1 << 50), *SLOTS[1:])
    space = SPACE._replace(arguments=wide, slots=slots)
    node, other = tree.AtMost(SUM, bound), tree.AtMost(tuple(t._replace(factor=-t.factor) for t in SUM), 0)
    answer = satisfiable([(node, TRUE), (other, TRUE)], space)
    assert isinstance(answer, Yes if holds else No)


def test_implication_has_a_counterexample_or_a_proof() -> None:
    low, high = (tree.AtMost((tree.LinearTerm(False, 0, 1),), bound) for bound in (0, 1))
    assert isinstance(implies(low, high, SPACE), No)
    against = implies(high, low, SPACE)
    assert isinstance(against, Yes)
    assert against.witness.cells[False, 0] == 1


def test_question_over_the_budget_stays_undecided() -> None:
    terms = tuple(tree.LinearTerm(True, cell, factor) for cell, factor in ((0, 6), (1, 10)))
    space = SPACE._replace(arguments=(interval(-(1 << 40), 1 << 40), interval(-(1 << 40), 1 << 40), *ARGUMENTS[2:]))
    odd = (tree.Equal((*terms, tree.LinearTerm(False, 0, 15)), 1), TRUE)
    assert isinstance(satisfiable([odd], space, budget=1), Undecided)
