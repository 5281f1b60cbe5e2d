"""E0804, E0814: what each step is proved to take, by which speeds, against which wind, and what follows it."""

from pathlib import Path

import pytest

from reference.sources import LIBRARY, findings, found, mission, policy, program, skill
from rtshcua.decision.prepare import PreparedInvocation, prepare, prepare_mission
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.ground.prove.step_bounds import StepBound
from rtshcua.mavlink import dialect
from rtshcua.wire.binding import bind
from virtual.rows import rows

UP, HOME = "takeoff(altitude = 20 m)", "return_home()"
#: 200 m north of home
NORTH = "47.39954 N, 8.54559 E"
LONG = {"lasts": "at most 5 min", "energy": "at most 30 %"}
EAST = "aim: position, top: altitude in 5 m .. 50 m"


def compiled(*parts: str) -> Compiled:
    """A program, compiled."""

    def read(path: str) -> bytes:
        return program(*parts).encode() if path == "probe.rts" else Path(path).read_bytes()

    return compile_program(load(["probe.rts"], read, LIBRARY), dialect.load(), mission=None, issued_at_us=1)


def bounds(*parts: str) -> tuple[StepBound, ...]:
    """What the steps of a program are proved to take."""
    made = compiled(*parts)
    assert made.bounds is not None, made.diagnostics
    return made.bounds.steps


def seconds(clauses: dict[str, str], *rules: str, speed: str = "12 m/s") -> int:
    """How long 200 m take at most, in seconds rounded down, beyond the commands."""
    fast = skill(
        f"fast({EAST}, pace: speed in 1 m/s .. 12 m/s)", motion="fly to aim at top speed pace", **LONG, **clauses
    )
    steps = bounds(fast, policy(*rules), mission(UP, f"fast({NORTH}, 20 m, {speed})", HOME))
    return steps[1].time_us // 1_000_000 - 5


@rows(
    ("clauses", "rules", "expected"),
    [
        ({}, [], 33),  # at 8 m/s, for it flies 16 m/s against 8 m/s of wind, and 8 s to come to speed and to stop
        ({"assume": "wind.speed < 4 m/s"}, [], 28),  # at 12 m/s
        ({"assume": "wind.speed < 13 m/s"}, [], 33),  # more than it is flown in
        ({}, ["degrade fast when wind.speed > 4 m/s to return_home"], 28),
        ({}, ["degrade hover when wind.speed > 4 m/s to return_home"], 33),
    ],
)
def test_wind_counts_as_far_as_the_step_goes_on_in_it(clauses: dict[str, str], rules: list[str], expected: int) -> None:
    assert seconds(clauses, *rules) == expected


def test_a_step_is_no_faster_than_it_asks_for() -> None:
    assert seconds({}, speed="2 m/s") == 102


def test_a_return_counts_the_slowest_speed_that_was_asked_for() -> None:
    """A PX4 goes on with it."""
    goto = "goto(47.39819 N, 8.54559 E, 20 m, speed = {} m/s)"
    quick = bounds(policy(), mission(UP, goto.format(5), HOME))[-1]
    slow = bounds(policy(), mission(UP, goto.format(2), HOME))[-1]
    # 50 m, and 50 m that home may lie away: at 5 m/s 20 s and 5 s, at 2 m/s 50 s and 2 s
    assert 26_000_000 < slow.time_us - quick.time_us < 28_000_000
    assert slow.energy > quick.energy


@rows(
    ("link", "expected"),
    [
        ("goto(47.39999 N, 8.54559 E, altitude = 20 m)", []),
        ("goto(47.39799 N, 8.54559 E, altitude = 60 m)", []),
        (
            "goto(47.39999 N, 8.54559 E, altitude = 20 m, speed = 2 m/s)",
            ["`goto`, a link of this step's chains, takes up to 233 s, and `goto` lasts at most 2 min"],
        ),
        ("rise(45 m)", []),
        (
            "rise(50 m)",
            ["`rise`, a link of this step's chains, takes up to 27 s, and `rise` lasts at most 24 s"],
        ),
    ],
)
def test_a_link_is_proved_from_the_farthest_place_of_the_step(link: str, expected: list[str]) -> None:
    rise = skill("rise(to: altitude in 5 m .. 60 m)", motion="climb to to", lasts="at most 24 s")
    away = skill(f"away({EAST})", motion="fly to aim at top", fallback=f"{link}, return_home, emergency_land", **LONG)
    text = program(rise, away, policy(), mission(UP, f"away({NORTH}, 20 m)", HOME))
    assert [message for code, message in found(text) if code == "E0804"] == expected


