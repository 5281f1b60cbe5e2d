"""The base of all IR nodes, and names with the place where they stand."""

from typing import Any, Self, dataclass_transform

import msgspec

from rtshcua.diagnostics.span import Span


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Node(msgspec.Struct, frozen=True, kw_only=True):
    """A frozen piece of what a source says, its parts given by name; `span` is the exact text it came from.

    Types are held by mypy, and by a test over everything that is parsed (`tests/unit/model`); ADR 29 says why not at
    every construction. A node that has a part with a default before one without says `kw_only=True` again.
    """

    span: Span

    def copied(self, **changes: Any) -> Self:
        """The same with some parts changed."""
        return msgspec.structs.replace(self, **changes)


class Name(Node):
    """A name as written: dotted for signals and zone members (`gps.fix`, `bridge_a.entry`)."""

    text: str
