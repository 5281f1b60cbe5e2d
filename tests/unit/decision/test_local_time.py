"""The local time of a time zone, whose offset changes, and windows of its days and weeks, by definition."""

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import ask, loaded
from reference.flat_case import H
from reference.naive_code import on_the_wall
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.nearest import ChangeSearch, offer
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.times import LocalTime, Times, Windows, daily, local_time, weekly
from rtshcua.decision.tree import InWeek
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

T, F, U = TRUE, FALSE, UNKNOWN
LETTERS = {"T": T, "F": F, "U": U}
ZERO = 1_767_571_200_000_000  # Monday, 2026-01-05 00:00 UTC
#: one hour ahead from Monday, two from Wednesday 01:00 UTC, one again from Friday 01:00; known until Sunday
OFFSETS = (ZERO, H, ZERO + 2 * DAY + H, 2 * H, ZERO + 4 * DAY + H, H, ZERO + 6 * DAY)
LOCAL = LocalTime(0, OFFSETS)
VEHICLE = replace(flat.POLICY.vehicle, utc_offset_us=0, time_zone="A/B", time_zone_data="1", offsets=OFFSETS)

SMALL = st.integers(0, 14)
CLOCKS = st.one_of(
    st.just(((), st.integers(-3, 3))),
    st.lists(SMALL, min_size=2, max_size=4, unique=True).map(lambda moments: (tuple(sorted(moments)), None)),
)


@st.composite
def clocks(draw: st.DrawFn) -> tuple[int, tuple[int, ...]]:
    moments = sorted(draw(st.lists(SMALL, max_size=4, unique=True)))
    if len(moments) < 2:
        return draw(st.integers(-4, 4)), ()
    given = [part for moment in moments[:-1] for part in (moment, draw(st.integers(-4, 4)))]
    return 0, (*given, moments[-1])


