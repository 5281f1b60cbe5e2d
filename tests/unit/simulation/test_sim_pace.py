"""At high speed the simulated vehicle waits for a busy computer, but not for a stalled one."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.simulation.process import Pace

CODEC = Codec(1, 1)


def position(boot_ms: int) -> bytes:
    return CODEC.pack(mavlink.MAVLink_global_position_int_message(boot_ms, 0, 0, 0, 0, 0, 0, 0, 0))


def test_pace_waits_while_ahead_of_received_positions() -> None:
    pace = Pace()
    pace.says(position(70_000))
    pace.hears(69_000_000, 5.0)
    assert not pace.waits(5.1)
    pace.says(position(70_100))
    assert pace.waits(5.1)
    pace.hears(69_100_000, 5.2)
    assert not pace.waits(5.2)


def test_pace_does_not_wait_without_reports() -> None:
    """With a cut link or a stalled computer the vehicle flies on."""
    pace = Pace()
    pace.says(position(70_000))
    assert not pace.waits(100.0), "nobody ever told"
    pace.hears(1_000_000, 5.0)
    assert [pace.waits(5.0 + s) for s in (0.4, 0.6)] == [True, False]


@pytest.mark.parametrize(
    "message",
    [mavlink.MAVLink_attitude_message(90_000, 0, 0, 0, 0, 0, 0), mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3)],
)
def test_pace_counts_only_positions(message: object) -> None:
    pace = Pace()
    pace.hears(1_000_000, 5.0)
    pace.says(CODEC.pack(message))
    assert not pace.waits(5.1)


def test_pace_does_not_wait_after_a_restart() -> None:
    pace = Pace()
    pace.hears(90_000_000, 5.0)
    pace.says(position(100))
    assert not pace.waits(5.1)
