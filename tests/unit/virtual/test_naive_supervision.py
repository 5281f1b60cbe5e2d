"""The judge's own supervision: tables by hand; in random worlds it agrees with the runtime or is in doubt."""

from random import Random
from typing import Any

import pytest
from hypothesis import assume, given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import rich_worlds, worlds
from reference.flat_case import M, S
from rtshcua.decision.fallbacks import choose_fallback
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_invocation
from rtshcua.decision.running_conditions import watch
from rtshcua.decision.temporal import initial, observe
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import NUMBER, Signal
from rtshcua.model.flat.situation import Now, State
from rtshcua.virtual.flight_record import HeardReadings, Turn
from rtshcua.virtual.naive_supervision import (
    ConditionQuery,
    HeardState,
    JudgedState,
    RunningStep,
    WatchedStep,
    supervise,
)

MANY = settings(max_examples=settings().max_examples * 4)
VELOCITY = ("velocity.north", "velocity.east", "velocity.down")
TRUTHS = {TRUE: True, FALSE: False, UNKNOWN: None}


def prepared(policy: Policy, invocation: Invocation) -> tuple[PreparedPolicy, PreparedInvocation]:
    made = prepare(policy)
    assume(isinstance(made, PreparedPolicy))
    assert isinstance(made, PreparedPolicy)
    step = prepare_invocation(invocation, made, flat.MISSION.phases)
    assume(isinstance(step, PreparedInvocation))
    assert isinstance(step, PreparedInvocation)
    return made, step


def situation(policy: Policy, state: State, now: Now) -> JudgedState:
    return JudgedState(policy, state.values, state.ages, [TRUTHS[each] for each in state.monitors], now)


def watched(policy: Policy, invocation: Invocation) -> WatchedStep:
    return WatchedStep(policy, replace(flat.MISSION, invocations=(invocation,)), 0)


def compare(policy: Policy, invocation: Invocation, state: State, now: Now) -> tuple[int, int]:
    """The number of compared violations, and of doubtful ones."""
    by_product, step = prepared(policy, invocation)
    at, naive = situation(policy, state, now), watched(policy, invocation)
    broken = list(at.broken(naive))
    doubtful = {each.text for each in broken if not each.sure}
    claimed = [(each.text, each.truth) for each in broken if each.text not in doubtful]
    expected = [(each.text, TRUTHS[each.truth]) for each in watch(step, state, by_product, now)]
    assert sorted(claimed, key=str) == sorted((each for each in expected if each[0] not in doubtful), key=str), (
        claimed,
        expected,
        doubtful,
    )
    at.doubtful = False
    link, choice = at.first_link(naive), choose_fallback(step, state, by_product, now)
    assert at.doubtful or link == (None if choice is None else choice.index)
    return len(claimed), len(doubtful)


@MANY
@given(worlds.CHANCES)
def test_agrees_with_the_runtime_in_random_worlds(of: Random) -> None:
    policy = named(worlds.policy(of))
    compare(
        policy, worlds.invocation(of, policy), heard(policy, worlds.state(of, len(policy.monitors))), worlds.now(of)
    )


