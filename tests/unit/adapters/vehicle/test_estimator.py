"""Estimator flags, their age, and a known home decide whether position and height are valid."""

from rtshcua.adapters.vehicle.observed import STALE_US, Estimator
from virtual.rows import rows

S = 1_000_000
GPI = "GLOBAL_POSITION_INT"
ALL = ("lat", "relative_alt", "vx", "vz", "hdg")


def known(estimator: Estimator, now_us: int = S) -> set[str]:
    vouched = {field for field in ALL if estimator.vouches_for(GPI, field, now_us)}
    assert vouched == set(ALL) - estimator.doubtful(GPI, now_us)
    return vouched


@rows(("flags", "fields"), [
    (0x000, set()),
    (0x400, set()),  # ArduPilot while it boots
    (0x0A7, {"vx", "vz", "hdg"}),  # ArduPilot before GPS: a height, but no home yet
    (0x0E5, {"vz", "hdg"}),  # PX4's first
    (0x33F, set(ALL)),  # both, in flight
    (0x3FF, set(ALL)),  # PX4 on the ground
    (0x73F, {"relative_alt", "vz", "hdg"}),  # PX4: GPS glitch
    (0x833F, {"relative_alt", "vz", "hdg"}),  # ArduPilot: GPS glitching
    (0x025, {"relative_alt", "vz", "hdg"}),  # GPS lost
    (0x024, set()),  # no attitude, so no other flag counts
])  # fmt: skip
def test_flags_as_recorded_and_as_documented(flags: int, fields: set[str]) -> None:
    estimator = Estimator("EKF_STATUS_REPORT")
    if flags in (0x025, 0x024, 0x73F, 0x833F):
        estimator.take(0x33F, 0)
    estimator.take(flags, S)
    assert known(estimator) == fields
    assert estimator.position(S) == ("lat" in fields)


def test_a_report_that_is_old_vouches_for_nothing() -> None:
    estimator = Estimator("ESTIMATOR_STATUS")
    assert estimator.missing(0) == "no report of the estimator ( ESTIMATOR_STATUS)"
    estimator.take(0x33F, S)
    assert known(estimator, S + STALE_US) == set(ALL)
    assert estimator.missing(S + STALE_US) is None
    assert known(estimator, S + STALE_US + 1) == set()
    assert estimator.missing(S + STALE_US + 1) == "the estimator's reports have stopped ( ESTIMATOR_STATUS)"


def test_a_report_that_was_overtaken_is_set_aside() -> None:
    estimator = Estimator("ESTIMATOR_STATUS")
    estimator.take(0x025, 2 * S)
    estimator.take(0x33F, S)
    assert not estimator.position(2 * S)
    estimator.take(0x33F, 2 * S)
    assert estimator.position(2 * S), "of two that bear the same time the later counts"


def test_missing_estimates_are_named() -> None:
    estimator = Estimator("ESTIMATOR_STATUS")
    estimator.take(0x0E5, S)
    assert estimator.missing(S) == "the estimator has no position (flags 0xe5)"
    estimator.take(0x013, S)
    assert estimator.missing(S) == "the estimator has no height (flags 0x13)"


def test_fields_without_estimator_need_no_confirmation() -> None:
    assert Estimator().vouches_for("BATTERY_STATUS", "battery_remaining", 0)
    assert Estimator().vouches_for(GPI, "time_boot_ms", 0)
    assert not Estimator().vouches_for("LOCAL_POSITION_NED", "x", 0)
