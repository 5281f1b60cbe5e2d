"""A policy to report on, with its program, and what the parts of its chapter ask of both."""

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
    """A program, and one of its policies in the form that is signed."""

    program: Program
    lowered: LoweredPolicy

    @property
    def policy(self) -> Policy:
        """The flat policy."""
        return self.lowered.policy

    @cached_property
    def symbols(self) -> Symbols:
        """The declarations as they are written."""
        return collect(self.program.units, self.program.broken)

    @cached_property
    def names(self) -> Vocabulary:
        """What names stand for."""
        return Vocabulary(frozenset(self.symbols.signals), frozenset(self.symbols.zones))

    @cached_property
    def rules(self) -> tuple[RuleDecl, ...]:
        """The rules by the numbers that they are signed by. One that is written over skills which keep its arguments in
        different places is signed as several, each about its own skills alone.
        """
        names = [contract.name for contract in self.policy.contracts]
        own = zip(self.policy.rules, self.lowered.rules, strict=True)
        return tuple(
            rule.copied(skills=tuple(each for each in rule.skills if each.text in {names[at] for at in flat.skills}))
            for flat, rule in own
        )

    def place(self, span: Span) -> str:
        """File and line, the file as `file_of` calls it."""
        return place_of(self.program, span)

    @property
    def files(self) -> tuple[str, ...]:
        """The files that the policy rests on, in the order in which they are signed, as `file_of` calls them.

        They are signed by names as seen from the policy's own file (`lower/closure.py`).
        """
        stable, own = self.program.stable, self.lowered.declaration.name.span.file
        seen = {beside(name, stable.get(own, own)): file for file, name in stable.items()}
        return tuple(file_of(self.program, seen[name]) if name in seen else name for name in self.policy.sources)

    def note(self, node: Node) -> str:
        """The comment of whole lines right above a declaration or a rule; empty where there is none."""
        return note_above(self.program.sources, node.span)


def file_of(program: Program, file: str) -> str:
    """A file of a program for whoever reads the page: by its name in its pack (`lib:skills/goto.rts`), else relative to
    the folder that the command ran in.
    """
    stable = program.stable.get(file, file)
    return stable if pack_of(stable) is not None else from_here(file)


def place_of(program: Program, span: Span) -> str:
    """File and line, the file as `file_of` calls it."""
    source, name = program.sources.get(span.file), file_of(program, span.file)
    return name if source is None else f"{name}:{source.position(span.start).line}"


def note_above(sources: Mapping[str, Source], span: Span) -> str:
    """The lines of `//` right above a place, in one paragraph."""
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
    """A node and all nodes in it."""
    if isinstance(node, Node):
        yield node
        for field in type(node).__struct_fields__:
            yield from within(getattr(node, field))
    elif type(node) is tuple:
        for part in node:
            yield from within(part)