@MANY
@given(worlds.CHANCES)
def test_agrees_with_the_runtime_about_a_braking_vehicle(of: Random) -> None:
    policy = named(rich_worlds.policy(of))
    first = policy.slots
    signals = tuple(
        Signal(name, first + n, NUMBER, "speed", of.choice([S // 2, S]), (), ()) for n, name in enumerate(VELOCITY)
    )
    brakes = replace(
        policy.vehicle, braking=of.choice([1, 500, 2_000]), reaction_us=of.choice([0, S // 2, 2 * S]),
        north=first, east=first + 1, down=first + 2,
    )  # fmt: skip
    policy = replace(policy, vehicle=brakes, signals=(*policy.signals, *signals), slots=first + 3)
    state = heard(policy, worlds.state(of, len(policy.monitors)))
    speeds = tuple(of.choice([None, 0, 0, 900, -2_500, 12_000, -40_000]) for _ in signals)
    state = replace(
        state, values=(*state.values, *speeds), ages=(*state.ages, *(of.choice([0, 90_000, 700_000]) for _ in signals))
    )
    compare(policy, worlds.invocation(of, policy), state, rich_worlds.now(of))


def named(policy: Policy) -> Policy:
    """Give each rule and clause its own text, by which doubts are identified."""

    def own(contract: Contract) -> Contract:
        clauses: dict[str, Any] = {
            name: tuple(replace(each, text=f"{name} {n}") for n, each in enumerate(getattr(contract, name)))
            for name in ("require", "assume", "maintain")
        }
        return replace(contract, **clauses)

    rules = tuple(replace(rule, text=f"rule {n}") for n, rule in enumerate(policy.rules))
    return replace(policy, rules=rules, contracts=tuple(map(own, policy.contracts)))


def heard(policy: Policy, state: State) -> State:
    """Return the state as the runtime stores it: one truth per monitor, and no negative ages."""
    monitors = state.monitors if len(state.monitors) == len(policy.monitors) else (UNKNOWN,) * len(policy.monitors)
    return replace(
        state,
        ages=tuple(max(0, age) for age in state.ages),
        monitors=tuple(each if each in TRUTHS else UNKNOWN for each in monitors),
    )


@MANY
@given(worlds.CHANCES)
def test_temporal_monitors_agree_with_the_runtime(of: Random) -> None:
    policy = replace(named(worlds.policy(of)), monitors=worlds.monitors(of, 3))
    made = prepare(policy)
    assume(isinstance(made, PreparedPolicy))
    assert isinstance(made, PreparedPolicy)
    memory, before, at_us = HeardState(policy), initial(made), 500 * S
    for _ in range(12):
        at_us += of.choice([0, 1, 50_000, 50_000, 400_000, S, S + 1, 3 * S])
        state = worlds.state(of)
        memory.hear(HeardReadings(at_us, tuple(enumerate(state.values))))
        now = Now(at_us, flat.NOW.utc_us + at_us, 20_000)
        memory.observe(now)
        fresh = replace(state, ages=(0,) * policy.slots)
        before, truths = observe(before, made, fresh, now)
        says = memory.look(now)
        for number, truth in enumerate(truths):
            says.doubtful = False
            assert says.truths((Op.MONITOR, number, 0), ConditionQuery()) == {TRUTHS[truth]} or says.doubtful


STEP = flat.INVOCATIONS[flat.INSPECTION_STEP]
QUIET = replace(flat.POLICY, rules=())


def texts(policy: Policy, state: State, now: Now = flat.NOW) -> list[tuple[str, bool | None, bool]]:
    return [tuple(each) for each in situation(policy, state, now).broken(watched(policy, STEP))]


@pytest.mark.parametrize(
    ("state", "broken"),
    [
        (flat.state(), []),
        (flat.state({flat.WIND: 10 * M}), [("wind.speed < 10 m/s", False, True)]),
        (flat.state(ages={flat.LINK: 5 * S + 1}), [("link.quality >= 40 %", None, True)]),
        # the area grown by 15 m ends at 85 m, plus 3 m of position error
        (flat.state({flat.POSITION_X: 88_020}), []),
        (flat.state({flat.POSITION_X: 88_000}), [("position inside grow(area, 15 m)", False, False)]),
        (flat.state({flat.POSITION_X: 87_980}), [("position inside grow(area, 15 m)", False, True)]),
        # 111.8 m away at 12 m/s of 18 minutes are 0.87 %, and the reserve is 10 %
        (flat.state({flat.BATTERY: 1_092}), []),
        (flat.state({flat.BATTERY: 1_080}), [("the reserve and the way home", False, True)]),
    ],
)
def test_violated_conditions_of_a_step_are_found(state: State, broken: list[tuple[str, bool | None, bool]]) -> None:
    assert texts(QUIET, state) == broken


def test_exclusion_zone_counts_while_it_exists() -> None:
    utc_us = flat.NOW.utc_us
    for dates, there in (((utc_us, utc_us + S), True), ((utc_us + S, utc_us + 2 * S), False)):
        zones = [*flat.ZONES]
        zones[flat.SCHOOL] = replace(zones[flat.SCHOOL], data=(110 * M, -20 * M, (5 * M) ** 2), dates=dates)
        found = texts(replace(QUIET, zones=tuple(zones)), flat.state(), replace(flat.NOW, utc_error_us=0))
        assert bool(found) is there


def turns(unknown: tuple[int, int], until_us: int) -> list[Turn]:
    """Ten turns in a second, some without the link quality."""
    made = []
    for at_us in range(0, until_us, S // 10):
        quality = None if unknown[0] <= at_us < unknown[1] else 9_000
        made.append(Turn(at_us, (HeardReadings(at_us, tuple(enumerate(flat.state({flat.LINK: quality}).values))),)))
    return made


@pytest.mark.parametrize(
    ("silences", "broken_us"),
    [((), 2 * S + 600_000), (((2 * S + 200_000, 5 * S),), 5 * S + 400_000), (((2 * S, 4 * S),), 4 * S + 600_000)],
)
def test_silence_does_not_count_for_the_grace(silences: tuple[tuple[int, int], ...], broken_us: int) -> None:
    """The signal is unknown from 2 s on; the grace is 500 ms, and the next turn detects it."""
    contract = replace(STEP.contract, grace_us=500_000)
    mission = replace(flat.MISSION, invocations=(replace(STEP, contract=contract),))
    step = RunningStep(QUIET, mission, 0, (0, None), silences)
    supervise(QUIET, [step], turns((2 * S, 9 * S), 8 * S), lambda us: replace(flat.NOW, monotonic_us=us))
    assert step.sure is not None
    at_us, text = step.sure
    assert at_us == broken_us
    assert text == "link.quality >= 40 %: unknown for longer than its grace of 500 ms"


def test_each_of_several_frames_in_a_turn_is_judged() -> None:
    values = tuple(enumerate(flat.state().values))
    gust = tuple((slot, 11 * M if slot == flat.WIND else value) for slot, value in values)
    at_once = [
        Turn(S // 10, (HeardReadings(0, values),)),
        Turn(S, (HeardReadings(S, values), HeardReadings(S, gust), HeardReadings(S, values))),
    ]
    step = RunningStep(QUIET, flat.MISSION, flat.INSPECTION_STEP, (0, None), ())
    supervise(QUIET, [step], at_once, lambda us: replace(flat.NOW, monotonic_us=us))
    assert step.sure == (S, "wind.speed < 10 m/s")


def test_maximum_duration_excludes_silences() -> None:
    contract = replace(STEP.contract, duration_us=3 * S)
    mission = replace(flat.MISSION, invocations=(replace(STEP, contract=contract),))
    step = RunningStep(QUIET, mission, 0, (0, None), ((S, 2 * S),))
    supervise(QUIET, [step], turns((0, 0), 8 * S), lambda us: replace(flat.NOW, monotonic_us=us))
    assert step.sure == (4 * S + 100_000, "maximum duration, excluding 1000 ms without a link")
