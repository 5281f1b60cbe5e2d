"""Virtual time: the speed of the shipped missions in one process, relative to real time.

Simulation, real MAVLink both ways, driver, loop, runtime and evidence; with at least 50 frames a second from the
vehicle, for which the limit applies, and one mission with 200. Exits with 1 when a mission is slower than the limit.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.onboard.ports import Ending
from rtshcua.virtual.vehicle import TICK_US
from virtual.flight import Flight
from virtual.shipped import NAMES, shipped, simulated

LIMIT = 150
FRAMES = 50
ROUNDS = 3
MANY_FRAMES = 200
MANY = "standard"
_MORE = {mavlink.MAVLINK_MSG_ID_ATTITUDE: 40_000}
_MANY = dict.fromkeys(
    (
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
    ),
    20_000,
)


def one(name: str, flavour: str, more: Mapping[int, int] = _MORE) -> tuple[float, float, float]:
    """Return simulated seconds, processor time in seconds, and frames per simulated second; `more`: intervals in us."""
    flight = Flight(shipped(name), simulated(flavour, land_mm_s=None), tick_us=TICK_US)
    streams = flight.vehicle.simulation._autopilot.streams
    for number, interval_us in more.items():
        streams.set(number, interval_us)
    start = process_time()
    flown = flight.fly()
    took = process_time() - start
    assert flown.ending is Ending.COMPLETED
    seconds = flight.clock.elapsed_us / 1e6
    return seconds, took, flight.vehicle.received / seconds


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    slowest = float("inf")
    for name in NAMES:
        for flavour in ("px4", "ardupilot"):
            flights = [one(name, flavour) for _ in range(ROUNDS)]
            seconds, took, frames = min(flights, key=lambda flight: flight[1])
            assert frames >= FRAMES, frames
            slowest = min(slowest, seconds / took)
            print(
                f"virtual time: `{name}` on {flavour}: {seconds / took:.0f} times real time "
                f"({seconds:.0f} s in {took:.2f} s, {frames:.0f} frames a second)"
            )
    seconds, took, frames = min((one(MANY, "px4", _MANY) for _ in range(ROUNDS)), key=lambda flight: flight[1])
    assert frames >= MANY_FRAMES, frames
    print(f"virtual time: `{MANY}` on px4: {seconds / took:.0f} times real time at {frames:.0f} frames a second")
    print(f"virtual time: {slowest:.0f} times real time at the least, limit {LIMIT}")
    return int(slowest < LIMIT)


if __name__ == "__main__":
    sys.exit(main())
