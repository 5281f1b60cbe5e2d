"""The error of UTC: its sources, their order, and the result without any source."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference import flat_case as flat
from rtshcua.adapters.clock import PacedClock, SystemClock
from rtshcua.adapters.utc import UtcWatch, certain_from_us, kernel_error_us, synchronised_us
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.codec.frames import ReceivedFrame
from rtshcua.decision.decide import decide
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.isolated import OwnTime
from rtshcua.wire.clock import AUTOPILOT_US, DRIFT_US, ClockSource

NOW_US = 1_800_000_000_000_000


class Vehicle:
    """Reports that UTC is so far ahead of our monotonic time, or reports nothing."""

    def __init__(self, ahead_us: int | None = None) -> None:
        self._ahead_us = ahead_us

    def utc(self, now_us: int) -> tuple[int, int] | None:
        return None if self._ahead_us is None else (self._ahead_us, 2_000)


def says(us: int | None) -> Callable[[], int | None]:
    return lambda: us


@pytest.mark.parametrize(
    ("state", "status", "maxerror", "us"),
    [
        (0, 0x2001, 1_500, 1_500),
        (0, 0x41, 1_500, None),  # STA_UNSYNC
        (5, 0x01, 1_500, None),  # TIME_ERROR
        (-1, 0, 0, None),  # the call failed
        (0, 0, -3, None),
    ],
)
def test_kernel_clock_is_trusted_only_while_synchronised(
    state: int, status: int, maxerror: int, us: int | None
) -> None:
    assert synchronised_us(state, status, maxerror) == us


def test_this_machines_kernel_is_asked_and_answers_or_does_not() -> None:
    us = kernel_error_us()
    assert us is None or us >= 0


@pytest.mark.parametrize(
    ("kernel_us", "ahead_us", "stated_us", "source", "error_us"),
    [
        (3_000, 5, 9, "kernel", 3_000),
        (None, 5, 9, "vehicle", AUTOPILOT_US["px4"] + 3_000),
        (None, None, 500_000, "operator", 500_000),
        (None, None, None, "unknown", UTC_UNKNOWN_US),
    ],
)
def test_the_first_that_tells_is_believed(
    kernel_us: int | None, ahead_us: int | None, stated_us: int | None, source: str, error_us: int
) -> None:
    clock = SystemClock()
    watch = UtcWatch(clock, stated_us, says(kernel_us))
    taken = watch.look(Vehicle(ahead_us), "px4", clock.now().monotonic_us)
    watch.settle()
    assert (watch.bound.source, watch.bound.error_us) == (source, error_us)
    assert taken == (source == "vehicle")
    assert watch.waits == (source == "unknown")
    assert error_us <= clock.now().utc_error_us <= error_us + 60 * DRIFT_US
    assert source in watch.bound.told()
    if source == "vehicle":
        now = clock.now()
        assert now.utc_us - now.monotonic_us == ahead_us, "its time of day replaces ours"


def test_vehicle_may_set_the_time_late_and_only_once() -> None:
    clock = SystemClock()
    watch = UtcWatch(clock, None, says(None))
    watch.settle()
    assert watch.waits
    assert watch.look(Vehicle(7), "ardupilot", 0)
    assert not watch.look(Vehicle(8), "ardupilot", 0)
    now = clock.now()
    assert now.utc_us - now.monotonic_us == 7


def test_a_simulation_has_the_time_of_its_machine() -> None:
    clock = PacedClock(10)
    watch = UtcWatch.simulated(clock)
    assert (watch.bound.source, clock.now().utc_error_us, watch.waits) == ("simulated", 100_000, False)


def test_a_clock_that_nobody_keeps_right_grows_worse() -> None:
    clock = SystemClock(1_000)
    clock._bounded_us -= 3_600_000_000
    assert clock.now().utc_error_us >= 1_000 + 3_600 * DRIFT_US
    assert SystemClock().now().utc_error_us == UTC_UNKNOWN_US


def test_the_vehicles_time_is_known_as_well_as_its_clock() -> None:
    """It was up for 5 s at 100 s of ours; the answer took 4 ms; SYSTEM_TIME says when that was."""
    source = SourceTime()
    ts1_ns = source.clock.due(99_998_000)
    assert ts1_ns is not None
    for message, at_us in (
        (mavlink.MAVLink_timesync_message(5_000_000_000, ts1_ns), 100_002_000),
        (mavlink.MAVLink_system_time_message(0, 5_010), 100_012_000),  # before its receiver reported the time
    ):
        source.of(ReceivedFrame(message, message.get_type(), 1, 1, 0, False, b""), at_us)
    assert source.utc(100_012_000) is None
    message = mavlink.MAVLink_system_time_message(NOW_US, 5_020)
    source.of(ReceivedFrame(message, message.get_type(), 1, 1, 2, False, b""), 100_022_000)
    told = source.utc(100_022_000)
    assert told is not None
    ahead_us, open_us = told
    assert open_us <= 4_000
    assert abs(100_020_000 + ahead_us - NOW_US) <= open_us


def test_unknown_utc_makes_dependent_conditions_unknown() -> None:
    """Freshness and permitted hours are unknown: the step waits and is not permitted."""
    policy = prepare(flat.POLICY)
    assert not isinstance(policy, Refusal)
    invocations = prepare_mission(flat.MISSION, policy)
    assert not isinstance(invocations, Refusal)
    step = invocations[0]
    context = flat.context(step.invocation)
    known = decide(step, flat.state({}), policy, context, flat.NOW)
    assert known.outcome == Outcome.ALLOW
    unknown = Now(flat.NOW.monotonic_us, flat.NOW.utc_us, UTC_UNKNOWN_US)
    decision = decide(step, flat.state({}), policy, context, unknown)
    assert (decision.outcome, decision.reason) == (Outcome.DEFER, Reason.CLOCK_UNCERTAIN)


@pytest.mark.parametrize(
    ("issued_us", "error_us", "wait_us"),
    [
        (NOW_US - 10_000_000, 6_000_000, 0),
        (NOW_US - 6_000_000, 6_000_000, 0),
        (NOW_US - 2_000_000, 6_000_000, 4_000_000 + 2_001 + 1),
        (NOW_US + 5_000_000, 6_000_000, 11_000_000 + 5_502 + 1),  # its clock may be ahead of ours
        (NOW_US + 6_000_001, 6_000_000, 0),  # certainly in the future, so it is refused without waiting
        (NOW_US, UTC_UNKNOWN_US, 0),
    ],
)
def test_a_bundle_is_waited_for_that_may_be_of_the_time_to_come(issued_us: int, error_us: int, wait_us: int) -> None:
    now = Now(77, NOW_US, error_us)
    from_us = certain_from_us(issued_us, now)
    assert from_us - now.monotonic_us == wait_us
    if wait_us:
        then_error_us = error_us + wait_us * 500 // 1_000_000
        assert NOW_US + wait_us - then_error_us >= issued_us


# ---------------------------------------------------------------- a boundary with a clock of its own


class Own:
    """A boundary's clock, which knows nothing yet."""

    def __init__(self, source: ClockSource = ClockSource.UNKNOWN, number: int = 0) -> None:
        self.source, self.number = source, number
        self.stated: ClockSource | None = None
        self.gone = False

    def __call__(self, settle: bool) -> OwnTime | None:
        if settle and self.source is ClockSource.UNKNOWN and self.stated is not None:
            self.source = self.stated
        known = self.source is not ClockSource.UNKNOWN
        now = Now(1_000, 1_800_000_000_000_000, 700 if known else UTC_UNKNOWN_US)
        return None if self.gone else OwnTime(self.source, now, 0 if known else self.number)


