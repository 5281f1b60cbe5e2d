"""The subject of a chapter: a policy with its program, and helpers for names, places and comments."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.symbols import Symbols, collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.language.paths import from_here, pack_of
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.pipeline.closure import beside
from rtshcua.ground.report.prose.phrases import Vocabulary
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import RuleDecl


@dataclass(frozen=True)
class ReportedPolicy:
    """A program, and one of its policies in signed form."""

    program: Program
    lowered: LoweredPolicy

    @property
    def policy(self) -> Policy:
        """The flat policy."""
        return self.lowered.policy

    @cached_property
    def symbols(self) -> Symbols:
        """The declarations of the sources."""
        return collect(self.program.units, self.program.broken)

    @cached_property
    def names(self) -> Vocabulary:
        """The vocabulary of the program."""
        return Vocabulary(frozenset(self.symbols.signals), frozenset(self.symbols.zones))

    @cached_property
    def rules(self) -> tuple[RuleDecl, ...]:
        """The rules in signed order. A rule over skills with arguments in different cells is signed as several rules,
        each with its own skills.
        """
        names = [contract.name for contract in self.policy.contracts]
        own = zip(self.policy.rules, self.lowered.rules, strict=True)
        return tuple(
            rule.copied(skills=tuple(each for each in rule.skills if each.text in {names[at] for at in flat.skills}))
            for flat, rule in own
        )

    def place(self, span: Span) -> str:
        """The file and line of a span, with the file name of `file_of`."""
        return place_of(self.program, span)

    @property
    def files(self) -> tuple[str, ...]:
        """The source files of the policy in signed order, with the names of `file_of`.

        The signed names are relative to the policy's own file (`pipeline/closure.py`).
        """
        stable, own = self.program.stable, self.lowered.declaration.name.span.file
        seen = {beside(name, stable.get(own, own)): file for file, name in stable.items()}
        return tuple(file_of(self.program, seen[name]) if name in seen else name for name in self.policy.sources)

    def note(self, node: Node) -> str:
        """The line comments directly above a declaration or a rule; empty if there are none."""
        return note_above(self.program.sources, node.span)


def file_of(program: Program, file: str) -> str:
    """The displayed name of a file: its name in its pack (`lib:skills/goto.rts`), or else its path relative to the
    working directory.
    """
    stable = program.stable.get(file, file)
    return stable if pack_of(stable) is not None else from_here(file)


def place_of(program: Program, span: Span) -> str:
    """The file and line of a span, with the file name of `file_of`."""
    source, name = program.sources.get(span.file), file_of(program, span.file)
    return name if source is None else f"{name}:{source.position(span.start).line}"


def note_above(sources: Mapping[str, Source], span: Span) -> str:
    """The line comments directly above a span, as one paragraph."""
    source = sources.get(span.file)
    if source is None:
        return ""
    number = source.position(span.start).line - 1
    lines: list[str] = []
    while number > 0 and (line := source.line(number).strip()).startswith("//"):
        lines.append(line.lstrip("/").strip())
        number -= 1
    return " ".join(reversed(lines))


def within(node: Any) -> Iterator[Node]:
    """Yield a node and all nodes below it."""
    if isinstance(node, Node):
        yield node
        for field in type(node).__struct_fields__:
            yield from within(getattr(node, field))
    elif type(node) is tuple:
        for part in node:
            yield from within(part)