@st.composite
def windows(draw: st.DrawFn, period: int) -> tuple[int, ...]:
    edges = sorted(draw(st.sets(st.integers(0, period), min_size=2, max_size=4)))
    return tuple(edges[: len(edges) // 2 * 2])


@given(clocks(), windows(5), st.lists(st.tuples(SMALL, SMALL), min_size=1, max_size=3), st.integers(0, 3), SMALL)
def test_windows_over_sets(
    clock: tuple[int, tuple[int, ...]], parts: tuple[int, ...], spans: list[tuple[int, int]], least: int, more: int
) -> None:
    vehicle = replace(VEHICLE, utc_offset_us=clock[0], offsets=clock[1])
    utc = tuple((low, low + width) for low, width in spans)
    expected = 0
    for low, high in utc:
        for moment in range(low, high + 1):
            for error in range(least, least + more % 3 + 1):
                (letter,) = on_the_wall(moment, error, vehicle, parts, 5)
                expected |= LETTERS[letter]
    assert Windows(parts, 5, local_time(vehicle)).truth(utc, (least, least + more % 3)) == expected


@given(clocks(), windows(5), SMALL, SMALL)
def test_offset_change_lies_between_differing_moments(
    clock: tuple[int, tuple[int, ...]], parts: tuple[int, ...], low: int, width: int
) -> None:
    window = Windows(parts, 5, LocalTime(*clock))
    shown = [window.truth(((moment, moment),), (0, 0)) for moment in range(low, low + width + 1)]
    turns = [low + number for number in range(1, width + 1) if shown[number] != shown[number - 1]]
    assert list(window.changes(low, low + width)) == turns


@rows(("start", "end"), [(8 * H, 18 * H), (22 * H, 6 * H), (0, DAY), (8 * H, 8 * H - 1), (23 * H, DAY), (H, H), (0, 0)])
def test_day_window_with_constant_offsets_equals_fixed_offset(start: int, end: int) -> None:
    fixed, named = LocalTime(H), LocalTime(0, (0, H, 3 * DAY))
    for moment in range(DAY, 2 * DAY, H // 2):
        for late in (-1, 0, 1):
            spans = ((moment + late,) * 2,)
            assert daily(start, end, fixed).truth(spans, (0, 1)) == daily(start, end, named).truth(spans, (0, 1))
    found, other = (set(daily(start, end, local).changes(DAY, 2 * DAY)) for local in (fixed, named))
    assert other <= found


@rows(
    ("at", "answer"),
    [
        (-1, U),  # nothing is known yet
        (0, F),  # 01:00
        (H, T),
        (2 * H, F),
        (2 * DAY + H, F),  # Wednesday: after 01:59 it is 03:00
        (4 * DAY, T),  # Friday 02:00
        (4 * DAY + H - 1, T),
        (4 * DAY + H, T),  # and 02:00 again
        (4 * DAY + 2 * H - 1, T),
        (4 * DAY + 2 * H, F),
        (6 * DAY, U),
    ],
)
def test_daily_window_handles_skipped_and_repeated_hours(at: int, answer: int) -> None:
    window = daily(2 * H, 3 * H - 1, LOCAL)
    assert window.truth(((ZERO + at,) * 2,), (0, 0)) == answer
    assert window.truth(((ZERO + at,) * 2,), (0, 1)) in (answer, answer | U)


def test_no_clock_error_at_the_change_matters_to_a_window_that_goes_on() -> None:
    change = ZERO + 4 * DAY + H
    assert daily(2 * H, 3 * H - 1, LOCAL).truth(((change, change),), (H, H)) == U  # its ends are as far away
    assert daily(2 * H, 3 * H - 1, LOCAL).truth(((change, change),), (H - 1, H - 1)) == T


def test_the_local_time() -> None:
    assert [LOCAL.offset(ZERO + at) for at in (-DAY, 0, 2 * DAY + H - 1, 2 * DAY + H, 9 * DAY)] == [H, H, H, 2 * H, H]
    assert [LocalTime(H).known(), LOCAL.known()] == [None, (ZERO, ZERO + 6 * DAY)]
    assert LOCAL.changes() == ((ZERO + 2 * DAY + H, H, 2 * H), (ZERO + 4 * DAY + H, 2 * H, H))
    assert LOCAL.steady() % WEEK == 0
    assert LocalTime(H).steady() == 0
    assert LocalTime(0, (0, H, 3 * DAY, 2 * H, 40 * DAY, H, 41 * DAY)).steady() == WEEK


@rows(
    ("daytime", "since", "after"),
    [
        (H, 0, 0),
        (0, 0, 23 * H),
        (2 * H, DAY + 2 * H, 3 * DAY),  # not on Wednesday, when it is skipped
        (2 * H, 4 * DAY + 1, 4 * DAY + H),
        (0, 5 * DAY + 23 * H + 1, None),
        (0, 7 * DAY, None),
    ],
)
def test_the_next_time_of_day(daytime: int, since: int, after: int | None) -> None:
    assert LOCAL.next(daytime, ZERO + since) == (None if after is None else ZERO + after)


def zone(**times: tuple[int, ...]) -> Zone:
    return replace(Zone("z", CIRCLE, LOWEST, HIGHEST, (0, 0, 1)), **times)


def test_a_zone_on_days_of_the_week_and_on_dates() -> None:
    monday, both = {"weekly": (8 * H, 18 * H)}, {"weekly": (8 * H, 18 * H), "dates": (0, ZERO + 9 * H)}
    truths = [
        Times(zone(**times), LOCAL).truth(((ZERO + at, ZERO + at),), (0, 0), through)
        for times, at, through in (
            (monday, 7 * H, 0), (monday, 17 * H - 1, 0), (monday, 17 * H, 0), (monday, DAY + 8 * H, 0),
            (monday, 16 * H, H), (both, 9 * H, 0), (both, 9 * H + 1, 0),
        )
    ]  # fmt: skip
    assert truths == [T, T, F, F, T | F, T, F]


@rows(
    ("windows", "good"),
    [
        ((0, WEEK), True),
        ((0, 1, 2, 3), True),
        ((), False),
        ((0,), False),
        ((0, 1, 2), False),
        ((-1, 1), False),
        ((0, WEEK + 1), False),
        ((1, 0), False),
        ((0, 1, 1, 2), False),
    ],
)
def test_windows_of_a_week(windows: tuple[int, ...], good: bool) -> None:
    code = flat.clause("times", (Op.WEEK_IN, len(flat.POLICY.sets), 0))
    rule = replace(flat.POLICY.rules[0], when=code)
    read = replace(flat.POLICY, sets=(*flat.POLICY.sets, windows), rules=(rule,))
    assert isinstance(prepare(read), PreparedPolicy) is good
    if windows:
        zones = (replace(flat.POLICY.zones[0], daily=(), weekly=windows), *flat.POLICY.zones[1:])
        assert isinstance(prepare(replace(flat.POLICY, zones=zones)), PreparedPolicy) is good


@rows(
    ("code", "good"),
    [((Op.WEEK_IN, 999, 0), False), ((Op.WEEK_IN, -1, 0), False), ((Op.WEEK_IN, len(flat.POLICY.sets), 1), False)],
)
def test_invalid_windows_are_refused(code: tuple[int, ...], good: bool) -> None:
    rule = replace(flat.POLICY.rules[0], when=flat.clause("times", code))
    read = replace(flat.POLICY, sets=(*flat.POLICY.sets, (0, 1)), rules=(rule,))
    assert isinstance(prepare(read), PreparedPolicy) is good


def test_times_of_the_day_or_of_the_week() -> None:
    zones = (replace(flat.POLICY.zones[0], daily=(0, 1), weekly=(0, 1)), *flat.POLICY.zones[1:])
    assert isinstance(prepare(replace(flat.POLICY, zones=zones)), Refusal)


@rows(
    ("given", "good"),
    [
        ({}, True),
        ({"time_zone": ""}, False),
        ({"time_zone_data": ""}, False),
        ({"offsets": ()}, False),
        ({"utc_offset_us": 1}, False),
        ({"offsets": (0, 1)}, False),
        ({"offsets": (1,)}, False),
        ({"offsets": (2, 0, 1)}, False),
        ({"offsets": (1, 0, 1)}, False),
        ({"offsets": (-1, 0, 1)}, False),
        ({"offsets": (0, 0, 1 << 53)}, False),
        ({"offsets": (0, DAY + 1, 1)}, False),
        ({"offsets": tuple(range(513))}, True),
        ({"offsets": tuple(range(515))}, False),
    ],
)
def test_time_zone_offsets_in_policy(given: dict[str, object], good: bool) -> None:
    made = replace(flat.POLICY, vehicle=replace(VEHICLE, **given))
    assert isinstance(prepare(made), PreparedPolicy) is good


def on_monday(**offsets: object) -> PreparedPolicy:
    """The hand-written policy with a first permit that holds on a Monday from 08:00 to 18:00."""
    code = flat.clause("times", (Op.WEEK_IN, len(flat.POLICY.sets), 0))
    rules = tuple(replace(rule, when=code) if rule.kind == 1 else rule for rule in flat.POLICY.rules)
    vehicle = replace(flat.POLICY.vehicle, utc_offset_us=0, **offsets)
    return loaded(replace(flat.POLICY, vehicle=vehicle, sets=(*flat.POLICY.sets, (8 * H, 18 * H)), rules=rules))


@rows(
    ("at", "answer"),
    [
        (8 * H, True),
        (18 * H - 1, True),
        (18 * H, False),
        (8 * H - 1, False),
        (DAY + 8 * H, False),
        (WEEK + 8 * H, True),
    ],
)
def test_a_rule_of_a_monday(at: int, answer: bool) -> None:
    policy = on_monday()
    when = policy.compiler.condition(policy.policy.rules[[rule.kind for rule in policy.policy.rules].index(1)], 0)
    assert when(Environment((), (), ((ZERO + at, ZERO + at),), (0, 0))) == (T if answer else F)


@rows(
    ("at", "windows", "times"),
    [
        (7 * H, (8 * H, 18 * H), (8 * H, 18 * H - 1)),
        (7 * H, (0, 6 * H, 22 * H, 30 * H), (22 * H, DAY - 1)),
        (23 * H, (0, 6 * H, 8 * H, 9 * H), (8 * H, 9 * H - 1)),
        (DAY, (8 * H, 18 * H), None),
        (DAY + 7 * H, (22 * H, 30 * H), (0, 6 * H - 1)),
    ],
)
def test_the_nearest_time_is_on_the_same_day(at: int, windows: tuple[int, ...], times: tuple[int, int] | None) -> None:
    tables = on_monday().tables
    changes = ChangeSearch(Environment((), (), ((ZERO + at, ZERO + at),), (0, 0)), tables)
    found = changes.find(InWeek(windows), True)
    if times is None:
        assert found is None
        return
    assert found is not None
    (change,) = found
    assert (change.low, change.high) == times
    assert changes.find(InWeek(windows), False) in (None, ())


def test_no_time_is_near_where_the_local_time_is_not_known() -> None:
    tables = loaded(replace(flat.POLICY, vehicle=VEHICLE)).tables
    at = Environment((), (), ((ZERO + 9 * DAY,) * 2,), (0, 0))
    (change,) = ChangeSearch(at, tables).find(InWeek((0, WEEK)), True) or ()
    assert not ChangeSearch(at, tables).help(InWeek((0, WEEK)), True, {change.subject: 0})
    (option,) = offer(change, flat.POLICY.contracts[0], replace(flat.POLICY, vehicle=VEHICLE), at).options
    assert option[0] in (0, DAY - 1)


def test_a_window_of_the_week_that_is_all_of_it() -> None:
    assert weekly((0, WEEK), LOCAL).truth(((ZERO, ZERO + 6 * DAY - 1),), (0, 0)) == T
    assert weekly((0, WEEK), LOCAL).truth(((0, 1 << 53),), (0, 0)) == T | U
    assert weekly((0, WEEK), LocalTime(0)).truth(((0, 1 << 53),), (0, 1)) == T
    assert daily(8 * H, 18 * H, LOCAL).truth(((0, 1 << 53),), (0, 0)) == T | F | U


def test_a_step_is_decided_by_the_clock_on_the_wall() -> None:
    asked = ask(policy=on_monday(time_zone="A/B", time_zone_data="1", offsets=(0, H, 1)))
    assert (asked.outcome, asked.reason) == (Outcome.DENY, Reason.OUT_OF_SCOPE)
