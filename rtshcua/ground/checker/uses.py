"""Findings inside of a template say where the template is used."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import Symbols
from rtshcua.model.ir.policies import Rule, TemplateDecl, Use

USED = "used here"
DELEGATED = "delegated here"

#: of how many uses a finding tells that is about all of them
MAX_USES = 3


def brought_about(rule: Rule) -> Iterator[tuple[Span, str]]:
    """Labels for the `use` and the delegations through which a rule came to be."""
    for node in rule.origin:
        yield node.span, USED if isinstance(node, Use) else DELEGATED


def with_uses(found: Diagnostic, symbols: Symbols) -> Diagnostic:
    """The finding; inside of a template, and where nothing says so yet, with the places where the template is used."""
    span = found.span
    template = None if span is None else _around(span, symbols.templates.values())
    if template is None or any(label.text == USED for label in found.labels):
        return found
    uses = [use for policy in symbols.policies.values() for use in policy.uses]
    own = [use for use in uses if use.template.text == template.name.text]
    return replace(found, labels=(*found.labels, *(Label(use.span, USED) for use in own[:MAX_USES])))


def _around(span: Span, templates: Iterable[TemplateDecl]) -> TemplateDecl | None:
    for each in templates:
        if span.file == each.span.file and each.span.start <= span.start and span.end <= each.span.end:
            return each
    return None
