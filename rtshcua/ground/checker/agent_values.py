"""Parse the arguments of a mission specification, which are written in the language, with its own parser."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import Quantity, Value
from rtshcua.model.ir.missions import Overrides, Step
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.skills import ClauseDecl

N = TypeVar("N", bound=Node)

#: the source around a value while it is parsed
_VALUE = "mission m under p@1 on v { phase a { s(x = "
_AFTER_VALUE = "\n) } }"
_OVERRIDE = "mission m under p@1 on v { phase a { s() { "
_AFTER_OVERRIDE = "\n} } }"

Moved = Callable[[int], int]
Found = tuple[Diagnostic, ...]


def parse_value(text: str, span: Span, moved: Moved) -> tuple[Value | None, Found]:
    """Return the value of `text`, at `span` of the specification; `moved` maps its offsets to offsets there."""
    given = _Given(_VALUE, text, _AFTER_VALUE, span, moved)
    step, found = given.step()
    if found:
        return None, found
    if step is not None and len(step.arguments) == 1 and step.arguments[0].name is not None and not step.overrides:
        return given.placed(step.arguments[0].value), ()
    return None, (given.more("expected one value: a quantity, a name, coordinates or a choice", "20 m"),)


def parse_quantity(words: str, text: str, span: Span, moved: Moved) -> tuple[Quantity | None, Found]:
    """Return the quantity after the keywords of a step's override: `deadline`, `lasts at most`."""
    given = _Given(f"{_OVERRIDE}{words} ", text, _AFTER_OVERRIDE, span, moved)
    step, found = given.step()
    if found:
        return None, found
    for value in () if step is None else _only(step):
        if isinstance(value, Quantity):
            return given.placed(value), ()
    return None, (given.more("expected one quantity", "2 s"),)


def parse_clauses(words: str, text: str, span: Span, moved: Moved) -> tuple[tuple[ClauseDecl, ...], Found]:
    """Return the clauses of the condition after `require`, `assume` or `maintain`."""
    given = _Given(f"{_OVERRIDE}{words} ", text, _AFTER_OVERRIDE, span, moved)
    step, found = given.step()
    if found:
        return (), found
    for value in () if step is None else _only(step):
        if isinstance(value, tuple) and value and isinstance(value[0], ClauseDecl):
            return tuple(given.placed(clause) for clause in value), ()
    return (), (given.more("expected one condition", "battery > 50 %"),)


def _only(step: Step) -> Iterator[Any]:
    """The only part of a step's overrides; nothing if there are several."""
    overrides = step.overrides
    names = (name for name in Overrides.__struct_fields__ if name != "span")
    parts = [] if overrides is None else [getattr(overrides, name) for name in names if getattr(overrides, name)]
    yield from parts if len(parts) == 1 else ()


class _Given(NamedTuple):
    """A text, the source around it while it is parsed, and its real place."""

    before: str
    text: str
    after: str
    span: Span
    moved: Moved

    def step(self) -> tuple[Step | None, Found]:
        """The parsed step, or the first finding."""
        if "//" in self.text or "/*" in self.text:
            message = "a value contains a comment"
            return None, (Diagnostic(codes.SPECIFICATION_SHAPE, message, self.span, "remove the comment"),)
        parsed = parse(Source(self.span.file, self.before + self.text + self.after))
        found = tuple(self._finding(diagnostic) for diagnostic in parsed.diagnostics)
        if found:
            return None, found[:1]
        missions = parsed.unit.missions
        if len(missions) == 1 and len(missions[0].phases) == 1 and len(missions[0].phases[0].items) == 1:
            item = missions[0].phases[0].items[0]
            return (item if isinstance(item, Step) else None), ()
        return None, ()

    def placed(self, node: N) -> N:
        """A parsed node with its real spans."""
        return _moved(node, self._place)  # type: ignore[no-any-return]

    def more(self, what: str, example: str) -> Diagnostic:
        """The finding on a text with other parts than the expected one."""
        return Diagnostic(codes.SPECIFICATION_SHAPE, what, self.span, f'write one value, such as "{example}"')

    def _place(self, old: Span) -> Span:
        start, end = (min(max(at - len(self.before), 0), len(self.text)) for at in (old.start, old.end))
        return Span(self.span.file, self.moved(start), max(self.moved(end), self.moved(start)))

    def _finding(self, diagnostic: Diagnostic) -> Diagnostic:
        """A finding of the parser with its real spans."""
        labels = tuple(Label(self._place(label.span), label.text) for label in diagnostic.labels)
        fixes = tuple(
            Fix(self._place(fix.span), fix.replacement, fix.title, fix.applicability)
            for fix in diagnostic.fixes
            if len(self.before) <= fix.span.start and fix.span.end <= len(self.before) + len(self.text)
        )
        here = self.span if diagnostic.span is None else self._place(diagnostic.span)
        return replace(diagnostic, span=here, labels=labels, fixes=fixes)


def _moved(node: Any, place: Callable[[Span], Span]) -> Any:
    """A node with all its spans mapped by `place`."""
    if isinstance(node, Node):
        changes = {name: _moved(getattr(node, name), place) for name in type(node).__struct_fields__}
        return node.copied(**changes)
    if isinstance(node, Span):
        return place(node)
    if isinstance(node, tuple) and not hasattr(node, "_fields"):
        return tuple(_moved(each, place) for each in node)
    return node
