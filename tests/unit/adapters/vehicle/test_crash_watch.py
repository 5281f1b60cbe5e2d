"""A crash is detected from reports of one moment by the vehicle's clock, whenever they are read."""

from types import SimpleNamespace
from typing import Any

from rtshcua.adapters.vehicle.observed import (
    ATTITUDE,
    HEIGHT,
    POSITION,
    VELOCITY_HORIZONTAL,
    VELOCITY_VERTICAL,
    Estimator,
    ObservedVehicle,
)
from rtshcua.adapters.vehicle.supervision import CrashWatch
from rtshcua.mavlink import enums

S = 1_000_000
IN_AIR, LANDING, ON_GROUND = (
    enums.MAV_LANDED_STATE_IN_AIR, enums.MAV_LANDED_STATE_LANDING, enums.MAV_LANDED_STATE_ON_GROUND,
)  # fmt: skip
KNOWN = ATTITUDE | POSITION | VELOCITY_HORIZONTAL | HEIGHT | VELOCITY_VERTICAL


class Watched:
    """A vehicle whose messages arrive at `now_us`, or as they are sent. `told` lists the signs of a crash."""

    def __init__(self) -> None:
        self.seen = ObservedVehicle(estimator=Estimator("ESTIMATOR_STATUS"))
        self.watch = CrashWatch()
        self.told: list[str] = []
        self.place = 0
        self.now_us: int | None = None

    def hear(self, name: str, at_us: int, **fields: Any) -> None:
        self.place += 1
        now_us = at_us if self.now_us is None else self.now_us
        self.seen.take(name, SimpleNamespace(**fields), now_us, at_us, self.place)
        how = self.watch.look(self.seen, name, now_us)
        self.told += [] if how is None else [how]

    def beat(self, at_us: int, *, armed: bool = True) -> None:
        base_mode = enums.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self.hear("HEARTBEAT", at_us, custom_mode=0, base_mode=base_mode, system_status=4)

    def says(self, at_us: int, landed_state: int) -> None:
        self.hear("EXTENDED_SYS_STATE", at_us, landed_state=landed_state)

    def at(self, at_us: int, height: int, sinks: int = 0) -> None:
        self.hear("ESTIMATOR_STATUS", at_us, flags=KNOWN)
        self.hear(
            "GLOBAL_POSITION_INT",
            at_us,
            lat=0,
            lon=0,
            alt=height,
            relative_alt=height,
            vx=0,
            vy=0,
            vz=sinks // 10,
            hdg=0,
        )

    def leans(self, at_us: int, tilt: float) -> None:
        self.hear("ATTITUDE", at_us, roll=tilt, pitch=0.0)

    def flies(self, at_us: int, height: int = 16_000, state: int = IN_AIR) -> None:
        self.beat(at_us)
        self.says(at_us, state)
        self.leans(at_us, 0.0)
        self.at(at_us, height)

    def flew(self) -> "Watched":
        for second in range(10, 13):
            self.flies(second * S)
        return self

    def motors_off(self, at_us: int) -> None:
        for later in range(3):
            self.beat(at_us + later * S, armed=False)
            self.says(at_us + later * S + 10_000, ON_GROUND)
            self.at(at_us + later * S + 20_000, 16_000)


def test_two_reports_of_stopped_motors_in_flight_are_a_crash() -> None:
    one = Watched().flew()
    one.beat(12_500_000, armed=False)
    assert not one.told
    one.beat(13_500_000, armed=False)
    assert one.told == ["the motors stopped 16 m above home"]


def test_crash_in_queued_frames_is_reported_late() -> None:
    one = Watched()
    one.now_us = 90 * S
    one.flew()
    one.motors_off(12_500_000)
    assert one.told == ["the motors stopped 16 m above home"]


def test_motors_off_after_a_gap_are_not_a_crash() -> None:
    one = Watched()
    one.now_us = 70 * S
    one.flew()
    one.now_us = None
    one.motors_off(70 * S)
    assert not one.told


