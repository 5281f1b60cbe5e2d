"""How a list of claims, and other styled lines, are shown to a person."""

import os
import sys
from collections.abc import Iterable, Sequence
from textwrap import wrap

from rtshcua.cli.stdout import out
from rtshcua.diagnostics.excerpt import visible
from rtshcua.evidence.finding import Claim

#: characters in a line
WIDTH = 100


def listed(title: str, style: str, mark: str, claims: Sequence[Claim]) -> list[tuple[str, str]]:
    """Claims under a title, each behind a mark, as (style, line); nothing where there are none."""
    if not claims:
        return []
    lines = [("", ""), ("bold", title)]
    for claim in claims:
        head, *more = wrap(visible(claim.text), WIDTH)
        lines += [(style, f"  {mark} {head}"), *((style, f"    {line}") for line in more)]
    return lines


def write(lines: Iterable[tuple[str, str]]) -> None:
    """Prints (style, line): in colour on a terminal, unless NO_COLOR is set."""
    if not sys.stdout.isatty() or "NO_COLOR" in os.environ:
        out(*(text for _, text in lines))
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    for style, text in lines:
        console.print(Text(visible(text), style))
