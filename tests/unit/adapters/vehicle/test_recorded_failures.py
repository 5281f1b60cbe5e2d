"""Ten recorded flights with a failure, replayed through the present driver.

Times are seconds from the first frame of the recording (`tests/traces/README.md`).
"""

from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded.flown import Recorded, command, shipped_policy, stock
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.decision.running_conditions import watch
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.signal import CELL
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import CommandFailed, LinkBack, LinkLost, StatusText, TakenOver

BRIDGE = (473_987_600, 85_469_800)
NOWHERE = (1 << 31) - 1


def leg(token: int = 1) -> Any:
    return command(token, MotionKind.FLY, *BRIDGE, altitude=20_000, speed=6_000)


def hover(token: int = 2) -> Any:
    return command(token, MotionKind.HOLD)


def flown(name: str, *commands: tuple[float, Any], until_s: float) -> Recorded:
    return Recorded(name, 0, shipped_policy(), {"RTL_RETURN_ALT": 30.0}, commands, acknowledges=True, until_s=until_s)


def legs_sent(of: Recorded) -> list[float]:
    """The times at which legs were sent."""
    return [
        at
        for at, frame in of.sent
        if (frame.name == "COMMAND_INT" and frame.message.x != NOWHERE)
        or frame.name == "SET_POSITION_TARGET_GLOBAL_INT"
    ]


def test_a_hover_that_does_not_stop_is_seen_within_seconds() -> None:
    """It continued at 4.5 to 5.6 m/s for the 10 s of the hover, about 46 m, and the hover counted as successful."""
    seen = flown("px4-hover-does-not-stop", (21.27, leg()), (25.71, hover()), until_s=31)
    (at, failed), *_ = seen.of(CommandFailed)
    assert (failed.token, failed.reason) == (2, "did-not-stop")
    assert 28 < at < 30


def test_landing_between_heartbeats_prevents_the_next_leg() -> None:
    """No HEARTBEAT shows the pilot's Land: the target shows it first, and the landed state from 17.38 s on."""
    seen = flown("px4-takeover-race", (12.0, hover()), (18.15, leg(3)), until_s=40)
    (at, taken), *_ = seen.of(TakenOver)
    assert 17.25 < at < 17.5
    assert taken.how in ("landing", "another target")
    assert legs_sent(seen) == []


@pytest.mark.parametrize(
    ("name", "begun", "taken_at"), [("px4-pilot-pause", 19.86, 25.07), ("px4-pilot-goto", 19.69, 24.73)]
)
def test_a_pause_and_a_go_to_without_a_change_of_mode_are_seen(name: str, begun: float, taken_at: float) -> None:
    """The pause was reported as `stopped-short` after 12 s; the go-to was not detected for 41 s."""
    seen = flown(name, (begun, leg()), until_s=60)
    (at, taken), *_ = seen.of(TakenOver)
    assert taken_at - 0.1 < at < taken_at + 0.3
    assert taken.how == "another target"
    assert len(legs_sent(seen)) == 1


def test_a_guided_target_is_not_overwritten() -> None:
    """Our target was repeated every 2 s and overrode the pilot's. Now it is not repeated after a leg began.

    That autopilot's target was not requested, so the recording does not contain it.
    """
    seen = flown("arducopter-pilot-goto", (18.6, leg()), until_s=61)
    assert len([at for at in legs_sent(seen) if at < 60]) <= 2


#: the start of a cut recording, in seconds of the original
FIRST_S = {"arducopter-velocity-takeover": 0.26, "arducopter-pause-takeover": 0.25}
FAR = (473_996_000, 85_455_900)


def far_leg() -> Any:
    return command(1, MotionKind.FLY, *FAR, altitude=20_000, speed=6_000)


