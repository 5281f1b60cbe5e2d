"""What all parts of the builder share: findings, and the parts of a declaration that may stand in any order."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX, TOO_DEEP, WRITTEN_TWICE, Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.tests import Quoted

MAX_DEPTH = 64  # of what stands within its like; far above what a person writes, far below what Python can walk

MAX_FINDINGS = 1000  # in one file; a text that has more is not one of ours

T = TypeVar("T", bound=Node)


class Enough(Exception):
    """So much was found that reading on helps nobody; `parse` catches it."""


class Part(NamedTuple):
    """One part of a declaration's body, as `deadline 2 s`: what it is called, where it stands, what it says."""

    key: str
    span: Span
    value: Any


class Base:
    """Findings and declarations of one file. A declaration in which something was found is not kept, only its name."""

    def __init__(self, source: Source) -> None:
        self._source = source
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
                f"the name of a {what} has no dot: `{shown}`",
                name.span,
                "only a signal's name may have dots",
                fixes=(Fix(name.span, plain, f"call it `{short(plain)}`"),),
            )

    def nested(self, node: Node, *inner: Node, help: str = "split it into several clauses, joined by `and`") -> Node:
        """`node`, counting how deeply such are nested; one level too many is reported once, and not built."""
        depth = 1 + max((self._depths.get(part.span, 0) for part in inner), default=0)
        if depth == MAX_DEPTH + 1:
            self.report(TOO_DEEP, f"this is nested more than {MAX_DEPTH} deep", node.span, help)
        if depth > MAX_DEPTH:
            node = inner[0]
        self._depths[node.span] = depth
        return node

    def parts(
        self, owner: str, name: Name | Quoted, given: Sequence[Part], required: Sequence[str] = ()
    ) -> dict[str, Part]:
        """The parts by their key: each at most once, the required ones present."""
        found: dict[str, Part] = {}
        for part in given:
            first = found.setdefault(part.key, part)
            if first is not part:
                self.report(
                    WRITTEN_TWICE,
                    f"`{part.key}` is written twice in {owner} `{short(name.text)}`",
                    part.span,
                    "keep one of them",
                    labels=(Label(first.span, "first written here"),),
                )
        missing = [key for key in required if key not in found]
        if missing and self.sound:
            lacks = ", ".join(f"`{key}`" for key in missing)
            self.report(
                NOT_WRITTEN, f"{owner} `{short(name.text)}` does not say its {lacks}", name.span, f"add {lacks}"
            )
        return found
