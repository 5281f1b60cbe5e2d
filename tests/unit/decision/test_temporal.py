"""Temporal monitors: tables by hand, and random traces against the whole history."""

from collections.abc import Sequence
from functools import cache
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.asking import loaded
from reference.flat_case import WIND, M, S, apply, clause, const, signal
from reference.naive_code import Leg, World, truths
from reference.naive_temporal import History, says
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.situation import situation
from rtshcua.decision.temporal import initial, lasting, observe
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.limits import MAX_GAP, MAX_MONITORS, MAX_WINDOW
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.situation import Now, State
from virtual.rows import rows

LETTERS = {1: "T", 2: "F", 4: "U"}
CALM = clause("wind.speed < 8 m/s", apply(Op.LT, signal(WIND), const(8 * M)))
WINDS: dict[str, int | None] = {"T": 4 * M, "F": 9 * M, "U": None}
FOR, WITHIN, RISING, FALLING = MonitorKind


def asks(number: int) -> Clause:
    return clause(f"monitor {number}", (Op.MONITOR, number, 0))


@cache
def policy_of(*monitors: Monitor) -> PreparedPolicy:
    return loaded(replace(flat.POLICY, monitors=monitors))


def now(at_us: int) -> Now:
    return Now(at_us, flat.ISSUED + at_us, 0)


def windy(letter: str) -> State:
    return flat.state({WIND: WINDS[letter]})


def run(policy: PreparedPolicy, trace: Sequence[tuple[int, str]]) -> list[str]:
    """What the monitors say at each observation of the wind, as one word of letters."""
    memory, words = initial(policy), []
    for at_us, letter in trace:
        memory, said = observe(memory, policy, windy(letter), now(at_us))
        words.append("".join(LETTERS[truth] for truth in said))
    return words


HALF = S // 2
EVERY_HALF = [number * HALF for number in range(20)]


@rows(
    ("kind", "window_us", "times", "observed", "said"),
    [
        # the window reaches exactly back to the first observation, not before
        (FOR, S, EVERY_HALF, "TTTT", "UUTT"),
        (FOR, S + 1, EVERY_HALF, "TTTT", "UUUT"),
        # FALSE decides at once, and until the window has left the last moment at which it held
        (FOR, S, EVERY_HALF, "TTTFTTTT", "UUTFFFTT"),
        (FOR, S, [0, 500_000, 999_999, 1_000_000, 1_999_999, 2_000_000], "TFTTTT", "UFFFTT"),
        (FOR, S, EVERY_HALF, "UTTTT", "UUUTT"),
        (FOR, S, EVERY_HALF, "FUTTTTT", "FFFUTTT"),
        (WITHIN, S, EVERY_HALF, "FFFF", "UUFF"),
        (WITHIN, S, EVERY_HALF, "FTFFFFF", "UTTTFFF"),
        (WITHIN, S, EVERY_HALF, "FFFUFFFF", "UUFUUUFF"),
        (WITHIN, S, EVERY_HALF, "T", "T"),
        # a gap of exactly the limit is bridged, a longer one is not known
        (FOR, S, [0, MAX_GAP, 2 * MAX_GAP, 3 * MAX_GAP + 1, 4 * MAX_GAP + 1], "TTTTT", "UTTUT"),
        (WITHIN, S, [0, MAX_GAP, 2 * MAX_GAP + 1, 3 * MAX_GAP + 1], "FFFF", "UFUF"),
        (FOR, S, [0, MAX_GAP + 1], "FT", "FU"),
        (FOR, 3 * S, [0, MAX_GAP + 1], "FT", "FF"),
        # several observations at one moment all count there, in any order
        (FOR, S, [0, S, S, S, 2 * S, 2 * S + 1], "TTFTTT", "UTFFFT"),
        (WITHIN, S, [0, S, S, S, 2 * S, 2 * S + 1], "FFTFFF", "UFTTTF"),
        # an edge lasts for one observation
        (RISING, 0, EVERY_HALF, "FTTFTUTFUFT", "FTFFTFUFUFT"),
        (FALLING, 0, EVERY_HALF, "TFFTFUFTUTF", "FTFFTFUFUFT"),
        (RISING, 0, EVERY_HALF, "TUTF", "UFUF"),
        (FALLING, 0, EVERY_HALF, "FUFT", "UFUF"),
        (RISING, 0, [0, 0, 0], "FTT", "FTF"),
        # a clock that goes back stands still
        (FOR, S, [0, S, HALF, 2 * S, 2 * S + 1], "TTFTT", "UTFFF"),
    ],
)
def test_by_hand(kind: int, window_us: int, times: list[int], observed: str, said: str) -> None:
    trace = list(zip(times, observed, strict=False))
    assert "".join(run(policy_of(Monitor(kind, window_us, CALM)), trace)) == said
    history: History = []
    for number, (at_us, letter) in enumerate(trace):
        history.append((max([at_us, *(time for time, _ in history)]), letter))
        assert says(kind, window_us, history) == said[number], "the reference agrees with the hand"


def test_outer_monitor_reads_inner_at_same_observation() -> None:
    """`rising calm within the last 1 s`."""
    policy = policy_of(Monitor(RISING, 0, CALM), Monitor(WITHIN, S, asks(0)))
    words = run(policy, list(zip(EVERY_HALF, "FFFTTTTTT", strict=False)))
    assert words == ["FU", "FU", "FF", "TT", "FT", "FT", "FF", "FF", "FF"]


