"""The shipped pages of diagnostic codes, such as `docs/codes/E0310.md`."""

import re
from typing import NamedTuple

from rtshcua.diagnostics.codes import Code
from rtshcua.library import root

#: the headings of every page, in order
WHAT, WHY, BAD, GOOD = "What it means", "Why it matters", "Bad", "Good"
HEADINGS = (WHAT, WHY, BAD, GOOD)

_SECTION = re.compile(r"^## (.+)\n", re.MULTILINE)


class Page(NamedTuple):
    """A page, and its four sections without headings."""

    text: str
    what: str
    why: str
    bad: str
    good: str


def read_page(code: Code) -> Page:
    """Return the page of a code. Raises OSError if the installation lacks it."""
    text = (root() / "docs" / "codes" / f"{code.id}.md").read_text(encoding="utf-8")
    parts = _SECTION.split(text)
    sections = dict(zip(parts[1::2], (part.strip() for part in parts[2::2]), strict=True))
    return Page(text, *(sections[heading] for heading in HEADINGS))


def example(section: str) -> str | None:
    """Return the source in a section; None if the section has no source."""
    found = re.search(r"^```rts\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
    return None if found is None else found[1]