def test_first_report_after_a_gap_is_not_dated_by_queued_frames() -> None:
    """A heartbeat has no timestamp: its earliest time is that of the last stamp before it."""
    one = Watched()
    one.now_us = 70 * S
    one.flew()
    one.beat(12 * S, armed=False)
    one.beat(12 * S, armed=False)
    assert not one.told
    one.now_us = None
    one.at(70 * S, 16_000)
    one.motors_off(71 * S)
    assert not one.told


def test_overtaken_position_does_not_date_a_motor_stop() -> None:
    one = Watched()
    one.now_us = 70 * S
    one.flew()
    one.place += 5
    one.beat(12 * S, armed=False)
    one.beat(12 * S, armed=False)
    one.place -= 6  # overtaken
    one.at(12_100_000, 16_000)
    assert not one.told


def test_landing_on_a_hill_during_a_gap_is_not_a_crash() -> None:
    one = Watched().flew()
    one.at(70 * S, 16_000)  # whether it flies is not known yet
    one.beat(70_100_000, armed=False)
    one.beat(71 * S, armed=False)
    one.motors_off(71_200_000)
    assert not one.told


def test_motor_stop_on_a_hill_after_landing_is_not_a_crash() -> None:
    one = Watched().flew()
    one.flies(13 * S, state=LANDING)
    one.motors_off(14 * S)
    assert not one.told


def test_rearmed_vehicle_counts_as_flying() -> None:
    one = Watched().flew()
    one.beat(13 * S, armed=False)
    one.at(13_100_000, 16_000)
    one.flies(14 * S)
    one.flies(15 * S)
    assert not one.told
    one.motors_off(15_500_000)
    assert one.told


def test_tilt_in_flight_is_a_crash() -> None:
    one = Watched().flew()
    one.leans(12_500_000, 1.5)
    assert not one.told
    one.leans(13 * S, 1.5)
    assert one.told == ["the vehicle is tilted by 86 degrees"]


def test_tilt_after_a_gap_is_a_crash_only_if_armed() -> None:
    one = Watched().flew()
    for step in range(5):
        one.leans(70 * S + 200_000 * step, 1.5)
    assert not one.told
    one.beat(71 * S)
    assert one.told, "it is still armed"


def test_tilt_reports_on_both_sides_of_a_gap_do_not_add_up() -> None:
    one = Watched().flew()
    one.leans(12_500_000, 1.5)
    one.beat(70 * S)
    one.leans(70_010_000, 1.5)
    assert not one.told
    one.leans(70_510_000, 1.5)
    assert one.told


def test_a_fall_that_ends_at_once_is_an_impact_by_the_time_of_the_reports() -> None:
    one = Watched().flew()
    one.at(12_500_000, 6_000, sinks=8_000)
    one.at(12_600_000, 0)
    one.says(12_650_000, ON_GROUND)
    one.at(12_700_000, 0)
    assert one.told == ["the vehicle came down at 8.0 m/s"]


def test_descent_read_together_with_its_landing_is_not_an_impact() -> None:
    one = Watched()
    one.now_us = 14 * S
    one.flew()
    one.at(12_500_000, 6_000, sinks=3_500)
    one.at(13_500_000, 3_000)
    one.says(13_550_000, ON_GROUND)
    one.at(13_600_000, 0)
    assert not one.told


def test_lying_long_after_a_hard_stop_is_not_a_crash() -> None:
    one = Watched().flew()
    one.at(12_500_000, 16_000, sinks=3_500)
    one.at(12_600_000, 16_000)
    one.says(70 * S, ON_GROUND)
    one.at(70_100_000, 0)
    one.at(70_200_000, 0)
    assert not one.told


def test_times_from_before_the_clock_was_set_are_forgotten() -> None:
    one = Watched().flew()
    one.watch.forget()
    one.motors_off(12_500_000)
    assert not one.told
