"""The reader of one text: its source, its declarations and findings so far, and the makers of actions.

The parser calls an action for each rule of the grammar with the reader, the rule's span and its parts (`actions`).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

from msgspec import NODEFAULT

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX, TOO_DEEP, WRITTEN_TWICE, Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Source, Span
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.tests import Quoted

MAX_DEPTH = 64  # nesting levels: far above what people write, far below the recursion limit of Python

MAX_FINDINGS = 1000  # in one file

T = TypeVar("T", bound=Node)

#: makes the value of a rule from the reader, the rule's span and the values of its parts
Action = Callable[..., object]


class Enough(Exception):
    """Raised at the limit of findings; `parse` catches it."""


class Part(NamedTuple):
    """One part of a declaration's body, such as `deadline 2 s`: its key, span and value."""

    key: str
    span: Span
    value: Any


class Reader:
    """Findings and declarations of one text. Of a declaration with findings only the name is kept."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.diagnostics: list[Diagnostic] = []
        self.declarations: list[Node] = []
        self.broken: set[str] = set()
        self.whole = True  # whether all imports were parsed
        self._settled = 0  # the number of findings at the end of the last declaration
        self._depths: dict[Span, int] = {}  # nesting depths of the nodes of the current declaration

    def report(
        self,
        code: Code,
        message: str,
        span: Span,
        help: str | None = None,
        labels: tuple[Label, ...] = (),
        fixes: tuple[Fix, ...] = (),
    ) -> None:
        """Add a finding."""
        self.note(Diagnostic(code, message, span, help, labels, fixes))

    def note(self, diagnostic: Diagnostic) -> None:
        """Add a finding; raises Enough at the limit."""
        if len(self.diagnostics) == MAX_FINDINGS:
            raise Enough
        self.diagnostics.append(diagnostic)

    def declare(self, node: T, name: Name | None = None) -> None:
        """Keep a declaration, unless it has findings."""
        if len(self.diagnostics) == self._settled:
            self.declarations.append(node)
        elif name is not None:
            self.broken.add(name.text)
        self.settle()

    def abandon(self, name: Name) -> None:
        """Drop a declaration with findings, and keep its name."""
        self.broken.add(name.text)
        self.settle()

    def settle(self) -> None:
        """End the current declaration: later findings belong to the next one."""
        self._settled = len(self.diagnostics)
        self._depths.clear()

    @property
    def sound(self) -> bool:
        """Whether the current declaration has no findings so far."""
        return len(self.diagnostics) == self._settled

    def undotted(self, name: Name, what: str) -> None:
        """Report a dot in a name. Only signals have dotted names; elsewhere a dot refers to a member: `zone.entry`."""
        if "." in name.text:
            plain = name.text.replace(".", "_")
            shown = short(name.text)
            self.report(
                SYNTAX,
                f"the name of a {what} cannot have a dot: `{shown}`",
                name.span,
                "only names of signals may have dots",
                fixes=(Fix(name.span, plain, f"write `{short(plain)}`"),),
            )

    def nested(self, node: Node, *inner: Node, help: str = "split it into several clauses joined by `and`") -> Node:
        """Return `node` and count its nesting level. A node above the limit is reported once and not built."""
        depth = 1 + max((self._depths.get(part.span, 0) for part in inner), default=0)
        if depth == MAX_DEPTH + 1:
            self.report(TOO_DEEP, f"this is nested more than {MAX_DEPTH} levels deep", node.span, help)
        if depth > MAX_DEPTH:
            node = inner[0]
        self._depths[node.span] = depth
        return node

    def parts(
        self,
        owner: str,
        name: Name | Quoted,
        given: Sequence[Part],
        required: Sequence[str] = (),
        listed: Sequence[str] = (),
    ) -> dict[str, Any]:
        """Return the values of the parts by key; report repeated parts and missing `required` ones.

        Keys in `listed` may repeat: each has a list of values, which may be empty.
        """
        first: dict[str, Part] = {}
        found: dict[str, Any] = {key: [] for key in listed}
        for part in given:
            if part.key in listed:
                found[part.key].append(part.value)
            elif part.key in first:
                self.report(
                    WRITTEN_TWICE,
                    f"`{part.key}` is repeated in {owner} `{short(name.text)}`",
                    part.span,
                    "keep one of them",
                    labels=(Label(first[part.key].span, "first written here"),),
                )
            else:
                first[part.key], found[part.key] = part, part.value
        missing = [key for key in required if key not in found]
        if missing and self.sound:
            lacks = ", ".join(f"`{key}`" for key in missing)
            self.report(NOT_WRITTEN, f"{owner} `{short(name.text)}` lacks {lacks}", name.span, f"add {lacks}")
        return found


def node(kind: type[Node], /, *fields: str, **constants: object) -> Action:
    """Return the action that makes a node from a rule whose parts are, in order, these fields.

    A field without a part, or whose part was not written, has the value in `constants`, or else its default or None.
    """
    names, defaults = kind.__struct_fields__, kind.__struct_defaults__  # `structs.fields` resolves types: 4 ms for all
    defaults = (NODEFAULT,) * (len(names) - len(defaults)) + defaults
    required = {name for name, default in zip(names, defaults, strict=True) if default is NODEFAULT} - {"span"}
    missing = dict.fromkeys(required.difference(fields)) | constants
    spanned = ("span", *fields)

    def make(reader: Reader, *values: Any) -> object:
        return kind(**dict(zip(spanned, values, strict=True)))

    def make_partly(reader: Reader, span: Span, *values: object) -> object:
        given = dict(missing)
        for field, value in zip(fields, values, strict=True):
            if value is not None or (field not in given and field in required):
                given[field] = value
        return kind(span=span, **given)

    return make_partly if missing or not required.issuperset(fields) else make


def nesting(kind: type[Node], /, *fields: str, **constants: object) -> Action:
    """Like `node`, for a node that is one nesting level above its fields."""
    make = node(kind, *fields, **constants)

    def make_nesting(reader: Reader, span: Span, *values: object) -> object:
        made: Any = make(reader, span, *values)
        return reader.nested(made, *[value for value in values if isinstance(value, Node)])

    return make_nesting


def part(key: str, value: Action | None = None) -> Action:
    """Return the action that makes a part of a declaration: its value, or the result of `value`."""

    def make(reader: Reader, span: Span, held: object) -> Part:
        return Part(key, span, held)

    def make_of(reader: Reader, span: Span, *held: object) -> Part:
        return Part(key, span, value(reader, span, *held) if value else held)

    return make_of if value else make


def several(reader: Reader, span: Span, *values: T) -> tuple[T, ...]:
    """A list of values."""
    return values
