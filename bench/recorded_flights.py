"""Recorded flights of ArduCopter and PX4, replayed through driver and state monitor.

The known signals are compared with the recording's page second by second, except the second of a change; events are
compared with their times on the page. Exits with 1 when a second differs, or an event is off by more than the limit.
"""

import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from recorded.flown import Recorded, at_home, command, shipped_policy
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import AirState, CommandFailed, Ready, Succeeded, TakenOver

LIMIT_S = 2.0

Stretches = list[tuple[float, float]]

#: when a signal is known according to the page: seconds after the autopilot's start
ARDUCOPTER: dict[str, Stretches] = {
    "position": [(41.6, 85.06), (86.56, 162)],
    "height": [(41.6, 162)],
    "gps.fix": [(10.0, 77.9), (86.3, 162)],
    "battery": [(2.5, 162)],
    "landed": [(2.5, 162)],
    "wind.speed": [],
    "obstacle.distance": [],
    "link.quality": [],
}
PX4: dict[str, Stretches] = {
    "position": [(2.9, 150)],
    "height": [(2.9, 150)],
    "gps.fix": [(0.5, 150)],
    "battery": [(2.4, 150)],
    "landed": [(1.4, 150)],
    "wind.speed": [],
    "link.quality": [],
}


def compare(flight: Recorded, page: dict[str, Stretches]) -> int:
    """Print each differing second and the number of compared ones; return the number of differences."""
    compared = differ = 0
    for second, state in enumerate(flight.states):
        for signal, stretches in page.items():
            edges = [edge for stretch in stretches for edge in stretch]
            if any(abs(second - edge) < 1 for edge in edges) or signal not in state:
                continue
            compared += 1
            known = any(begin <= second <= end for begin, end in stretches)
            if known != (state[signal] is not None):
                differ += 1
                print(f"recorded flights: {flight.name}: second {second}: `{signal}` should be {known=}")
    print(f"recorded flights: {flight.name}: {compared} states of signals as its page says, {differ} not")
    return differ


def moments(flight: Recorded, page: list[tuple[str, float, float]]) -> int:
    """Print each event that is off by more than the limit; return their number."""
    off = 0
    for what, said, seen in page:
        late = abs(seen - said) > LIMIT_S
        off += late
        times = f"{said:.1f} s by its page, {seen:.1f} s seen, limit {LIMIT_S:.0f} s"
        print(f"recorded flights: {flight.name}: {what}: {times}")
    return off


def main() -> int:
    """Replay both flights and print the comparison; return 1 if there is a difference."""
    start = process_time()
    home = (-353_632_621, 1_491_652_371)
    copter = Recorded("arducopter", 1_000_000, at_home(*home), {"RTL_ALT": 3_000.0})
    px4 = Recorded("px4", 370_000, shipped_policy(), {"RTL_RETURN_ALT": 30.0}, (
        (10.6, command(1, MotionKind.CLIMB, altitude=15_000)),
        (56.0, command(2, MotionKind.FLY, 473_986_400, 85_456_000, altitude=15_000)),
        (86.8, command(3, MotionKind.HOME)),
    ))  # fmt: skip
    took = process_time() - start
    wrong = compare(copter, ARDUCOPTER) + compare(px4, PX4)
    taken = [at for at, _ in copter.of(TakenOver)]
    lost = copter.known("gps.fix")[0][1] + 1
    wrong += moments(copter, [
        ("ready, not before its estimator is", 41.6, copter.first(Ready)),
        ("lost GPS seen", 77.9, lost),
        ("its own failsafe taken for a take-over", 86.0, taken[0]),
        ("somebody else's return too", 107.0, taken[1]),
        ("landed and disarmed", 158.0, copter.of(AirState)[-1][0]),
    ])  # fmt: skip
    done = {event.token: at for at, event in px4.of(Succeeded) if isinstance(event, Succeeded)}
    unanswered = [event.reason for _, event in px4.of(CommandFailed) if isinstance(event, CommandFailed)]
    wrong += moments(px4, [
        ("ready", 5.6, px4.first(Ready)),
        ("takeoff done, when the recorded client went on", 26.9, done[1]),
        ("returned, landed and disarmed", 147.0, done[3]),
    ])  # fmt: skip
    print(f"recorded flights: px4: a command that is never answered: {', '.join(unanswered)}")
    wrong += unanswered != ["unknown/no-answer"]
    seconds = copter.second + px4.second
    print(f"recorded flights: {seconds / took:.0f} times real time")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