@rows(("speed", "expected"), [(3, []), (1, ["E0804"])])
def test_a_return_counts_the_speed_of_the_link_before_it(speed: int, expected: list[str]) -> None:
    """220 m, and 50 m that home may be away: at 1 m/s it takes longer than a return may."""
    chain = f"near(47.39974 N, 8.54559 E, 20 m, {speed} m/s), return_home, emergency_land"
    near = skill(
        "near(aim: position, top: altitude in 5 m .. 50 m, pace: speed in 1 m/s .. 8 m/s)",
        motion="fly to aim at top speed pace", fallback="return_home, emergency_land", lasts="at most 10 min",
    )  # fmt: skip
    away = skill(f"away({EAST})", motion="fly to aim at top", fallback=chain, **LONG)
    rules = policy(contingency="emergency_land")
    text = program(near, away, rules, mission(UP, "away(47.39970 N, 8.54559 E, 20 m)", HOME))
    late = [(code, message) for code, message in found(text) if code == "E0804"]
    assert [code for code, _ in late] == expected
    assert all(message.startswith("`return_home`, a link of this step's chains") for _, message in late)


@pytest.mark.parametrize(("energy", "told"), [(2, True), (11, False)])
def test_a_return_in_a_chain_that_takes_more_than_its_skill_says_is_told_once(energy: int, told: bool) -> None:
    """It is never refused for want of charge, and the mission flies all the same."""
    back = skill(
        "back()", motion="home", fallback="emergency_land", lasts="at most 5 min", energy=f"at most {energy} %"
    )
    away = skill(f"away({EAST})", motion="fly to aim at top", fallback="back, emergency_land", **LONG)
    steps = mission(UP, f"away({NORTH}, 20 m)", f"away({NORTH}, 20 m)", HOME)
    made = compiled(back, away, policy("permit back by any"), steps)
    assert made.bounds is not None
    warned = [each.message for each in made.diagnostics if each.code is codes.RETURN_ENERGY]
    assert len(warned) == told
    assert all(each.startswith("the return, a link of this step's chains, takes up to 10.6 %") for each in warned), (
        warned
    )


@pytest.mark.parametrize("top", ["6 m", "45 m"])
def test_the_nearest_height_that_is_in_time_is_named(top: str) -> None:
    """100 m north of home, and down or up at 1 m/s or 1.5 m/s from 20 m."""
    near = skill(f"near({EAST})", motion="fly to aim at top", lasts="at most 37 s", energy="at most 9 %")
    text = program(near, policy(), mission(UP, f"near(47.39864 N, 8.54559 E, {top})", HOME))
    [late] = [each for each in findings(text) if each.code.id == "E0804"]
    [fix] = late.fixes
    assert text[late.span.start : late.span.end] == top
    fixed = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
    assert [code for code, _ in found(fixed) if code == "E0804"] == []
    further = int(fix.replacement.split()[0]) + (1 if top == "45 m" else -1)
    again = text[: fix.span.start] + f"{further} m" + text[fix.span.end :]
    assert [code for code, _ in found(again) if code == "E0804"] == ["E0804"]


def prepared_steps(*parts: str) -> tuple[PreparedInvocation, ...]:
    """The steps of a program, as on board."""
    made = compiled(*parts)
    assert made.policy is not None
    assert made.mission is not None, made.diagnostics
    policy = prepare(made.policy)
    assert not isinstance(policy, Refusal)
    steps = prepare_mission(bind(made.mission, bytes(32)), policy)
    assert not isinstance(steps, Refusal)
    return steps


def test_on_board_the_way_home_counts_the_slowest_speed_that_was_asked_for() -> None:
    """As the proofs count it, or the boundary would admit what they refuse."""
    goto = "goto(47.398{}9 N, 8.54559 E, 20 m, speed = {} m/s)"
    legs = [goto.format(1, 4), goto.format(2, 2), goto.format(1, 5), "hover()"]
    steps = prepared_steps(policy(), mission(UP, *legs, HOME))
    alone = prepared_steps(policy(), mission(UP, goto.format(1, 2), HOME))[1]
    fast = prepared_steps(policy(), mission(UP, goto.format(1, 5), HOME))[1]
    ways = [step.energy.way_home(100_000, (20_000, 20_000)) for step in (*steps, alone, fast)]
    up, four, two, five, hover, _, slow, quick = ways
    assert four > up >= quick
    assert two == five == hover == slow > four


def test_the_charge_of_a_mission_is_proved_as_on_board() -> None:
    """E0620: with what the steps before may have taken, a step that comes after a slow one finds too little."""
    far = "goto(47.40100 N, 8.54559 E, 20 m, speed = {} m/s)"
    near = "goto(47.39864 N, 8.54559 E, 20 m, speed = {} m/s)"
    long = skill(
        "goto2(target: position, altitude: altitude in 5 m .. 60 m, speed: speed in 1 m/s .. 8 m/s)",
        motion="fly to target at altitude speed speed", lasts="at most 10 min", energy="at most 25 %",
        fallback="emergency_land",
    )  # fmt: skip

    def charged(first: int) -> list[str]:
        legs = [near.format(first).replace("goto(", "goto2("), far.format(8).replace("goto(", "goto2(")]
        rules = policy(contingency="emergency_land")
        return [code for code, _ in found(program(long, rules, mission(UP, *legs, "emergency_land()")))]

    assert charged(8) == []
    assert charged(1) == ["E0620"]
