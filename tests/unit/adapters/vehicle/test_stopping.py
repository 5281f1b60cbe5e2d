"""A stop works from every state in which it may be commanded; a failed stop is reported.

The command, speed and distance of a stop are measured for each autopilot (vehicles.md 5); `did-not-stop` is reported
by ground speed only, not by an acknowledgement or a mode.
"""

from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any

import msgspec
import pytest

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.effects import STILL
from rtshcua.adapters.vehicle.flavour import ExpectedProgress
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.supervision import LAG_US, Brakes, BrakingWatch, StageProgress
from rtshcua.model.faults import FlightMode, Kill, LinkDelay, Pillar
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import CommandFailed, Crashed, Event, Ready, Succeeded, TakenOver
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.vehicle import Multirotor
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.copying import copied
from virtual.flyer import Flyer
from virtual.policy import POLICY
from virtual.rows import rows
from virtual.sampling import each_once

Make = Callable[..., Any]
S = 1_000_000
FAR = (300_000, 0)


def stops(one: Any, seconds: float = 9) -> None:
    """Whether the vehicle really comes to a standstill."""
    begun = one.now_us
    one.begin(MotionKind.HOLD, hold_us=2 * S)
    end = one.until((Succeeded, CommandFailed, TakenOver), seconds)
    assert isinstance(end, Succeeded), end
    assert end.at_us - begun < seconds * S
    assert one.truth.speed_mm_s < STILL
    assert abs(one.truth.climb_mm_s) < STILL


@pytest.mark.parametrize(("after_s", "flavour"), each_once([0.0, 0.3, 1.0, 4.0, 8.0, 8.5], ["px4", "ardupilot"]))
def test_a_leg_is_stopped_whenever_that_is_asked(aloft: Make, after_s: float) -> None:
    """PX4 is in Hold already, where DO_SET_MODE to Hold changes nothing (recorded: it flew on for 46 m)."""
    one = aloft()
    one.begin(MotionKind.FLY, FAR, altitude=20_000, speed=8_000)
    one.wait(after_s)
    stops(one)


def test_a_climb_is_stopped(flyer: Make) -> None:
    one = flyer()
    one.until(Ready)
    one.begin(MotionKind.CLIMB, altitude=40_000)
    one.wait(9)
    assert one.truth.climb_mm_s > 1_000
    stops(one)


@pytest.mark.parametrize(("kind", "flavour"), each_once([MotionKind.HOME, MotionKind.LAND], ["px4", "ardupilot"]))
def test_a_return_and_a_landing_are_stopped(aloft: Make, kind: MotionKind) -> None:
    one = aloft(40_000)
    one.fly(MotionKind.FLY, (60_000, 0), altitude=40_000, speed=8_000)
    one.begin(kind)
    one.wait(4)
    stops(one)
    assert one.truth.mode in (FlightMode.LOITER, FlightMode.BRAKE)


@pytest.mark.parametrize(("after_s", "flavour"), each_once([0.6, 1.2, 1.8], ["px4", "ardupilot"]))
def test_a_vehicle_that_still_gathers_speed_is_stopped_over_a_slow_link(aloft: Make, after_s: float) -> None:
    """The speed when the stop is sent differs from the speed when it is obeyed."""
    one = aloft()
    one.vehicle.simulation.inject(LinkDelay(0, 300_000))
    one.wait(1)
    one.begin(MotionKind.FLY, FAR, altitude=20_000, speed=8_000)
    one.wait(after_s + 0.6)
    stops(one, 12)


@pytest.mark.parametrize(("delay_us", "flavour"), each_once([0, 700_000], ["ardupilot", "px4"]))
def test_own_stopping_point_is_not_a_foreign_target(aloft: Make, delay_us: int) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, FAR, altitude=20_000, speed=12_000)
    one.wait(8)
    one.vehicle.simulation.inject(LinkDelay(0, delay_us))
    one.wait(2)
    stops(one, 15)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", pytest.param("ardupilot", marks=pytest.mark.soak)])
def test_a_return_from_far_gets_somewhere_wherever_home_is(aloft: Make) -> None:
    """A program started in the air has never observed the vehicle at home."""
    one = aloft()
    assert isinstance(one.fly(MotionKind.FLY, (300_000, 0), altitude=20_000, speed=12_000), Succeeded)
    again = Driver(POLICY, one.vehicle.frames, fence=False)
    one.vehicle.driver = again
    one.until(Ready, 20)
    assert isinstance(one.fly(MotionKind.HOME), Succeeded)


