"""The existence of zones, at one moment and over a time, with a clock error; and the effect on a flight."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import STEP, ask, loaded, ready
from reference.flat_case import MIN, H, M, S
from reference.naive_code import between
from rtshcua.decision.contracts import longest
from rtshcua.decision.fallbacks import choose_fallback
from rtshcua.decision.nearest import nearest
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.running_conditions import holding, watch
from rtshcua.decision.times import DateRange, LocalTime, Times
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

T, F, U = TRUE, FALSE, UNKNOWN
LETTERS = {"T": T, "F": F, "U": U}
UTC, OFFSET = flat.NOW.utc_us, flat.POLICY.vehicle.utc_offset_us
LOCAL = (UTC + OFFSET) % (24 * H)
SMALL = st.integers(0, 12)


@given(SMALL, SMALL, st.lists(st.tuples(SMALL, SMALL), min_size=1, max_size=3), SMALL, st.integers(0, 3))
def test_dates_over_sets(start: int, length: int, spans: list[tuple[int, int]], least: int, more: int) -> None:
    utc = tuple((low, low + width) for low, width in spans)
    expected = 0
    for low, high in utc:
        for moment in range(low, high + 1):
            for error in range(least, least + more + 1):
                (letter,) = between(moment, error, start, start + length)
                expected |= LETTERS[letter]
    assert DateRange(start, start + length).truth(utc, (least, least + more)) == expected


@rows(
    ("daily", "dates", "through", "answer"),
    [
        ((), (10, 20), 0, T),
        ((), (15, 15), 0, T),
        ((), (16, 20), 0, F),
        ((), (16, 20), 1, T | F),
        ((), (10, 20), 5, T),
        ((), (10, 20), 6, T | F),
        ((), (10, 14), 100, F),
        ((10, 20), (), 5, T),
        ((10, 20), (), 6, T | F),
        ((20, 10), (), 4, F),
        ((20, 10), (), 5, T | F),
        ((0, 24 * H), (10, 20), 0, T),
        ((10, 20), (16, 20), 0, F),
    ],
)
def test_at_moment_15(daily: tuple[int, ...], dates: tuple[int, ...], through: int, answer: int) -> None:
    zone = Zone("z", CIRCLE, LOWEST, HIGHEST, (0, 0, 1), daily, dates)
    assert Times(zone, LocalTime(0)).truth(((15, 15),), (0, 0), through) == answer


def test_clock_error_at_zone_times() -> None:
    zone = Zone("z", CIRCLE, LOWEST, HIGHEST, (0, 0, 1), (10, 20), (12, 18))
    answers = [Times(zone, LocalTime(0)).truth(((15, 15),), (error, error), 0) for error in (3, 4)]
    assert answers == [T, U]


# ------------------------------------------------------------------------------------------------ a whole flight


def airspace(zone: int, **times: tuple[int, ...]) -> PreparedPolicy:
    """The hand-written policy, with one of its zones at some times only."""
    zones = tuple(replace(one, **times) if n == zone else one for n, one in enumerate(flat.ZONES))
    return loaded(replace(flat.POLICY, zones=zones))


def in_school(**times: tuple[int, ...]) -> tuple[Outcome, Reason]:
    """The decision if the school, which is to be avoided, is on the way and exists at some times."""
    zones = list(flat.ZONES)
    for number in (flat.SCHOOL, flat.SCHOOL_GROWN):
        zones[number] = replace(zones[number], data=(150 * M, 0, (20 * M) ** 2), **times)
    decision = ask(policy=loaded(replace(flat.POLICY, zones=tuple(zones))))
    return decision.outcome, decision.reason


LONGEST = longest(STEP.contract, flat.POLICY.vehicle)
ADMITTED = (Outcome.ALLOW, Reason.ADMITTED)
AIRSPACE = (Outcome.FALLBACK, Reason.AIRSPACE)
UNSURE = (Outcome.DEFER, Reason.SAFETY_UNKNOWN)
ERROR = flat.NOW.utc_error_us


@rows(
    ("times", "answer"),
    [
        ({}, AIRSPACE),
        ({"dates": (0, UTC - ERROR - 1)}, ADMITTED),
        ({"dates": (0, UTC - ERROR)}, UNSURE),  # it may be over
        ({"dates": (0, UTC + ERROR)}, AIRSPACE),
        ({"dates": (UTC + LONGEST + ERROR + 1, UTC + H)}, ADMITTED),  # begins after the longest that it may take
        ({"dates": (UTC + LONGEST + ERROR, UTC + H)}, UNSURE),
        ({"dates": (UTC + LONGEST - ERROR, UTC + H)}, AIRSPACE),
        ({"daily": (LOCAL + MIN, LOCAL + 2 * MIN)}, AIRSPACE),  # for one minute of it
        ({"daily": (LOCAL - 2 * MIN, LOCAL - MIN)}, ADMITTED),
        ({"daily": (LOCAL - MIN, LOCAL + MIN), "dates": (0, UTC - H)}, ADMITTED),
    ],
)
def test_keeping_out(times: dict[str, tuple[int, ...]], answer: tuple[Outcome, Reason]) -> None:
    assert in_school(**times) == answer


@rows(
    ("times", "answer"),
    [
        ({"dates": (0, UTC + LONGEST + ERROR)}, ADMITTED),
        ({"dates": (0, UTC + LONGEST + ERROR - 1)}, UNSURE),
        ({"dates": (0, UTC + LONGEST - ERROR - 1)}, AIRSPACE),
        ({"dates": (UTC - ERROR, UTC + H)}, ADMITTED),
        ({"daily": (8 * H, LOCAL + LONGEST + ERROR)}, ADMITTED),
        ({"daily": (8 * H, LOCAL + MIN)}, AIRSPACE),
    ],
)
def test_staying_in(times: dict[str, tuple[int, ...]], answer: tuple[Outcome, Reason]) -> None:
    zone = flat.POLICY.airspace.inside[0]
    decision = ask(policy=airspace(zone, **times))
    assert (decision.outcome, decision.reason) == answer


def test_the_same_volume_at_two_times() -> None:
    """The cached result of a place does not depend on the time."""
    policy = airspace(flat.POLICY.airspace.inside[0], dates=(UTC - H, UTC + H))
    step = ready(STEP, policy)
    state, later = flat.state(), replace(flat.NOW, utc_us=UTC + 2 * H)
    for _ in range(2):
        assert tuple(watch(step, state, policy, flat.NOW)) == ()
        assert [one.truth for one in watch(step, state, policy, later)] == [F]
        assert [one.truth for one in holding(step, state, policy, later)] == [F]
    outcomes = [ask(policy=policy, now=now).reason for now in (flat.NOW, later, flat.NOW)]
    assert outcomes[0] == outcomes[2] == Reason.ADMITTED != outcomes[1]


@pytest.mark.parametrize(("end", "index"), [(UTC + H, 1), (UTC + MIN, 2)])
def test_zone_times_cover_the_longest_duration_of_a_link(end: int, index: int) -> None:
    """Hovering covers no way; the return takes up to five minutes; landing is the last link."""
    policy = airspace(flat.POLICY.airspace.inside[0], dates=(0, end))
    choice = choose_fallback(ready(STEP, policy), flat.state(), policy, flat.NOW, after=0)
    assert choice is not None
    assert choice.index == index


def test_an_argument_is_asked_about_at_the_moment() -> None:
    """`target inside school`, in a rule: while the school exists."""
    target = flat.clause("target inside city", (Op.ARGUMENT_POINT_IN, 0, flat.CITY))
    step = next(one for one in flat.INVOCATIONS if one.skill == flat.GOTO)
    for dates, outcome in [
        ((0, UTC - H), Outcome.DENY),
        ((0, UTC + ERROR - 1), Outcome.DENY),
        ((0, UTC + ERROR), Outcome.ALLOW),
        ((0, UTC + MIN), Outcome.ALLOW),
        ((), Outcome.ALLOW),
    ]:
        zones = (replace(flat.ZONES[flat.CITY], dates=dates), *flat.ZONES[1:])
        rules = (flat.rule(RuleKind.PERMIT, flat.GOTO, when=target),)
        policy = loaded(replace(flat.POLICY, zones=zones, rules=rules, airspace=None))
        assert ask(step, policy=policy, phase=step.phase).outcome == outcome


def test_no_time_is_offered_at_which_a_zone_blocks() -> None:
    """A rule requires the morning and a place outside a zone that exists from tomorrow on."""
    hours = (Op.TIME_IN, 8 * H, 12 * H)
    outside = (Op.POSITION_IN, flat.CITY, 0, Op.NOT, 0, 0)
    when = flat.clause("in the morning, outside of the city", flat.apply(Op.AND, hours, outside))
    rules = (flat.rule(RuleKind.PERMIT, flat.INSPECT, when=when),)
    for start, offers in [(UTC + 8 * H, 0), (UTC + 48 * H, 1)]:
        zones = (replace(flat.ZONES[flat.CITY], dates=(start, UTC + 1_000 * H)), *flat.ZONES[1:])
        policy = loaded(replace(flat.POLICY, zones=zones, rules=rules, airspace=None))
        decision = ask(policy=policy)
        assert decision.reason == Reason.OUT_OF_SCOPE
        assert len(nearest(decision, ready(STEP, policy), flat.state(), policy, flat.NOW)) == offers


def test_longest_flight_time_is_computed() -> None:
    contract, vehicle = flat.CONTRACTS[flat.HOVER], flat.POLICY.vehicle
    assert longest(contract, vehicle) == contract.duration_us
    assert longest(contract, vehicle, 7 * S) == 7 * S
    assert longest(replace(contract, duration_us=0), vehicle) == vehicle.endurance_us
