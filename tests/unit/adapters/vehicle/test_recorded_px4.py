"""The recorded flight of PX4 1.16, replayed through driver and state monitor second by second."""

import pytest

from recorded.flown import Recorded, command, shipped_policy
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import AirState, CommandFailed, Ready, StatusText, Succeeded, TakenOver

HOME = (473_977_400, 85_456_000)
NORTH_40 = (HOME[0] + 3_593, HOME[1])
NORTH_40_EAST_40 = (NORTH_40[0], HOME[1] + 5_308)
FAR = (HOME[0] + 9_000, HOME[1])
#: what happened, in seconds after the autopilot's start
READY, ARMED, RETURN, DISARMED = 5.6, 10.6, 87.1, 147.0


@pytest.fixture(scope="module")
def watched() -> Recorded:
    """The replay without commands of ours: a foreign flight."""
    return Recorded("px4", 370_000, shipped_policy(), {"RTL_RETURN_ALT": 30.0})


@pytest.fixture(scope="module")
def flown() -> Recorded:
    """The replay with the recorded commands as ours, and an unanswered command at 56 s."""
    return Recorded("px4", 370_000, shipped_policy(), {"RTL_RETURN_ALT": 30.0}, (
        (ARMED, command(1, MotionKind.CLIMB, altitude=15_000)),
        (26.9, command(2, MotionKind.FLY, *NORTH_40, altitude=15_000)),
        (41.0, command(3, MotionKind.FLY, *NORTH_40_EAST_40, altitude=15_000)),
        (56.0, command(4, MotionKind.FLY, *FAR, altitude=15_000)),
        (RETURN - 0.3, command(5, MotionKind.HOME)),
    ))  # fmt: skip


def test_position_is_known_with_the_estimator(watched: Recorded) -> None:
    """The first reports of the estimator, at 2.4 s, have a height and no place."""
    assert watched.known("position") == [(3, 150)]
    assert watched.known("height") == [(3, 150)]
    assert watched.known("gps.fix")[0][0] <= 2


def test_px4_is_ready_when_it_can_arm(watched: Recorded) -> None:
    """PX4 sets the health bit of its pre-arm check without declaring that it has one. A battery's second report is
    waited for.
    """
    ((ready, _),) = watched.of(Ready)
    assert READY - 0.3 < ready < READY + 2


def test_px4_signal_without_request_is_unknown(watched: Recorded) -> None:
    assert watched.known("wind.speed") == watched.known("link.quality") == []


def test_a_text_in_two_chunks_is_one(watched: Recorded) -> None:
    texts = [event.text for _, event in watched.of(StatusText)]
    assert "RTL: start return at 519 m (30 m above destination)" in texts
    assert texts[:2] == ["Armed by external command", "Takeoff detected"]
    assert len(texts) == 7


def test_return_is_a_takeover_and_takeoff_end_is_not(watched: Recorded) -> None:
    ((at, taken),) = watched.of(TakenOver)
    assert abs(at - RETURN) < 0.2
    assert taken.how == "Return"


def test_armed_and_airborne_states_are_reported(watched: Recorded) -> None:
    states = [(round(at), event.armed, event.airborne) for at, event in watched.of(AirState)]
    assert [state[1:] for state in states] == [
        (False, False), (True, False), (True, True), (True, False), (False, False),
    ]  # fmt: skip
    assert (states[1][0], states[2][0], states[3][0], states[4][0]) == (10, 12, 145, 147)


def test_the_effects_of_our_commands_are_seen_in_the_recording(flown: Recorded) -> None:
    ends = {event.token: at for at, event in flown.of(Succeeded)}
    assert list(ends) == [1, 2, 3, 5]
    assert 20 < ends[1] < 26.9
    assert 30 < ends[2] < 41
    assert 44 < ends[3] < 55
    assert 0.4 <= ends[5] - DISARMED < 0.7, "it is seen to lie there"
    assert not flown.of(TakenOver)


def test_a_command_that_is_never_answered_has_an_unknown_outcome(flown: Recorded) -> None:
    ((at, failed),) = flown.of(CommandFailed)
    assert (failed.token, failed.reason) == (4, "unknown/no-answer")
    assert 63 < at < 66, "nothing came nearer for 8 s"
    sent = [(at, frame.message) for at, frame in flown.sent if frame.name == "COMMAND_INT" and 55 < at < 87]
    assert 4 <= len(sent) <= 6, "sent again, a second apart, and then no more"


def test_frames_that_the_dialect_does_not_have_are_passed_over(watched: Recorded) -> None:
    assert watched.driver.link._codec.unknown > 340
    assert watched.driver.link._codec.damaged == 0
