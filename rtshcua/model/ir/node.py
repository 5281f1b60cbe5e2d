"""The base of all IR nodes, and names with their source position."""

from typing import Any, Self, dataclass_transform

import msgspec

from rtshcua.diagnostics.span import Span


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Node(msgspec.Struct, frozen=True, kw_only=True):
    """A frozen node of a source, whose parts are keyword arguments; `span` is the exact text that it came from.

    mypy checks the types, and so does a test over everything that is parsed (`tests/unit/model`); ADR 29 explains
    why a constructor does not. A node that has a part with a default before one without repeats `kw_only=True`.
    """

    span: Span

    def copied(self, **changes: Any) -> Self:
        """A copy with some parts changed."""
        return msgspec.structs.replace(self, **changes)


class Name(Node):
    """A name as written: dotted for signals and zone members (`gps.fix`, `bridge_a.entry`)."""

    text: str