def test_the_boundarys_clock_counts_and_no_other() -> None:
    clock, own = SystemClock(), Own()
    watch = UtcWatch(clock, 500, kernel_us=lambda: 3)
    watch.follow(own)
    assert (watch.bound.source, watch.waits) == ("unknown", True)
    assert clock.now().utc_error_us == UTC_UNKNOWN_US
    assert not watch.look(SourceTime(), "px4", 0)
    own.source = ClockSource.VEHICLE
    assert watch.look(SourceTime(), "px4", 0)
    assert (watch.bound.source, watch.bound.error_us) == ("vehicle", 700)
    now = clock.now()
    assert now.utc_us - now.monotonic_us == 1_800_000_000_000_000 - 1_000
    assert not watch.look(SourceTime(), "px4", 0)


def test_stated_utc_error_holds_once_waiting_ends() -> None:
    own = Own(number=77)
    own.stated = ClockSource.OPERATOR
    watch = UtcWatch(SystemClock(), 500, kernel_us=lambda: None)
    assert (watch.question(), watch.vehicle_may_tell) == (0, True)
    watch.follow(own)
    assert (watch.question(), watch.vehicle_may_tell) == (77, True)
    watch.settle()
    assert (watch.bound.source, watch.question(), watch.vehicle_may_tell) == ("operator", 0, False)
    unstated = UtcWatch(SystemClock(), None, kernel_us=lambda: None)
    unstated.follow(Own())
    unstated.settle()
    assert unstated.waits
    assert not unstated.vehicle_may_tell, "the boundary draws no number, for the link has no key"


def test_time_taken_by_the_boundary_meanwhile_is_followed() -> None:
    """Otherwise the vehicle counts as ready before the time of day is known, and its first step is deferred."""
    own = Own(number=77)
    watch = UtcWatch(SystemClock(), None, kernel_us=lambda: None)
    watch.follow(own)
    own.source = ClockSource.VEHICLE  # its answer came between two checks
    assert (watch.waits, watch.question(), watch.vehicle_may_tell) == (True, 0, True)
    assert watch.look(SourceTime(), "px4", 0)
    assert not watch.vehicle_may_tell


def test_a_boundary_without_a_clock_or_that_is_gone_changes_nothing() -> None:
    for own in (Own(ClockSource.SHARED), Own()):
        own.gone = own.source is ClockSource.UNKNOWN
        watch = UtcWatch(SystemClock(), None, kernel_us=lambda: 3)
        watch.follow(own)
        assert watch.bound.source == "kernel"


def test_of_a_simulated_vehicle_the_boundary_has_this_machines_time() -> None:
    own = Own()
    own.stated = ClockSource.OPERATOR
    watch = UtcWatch.simulated(SystemClock())
    watch.follow(own)
    assert (watch.bound.source, watch.bound.error_us) == ("simulated", 700)
