"""The standard output of commands: whatever they print there passes one of these, and is harmless when it leaves.

Names of files, of missions and of policies, texts of vehicles: others wrote them, and a terminal would obey them.
"""

import sys

from rtshcua.diagnostics.excerpt import escaped, hiding, visible


def out(*lines: str, flush: bool = False) -> None:
    """Prints each as one line, whatever is in it."""
    for line in lines:
        print(visible(line))
    if flush:
        sys.stdout.flush()


def out_json(text: str, *, end: str = "\n", flush: bool = False) -> None:
    """Prints JSON: it says what it said, and what a terminal would obey, or nobody sees, is written as an escape."""
    print(escaped(text), end=end, flush=flush)


def out_rendered(text: str, *, end: str = "\n") -> None:
    """Prints what is harmless already (made by `visible`, or of our own), and may be coloured by us."""
    print(text, end=end)


def out_source(text: str) -> None:
    """Prints a source as it stands, but for what no source may hold, for it hides or reorders what a person reads."""
    while (at := hiding(text)) is not None:
        text = f"{text[:at]}{visible(text[at])}{text[at + 1 :]}"
    print(text, end="")
