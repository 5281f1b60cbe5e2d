"""The results of a verification: flaws, and claims that were proven."""

from typing import NamedTuple


class Flaw(NamedTuple):
    """A defect of one object: a stable slug and a text. `found` and `expected` are the compared values, as text."""

    slug: str
    text: str
    found: str = ""
    expected: str = ""

    def at(self, record: int, offset: int = -1) -> "Finding":
        """This flaw in record number `record`, whose line begins at octet `offset`."""
        return Finding(self.slug, record, self.text, self.found, self.expected, offset)


class Finding(NamedTuple):
    """The flaw that ended a verification; `record` counts from 0 (its line number is one more).

    `offset` is where that line begins, in octets from the beginning of the log; -1 if unknown.
    """

    slug: str
    record: int
    text: str
    found: str = ""
    expected: str = ""
    offset: int = -1


class Claim(NamedTuple):
    """A statement that was proven, or not proven: a stable slug and a sentence for a person."""

    slug: str
    text: str
