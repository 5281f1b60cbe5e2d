"""The recorded flight of ArduCopter 4.7, replayed through driver and state monitor second by second."""

import pytest

from recorded.flown import Recorded, at_home, command
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import AirState, CommandFailed, LinkLost, Noted, Ready, StatusText, Succeeded, TakenOver

HOME = (-353_632_621, 1_491_652_371)
NORTH_40 = (HOME[0] + 3_593, HOME[1])
NORTH_40_EAST_40 = (NORTH_40[0], HOME[1] + 4_406)
#: what happened, in seconds after the autopilot's start
USING_GPS, ARMED, GPS_OFF, GPS_ON, TAKEN, RETURN, LANDED = 41.6, 42.3, 77.9, 85.9, 86.0, 107.0, 158.0


@pytest.fixture(scope="module")
def watched() -> Recorded:
    """The replay without commands of ours: a foreign flight."""
    return Recorded("arducopter", 1_000_000, at_home(*HOME), {"RTL_ALT": 3_000.0})


@pytest.fixture(scope="module")
def flown() -> Recorded:
    """The replay with the recorded commands as ours."""
    return Recorded("arducopter", 1_000_000, at_home(*HOME), {"RTL_ALT": 3_000.0}, (
        (ARMED, command(1, MotionKind.CLIMB, altitude=15_000)),
        (53.8, command(2, MotionKind.FLY, *NORTH_40, altitude=15_000)),
        (65.9, command(3, MotionKind.FLY, *NORTH_40_EAST_40, altitude=15_000)),
    ))  # fmt: skip


@pytest.mark.slow
def test_position_is_unknown_until_the_estimator_uses_gps(watched: Recorded) -> None:
    """GLOBAL_POSITION_INT began 39 seconds before, and the receiver had its fix for 31 seconds."""
    for signal in ("position", "height"):
        (first, _), *_ = watched.known(signal)
        assert USING_GPS < first <= USING_GPS + 2, signal
    (first, _), *_ = watched.known("gps.fix")
    assert first == 11


def test_readiness_follows_the_estimator_not_the_prearm_bit(watched: Recorded) -> None:
    ((ready, _),) = watched.of(Ready)
    assert USING_GPS < ready < ARMED


def test_lost_gps_is_seen_before_the_lost_position(watched: Recorded) -> None:
    (_, lost), (found, last) = watched.known("gps.fix")
    assert GPS_OFF < lost + 1 <= GPS_OFF + 2
    assert GPS_ON < found <= GPS_ON + 2
    (_, given_up), (again, _) = watched.known("position")
    assert (given_up, again) == (85, 87), "the estimator went on alone for seven seconds, and said when it could not"
    assert last == again + 75


def test_the_height_stays_known_without_gps(watched: Recorded) -> None:
    assert len(watched.known("height")) == 1
    assert 14_000 < watched.states[86]["height"] < 16_000


def test_arducopter_signal_without_report_is_unknown(watched: Recorded) -> None:
    assert watched.known("obstacle.distance") == watched.known("link.quality") == []


def test_missing_wind_estimate_is_unknown(watched: Recorded) -> None:
    """From 65.9 on the wind was 8 m/s, but WIND reported 0: an untuned copter does not estimate it."""
    assert watched.known("wind.speed") == []


def test_the_battery_is_known_with_its_stream(watched: Recorded) -> None:
    assert watched.known("battery") == [(3, 162)]


def test_failsafe_is_a_takeover_without_a_command(watched: Recorded) -> None:
    taken = [(at, event.how) for at, event in watched.of(TakenOver)]
    assert [mode for _, mode in taken] == ["LAND", "RTL"]
    assert abs(taken[0][0] - TAKEN) < 0.2
    assert abs(taken[1][0] - RETURN) < 0.2


def test_mode_changes_on_the_ground_are_not_takeovers(watched: Recorded) -> None:
    assert watched.of(TakenOver)[0][0] > 60


def test_armed_and_airborne_states_are_reported(watched: Recorded) -> None:
    states = [(at, event.armed, event.airborne) for at, event in watched.of(AirState)]
    assert [state[1:] for state in states] == [
        (False, False), (True, False), (True, True), (True, False), (False, False),
    ]  # fmt: skip
    assert states[1][0] < 43.5
    assert abs(states[3][0] - LANDED) < 1
    assert not watched.of(LinkLost)


def test_its_texts_are_heard_whole(watched: Recorded) -> None:
    texts = {event.text: (at, event.severity) for at, event in watched.of(StatusText)}
    assert len(texts) == 31
    assert texts["EKF3 IMU0 is using GPS"] == (USING_GPS, 6)
    assert abs(texts["EKF Failsafe: changed to LAND Mode"][0] - TAKEN) < 0.2
    assert texts["EKF Failsafe: changed to LAND Mode"][1] == 2


@pytest.mark.slow
def test_the_effects_of_our_commands_are_seen_in_the_recording(flown: Recorded) -> None:
    ends = [(at, event.token) for at, event in flown.of(Succeeded)]
    assert [token for _, token in ends] == [1, 2, 3]
    assert 52 < ends[0][0] < 53.8, "15 m reached"
    assert 58 < ends[1][0] < 65.9
    assert 70 < ends[2][0] < 77
    assert not flown.of(CommandFailed)


def test_after_our_last_command_the_failsafe_takes_over(flown: Recorded) -> None:
    ((at, taken), *_) = flown.of(TakenOver)
    assert abs(at - TAKEN) < 0.2
    assert taken.how == "LAND"


def test_unanswered_stream_requests_are_noted(watched: Recorded) -> None:
    """The recorded client had requested 1 Hz for some streams; most came at 4 Hz."""
    notes = [event.text for _, event in watched.of(Noted)]
    assert "the vehicle's own fence was left unchanged" in notes
    assert not any("GLOBAL_POSITION_INT" in note for note in notes)


def test_a_critical_state_is_told_though_the_mode_stays(watched: Recorded) -> None:
    """The battery failsafe triggered at 111.1, during a return."""
    told = [(at, event.text) for at, event in watched.of(Noted) if "critical" in event.text]
    assert [text for _, text in told][:3] == [
        "the vehicle reports a critical state", "the vehicle's state is no longer critical",
        "the vehicle reports a critical state",
    ]  # fmt: skip
    assert abs(told[0][0] - TAKEN) < 0.2
    assert 111 < told[2][0] < 113


def test_recorded_return_altitude_prevents_readiness() -> None:
    other = Recorded("arducopter", 1_000_000, at_home(*HOME), {"RTL_ALT": 1_500.0}, until_s=ARMED)
    assert not [at for at, _ in other.of(Ready) if at < ARMED]
