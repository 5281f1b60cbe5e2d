"""Arguments in a specification: texts in the language's own notation, parsed by the language's own parser."""

from collections.abc import Callable, Sequence
from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import Value
from rtshcua.model.ir.node import Node

#: what a value stands in while it is parsed; a comment in it cannot hide what follows, which is on its own line
_BEFORE = "mission m under p@1 on v { phase a { s(x = "
_AFTER = "\n) } }"

Moved = Callable[[int], int]


def parse_value(text: str, span: Span, moved: Moved) -> tuple[Value | None, tuple[Diagnostic, ...]]:
    """The value that `text` spells; `span` is where it stands, `moved` the offset of each of its characters there."""
    parsed = parse(Source(span.file, _BEFORE + text + _AFTER))
    found = tuple(_placed(diagnostic, span, text, moved) for diagnostic in parsed.diagnostics)
    if found:
        return None, found[:1]
    missions = parsed.unit.missions
    if len(missions) == 1 and len(missions[0].phases) == 1 and len(missions[0].phases[0].steps) == 1:
        arguments = missions[0].phases[0].steps[0].arguments
        if len(arguments) == 1 and arguments[0].name is not None:
            return _moved(arguments[0].value, lambda old: _place(old, span, text, moved)), ()
    message = "a value is a quantity, a name, a place or a choice, and nothing more"
    return None, (Diagnostic(codes.SPECIFICATION_SHAPE, message, span, 'write one value, such as "20 m"'),)


def _place(old: Span, span: Span, text: str, moved: Moved) -> Span:
    """A span of the parsed text as one of the specification, within the value."""
    start, end = (min(max(offset - len(_BEFORE), 0), len(text)) for offset in (old.start, old.end))
    return Span(span.file, moved(start), max(moved(end), moved(start)))


def _moved(node: Any, place: Callable[[Span], Span]) -> Any:
    """A node with other spans, all through."""
    if isinstance(node, Node):
        changes = {name: _moved(getattr(node, name), place) for name in type(node).model_fields}
        return node.model_copy(update=changes)
    if isinstance(node, Span):
        return place(node)
    if isinstance(node, tuple) and not hasattr(node, "_fields"):
        return tuple(_moved(each, place) for each in node)
    return node


def _placed(diagnostic: Diagnostic, span: Span, text: str, moved: Moved) -> Diagnostic:
    """A finding of the parser, with the places that lie in the value."""

    def at(old: Span) -> Span:
        return _place(old, span, text, moved)

    labels: Sequence[Label] = [Label(at(label.span), label.text) for label in diagnostic.labels]
    fixes: Sequence[Fix] = [
        Fix(at(fix.span), fix.replacement, fix.title, fix.applicability)
        for fix in diagnostic.fixes
        if len(_BEFORE) <= fix.span.start and fix.span.end <= len(_BEFORE) + len(text)
    ]
    here = span if diagnostic.span is None else at(diagnostic.span)
    return Diagnostic(
        diagnostic.code, diagnostic.message, here, diagnostic.help, tuple(labels), tuple(fixes), diagnostic.pointer
    )