def test_stale_signal_is_unknown_to_monitors_and_conditions() -> None:
    policy = policy_of(Monitor(FOR, S, CALM))
    memory, said = initial(policy), ()
    for number in range(4):
        memory, said = observe(memory, policy, windy("T"), now(number * HALF))
    assert said == (1,)
    stale = flat.state(ages={WIND: 10 * S + 1})
    assert observe(memory, policy, stale, now(4 * HALF))[1] == (4,)


def test_observation_ignores_truths_in_state() -> None:
    policy = policy_of(Monitor(FOR, 1, CALM), Monitor(FOR, 1, asks(0)))
    memory, said = observe(initial(policy), policy, replace(windy("F"), monitors=(1, 1)), now(0))
    assert said == (2, 2)
    memory, _ = observe(memory, policy, replace(windy("T"), monitors=(2,)), now(2))
    assert observe(memory, policy, replace(windy("T"), monitors=(2, 4)), now(3))[1] == (1, 2)
    assert observe(memory, policy, windy("T"), now(4))[1] == (1, 2)


@pytest.mark.unmeasured
def test_memory_does_not_grow() -> None:
    kinds = [(FOR, MAX_WINDOW), (WITHIN, MAX_WINDOW), (RISING, 0), (FALLING, 0)] * (MAX_MONITORS // 4)
    policy = policy_of(*(Monitor(kind, window_us, CALM) for kind, window_us in kinds))
    memory = initial(policy)
    for number in range(1_000):
        memory, _ = observe(memory, policy, windy("TFU"[number % 3]), now(number * 50_000))
        assert sum(map(len, memory.conditions)) == 4 * MAX_MONITORS
        assert all(abs(number) < 1 << 63 for condition in memory.conditions for number in condition)


STEPS = st.sampled_from([0, 0, 1, 2, 49_999, 50_000, HALF, S - 1, S, S + 1, 2 * S, 5 * S])
WINDOWS = st.sampled_from([1, 2, 50_000, HALF, S - 1, S, S + 1, 3 * S, 600 * S])
TRACES = st.lists(st.tuples(STEPS, st.sampled_from("TTFU")), min_size=1, max_size=25)


@settings(max_examples=settings().max_examples * 4)
@given(st.sampled_from([*MonitorKind]), WINDOWS, TRACES)
def test_monitor_matches_an_evaluation_of_its_whole_history(
    kind: int, window_us: int, steps: list[tuple[int, str]]
) -> None:
    monitor = Monitor(kind, 0 if kind in (RISING, FALLING) else window_us, CALM)
    history: History = []
    at_us = 0
    for step_us, letter in steps:
        at_us += step_us
        history.append((at_us, letter))
    expected = [says(kind, window_us, history[: number + 1]) for number in range(len(history))]
    assert run(policy_of(monitor), history) == expected


@settings(max_examples=settings().max_examples * 2)
@given(worlds.CHANCES)
def test_nested_monitors_of_random_worlds_say_what_their_histories_say(of: Random) -> None:
    policy = loaded(replace(flat.POLICY, monitors=worlds.monitors(of, 4)))
    histories: list[History] = [[] for _ in policy.monitors]
    memory, at_us = initial(policy), 0
    for _ in range(12):
        at_us += of.choice([0, 1, 50_000, HALF, S, S + 1, 3 * S])
        state, moment = worlds.state(of), replace(worlds.now(of), monotonic_us=at_us)
        memory, said = observe(memory, policy, state, moment)
        expected = ""
        for monitor, history in zip(policy.policy.monitors, histories, strict=True):
            history.append((at_us, naive(monitor.when.code, state, moment, policy, expected)))
            expected += says(monitor.kind, monitor.window_us, history)
        assert "".join(LETTERS[truth] for truth in said) == expected


def naive(code: tuple[int, ...], state: State, moment: Now, policy: PreparedPolicy, monitors: str) -> str:
    """The truth of a condition in one state, by the naive interpreter."""
    known = [value[0] if value[2] == 0 else None for value in situation(state, policy, moment).values]
    x, y, z = known[flat.POSITION_X], known[flat.POSITION_Y], known[flat.HEIGHT]
    at = None if x is None or y is None else (x, y)
    legs: list[Leg] = [(at, at, (0, 0, 0, 0), z, z)]
    about = (policy.policy, known, (), moment.utc_us, moment.utc_error_us, legs)
    (letter,) = truths(code, World(*about, monitors=monitors))
    return letter


@rows(("wind", "expected"), [(4 * M, (1, 1)), (9 * M, (2, 2)), (None, (4, 4))])
def test_lasting_state_is_known_for_any_window(wind: int | None, expected: tuple[int, ...]) -> None:
    policy = policy_of(Monitor(FOR, 20 * S, CALM), Monitor(WITHIN, 30 * S, asks(0)))
    state = State(tuple(wind if slot == WIND else None for slot in range(policy.policy.slots)), (0,) * 32, (4, 4))
    state = replace(state, ages=state.ages[: policy.policy.slots])
    assert lasting(state, policy, Now(7, 8, 9)).monitors == expected
    assert lasting(replace(state, monitors=()), policy_of(), Now(7, 8, 9)).monitors == ()
