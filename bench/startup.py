"""Start-up: commands compared with `python -c pass`, from start to exit, in turns, in processor time; and the imports
of a check.

Exits with 1 when the ratio of `rtshcua --help`, or the time of a check or of its imports, is above its limit.
"""

import subprocess
import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

LIMITS = {"--help": 9, "check": 90}  # multiples of `python -c pass`, which takes 10 ms on a quiet machine
IMPORTS = 50
ROUNDS = 7

ROOT = Path(__file__).resolve().parents[1]
NEEDED = "import rtshcua.front.cli.render.check_report, rtshcua.ground.pipeline.program, rtshcua.mavlink.dialect"
COMMANDS = (
    ("--help",),
    ("explain", "E0310"),
    *(("check", f"missions/{name}.rts") for name in ("short", "standard", "extended")),
)


def milliseconds(command: list[str]) -> float:
    """Return the processor time of one run of `command`, from start to exit."""
    before = getrusage(RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True, cwd=ROOT)
    after = getrusage(RUSAGE_CHILDREN)
    return (after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime) * 1e3


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    script = Path(sys.executable).with_name("rtshcua")
    ours = [str(script)] if script.exists() else [sys.executable, "-m", "rtshcua"]
    bare, imports = [sys.executable, "-c", "pass"], [sys.executable, "-c", NEEDED]
    asked = [bare, imports, *([*ours, *words] for words in COMMANDS)]
    [milliseconds(command) for command in asked]  # warm-up: byte code and file cache
    rounds = [[milliseconds(command) for command in asked] for _ in range(ROUNDS)]
    bare_ms, imports_ms, *times = (min(column) for column in zip(*rounds, strict=True))  # the fastest run counts
    held = imports_ms <= IMPORTS * bare_ms
    print(f"startup: the imports of a check take {imports_ms / bare_ms:.1f} times `python -c pass`, limit {IMPORTS}")
    for words, taken in zip(COMMANDS, times, strict=True):
        ratio, limit = taken / bare_ms, LIMITS.get(words[0])
        held = held and (limit is None or ratio <= limit)
        print(
            f"startup: `rtshcua {' '.join(words)}` takes {ratio:.1f} times `python -c pass`"
            f"{'' if limit is None else f', limit {limit}'} "
            f"({taken:.0f} ms against {bare_ms:.0f} ms of processor time, least of {ROUNDS})"
        )
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
