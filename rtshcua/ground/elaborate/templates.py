"""Elaborate `use low_flight(bridge_a, top = 20 m)`: the rules of a template with values for its parameters."""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import pair
from rtshcua.ground.checker.checks.parameters import ROLE
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.lookup import find_template
from rtshcua.ground.checker.name_scope import Argument
from rtshcua.ground.checker.substitution import names_in, substitute, substitute_roles
from rtshcua.ground.checker.types import Kind
from rtshcua.ground.elaborate.parameters import bound_value, value_of
from rtshcua.model.ir.expression import Reference, Value
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import RuleDecl, TemplateDecl, Use
from rtshcua.model.ir.skills import ParameterDecl

#: the role in sample rules of an unused template
ANY_ROLE = "operator"


class TemplateBinding(NamedTuple):
    """The values and the roles of a template's parameters."""

    values: dict[str, Value]
    roles: dict[str, str]


def used(context: CheckContext, use: Use) -> tuple[RuleDecl, ...] | None:
    """Return the rules of a `use`; None after a finding."""
    template = find_template(context, use.template)
    given = None if template is None else _bound(context, template, use)
    return None if template is None or given is None else tuple(_rules(template, given, (use,)))


def sample(context: CheckContext, template: TemplateDecl) -> tuple[RuleDecl, ...]:
    """Return the rules of an unused template with sample values, to check its names and types.

    Rules that read a parameter without a sample value are left out.
    """
    given = TemplateBinding({}, {})
    known = context.arguments(template)
    for parameter in template.parameters:
        name = parameter.name.text
        argument = known.get(name)
        if parameter.type.text == ROLE:
            given.roles[name] = ANY_ROLE
        elif argument is not None:
            value = _possible(context, argument)
            if value is not None:
                given.values[name] = value
    without = {parameter.name.text for parameter in template.parameters} - {*given.values, *given.roles}
    expanded = zip(template.rules, _rules(template, given, ()), strict=True)
    return tuple(put for rule, put in expanded if without.isdisjoint(names_in(rule)))


def _possible(context: CheckContext, argument: Argument) -> Value | None:
    """A sample value of a parameter: its default, or a value of its type."""
    parameter = argument.declaration
    if parameter.default is not None:
        return bound_value(context, argument, parameter.default, reporting=False)
    if argument.type.kind is Kind.NUMBER and argument.low is not None:
        return value_of(argument.low, argument, parameter.span)
    zones = sorted(context.symbols.zones.values(), key=lambda zone: zone.entry is None)  # those with an entry first
    return value_of(zones[0], argument, parameter.span) if argument.type.kind is Kind.ZONE and zones else None


def _bound(context: CheckContext, template: TemplateDecl, use: Use) -> TemplateBinding | None:
    pairs = pair(context, template, use.arguments, use.span)
    if pairs is None:
        return None
    given = TemplateBinding({}, {})
    known = context.arguments(template)
    good = True
    for parameter in template.parameters:
        name = parameter.name.text
        argument = known.get(name)
        written = pairs.get(name, parameter.default)
        if written is None:
            return None
        if parameter.type.text == ROLE:
            role = _role(context, parameter, written)
            good = good and role is not None
            given.roles[name] = role or ""
            continue
        if argument is None:  # reported where the parameter is declared
            return None
        value = bound_value(context, argument, written, reporting=name in pairs)
        good = good and value is not None
        if value is not None:
            given.values[name] = value
    return given if good else None


def _role(context: CheckContext, parameter: ParameterDecl, written: Value) -> str | None:
    kind = "not a name"
    if isinstance(written, Reference) and "." not in written.name:
        declared = context.symbols.kind_of(written.name)
        if declared is None:
            return written.name
        kind = declared
    context.report.add(
        codes.WRONG_TYPE,
        written.span,
        f"`{context.report.text(written.span)}` is {kind}; expected a role",
        help="write the name of a role, such as `operator`",
        labels=[(parameter.span, f"`{parameter.name.text}` is declared here")],
    )
    return None


def _rules(template: TemplateDecl, given: TemplateBinding, origin: tuple[Node, ...]) -> Iterator[RuleDecl]:
    for rule in template.rules:
        put = substitute_roles(substitute(rule, given.values), given.roles)
        yield put.copied(origin=origin)