@pytest.mark.parametrize(
    ("name", "begun", "taken_at", "how"),
    [
        ("arducopter-velocity-takeover", 49.88, 52.87, "no target"),  # it was braked at 62.58, and flown home
        ("arducopter-pause-takeover", 49.29, 57.0, "paused"),  # at 63.28; it stands from 54.9 s on
    ],
)
def test_a_velocity_and_a_pause_in_guided_are_seen_and_not_fought(
    name: str, begun: float, taken_at: float, how: str
) -> None:
    """The numbers of the frames in these recordings have gaps, so that only many heartbeats without a target tell."""
    seen = flown(name, (begun - FIRST_S[name], far_leg()), until_s=64 - FIRST_S[name])
    (at, taken), *_ = seen.of(TakenOver)
    assert taken.how == how
    late = 2.6 if how == "no target" else 0.5  # without answers, 25 heartbeats
    assert taken_at - 0.7 < at + FIRST_S[name] < taken_at + late
    steers = [frame.name for _, frame in seen.sent if frame.name == "SET_POSITION_TARGET_GLOBAL_INT"]
    modes = [f for _, f in seen.sent if f.name == "COMMAND_LONG" and f.message.command == mavlink.MAV_CMD_DO_SET_MODE]
    assert len(steers) == 1
    assert not modes


def test_leg_after_an_undone_land_changes_no_mode() -> None:
    """The recording does not show the Land, so the next command must not be able to undo it."""
    seen = flown("px4-land-undone", (30.86, hover()), (33.45, leg(3)), until_s=38)
    sent = [frame.message for _, frame in seen.sent if frame.name == "COMMAND_INT"]
    assert sent
    assert {message.param2 for message in sent} == {0.0}


def test_after_a_dropout_all_is_known_again_before_a_second_is_over() -> None:
    """At the first frames after 5 s of silence every other signal was stale: a decision then would land the vehicle."""
    seen = flown("arducopter-dropout", (14.5, leg()), until_s=60)
    (lost, why), *_ = seen.of(LinkLost)
    (back, _), *_ = seen.of(LinkBack)
    assert why.why == "silent"
    assert 17.5 < lost < 19.5
    assert 22.4 < back < 22.7
    before, known = seen.states[17], seen.states[24]
    assert before["battery.drain"] is None, "the charge changed too seldom in this recording"
    assert {name for name, value in known.items() if value is None} <= {
        "wind.speed",
        "link.quality",
        "obstacle.distance",
        "battery.drain",
    }
    assert not [frame for _, frame in seen.sent if frame.name == "COMMAND_LONG" and frame.message.command in LANDS]


def test_sagging_cells_and_fast_drain_are_both_detected() -> None:
    """10.2 V of three cells from 21.79 s on: flown on for 245 s, and landed with 7 % of a charge that was to be 15 %.

    ArduCopter's own failsafe triggered 10 s later. The shipped rule, for three cells, triggers at the next report.
    """
    policy, mission = stock()
    index, cell = next((number, each) for number, each in enumerate(policy.signals) if each.name == CELL)
    signals = list(policy.signals)
    signals[index] = replace(cell, sources=(replace(cell.sources[0], denominator=3),))
    policy = replace(policy, signals=tuple(signals))
    prepared = prepare(policy)
    assert not isinstance(prepared, Refusal)
    steps = prepare_mission(mission, prepared)
    assert not isinstance(steps, Refusal)
    step, rule = next(
        (each, degrade.rule.text)
        for each in steps
        for degrade in each.candidates.degrades
        if "battery.cell" in degrade.rule.text and each.invocation.contract.motion.kind != MotionKind.CLIMB
    )
    seen = Recorded("arducopter-low-voltage", 0, policy, {"RTL_ALT": 3_000.0}, ((17.6, far_leg()),), acknowledges=True)

    def truths(second: int) -> dict[str, int]:
        return {each.text: each.truth for each in watch(step, seen.monitored[second], prepared, Now(0, 0, 0))}

    known = [second for second, state in enumerate(seen.states) if state["battery.cell"] is not None]
    assert {second for second in known if truths(second).get(rule, TRUE) == FALSE} == {*range(22, known[-1] + 1)}
    assert {seen.states[second]["battery.cell"] for second in known} == {4_200, 3_400}
    (late, _) = next(each for each in seen.of(StatusText) if "Failsafe" in each[1].text)
    assert 31 < late < 32
    assert abs((seen.states[40]["battery.drain"] or 0) - 1_760) * 10 <= 1_760
    assert seen.driver.consumption.summary[0].startswith("6.2 % a minute declared, ")


LANDS = (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_NAV_LAND)
