"""Print lists of claims and other styled lines."""

import os
import sys
from collections.abc import Iterable, Sequence

from rtshcua.diagnostics.excerpt import visible
from rtshcua.evidence.finding import Claim
from rtshcua.front.cli.stdout import out
from rtshcua.front.cli.width import fitted


def listed(title: str, style: str, mark: str, claims: Sequence[Claim]) -> list[tuple[str, str]]:
    """Return claims below a title, each after a mark, as pairs (style, line); empty if there are no claims."""
    if not claims:
        return []
    lines = [("", ""), ("bold", title)]
    for claim in claims:
        lines += [(style, f"  {mark} {visible(claim.text)}")]
    return lines


def write(lines: Iterable[tuple[str, str]]) -> None:
    """Print pairs (style, line), in colour on a terminal unless NO_COLOR is set."""
    if not sys.stdout.isatty() or "NO_COLOR" in os.environ:
        out(*(text for _, text in lines))
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    for style, text in lines:
        for line in fitted(visible(text)):
            console.print(Text(line, style), soft_wrap=True)
