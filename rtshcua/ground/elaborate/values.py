"""What a parameter is bound to, as a value that may stand in the place of its name."""

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.context import Bound, Context
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.types import Kind
from rtshcua.model.ir.expression import Coordinates, Quantity, Reference, Value
from rtshcua.model.ir.places import ZoneDecl


def value_of(bound: Bound, argument: Argument, span: Span) -> Value:
    """The value of a parameter that is bound to an integer, a zone or a place."""
    if isinstance(bound, ZoneDecl):
        return Reference(span=span, name=bound.name.text)
    if isinstance(bound, Coordinates):
        return bound.copied(span=span)
    if argument.type.kind is Kind.ENUMERATION:
        return Reference(span=span, name=argument.declaration.choices[bound].text)
    assert argument.type.dimension is not None
    return Quantity(span=span, value=bound, dimension=argument.type.dimension, datum=argument.type.datum)


def bound_value(context: Context, argument: Argument, written: Value, *, heard: bool = True) -> Value | None:
    """The one value that a written one comes to; None after a finding. A default is heard where it is declared."""
    report = context.report if heard else Report(context.report.sources)
    before = len(report.found)
    bound = bind_value(Scope(context.symbols, report), argument, written)
    if bound is None or len(report.found) > before:
        return None
    return value_of(bound, argument, written.span)
