"""Parsing to IR, compared with a plain Lark parse of the same text with positions, in one run, with the garbage
collector on and off.

Also checks that time and memory grow linearly with the text, up to 50,000 lines. Exits with 1 when a limit is exceeded.
"""

import gc
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter_ns

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.generate import GRAMMAR, lark
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.table import table

CHECKOUT = Path(__file__).resolve().parents[1]

RATIO = 1.0
ROUNDS = 7
LINES = 2_000
MOST_LINES = 50_000
GROWTH = 1.3
"""The limit of the time per line at `MOST_LINES`, relative to a tenth of that."""
CEILING = 2_048
"""Bytes of memory per line, of the IR and at the peak of parsing, without the text."""


def sources(lines: int) -> str:
    """Return the shipped sources, repeated to so many lines. Names repeat, which only the checker rejects."""
    files = [
        path for folder in ("skills", "policies", "missions") for path in sorted((CHECKOUT / folder).glob("*.rts"))
    ]
    once = "".join(path.read_text(encoding="utf-8") for path in files)
    text = once * (lines // once.count("\n") + 1)
    end = 0
    for _ in range(lines):
        end = text.index("\n", end) + 1
    return text[: text.rindex("\n}\n", 0, end) + 3]


def milliseconds(work: Callable[[], object]) -> float:
    """Return the time of `work`."""
    start = perf_counter_ns()
    work()
    return (perf_counter_ns() - start) / 1e6


def ours(text: str) -> None:
    """Parse the text to IR; it must be valid."""
    assert not parse(Source("bench.rts", text)).diagnostics


def against_lark() -> bool:
    """Return the ratio to Lark, which makes a tree of tokens instead of IR."""
    grammar, text = GRAMMAR.read_text(encoding="utf-8"), sources(LINES)
    print(
        f"parse: reading the committed table takes {milliseconds(table):.1f} ms, "
        f"making it with Lark {milliseconds(lambda: lark(grammar)):.0f} ms"
    )
    bare = lark(grammar)
    held = True
    for collector in (True, False):
        (gc.enable if collector else gc.disable)()
        rounds = [(milliseconds(lambda: ours(text)), milliseconds(lambda: bare.parse(text))) for _ in range(ROUNDS)]
        mine, peer = median(a for a, _ in rounds), median(b for _, b in rounds)
        held &= mine <= RATIO * peer
        print(
            f"parse: text to IR takes {mine / peer:.2f} times a bare Lark parse, limit {RATIO:g} "
            f"({mine:.0f} ms against {peer:.0f} ms, {LINES} lines, collector {'on' if collector else 'off'})"
        )
    gc.enable()
    return held


def in_proportion() -> bool:
    """Return time and memory for few lines and for many."""
    few, many = sources(MOST_LINES // 10), sources(MOST_LINES)
    small = median(milliseconds(lambda: ours(few)) for _ in range(3)) * 10
    large = median(milliseconds(lambda: ours(many)) for _ in range(3))
    print(
        f"parse: a line takes {large / small:.2f} times as long in {MOST_LINES} lines as in a tenth of them, "
        f"limit {GROWTH:g} ({large:.0f} ms, {large * 1000 / MOST_LINES:.1f} us a line)"
    )
    tracemalloc.start()
    parsed = parse(Source("bench.rts", many))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert parsed.unit.skills
    print(
        f"parse: {MOST_LINES} lines take {peak / 2**20:.0f} MiB at their peak, {peak // MOST_LINES} bytes a line, "
        f"limit {CEILING}"
    )
    return large <= GROWTH * small and peak <= CEILING * MOST_LINES


def start_up() -> None:
    """Print the import time of the parser, and check that it does not import Lark."""
    code = (
        "import sys, time; t = time.perf_counter_ns(); import rtshcua.model.ir.program; m = time.perf_counter_ns();"
        "import rtshcua.ground.language.load; l = time.perf_counter_ns();"
        "assert 'lark' not in sys.modules; print((m - t) / 1e6, (l - m) / 1e6)"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, check=True) for _ in range(5)]
    model, parser = (median(float(run.stdout.split()[at]) for run in runs) for at in (0, 1))
    print(f"parse: importing takes {parser:.0f} ms, after {model:.0f} ms for the IR; Lark is not imported")


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    start_up()
    return int(not all([against_lark(), in_proportion()]))


if __name__ == "__main__":
    sys.exit(main())
