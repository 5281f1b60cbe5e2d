"""Formatting: the layout compared with our own parser, and the whole compared with a plain Lark parse.

The whole is the function `formatted`: parse, lay out, parse again, compare. All of the same text, in one run. Exits
with 1 when a limit is exceeded.
"""

import gc
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter_ns

from lark import Lark

from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from rtshcua.ground.format.format_text import lay_out
from rtshcua.ground.format.style import WIDTH
from rtshcua.ground.format.token_reader import read
from rtshcua.ground.language.generate import GRAMMAR, lark
from rtshcua.ground.language.parse import parse

CHECKOUT = Path(__file__).resolve().parents[1]

LAYOUT_RATIO = 1.0
"""The limit of the layout, relative to our own parser."""
WHOLE_RATIO = 1.0
"""The limit of the whole, relative to a plain Lark parse."""
GROWTH = 2.0
"""The limit of the time per line in a file ten times as long."""
ROUNDS = 7
LINES = 2_000


def shipped() -> list[str]:
    """Return the shipped sources."""
    folders = ("skills", "policies", "missions")
    return [path.read_text(encoding="utf-8") for each in folders for path in sorted((CHECKOUT / each).glob("*.rts"))]


def long(lines: int) -> str:
    """Return the shipped sources, repeated to so many lines, unformatted, because formatted text is skipped."""
    once = "".join(shipped()).replace("  ", " ").replace(" = ", "=")
    return once * (lines // once.count("\n") + 1)


def milliseconds(work: Callable[[], object]) -> float:
    """Return the time of `work`."""
    start = perf_counter_ns()
    work()
    return (perf_counter_ns() - start) / 1e6


def whole(texts: list[str]) -> None:
    """Format the text; the result must be accepted."""
    for text in texts:
        assert formatted(Source("bench.rts", text)).text is not None


def against(bare: Lark, name: str, texts: list[str]) -> bool:
    """Print both ratios for these texts."""
    readings = [found for text in texts if (found := read(text)) is not None]
    assert len(readings) == len(texts)

    def one_round() -> tuple[float, float, float, float]:
        return (
            milliseconds(lambda: [lay_out(each, WIDTH) for each in readings]),
            milliseconds(lambda: [parse(Source("bench.rts", text)) for text in texts]),
            milliseconds(lambda: whole(texts)),
            milliseconds(lambda: [bare.parse(text) for text in texts]),
        )

    one_round()
    layout, own, everything, peer = (
        median(column) for column in zip(*(one_round() for _ in range(ROUNDS)), strict=True)
    )
    lines = sum(text.count("\n") for text in texts)
    print(
        f"format: laying out takes {layout / own:.2f} times our own parse, limit {LAYOUT_RATIO:g} "
        f"({layout:.0f} ms against {own:.0f} ms, {name}, {lines} lines)"
    )
    print(
        f"format: the whole takes {everything / peer:.2f} times a bare Lark parse, limit {WHOLE_RATIO:g} "
        f"({everything:.0f} ms against {peer:.0f} ms, {name})"
    )
    return bool(layout <= LAYOUT_RATIO * own and everything <= WHOLE_RATIO * peer)


def in_proportion() -> bool:
    """Return the times for a long text and for ten times as much."""
    few, many = [long(LINES)], [long(LINES * 10)]
    small = median(milliseconds(lambda: whole(few)) for _ in range(3)) * 10 / few[0].count("\n")
    large = median(milliseconds(lambda: whole(many)) for _ in range(3)) * 10 / many[0].count("\n")
    print(f"format: a line takes {large / small:.2f} times as long in ten times as many, limit {GROWTH:g}")
    return large <= GROWTH * small


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    parser = lark(GRAMMAR.read_text(encoding="utf-8"))
    gc.collect()
    held = [against(parser, "one long file", [long(LINES)]), against(parser, "what ships", shipped()), in_proportion()]
    return int(not all(held))


if __name__ == "__main__":
    sys.exit(main())
