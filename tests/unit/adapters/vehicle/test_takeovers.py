"""Foreign control of the vehicle is detected, with or without a mode change, and never overridden.

The required property, over the moments at which a pilot may act, the phases of the reports and the delays of the link:
no frame that moves the vehicle leaves later than W after the takeover took effect, where W is how old a mode report may
be on which a frame leaves, and the link's delay; and a takeover that shows after a frame of ours was on its way ends
what we do.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.flavour import ExpectedTarget
from rtshcua.adapters.vehicle.manoeuvre import ANSWER_MOST_US, TARGET_US, UNNAMED_MOST_US
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.adapters.vehicle.supervision import TargetWatch
from rtshcua.codec.frames import Codec
from rtshcua.model.faults import (
    EstimatorUnhealthy,
    Fault,
    FlightMode,
    LinkDelay,
    LinkLoss,
    MessageSilence,
    Obstacle,
    PilotGoto,
    PilotMode,
    PilotPause,
    PilotSpeed,
    PilotSticks,
    PilotVelocity,
    WindStep,
)
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, CommandFailed, Hindered, Noted, Ready, Succeeded, TakenOver
from rtshcua.wire.permit import LINK_VALID_US
from virtual.copying import copied
from virtual.flyer import Flyer, climbed
from virtual.policy import POLICY, geo
from virtual.sampling import each_once

Make = Callable[..., Any]
ASKS = (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE)
MS, S = 1_000, 1_000_000
WITHIN_US = {"px4": PX4.mode_within_us, "ardupilot": ARDUPILOT.mode_within_us}
#: the longest time until the driver's next check
TICK_US = 40 * MS
#: the report interval of landed state and target
REPORTED_US = 100 * MS
DELAYS_US = (0, 20 * MS, 150 * MS)
#: the target of our next command, in mm
NEXT = (200_000, 90_000)


def moves(frame: bytes) -> bool:
    """Whether the frame has an effect on an autopilot."""
    for received in Codec(1, 1).parse(frame):
        if received.name.startswith("COMMAND_"):
            return received.message.command not in (
                mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
                mavlink.MAV_CMD_REQUEST_MESSAGE,
            )
        if received.name == "SET_POSITION_TARGET_GLOBAL_INT":
            return True
    return False


def steers(frame: bytes) -> bool:
    """Whether the frame commands a target or a mode: a speed alone is not a takeover."""
    (received,) = Codec(1, 1).parse(frame)
    return getattr(received.message, "command", None) != mavlink.MAV_CMD_DO_CHANGE_SPEED


class Sent:
    """The times of frames that move the vehicle, and those that steer it."""

    def __init__(self, one: Any) -> None:
        self.at_us: list[int] = []
        self.steering_us: list[int] = []
        self._one = one
        one.vehicle.lose = self

    def __call__(self, frame: bytes) -> bool:
        if moves(frame):
            self.at_us.append(self._one.now_us)
            if steers(frame):
                self.steering_us.append(self._one.now_us)
        return False


TAKEOVERS: dict[str, Callable[[int], Fault]] = {
    "pause": PilotPause,
    "go-to": lambda at_us: PilotGoto(at_us, -60_000, 40_000, 25_000),
    "go-to lower": lambda at_us: PilotGoto(at_us, 0, 300_000, 12_000),
    "land": lambda at_us: PilotMode(at_us, FlightMode.LAND),
    "return": lambda at_us: PilotMode(at_us, FlightMode.RETURN),
    "position": lambda at_us: PilotMode(at_us, FlightMode.POSITION),
}


@cache
def in_a_leg(flavour: str) -> Flyer:
    """A vehicle five seconds into a leg."""
    one = copied(climbed(flavour, 20_000))
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=5_000)
    one.wait(5)
    return one


@cache
def held(flavour: str) -> Flyer:
    """A vehicle that stopped during a leg, and stands."""
    one = copied(in_a_leg(flavour))
    one.begin(MotionKind.HOLD)
    one.wait(8)
    return one


@cache
def climbing(flavour: str, height: int) -> Flyer:
    """A vehicle at a height, in mm, on its climb to 20 m."""
    one = copied(ready(flavour))
    one.begin(MotionKind.CLIMB, altitude=20_000)
    while one.truth.up_mm < height:
        one.wait(0.1)
    return one


@cache
def ready(flavour: str) -> Flyer:
    one = Flyer(flavour)
    one.until(Ready)
    return one


@pytest.mark.slow
@pytest.mark.parametrize("name", TAKEOVERS)
def test_a_takeover_in_a_leg_is_seen_and_not_fought(flavour: str, name: str) -> None:
    """PX4's pause and go-to, and ArduCopter's guided target, change no mode (recorded)."""
    one = copied(in_a_leg(flavour))
    sent = Sent(one)
    one.vehicle.simulation.inject(TAKEOVERS[name](0))
    # a paused ArduCopter still reports our target, so only its motion shows it
    taken = one.until((TakenOver, CommandFailed), 5.5 if (name, flavour) == ("pause", "ardupilot") else 3)
    assert isinstance(taken, TakenOver), taken
    one.wait(10)
    assert sent.at_us == []


def test_a_velocity_in_guided_is_a_takeover_at_once() -> None:
    """Recorded: no target is reported any more, and the mode stays. Our command overrode it 10 s later."""
    one = copied(in_a_leg("ardupilot"))
    sent = Sent(one)
    one.vehicle.simulation.inject(PilotVelocity(0, -3_000, 0))
    assert one.until(TakenOver, 0.5).how == "no target"
    one.wait(10)
    assert sent.at_us == []


@pytest.mark.parametrize("kind", [MotionKind.HOLD, MotionKind.HOME, MotionKind.FLY])
@pytest.mark.parametrize("after_ms", [40, 220, 300])
def test_command_after_a_pilot_velocity_leaves_only_within_the_window(kind: MotionKind, after_ms: int) -> None:
    one = copied(in_a_leg("ardupilot"))
    one.vehicle.simulation.inject(PilotVelocity(one.vehicle.simulation.now_us + 20 * MS, -3_000, 0))
    takes_us = one.now_us + 20 * MS
    one.wait((20 + after_ms) / 1_000)
    sent = Sent(one)
    if not any(isinstance(event, TakenOver) for event in one.events):
        path = [NEXT] if kind == MotionKind.FLY else []
        one.begin(kind, *path, altitude=25_000 if path else 0, speed=5_000 if path else 0)
    one.wait(8)
    assert max(sent.at_us, default=0) <= takes_us + WITHIN_US["ardupilot"] + TICK_US
    if after_ms > 200:
        assert any(isinstance(event, TakenOver) for event in one.events)
        assert sent.at_us == []


@pytest.mark.parametrize("loss", [2_000, 5_000, 9_000])
def test_lost_reports_are_not_a_takeover(loss: int) -> None:
    one = copied(in_a_leg("ardupilot"))
    one.vehicle.simulation.inject(LinkLoss(0, loss))
    assert not any(isinstance(event, TakenOver) for event in one.wait(40))


def test_a_way_home_waits_no_longer_than_its_permit_lasts() -> None:
    """Regression: it waited a second for a target, was then too late, and the vehicle landed on the spot."""
    for flavour in (PX4, ARDUPILOT):
        assert UNNAMED_MOST_US + ANSWER_MOST_US + flavour.mode_within_us < LINK_VALID_US - TICK_US


def test_a_velocity_is_noticed_where_half_of_all_is_lost() -> None:
    one = copied(in_a_leg("ardupilot"))
    one.vehicle.simulation.inject(LinkLoss(0, 5_000))
    one.wait(2)
    one.vehicle.simulation.inject(PilotVelocity(0, -3_000, 0, 20 * S))
    assert one.until(TakenOver, 8).how == "no target"


NOT_PAUSED: dict[str, tuple[Fault, ...]] = {
    "a strong wind": (WindStep(0, 14_000, 0),),
    "an obstacle": (Obstacle(0, 4_000), PilotPause(0)),
    "without a position": (EstimatorUnhealthy(0), PilotPause(0)),
}


@pytest.mark.parametrize("name", NOT_PAUSED)
def test_vehicle_standing_for_a_reason_is_not_paused(name: str) -> None:
    one = copied(in_a_leg("ardupilot"))
    streams(one, "DISTANCE_SENSOR", 100 * MS)
    one.wait(0.5)
    for fault in NOT_PAUSED[name]:
        one.vehicle.simulation.inject(fault)
    taken = [event.how for event in one.wait(12) if isinstance(event, TakenOver)]
    assert taken in ([], ["LAND"]), taken  # without a position it lands


def test_end_of_a_leg_is_not_a_takeover(aloft: Make) -> None:
    """The vehicle stands at its target, and no command follows for a while."""
    one = aloft()
    assert isinstance(one.fly(MotionKind.FLY, (60_000, 0), altitude=20_000, speed=8_000), Succeeded)
    assert not any(isinstance(event, TakenOver) for event in one.wait(30))


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_leg_that_somebody_slows_down_says_so_once(flavour: str) -> None:
    one = copied(in_a_leg(flavour))
    one.wait(5)
    one.vehicle.simulation.inject(PilotSpeed(0, 1_000))
    told = [event.text for event in one.wait(20) if isinstance(event, Hindered)]
    assert told == ["it flies at 1.0 m/s instead of 5.0 m/s: somebody else may have changed its speed"]
    assert not any(isinstance(event, (TakenOver, CommandFailed)) for event in one.events)


@pytest.mark.parametrize("result", [0, 4])
def test_command_accepted_from_another_invalidates_older_reports(result: int) -> None:
    """No report shows the Land yet: our next command waits for a report of a later time."""
    one = copied(held("px4"))
    one.vehicle._tick_us = MS
    sent = Sent(one)
    answer = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_LAND, result, 0, 0, 255, 190)
    one.begin(MotionKind.FLY, NEXT, altitude=25_000, speed=5_000)
    one.wait(0.024)
    before_us = one.now_us
    one.vehicle._take([Codec(1, 1).pack(answer)], one.events)
    one.wait(0.2)
    late = sent.at_us[0] - before_us >= 20 * MS
    assert late == (result == 0)


def test_command_accepted_from_another_after_ours_is_noted() -> None:
    one = copied(held("px4"))
    one.begin(MotionKind.FLY, NEXT, altitude=25_000, speed=5_000)
    one.wait(0.2)
    answer = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, 0, 0, 0, 255, 190)
    for _ in range(2):
        one.vehicle._take([Codec(1, 1).pack(answer)], one.events)
    (told,) = [event.text for event in one.events if isinstance(event, Noted) and "frame of ours left" in event.text]
    assert "255/190 was granted a mode" in told


#: ArduCopter's answer to a ground station that pauses it
PAUSED = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0, 0, 0, 255, 190)

CLIMBING = {
    **TAKEOVERS,
    "go-to beside": lambda at_us: PilotGoto(at_us, 0, 12_000, 20_000),
    "go-to above": lambda at_us: PilotGoto(at_us, 0, 0, 24_000),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CLIMBING)
@pytest.mark.parametrize("height", [3_000, 17_800])
def test_a_takeover_in_a_climb_is_seen_and_not_fought(flavour: str, name: str, height: int) -> None:
    """ArduCopter has no target to report in a takeoff (recorded), PX4 the same one from its first to its last moment.
    ArduCopter's pause shows in its motion, and in the answer to its sender.
    """
    one = copied(climbing(flavour, height))
    sent = Sent(one)
    one.vehicle.simulation.inject(CLIMBING[name](0))
    if (name, flavour) == ("pause", "ardupilot"):
        one.vehicle._take([Codec(1, 1).pack(PAUSED)], one.events)
        end = one.until((TakenOver, CommandFailed, Succeeded), 30)
        assert isinstance(end, Succeeded if height > 17_000 else TakenOver)
        return
    one.until(TakenOver, 0.4)
    one.wait(5)
    assert sent.at_us == []


SLOWLY_UP: dict[str, tuple[Fault, ...]] = {
    "velocity": (PilotVelocity(0, -2_000, 0, 60 * S),),
    "slow velocity": (PilotVelocity(0, 0, 1_000, 60 * S),),
    "pause": (PilotPause(0),),
    "slowed down, and paused": (PilotSpeed(0, 2_500), PilotPause(200 * MS)),
}


@pytest.mark.parametrize("name", SLOWLY_UP)
@pytest.mark.parametrize(("height", "within_s"), [(500, 13), (5_000, 5), (15_000, 13)])
def test_climb_held_down_by_others_is_a_takeover(name: str, height: int, within_s: float) -> None:
    """ArduCopter reports no target in a takeoff: sideways motion shows the takeover, or an answer to another sender
    that it obeys.
    """
    one = copied(climbing("ardupilot", height))
    sent = Sent(one)
    now_us = one.vehicle.simulation.now_us
    for fault in SLOWLY_UP[name]:
        one.vehicle.simulation.inject(replace(fault, at_us=now_us + fault.at_us))
    if "pause" in name:
        one.vehicle._take([Codec(1, 1).pack(PAUSED)], one.events)
    assert isinstance(one.until((TakenOver, CommandFailed, Succeeded), within_s), TakenOver)
    assert sent.at_us == []


@pytest.mark.parametrize("ceiling_mm", [7_000, 17_000])
def test_stalled_climb_without_intervention_is_not_a_takeover(ceiling_mm: int) -> None:
    """Weight, weak motors or a fence stop the climb. Regression: it counted as a pause, and the run stood down."""
    one = Flyer("ardupilot", ceiling_mm=ceiling_mm)
    one.until(Ready)
    one.begin(MotionKind.CLIMB, altitude=20_000)
    end = one.until((TakenOver, CommandFailed, Succeeded), 40)
    assert isinstance(end, CommandFailed), end
    assert end.reason == "stopped-short"


@pytest.mark.parametrize("delay_us", [0, 150 * MS])
def test_the_first_leg_waits_for_no_target_that_arducopter_never_tells(aloft: Make, delay_us: int) -> None:
    one = aloft()
    if delay_us:
        one.vehicle.simulation.inject(LinkDelay(0, delay_us))
        one.wait(2)
    sent = Sent(one)
    begins_us = one.now_us
    one.begin(MotionKind.FLY, (200_000, 90_000), altitude=25_000, speed=5_000)
    one.wait(2)
    assert sent.at_us[0] <= begins_us + 2 * delay_us + TICK_US


@pytest.mark.parametrize(("up_mm", "foreign"), [(20_000, False), (10_000, True)])
def test_the_end_of_the_takeoff_is_ours_where_arducopter_tells_it(up_mm: int, foreign: bool) -> None:
    """Up to version 4.1, its guided takeoff ends with a target at the commanded height."""
    seen = ObservedVehicle(latitude=473977418, longitude=85455939, home_amsl=488_000, up_us=S)
    command = Command(1, "takeoff", MotionKind.CLIMB, (), (), 20_000, 0, 0)
    targets = TargetWatch()
    targets.expect(ARDUPILOT.stages(command, seen, 1)[-1].target, seen)
    assert not targets.compares
    seen.up_us = 10 * S
    seen.target = (seen.latitude + 3, seen.longitude, 488_000 + up_mm)
    assert targets.is_foreign(seen) is foreign


@pytest.mark.parametrize(("off_mm", "foreign"), [(400, False), (600, True)])
def test_reported_target_becomes_foreign_only_if_it_changes(off_mm: int, foreign: bool) -> None:
    """At any distance from the commanded one: PX4 rounds, and reports its own stopping point."""
    seen = ObservedVehicle(up_us=S)
    targets = TargetWatch()
    targets.expect(ExpectedTarget(0, 0, 500_000), seen)
    seen.target = (100, 0, 502_500)
    assert not targets.is_foreign(seen)
    seen.target = (100, 0, 502_500 - off_mm)
    assert targets.is_foreign(seen) is foreign


@pytest.mark.parametrize(("name", "flavour"), each_once(["go-to", "land", "position"], ["px4", "ardupilot"]))
def test_takeover_is_detected_without_a_running_command(aloft: Make, name: str) -> None:
    one = aloft()
    assert isinstance(one.fly(MotionKind.FLY, (30_000, 0), altitude=20_000, speed=5_000), Succeeded)
    one.wait(3)
    one.vehicle.simulation.inject(TAKEOVERS[name](0))
    one.until(TakenOver, 3)


@pytest.mark.parametrize("name", ["pause", "go-to", "land", "position"])
def test_takeover_is_detected_during_a_hold(flavour: str, name: str) -> None:
    """ArduCopter ignores a pause in BRAKE, so there is nothing to detect."""
    one = copied(held(flavour))
    sent = Sent(one)
    one.vehicle.simulation.inject(TAKEOVERS[name](0))
    if (name, flavour) == ("pause", "ardupilot"):
        assert not any(isinstance(event, (TakenOver, CommandFailed)) for event in one.wait(10))
    elif (name, flavour) == ("pause", "px4"):
        one.wait(10)  # it stands at the same place: no takeover, and no command follows
    else:
        one.until(TakenOver, 3)
    assert sent.at_us == []


def streams(one: Any, name: str, interval_us: int) -> None:
    """Another sender sets the interval of a message; -1 stops it."""
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    asks = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    made = mavlink.MAVLink_command_long_message(1, 1, asks, 0, number, interval_us, 0, 0, 0, 0, 0)
    one.vehicle.simulation.receive(Codec(255, 190).pack(made), one.vehicle.clock.elapsed_us)


def unstreamed(one: Any) -> None:
    """Stop the stream of targets, so that only a request shows one."""
    streams(one, "POSITION_TARGET_GLOBAL_INT", -1)


def test_foreign_target_is_requested_before_the_next_command(flavour: str) -> None:
    """Both answer REQUEST_MESSAGE of POSITION_TARGET_GLOBAL_INT: it is asked for with the mode."""
    one = copied(in_a_leg(flavour))
    unstreamed(one)
    one.wait(1)
    sent = Sent(one)
    one.vehicle.simulation.inject(TAKEOVERS["go-to"](0))
    one.wait(1)
    taken = [event for event in one.events if isinstance(event, TakenOver)]
    assert len(taken) == (flavour == "ardupilot")  # which keeps reporting it, and is requested when it stops
    if not taken:
        one.begin(MotionKind.FLY, (200_000, 90_000), altitude=25_000, speed=5_000)
        taken = [one.until(TakenOver, 1)]
    assert taken[0].how == "another target"
    one.wait(5)
    assert sent.at_us == []


def test_an_arducopter_that_tells_its_target_no_more_is_taken_over() -> None:
    """A foreign velocity command looks the same."""
    one = copied(in_a_leg("ardupilot"))
    one.vehicle.simulation.inject(MessageSilence(0, "POSITION_TARGET_GLOBAL_INT"))
    assert one.until(TakenOver, 1).how == "no target"


@pytest.mark.parametrize("flavour", ["px4"])
@pytest.mark.parametrize("delay_us", [0, 150 * MS])
def test_missing_target_report_delays_a_command_briefly(aloft: Make, delay_us: int) -> None:
    one = under_way(aloft, delay_us)
    one.vehicle.simulation.inject(MessageSilence(0, "POSITION_TARGET_GLOBAL_INT"))
    one.wait(1)
    sent = Sent(one)
    begins_us = one.now_us
    one.begin(MotionKind.FLY, (200_000, 90_000), altitude=25_000, speed=5_000)
    one.wait(2)
    assert sent.at_us[0] <= begins_us + 2 * delay_us + TARGET_US + TICK_US


def test_sticks_end_what_px4_does_by_itself(flavour: str) -> None:
    """ArduCopter ignores them in GUIDED."""
    one = copied(in_a_leg(flavour))
    one.vehicle.simulation.inject(PilotSticks(0))
    if flavour == "px4":
        assert one.until(TakenOver, 3).how == "Position"
    else:
        assert not any(isinstance(event, (TakenOver, CommandFailed)) for event in one.wait(10))


@pytest.mark.slow
def test_own_targets_are_not_a_takeover(aloft: Make) -> None:
    """Leg after leg, a hold, and another leg."""
    one = aloft()
    path = [(20_000, 0), (20_000, 20_000), (0, 20_000), (0, 0), (20_000, 0)]
    assert isinstance(one.fly(MotionKind.COVER, *path, altitude=20_000, speed=5_000), Succeeded)
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=8_000)
    one.wait(6)
    assert isinstance(one.fly(MotionKind.HOLD, hold_us=5 * S), Succeeded)
    assert isinstance(one.fly(MotionKind.FLY, (0, 0), altitude=24_000, speed=8_000), Succeeded)
    one.begin(MotionKind.HOME)
    one.wait(8)
    assert not any(isinstance(event, TakenOver) for event in one.events)


def test_the_old_mode_chosen_again_right_after_ours_is_a_takeover(flavour: str) -> None:
    one = copied(in_a_leg(flavour))
    sent = Sent(one)
    one.begin(MotionKind.HOME)
    one.vehicle.simulation.inject(PilotMode(one.vehicle.simulation.now_us, OLD[flavour]))
    one.until((TakenOver, CommandFailed), 4)
    taken = [event for event in one.events if isinstance(event, (TakenOver, CommandFailed))]
    assert isinstance(taken[0], TakenOver), taken
    before = len(sent.at_us)
    one.wait(10)
    assert len(sent.at_us) == before


OLD = {"px4": FlightMode.LOITER, "ardupilot": FlightMode.GUIDED}


def test_no_command_begins_after_a_takeover(aloft: Make) -> None:
    """Neither the command that waited for its record, nor any later one."""
    one = aloft()
    one.vehicle.simulation.inject(PilotMode(0, FlightMode.POSITION))
    one.until(TakenOver, 3)
    sent = Sent(one)
    assert one.fly(MotionKind.HOME).reason == "taken-over"
    assert sent.at_us == []


@pytest.mark.parametrize(
    ("mode", "others"), [(FlightMode.POSITION, True), (FlightMode.LAND, True), (FlightMode.LOITER, None)]
)
def test_program_started_in_flight_reports_who_flies(
    aloft: Make, flavour: str, mode: FlightMode, others: bool | None
) -> None:
    """PX4 loiters for us too; ArduCopter's LOITER is a pilot's."""
    one = aloft()
    one.vehicle.simulation.inject(PilotMode(0, mode))
    one.wait(1)
    one.vehicle.driver = Driver(POLICY, one.vehicle.frames, fence=False)
    ready = one.until(Ready, 20)
    assert bool(ready.others) == (flavour == "ardupilot" if others is None else others)


# ---------------------------------------------------------------- interleavings


def moments(whole: bool) -> Iterator[tuple[int, int, int]]:
    """(when the pilot acts after our command is begun, the phase of PX4's heartbeat then, the link's delay), in us."""
    if not whole:
        return ((act * MS, phase * MS, delay_us) for act in (-100, 20, 200) for phase, delay_us in SAMPLE)
    return product((ms * MS for ms in range(-400, 600, 20)), (ms * MS for ms in range(0, 1_000, 100)), DELAYS_US)


#: phases in ms, each with a delay
SAMPLE = ((100, DELAYS_US[0]), (600, DELAYS_US[-1]))


def under_way(aloft: Make, delay_us: int) -> Any:
    """A flight in the middle of a leg."""
    one = aloft()
    if delay_us:
        one.vehicle.simulation.inject(LinkDelay(0, delay_us))
    one.begin(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=5_000)
    one.wait(4)
    return one


def holds(one: Any, flavour: str, name: str, acts_us: int, phase_us: int, delay_us: int) -> None:
    """Check one pilot action and our next command, close together."""
    one.wait((phase_us - one.now_us % S) % S / S)
    sent = Sent(one)
    begins_us = one.now_us + 500 * MS
    takes_us = begins_us + acts_us
    simulation = one.vehicle.simulation
    simulation.inject(TAKEOVERS[name](simulation.now_us + takes_us - one.now_us))
    one.wait((begins_us - one.now_us) / S)
    if not any(isinstance(event, TakenOver) for event in one.events):
        one.begin(MotionKind.FLY, NEXT, altitude=25_000, speed=5_000)
        one.wait(6)
    latest_us, late_us = max(sent.at_us, default=0), takes_us + WITHIN_US[flavour] + 2 * delay_us + TICK_US
    if any(isinstance(event, TakenOver) for event in one.events):
        one.wait(3)
        assert max(sent.at_us, default=0) == latest_us, "nothing is sent once it shows"
    else:  # our command arrived before any report of the pilot's; a speed follows once ours is reported
        assert takes_us - TICK_US <= sent.steering_us[-1] + delay_us <= takes_us + REPORTED_US
        assert one.vehicle.driver.seen.target[:2] == pytest.approx(geo(NEXT), abs=10)
    assert latest_us <= late_us, f"{(latest_us - takes_us) / MS} ms after it took effect"
    assert max(sent.steering_us, default=0) <= late_us - delay_us


def try_all(aloft: Make, flavour: str, name: str, *, whole: bool) -> None:
    tried = [*moments(whole)]
    flights = {delay_us: under_way(aloft, delay_us) for delay_us in {each[-1] for each in tried}}
    for acts_us, phase_us, delay_us in tried:
        holds(copied(flights[delay_us]), flavour, name, acts_us, phase_us, delay_us)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "flavour"), each_once(["land", "go-to"], ["px4", "ardupilot"]))
def test_no_frame_leaves_later_than_w(aloft: Make, flavour: str, name: str) -> None:
    try_all(aloft, flavour, name, whole=False)


@pytest.mark.parametrize("flavour", ["ardupilot"])
def test_a_go_to_that_comes_before_our_question_is_not_flown_over(aloft: Make) -> None:
    """The go-to took effect 20 ms before our next target was sent; only a requested target report shows it."""
    one = under_way(aloft, DELAYS_US[1])
    holds(one, "ardupilot", "go-to", 20 * MS, 0, DELAYS_US[1])
    assert [event.how for event in one.events if isinstance(event, TakenOver)] == ["another target"]


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "flavour"),
    [*product(["land", "return", "position", "go-to"], ["px4", "ardupilot"]), ("pause", "px4")],
)
def test_no_frame_leaves_later_than_w_at_any_moment(aloft: Make, flavour: str, name: str) -> None:
    try_all(aloft, flavour, name, whole=True)


def test_target_change_before_an_untargeted_command_shows_is_a_takeover() -> None:
    """Two heartbeats later, because by then the mode shows the effect of our own command."""
    ours, theirs = (470_000_000, 80_000_000, 500_000), (470_001_000, 80_000_000, 500_000)
    targets, seen = TargetWatch(), ObservedVehicle()
    targets.expect(ExpectedTarget(*ours), seen)
    seen.target = ours
    assert not targets.is_foreign(seen)
    targets.expect(None, seen)  # a return, which a link that is silent upwards swallows
    for beats, target, foreign in ((1, ours, False), (2, theirs, False), (3, theirs, False), (4, theirs, True)):
        seen.beats, seen.target = beats, target
        assert targets.is_foreign(seen) is foreign, beats
    targets.expect(None, seen)  # the next fallback
    assert targets.is_foreign(seen)
    targets.obeyed()
    assert not targets.is_foreign(seen)


def test_a_leg_that_gets_there_after_the_stop_left_is_not_a_takeover() -> None:
    """Regression: its target was taken for that of the stop or for a foreign one, and the run stood down."""
    here, leg, other = ((latitude, 80_000_000, 500_000) for latitude in (470_000_000, 470_000_500, 470_000_200))
    for stop in (ExpectedTarget(here[0], here[1], None, within=10_000), None):
        targets, seen = TargetWatch(), ObservedVehicle()
        targets.expect(ExpectedTarget(*here), seen)
        seen.target = here
        assert not targets.is_foreign(seen)
        targets.expect(ExpectedTarget(*leg), seen)  # still on its way when
        targets.expect(stop, seen)  # this leaves
        for beats, up_us in enumerate((S, 4 * S, 5 * S)):
            seen.beats, seen.up_us, seen.target = beats, up_us, leg
            assert not targets.is_foreign(seen)
            assert not targets.shown
        if stop is None:
            continue
        seen.target = other
        assert not targets.is_foreign(seen)
        assert targets.named is not None
        seen.target = leg
        assert targets.is_foreign(seen), "somebody sends it there again"
