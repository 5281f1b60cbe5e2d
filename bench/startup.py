"""Start-up: `rtshcua --help` against `python -c pass`, in turns, so that a noisy machine slows both alike.

Exits with 1 when the ratio of the medians is above the limit.
"""

import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter_ns

LIMIT = 9
ROUNDS = 25


def milliseconds(command: list[str]) -> float:
    """How long one run of `command` takes, from start to exit."""
    start = perf_counter_ns()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    return (perf_counter_ns() - start) / 1e6


def main() -> int:
    """Measures, prints one line, and says whether the limit held."""
    script = Path(sys.executable).with_name("rtshcua")
    ours = [str(script)] if script.exists() else [sys.executable, "-m", "rtshcua.cli.app"]
    bare = [sys.executable, "-c", "pass"]
    milliseconds([*ours, "--help"]), milliseconds(bare)  # warm: byte code is written, files are in memory
    rounds = [(milliseconds([*ours, "--help"]), milliseconds(bare)) for _ in range(ROUNDS)]
    help_ms, bare_ms = median(a for a, _ in rounds), median(b for _, b in rounds)
    ratio = help_ms / bare_ms
    print(
        f"startup: `rtshcua --help` takes {ratio:.2f} times `python -c pass`, limit {LIMIT} "
        f"({help_ms:.1f} ms against {bare_ms:.1f} ms, medians of {ROUNDS})"
    )
    return int(ratio > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
