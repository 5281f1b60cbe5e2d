"""The decision in C, in this process, compared with Python: ten candidates, and a place that changes each time.

Exits with 1 when the limit is missed. RTSHCUA_BOUNDARY names another library than the one built here.
"""

import ctypes
import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from decide import asked_of_decide, measured, prepared, ten_candidates

from reference import flat_case as flat
from reference.native import Native, Question, expected

ROOT = Path(__file__).resolve().parents[1]
DECIDE_MEDIAN = 3.0  # us
ROUNDS, BATCHES, CALLS = 40, 100, 25
"""The number of batches and of calls in a batch: a call from Python takes longer than the called function."""


def library() -> ctypes.CDLL:
    """Load the boundary in C; build it if necessary."""
    named = os.environ.get("RTSHCUA_BOUNDARY")
    if named is None:
        subprocess.run(["make", "-s", "-C", str(ROOT / "boundary"), f"PYTHON={sys.executable}"], check=True)
    return ctypes.CDLL(named or str(ROOT / "build" / "boundary" / "librtshcua.so"))


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    policy = ten_candidates()
    native, question = Native(library()), Question(flat.state(), flat.context(), flat.NOW)
    assert native.policy(policy.policy) is None
    assert native.mission(flat.MISSION) is None
    native.step(flat.INSPECTION_STEP)
    assert native.candidates() == 10
    assert native.ask([question]) == [expected(prepared(flat.INVOCATIONS[flat.INSPECTION_STEP], policy), question)]
    taken: list[float] = []
    for _ in range(ROUNDS * BATCHES):
        start = perf_counter_ns()
        native.again(question, CALLS)
        taken.append((perf_counter_ns() - start) / 1e3 / CALLS)
    found, high = median(taken), sorted(taken)[len(taken) * 99 // 100]
    ((python, _),) = measured(asked_of_decide(100))
    print(
        f"decide in C, 10 candidates: median {found:.2f} us, p99 of {CALLS} calls {high:.2f} us; "
        f"{python / found:.0f} times as fast as in Python"
    )
    held = found <= DECIDE_MEDIAN
    print(f"{'held  ' if held else 'MISSED'}  decide in C: median {found:.2f} us, limit {DECIDE_MEDIAN:g} us")
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
