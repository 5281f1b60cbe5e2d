"""The reader of one text: its source, what was declared and found in it so far, and how a rule's parts are made values.

The parser calls an action for each rule of the grammar, with the reader, the rule's span and its parts (`actions`).
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

MAX_DEPTH = 64  # of what stands within its like; far above what a person writes, far below what Python can walk

MAX_FINDINGS = 1000  # in one file; a text that has more is not one of ours

T = TypeVar("T", bound=Node)

#: makes the value of a rule, of the reader, the rule's span and the values of its parts
Action = Callable[..., object]


class Enough(Exception):
    """So much was found that reading on helps nobody; `parse` catches it."""


class Part(NamedTuple):
    """One part of a declaration's body, as `deadline 2 s`: what it is called, where it stands, what it says."""

    key: str
    span: Span
    value: Any


class Reader:
    """Findings and declarations of one text. A declaration in which something was found is not kept, only its name."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.diagnostics: list[Diagnostic] = []
        self.declarations: list[Node] = []
        self.broken: set[str] = set()
        self.whole = True  # whether every import was understood
        self._settled = 0  # how many findings there were when the last declaration ended
        self._depths: dict[Span, int] = {}  # how deep what stands there is nested

    def report(
        self,
        code: Code,
        message: str,
        span: Span,
        help: str | None = None,
        labels: tuple[Label, ...] = (),
        fixes: tuple[Fix, ...] = (),
    ) -> None:
        """Notes a finding."""
        self.note(Diagnostic(code, message, span, help, labels, fixes))

    def note(self, diagnostic: Diagnostic) -> None:
        """Notes a finding; raises Enough instead of one too many."""
        if len(self.diagnostics) == MAX_FINDINGS:
            raise Enough
        self.diagnostics.append(diagnostic)

    def declare(self, node: T, name: Name | None = None) -> None:
        """Keeps a declaration, unless something was found in it."""
        if len(self.diagnostics) == self._settled:
            self.declarations.append(node)
        elif name is not None:
            self.broken.add(name.text)
        self.settle()

    def abandon(self, name: Name) -> None:
        """Drops a declaration in which something was found, and remembers its name."""
        self.broken.add(name.text)
        self.settle()

    def settle(self) -> None:
        """The declaration is over, kept or not: what is found from now on belongs to the next."""
        self._settled = len(self.diagnostics)
        self._depths.clear()

    @property
    def sound(self) -> bool:
        """Whether nothing was found in the current declaration so far."""
        return len(self.diagnostics) == self._settled

    def undotted(self, name: Name, what: str) -> None:
        """Only signals have dotted names; a dot elsewhere asks for a member, such as a zone's entry."""
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
        """`node`, counting how deeply such are nested; one level too many is reported once, and not built."""
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
        """What the parts hold, by their key: each is given at most once, and the required ones are there. Those of the
        keys `listed` may be given several times; there is a list of what they hold, which may be empty.
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
    """The action that makes a node of a rule whose parts are, in order, these fields of it.

    A field of a part that was not written has the value in `constants`, or else its default or None, as has a field
    that the rule has no part for.
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
    """As `node`, of a node that counts as a level above those of its fields that are nodes."""
    make = node(kind, *fields, **constants)

    def make_nesting(reader: Reader, span: Span, *values: object) -> object:
        made: Any = make(reader, span, *values)
        return reader.nested(made, *[value for value in values if isinstance(value, Node)])

    return make_nesting


def part(key: str, value: Action | None = None) -> Action:
    """The action that makes a part of a declaration: of what it holds, or of what `value` makes of that."""

    def make(reader: Reader, span: Span, held: object) -> Part:
        return Part(key, span, held)

    def make_of(reader: Reader, span: Span, *held: object) -> Part:
        return Part(key, span, value(reader, span, *held) if value else held)

    return make_of if value else make


def several(reader: Reader, span: Span, *values: T) -> tuple[T, ...]:
    """A list of any length."""
    return values