def test_a_hold_that_does_not_stop_has_failed(aloft: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command is acknowledged and the mode is right, but the vehicle flies on."""
    one = aloft()
    one.begin(MotionKind.FLY, FAR, altitude=20_000, speed=8_000)
    one.wait(8)
    monkeypatch.setattr(Multirotor, "hold", lambda self, up=None: None)
    begun = one.now_us
    one.begin(MotionKind.HOLD)
    failed = one.until((Succeeded, CommandFailed, TakenOver), 10)
    assert (type(failed), failed.reason) == (CommandFailed, "did-not-stop")
    assert failed.at_us - begun < 8 * S, "it declares no brakes: by the cautious guess"


def _drift(vehicle: Multirotor, dt: float, *_: object) -> None:
    """A simulation step without any reaction to commands."""
    body = vehicle.body
    body.north += body.v_north * dt
    body.east += body.v_east * dt


def test_drifting_hold_does_not_succeed(aloft: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: a gust stronger than the vehicle began during a hold, which counted as successful."""
    one = aloft()
    one.begin(MotionKind.HOLD, hold_us=3 * S)
    one.wait(2.5)
    vehicle = one.vehicle.simulation._autopilot.vehicle
    with monkeypatch.context() as blown:
        blown.setattr(type(vehicle), "_fly", _drift)
        vehicle.body.v_north = 3.0
        ends = [event for event in one.wait(3) if isinstance(event, (Succeeded, CommandFailed, TakenOver))]
    assert ends == []
    assert isinstance(one.until((Succeeded, CommandFailed), 15), Succeeded), "it stands again, near where it stood"


def test_a_hold_that_drifts_away_has_failed(aloft: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    one = aloft()
    one.begin(MotionKind.HOLD)
    one.wait(4)
    vehicle = one.vehicle.simulation._autopilot.vehicle
    monkeypatch.setattr(type(vehicle), "_fly", _drift)
    vehicle.body.v_north = 3.0
    assert one.until((Succeeded, CommandFailed), 15).reason == "did-not-hold"


# ---------------------------------------------------------------- the rule, by hand

BRAKES = Brakes(2_000, 500_000)


@rows(
    ("passed_s", "fastest"),
    [(0, 10_000), (0.5, 10_000), (2.5, 10_000), (3.5, 8_000), (5.0, 5_000), (7.0, 1_000), (7.5, STILL), (60, STILL)],
)
def test_fastest_allowed_speed_while_braking(passed_s: float, fastest: int) -> None:
    """10 m/s, 2 m/s^2 after 0.5 s, and 2 s for reports, filters and gusts."""
    assert BRAKES.fastest(10_000, round(passed_s * S)) == fastest


def speeds(
    stop: BrakingWatch, of: Callable[[float], int | None], until_s: float = 20, obeyed_s: float = 0
) -> float | None:
    """The time at which a stop from 10 m/s fails with speed `of` (seconds); None if it succeeds."""
    known_us = 0
    for tick in range(round(until_s * 10)):
        speed = of(tick / 10)
        known_us = known_us if speed is None else tick * S // 10
        seen = ObservedVehicle(up_us=tick * S // 10, speed=speed, speed_us=known_us)
        if stop.has_failed(seen, obeyed=tick / 10 >= obeyed_s):
            return tick / 10
    return None


def stop_from(speed: int | None) -> BrakingWatch:
    return BrakingWatch(BRAKES, ObservedVehicle(speed=speed))


def test_a_vehicle_that_brakes_as_declared_does_not_fail() -> None:
    assert speeds(stop_from(10_000), lambda s: max(0, round(10_000 - 2_000 * max(0.0, s - 0.5)))) is None


def test_measured_stops_do_not_fail() -> None:
    """PX4 from 4.5 m/s and ArduCopter from 10.1 m/s, with even braking to the measured time below 0.4 m/s."""
    assert speeds(stop_from(4_500), lambda s: max(300, round(4_500 - 4_100 * s / 4.6))) is None
    assert speeds(stop_from(10_100), lambda s: max(300, round(10_100 - 9_700 * s / 4.6))) is None


def test_stop_without_braking_fails_soon() -> None:
    failed = speeds(stop_from(10_000), lambda s: 10_000)
    assert failed is not None
    assert 2.5 < failed < 3.5


def test_stop_with_weak_braking_fails_later() -> None:
    failed = speeds(stop_from(10_000), lambda s: max(2_000, round(10_000 - 2_000 * s)))
    assert failed is not None
    assert 5 < failed < 8


def test_stop_with_residual_speed_fails_at_the_end() -> None:
    failed = speeds(stop_from(10_000), lambda s: 800)
    assert failed == pytest.approx((BRAKES.stands_us(10_000)) / S, abs=0.2)


def test_braking_time_counts_from_acceptance() -> None:
    failed = speeds(stop_from(10_000), lambda s: 10_000, obeyed_s=5)
    assert failed is not None
    assert 7.5 < failed < 8.5


def test_a_speed_that_nobody_knows_has_not_fallen() -> None:
    stands_s = (BRAKES.reaction_us + 2 * LAG_US) / S
    assert speeds(stop_from(None), lambda s: None) == pytest.approx(stands_s, abs=0.2)
    assert speeds(stop_from(10_000), lambda s: None) is not None


def test_a_speed_that_is_not_known_for_a_moment_is_not_held_against_it() -> None:
    """After a stall queued reports are too old, and fresh ones have not arrived yet."""
    stands_s = BRAKES.stands_us(10_000) / S
    braking = speeds(
        stop_from(10_000), lambda s: None if abs(s - stands_s) < 0.8 else round(max(0.0, 9_000 - 2_000 * s))
    )
    assert braking is None


#: the weakest braking with which a flight without a stall passes, in mm/s^2
TIGHT = {"px4": 4_000, "ardupilot": 6_000}


@cache
def stopping_tightly(flavour: str) -> Flyer:
    """A stop from 10 m/s, with braking as declared."""
    one = Flyer(flavour)
    policy = msgspec.structs.replace(
        POLICY, vehicle=msgspec.structs.replace(POLICY.vehicle, braking=TIGHT[flavour], reaction_us=100_000)
    )
    one.vehicle = VirtualVehicle(policy, SimulationConfig(flavour=AutopilotKind(flavour), return_mm=22_000))
    one.up(20_000)
    one.begin(MotionKind.FLY, (600_000, 0), altitude=20_000, speed=10_000)
    one.wait(8)
    one.begin(MotionKind.HOLD)
    return one


def stalled(flavour: str, after_ms: int, for_ms: int) -> list[Event]:
    """The end of a stop during which our computer stalls."""
    one = copied(stopping_tightly(flavour))
    one.wait(after_ms / 1_000)
    one.vehicle.stand_still(for_ms * 1_000)
    return [event for event in one.wait(8) if isinstance(event, (CommandFailed, TakenOver, Crashed))]


@pytest.mark.slow
@pytest.mark.parametrize(("after_ms", "flavour"), each_once([2_200, 2_900, 3_400], ["px4", "ardupilot"]))
def test_delayed_reports_are_judged_by_their_own_time(after_ms: int, flavour: str) -> None:
    """Regression: an old speed was compared with the limit of a second later, which reported `did-not-stop`."""
    for for_ms in (300, 1_000, 6_000):
        assert stalled(flavour, after_ms, for_ms) == []


@pytest.mark.soak
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_no_hold_up_makes_a_stop_fail(flavour: str) -> None:
    for after_ms, for_ms in product(
        range(0, 6_000, 100), (300, 700, 1_000, 1_500, 2_000, 3_000, 6_000, 15_000, 30_000)
    ):
        assert stalled(flavour, after_ms, for_ms) == [], (after_ms, for_ms)


def test_a_vehicle_without_declared_brakes_is_given_a_cautious_guess() -> None:
    assert POLICY.vehicle.braking == 0
    assert Brakes.of(POLICY.vehicle) == Brakes(1_000, S)


def test_progress_is_a_metre_in_its_time_by_any_part() -> None:
    left: list[tuple[int, ...] | None] = [None]
    progress = StageProgress(ExpectedProgress(lambda seen: left[0], 8 * S))

    def at(second: float, *parts: int) -> bool:
        left[0] = parts or None
        return progress.has_stalled(ObservedVehicle(up_us=round(second * S)))

    assert not at(0, 50_000, 20_000)
    assert not at(8, 49_500, 20_000)
    assert at(8.1, 49_500, 20_000), "half a metre in eight seconds"
    assert not at(8.2, 49_500, 19_000), "another part fell"
    assert not at(16.2, 60_000, 19_000)
    assert at(16.3, 60_000, 19_000)
    assert not at(16.4), "nothing is known: nothing is held against it"
    assert not at(60, 60_000, 19_000), "and it counts anew from there"
    assert at(68.1, 60_000, 19_000)


# ---------------------------------------------------------------- crashes

PILLAR = Pillar(0, 0, 100_000, 3_000, 60_000)


def test_a_vehicle_that_flies_into_a_pillar_has_crashed(flyer: Make) -> None:
    """It did not land: PX4 stays armed and in its mode, ArduCopter disarms; both lie tilted."""
    one = flyer(faults=(PILLAR,)).up()
    one.begin(MotionKind.FLY, FAR, altitude=20_000, speed=8_000)
    crashed = one.until((Crashed, Succeeded), 60)
    assert isinstance(crashed, Crashed)
    assert one.truth.crashed
    one.wait(20)
    assert sum(isinstance(event, Crashed) for event in one.events) == 1


def test_motors_that_stop_in_the_air_are_a_crash(aloft: Make) -> None:
    one = aloft()
    one.vehicle.simulation.inject(Kill(0))
    assert isinstance(one.until((Crashed, Succeeded, TakenOver), 10), Crashed)
