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

from decide import PAYLOAD, asked_of_decide, inspection, measured, prepared, ten_candidates
from msgspec.structs import replace

from reference import flat_case as flat
from reference.native import Native, Question, expected
from rtshcua.model.flat.policy import Policy

ROOT = Path(__file__).resolve().parents[1]
DECIDE_MEDIAN = 3.0  # us
ROUNDS, BATCHES, CALLS = 40, 100, 25
TURNS = 5
"""The number of batches and of calls in a batch: a call from Python takes longer than the called function."""


def library() -> ctypes.CDLL:
    """Load the boundary in C; build it if necessary."""
    named = os.environ.get("RTSHCUA_BOUNDARY")
    if named is None:
        subprocess.run(["make", "-s", "-C", str(ROOT / "boundary"), f"PYTHON={sys.executable}"], check=True)
    return ctypes.CDLL(named or str(ROOT / "build" / "boundary" / "librtshcua.so"))


def asked(native: Native, question: Question) -> tuple[float, float]:
    """The median and the 99th percentile of a decision on the step that was prepared, in us."""
    taken: list[float] = []
    for _ in range(ROUNDS * BATCHES):
        start = perf_counter_ns()
        native.again(question, CALLS)
        taken.append((perf_counter_ns() - start) / 1e3 / CALLS)
    return median(taken), sorted(taken)[len(taken) * 99 // 100]


def with_payload(native: Native, question: Question) -> float:
    """How much longer a decision takes on a skill that emits commands to payload: the median of ratios in turns."""
    policies = [ten_candidates(emits=emits).policy for emits in (False, True)]
    ratios = []
    for _ in range(TURNS):
        plain, emitting = (_decided(native, policy, question) for policy in policies)
        ratios.append(emitting / plain)
    return median(ratios)


def _decided(native: Native, policy: Policy, question: Question) -> float:
    steps = list(flat.INVOCATIONS)
    steps[flat.INSPECTION_STEP] = inspection(policy)
    assert native.policy(policy) is None
    assert native.mission(replace(flat.MISSION, invocations=tuple(steps))) is None
    native.step(flat.INSPECTION_STEP)
    return asked(native, question)[0]


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    policy = ten_candidates()
    native, question = Native(library()), Question(flat.state(), flat.context(), flat.NOW)
    assert native.policy(policy.policy) is None
    assert native.mission(flat.MISSION) is None
    native.step(flat.INSPECTION_STEP)
    assert native.candidates() == 10
    assert native.ask([question]) == [expected(prepared(flat.INVOCATIONS[flat.INSPECTION_STEP], policy), question)]
    found, high = asked(native, question)
    ((python, _),) = measured(asked_of_decide(100))
    print(
        f"decide in C, 10 candidates: median {found:.2f} us, p99 of {CALLS} calls {high:.2f} us; "
        f"{python / found:.0f} times as fast as in Python"
    )
    held = found <= DECIDE_MEDIAN
    print(f"{'held  ' if held else 'MISSED'}  decide in C: median {found:.2f} us, limit {DECIDE_MEDIAN:g} us")
    ratio = with_payload(native, question)
    same = ratio <= PAYLOAD
    print(f"{'held  ' if same else 'MISSED'}  with commands to payload: {ratio:.3f} times, limit {PAYLOAD}")
    return int(not (held and same))


if __name__ == "__main__":
    sys.exit(main())
