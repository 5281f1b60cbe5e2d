"""The base of all IR nodes, and names with the place where they stand."""

from pydantic import BaseModel, ConfigDict, InstanceOf

from rtshcua.diagnostics.span import Span


class Node(BaseModel):
    """A frozen piece of what a source says; `span` is the exact text it came from."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", arbitrary_types_allowed=True)

    span: InstanceOf[Span]


class Name(Node):
    """A name as written: dotted for signals and zone members (`gps.fix`, `bridge_a.entry`)."""

    text: str
