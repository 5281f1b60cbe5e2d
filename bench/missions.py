"""Checking a mission with its proofs: a short mission is fast, and the time per step does not grow.

Measured is a whole check of a mission under the shipped policy, from text. The long missions exceed the battery, which
the check reports and continues. Exits with 1 when a limit is missed.
"""

import gc
import sys
from pathlib import Path
from statistics import median
from time import process_time_ns

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect

INTERACTIVE_MS = 300.0  # for twelve steps
SPREAD = 1.6  # the time per step of the longest mission, relative to the shortest
SIZES = (250, 1_000, 2_000)
SHORT = 12
ROUNDS = 3

ROOT = Path(__file__).resolve().parents[1]


def source(steps: int) -> str:
    """Return a mission of so many steps."""
    middle = (
        f"goto(47.39{799 + number % 50:03d} N, 8.54559 E, altitude = 20 m)" if number % 2 else "hover()"
        for number in range(steps - 2)
    )
    body = "\n".join(("takeoff(altitude = 20 m)", *middle, "return_home()"))
    return (
        'import "lib:policies/bridge_inspection.rts"\n'
        "mission flight under bridge_inspection@7 on quad {\n"
        f"  proposed by agent openclaw for role operator\n  phase departure {{\n{body}\n  }}\n}}\n"
    )


def milliseconds(text: str) -> float:
    """Return the processor time of one check."""

    def read(path: str) -> bytes:
        return text.encode() if path == "flight.rts" else Path(path).read_bytes()

    gc.collect()
    start = process_time_ns()
    check_program(load(["flight.rts"], read, str(ROOT)), dialect.load())
    return (process_time_ns() - start) / 1e6


def main() -> int:
    """Measure and print the short mission and the growth; return 1 if a limit is missed."""
    milliseconds(source(SHORT))
    short = median(milliseconds(source(SHORT)) for _ in range(ROUNDS))
    print(f"missions: {SHORT} steps are checked in {short:.0f} ms, limit {INTERACTIVE_MS:g}, median of {ROUNDS}")
    base = milliseconds(source(2))
    costs = [median(milliseconds(source(size)) - base for _ in range(ROUNDS)) / size for size in SIZES]
    growth = costs[-1] / costs[0]
    print(
        f"missions: a step of {SIZES[-1]:,} costs {growth:.2f} times one of {SIZES[0]}, limit {SPREAD} "
        f"({1000 * costs[-1]:.0f} us a step)"
    )
    return int(short > INTERACTIVE_MS or growth > SPREAD)


if __name__ == "__main__":
    sys.exit(main())
