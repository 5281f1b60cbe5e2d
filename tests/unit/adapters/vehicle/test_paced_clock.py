"""The clock of a simulated vehicle that runs faster than real time."""

from rtshcua.adapters.clock import PacedClock, SystemClock

MS = 1_000_000  # ns
S = 1_000 * MS


class Machine:
    def __init__(self) -> None:
        self.ns = 50 * S

    def __call__(self) -> int:
        return self.ns


def test_follows_the_vehicles_time_and_runs_a_little_ahead() -> None:
    machine = Machine()
    clock = PacedClock(10, machine_ns=machine)
    start = clock.now().monotonic_us
    clock.heard(5_000_000)
    assert clock.now().monotonic_us == start
    machine.ns += 10 * MS
    assert clock.now().monotonic_us == start + 100_000
    clock.heard(5_120_000)
    assert clock.now().monotonic_us == start + 120_000
    machine.ns += 100 * MS  # one second of vehicle time without a frame
    assert clock.now().monotonic_us == start + 120_000 + clock.LEAD_US


def test_paced_clock_stops_during_a_pause_but_not_a_silence() -> None:
    machine = Machine()
    clock = PacedClock(10, machine_ns=machine)
    clock.heard(0)
    start = clock.now().monotonic_us
    machine.ns += 400 * MS
    assert clock.now().monotonic_us - start == clock.LEAD_US
    machine.ns += 1_100 * MS
    assert clock.now().monotonic_us - start == clock.LEAD_US + 10_000_000


def test_a_slower_one_notices_a_silence_sooner() -> None:
    machine = Machine()
    clock = PacedClock(5, machine_ns=machine)
    clock.heard(0)
    start = clock.now().monotonic_us
    machine.ns += 125 * MS
    assert clock.now().monotonic_us - start == clock.LEAD_US
    machine.ns += 875 * MS
    gone_us = clock.now().monotonic_us - start
    assert gone_us == clock.LEAD_US + 875_000 * 5
    clock.heard(5_000_000)
    assert clock.now().monotonic_us - start == 5_000_000, "and makes up for less than half a second in one step"


def test_never_goes_back() -> None:
    machine = Machine()
    clock = PacedClock(50, machine_ns=machine)
    clock.heard(1_000_000)
    latest = clock.now().monotonic_us
    for advance_ms, boot_us in (
        (5, 1_100_000),
        (2_000, None),
        (1, 1_150_000),
        (1, 900_000),
        (3, 1_400_000),
        (1, 30_000),
    ):
        machine.ns += advance_ms * MS
        if boot_us is not None:
            clock.heard(boot_us)
        now = clock.now()
        assert now.monotonic_us >= latest
        latest = now.monotonic_us


def test_is_the_machines_until_the_vehicle_tells_its_time() -> None:
    machine = Machine()
    clock = PacedClock(50, machine_ns=machine)
    start = clock.now()
    machine.ns += 100 * MS
    now = clock.now()
    assert now.monotonic_us - start.monotonic_us == 100_000
    assert now.utc_us - start.utc_us == 100_000


def test_utc_goes_with_it() -> None:
    machine = Machine()
    clock = PacedClock(2, machine_ns=machine)
    clock.heard(0)
    start = clock.now()
    clock.heard(7_000_000)
    assert clock.now().utc_us - start.utc_us == clock.now().monotonic_us - start.monotonic_us == 7_000_000
    assert (clock.real_seconds(4_000_000), clock.us_in(2)) == (2.0, 4_000_000)


def test_the_systems_clock_does_not_listen_nor_tell() -> None:
    clock, told = SystemClock(utc_error_us=5), list[int]()
    clock.tell(told.append)
    before = clock.now()
    clock.heard(10**12)
    after = clock.now()
    assert before.monotonic_us <= after.monotonic_us < before.monotonic_us + 10_000_000
    assert after.utc_us - before.utc_us == after.monotonic_us - before.monotonic_us
    assert 5 <= after.utc_error_us < 5 + 10 * 500, "it grows"
    assert (clock.real_seconds(1_500_000), clock.us_in(1.5), told) == (1.5, 1_500_000, [])


def test_tells_how_far_the_vehicle_was_heard() -> None:
    clock, told = PacedClock(20, machine_ns=Machine()), list[int]()
    clock.tell(told.append)
    for boot_us in (500_000, 550_000, 600_000, 400_000, 720_000):
        clock.heard(boot_us)
    assert told == [500_000, 600_000, 720_000]
