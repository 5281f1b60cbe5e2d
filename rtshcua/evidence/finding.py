"""How a verification speaks: what fails, and what was proven."""

from typing import NamedTuple


class Flaw(NamedTuple):
    """What is wrong with one thing: a stable slug, and words. `found` and `expected` are what was compared, as text."""

    slug: str
    text: str
    found: str = ""
    expected: str = ""

    def at(self, record: int, offset: int = -1) -> "Finding":
        """This flaw, found in record number `record`, whose line begins at octet `offset`."""
        return Finding(self.slug, record, self.text, self.found, self.expected, offset)


class Finding(NamedTuple):
    """The flaw that ended a verification; `record` counts from 0 (its line is one more).

    `offset` is where that line begins, in octets from the beginning of the log; -1 where it is not known.
    """

    slug: str
    record: int
    text: str
    found: str = ""
    expected: str = ""
    offset: int = -1


class Claim(NamedTuple):
    """Something that was proven, or that was not: a stable slug and a sentence for a person."""

    slug: str
    text: str
