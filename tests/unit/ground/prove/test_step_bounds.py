"""Proved bounds of steps and links, by declared speeds and wind (E0804, E0814, E0815)."""

from pathlib import Path

import pytest

from reference.sources import LIBRARY, findings, found, mission, policy, program, skill
from rtshcua.decision.prepare import PreparedInvocation, prepare, prepare_mission
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.ground.prove.step_time_and_energy import StepBound
from rtshcua.mavlink import dialect
from rtshcua.wire.binding import bind
from virtual.rows import rows

UP, HOME = "takeoff(altitude = 20 m)", "return_home()"
#: 200 m north of home
NORTH = "47.39954 N, 8.54559 E"
LONG = {"lasts": "at most 5 min", "energy": "at most 30 %"}
EAST = "aim: position, top: altitude in 5 m .. 50 m"


def compiled(*parts: str) -> Compiled:
    """Compile a program."""

    def read(path: str) -> bytes:
        return program(*parts).encode() if path == "probe.rts" else Path(path).read_bytes()

    return compile_program(load(["probe.rts"], read, LIBRARY), dialect.load(), mission=None, issued_at_us=1)


def bounds(*parts: str) -> tuple[StepBound, ...]:
    """Return the proved bounds of the steps of a program."""
    made = compiled(*parts)
    assert made.bounds is not None, made.diagnostics
    return made.bounds.steps


def seconds(clauses: dict[str, str], *rules: str, speed: str = "12 m/s") -> int:
    """Return the bound for a flight of 200 m in whole seconds, without the time for commands."""
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
        ({"assume": "wind.speed < 13 m/s"}, [], 33),  # above the limit of the vehicle
        ({}, ["degrade fast when wind.speed > 4 m/s to return_home"], 28),
        ({}, ["degrade hover when wind.speed > 4 m/s to return_home"], 33),
    ],
)
def test_wind_counts_up_to_the_limit_at_which_the_step_continues(
    clauses: dict[str, str], rules: list[str], expected: int
) -> None:
    assert seconds(clauses, *rules) == expected


def test_step_flies_at_most_at_its_own_speed() -> None:
    assert seconds({}, speed="2 m/s") == 102


def test_return_may_keep_the_slowest_speed_of_the_steps_before() -> None:
    """PX4 keeps a speed that was set."""
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
            ["`goto`, a link of this step's chains, takes up to 233 s, but `goto` lasts at most 2 min"],
        ),
        ("rise(45 m)", []),
        (
            "rise(50 m)",
            ["`rise`, a link of this step's chains, takes up to 27 s, but `rise` lasts at most 24 s"],
        ),
    ],
)
def test_link_is_proved_from_the_farthest_place_of_the_step(link: str, expected: list[str]) -> None:
    rise = skill("rise(to: altitude in 5 m .. 60 m)", motion="climb to to", lasts="at most 24 s")
    away = skill(f"away({EAST})", motion="fly to aim at top", fallback=f"{link}, return_home, emergency_land", **LONG)
    text = program(rise, away, policy(), mission(UP, f"away({NORTH}, 20 m)", HOME))
    assert [message for code, message in found(text) if code == "E0804"] == expected


@rows(("speed", "expected"), [(3, []), (1, ["E0804"])])
def test_return_may_keep_the_speed_of_the_link_before(speed: int, expected: list[str]) -> None:
    """220 m plus 50 m position error of home: at 1 m/s this exceeds the duration of the return."""
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


@pytest.mark.parametrize(("energy", "reported"), [(2, True), (11, False)])
def test_return_above_its_energy_is_reported_once(energy: int, reported: bool) -> None:
    """A return is never refused for lack of charge, so this is only a warning."""
    back = skill(
        "back()", motion="home", fallback="emergency_land", lasts="at most 5 min", energy=f"at most {energy} %"
    )
    away = skill(f"away({EAST})", motion="fly to aim at top", fallback="back, emergency_land", **LONG)
    steps = mission(UP, f"away({NORTH}, 20 m)", f"away({NORTH}, 20 m)", HOME)
    made = compiled(back, away, policy("permit back by any"), steps)
    assert made.bounds is not None
    warned = [each.message for each in made.diagnostics if each.code is codes.RETURN_ENERGY]
    assert len(warned) == reported
    assert all(each.startswith("the return, a link of this step's chains, needs up to 10.6 %") for each in warned), (
        warned
    )


@pytest.mark.parametrize("top", ["6 m", "45 m"])
def test_fix_names_the_nearest_height_that_is_reached_in_time(top: str) -> None:
    """100 m north of home, from 20 m down at 1 m/s or up at 1.5 m/s."""
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
    """Return the steps of a program, prepared as on board."""
    made = compiled(*parts)
    assert made.policy is not None
    assert made.mission is not None, made.diagnostics
    policy = prepare(made.policy)
    assert not isinstance(policy, Refusal)
    steps = prepare_mission(bind(made.mission, bytes(32)), policy)
    assert not isinstance(steps, Refusal)
    return steps


def test_way_home_on_board_uses_the_slowest_speed_set_before() -> None:
    """The proofs use the same speed, or the boundary would admit steps that they refuse."""
    goto = "goto(47.398{}9 N, 8.54559 E, 20 m, speed = {} m/s)"
    legs = [goto.format(1, 4), goto.format(2, 2), goto.format(1, 5), "hover()"]
    steps = prepared_steps(policy(), mission(UP, *legs, HOME))
    alone = prepared_steps(policy(), mission(UP, goto.format(1, 2), HOME))[1]
    fast = prepared_steps(policy(), mission(UP, goto.format(1, 5), HOME))[1]
    ways = [step.energy.way_home(100_000, (20_000, 20_000)) for step in (*steps, alone, fast)]
    up, four, two, five, hover, _, slow, quick = ways
    assert four > up >= quick
    assert two == five == hover == slow > four


def test_charge_proof_agrees_with_the_decision_on_board() -> None:
    """E0620: after a slow step, the next step may lack charge."""
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
