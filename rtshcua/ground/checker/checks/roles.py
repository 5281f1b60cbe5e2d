"""Check that the roles of rules are declared: a rule with a misspelt role would have no effect.

The role of a mission, of a test's requester and of a fault must be one of the policy: the lowering checks it.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.checks.parameters import ROLE
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import RuleDecl, Use

#: the role that needs no declaration
OPERATOR = "operator"


def check_roles(context: CheckContext) -> None:
    """Report every role that is declared twice in a file, and every undeclared role of a rule."""
    for first, again in context.symbols.roles_again:
        context.report.add_twice(codes.DUPLICATE_NAME, again.span, f"the role `{again.text}`", "declared", first.span)
    for policy in context.symbols.policies.values():
        for rule in policy.rules:
            if not rule.origin:  # what a template or a delegation brought about names what these were given
                _rule(context, rule, frozenset())
        for delegation in policy.delegations:
            for name in (delegation.grantor, delegation.grantee):
                _role(context, name)
        for use in policy.uses:
            for name in _given(context, use):
                _role(context, name)
    for template in context.symbols.templates.values():
        own = frozenset(each.name.text for each in template.parameters if each.type.text == ROLE)
        for rule in template.rules:
            _rule(context, rule, own)


def _rule(context: CheckContext, rule: RuleDecl, own: frozenset[str]) -> None:
    """The roles of a rule, without the `own` parameters of its template."""
    for name in (*rule.roles, rule.approver, rule.another):
        if name is not None and name.text not in own:
            _role(context, name)


def _given(context: CheckContext, use: Use) -> Iterator[Name]:
    """The role arguments of a template."""
    template = context.symbols.templates.get(use.template.text)
    if template is None:
        return
    parameters = {each.name.text: each for each in template.parameters}
    for place, argument in enumerate(use.arguments):
        if argument.name is not None:
            parameter = parameters.get(argument.name.text)
        else:
            parameter = template.parameters[place] if place < len(template.parameters) else None
        value = argument.value
        if parameter is None or parameter.type.text != ROLE or not isinstance(value, Reference):
            continue
        if value.name not in context.symbols.declared:  # another kind of declaration is reported elsewhere
            yield Name(span=value.span, text=value.name)


def _role(context: CheckContext, name: Name) -> None:
    known = {OPERATOR, *context.symbols.roles}
    if name.text in known:
        return
    context.report.add(
        codes.UNKNOWN_ROLE,
        name.span,
        f"the role `{name.text}` is not declared",
        help=suggestion(name.text, known)
        or f"declare it with `role {name.text}`, in this file or in one that it imports",
        fix=correction(context.report, name.span, name.text, known),
    )
