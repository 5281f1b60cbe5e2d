"""Check parameters and sizes of skills: their type, range and default fit together."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.context import CheckContext, Parametric
from rtshcua.ground.checker.fields import size
from rtshcua.ground.checker.fitting import declaration_labels
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.ground.checker.name_scope import Argument, Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import EXAMPLES, NAMED, Kind
from rtshcua.ground.checker.values import whole_range
from rtshcua.model.ir.expression import Quantity, Range, Reference
from rtshcua.model.ir.policies import TemplateDecl
from rtshcua.model.ir.skills import GivenSize, ParameterDecl, SizesDecl, SkillDecl

#: the type of a template's role parameters
ROLE = "role"


def check_parameters(context: CheckContext) -> None:
    """Report every parameter whose arguments cannot be checked before the flight."""
    symbols = context.symbols
    owners: list[Parametric] = [*symbols.skills.values(), *symbols.templates.values(), *symbols.missions.values()]
    for owner in owners:
        known = context.arguments(owner)
        scope = context.scope()
        for parameter in owner.parameters:
            argument = known.get(parameter.name.text)
            if isinstance(owner, TemplateDecl) and _of_template(context, parameter):
                continue
            if argument is None:
                context.report.add(
                    codes.BAD_PARAMETER,
                    parameter.type.span,
                    f"a parameter cannot have the type `{parameter.type.text}`",
                    help=suggestion(parameter.type.text, NAMED) or "the types of parameters are " + _types(type(owner)),
                    fix=correction(context.report, parameter.type.span, parameter.type.text, NAMED),
                )
                continue
            if argument.declaration is not parameter:
                continue  # a second one of the same name: reported as such
            numeric = argument.type.kind is Kind.NUMBER
            if numeric != (parameter.range is not None):
                no_range(context, parameter)
            elif parameter.range is not None:
                check_range(context, argument, parameter.range)
            if parameter.default is not None:
                bind_value(scope, argument, parameter.default)


def check_range(context: CheckContext, argument: Argument, range: Range) -> None:
    """Report ends of a parameter's range that are not numbers of its type, or too large."""
    scope, before = context.scope(), len(context.report.found)
    ends = whole_range(scope, range, argument.type)
    if ends is None and len(context.report.found) == before:
        _unknown_end(scope, range)
    elif ends is not None and argument.type.dimension is not None:
        for end, number in zip((range.low, range.high), ends, strict=True):
            size(context, end, argument.type.dimension, number)


def _unknown_end(scope: Scope, range: Range) -> None:
    """Report ends of a range that are signals or arguments."""
    for end in (range.low, range.high):
        if any(isinstance(part, Reference) for part in walk(end)):
            scope.report.add(
                codes.NOT_CONSTANT,
                end.span,
                f"`{scope.report.text(end.span)}` is not known before the flight, as the end of a range must be",
                help="write both ends as numbers with their units; put other limits in a `require` clause or a rule",
                labels=declaration_labels(scope, end),
            )


def _types(owner: type[Parametric]) -> str:
    """The allowed types of a declaration's parameters."""
    if owner is TemplateDecl:
        return ", ".join(f"`{name}`" for name in (*NAMED, ROLE) if name != Kind.POSITION.value)
    return ", ".join(f"`{name}`" for name in NAMED) + " and `one of ...`"


def _of_template(context: CheckContext, parameter: ParameterDecl) -> bool:
    """Whether the check of a template's parameter is complete: it is a role, or its type was reported."""
    if parameter.type.text == ROLE and not parameter.choices:
        if parameter.range is not None:
            no_range(context, parameter)
        return True
    if parameter.choices or parameter.type.text == Kind.POSITION.value:
        context.report.add(
            codes.BAD_PARAMETER,
            parameter.type.span,
            f"a parameter of a template cannot be {'a choice' if parameter.choices else 'a position'}",
            help="the types of its parameters are " + _types(TemplateDecl),
        )
        return True
    return False


def no_range(context: CheckContext, parameter: ParameterDecl) -> None:
    """Report a number without a range, and a range of anything else."""
    name = parameter.name.text
    type = NAMED.get(parameter.type.text)
    if parameter.range is None and type is not None and type.dimension is not None:
        example = EXAMPLES[type.dimension]
        context.report.add(
            codes.BAD_PARAMETER,
            parameter.span,
            f"the parameter `{name}` has no range",
            help=f"add the accepted values, such as `in 0 {example.partition(' ')[2]} .. {example}`".replace(
                "0  ..", "0 .."
            ),
        )
    elif parameter.range is not None:
        context.report.add(
            codes.BAD_PARAMETER,
            parameter.range.span,
            f"`{name}` is not a number and cannot have a range",
            help="remove the range",
        )


def check_sizes(context: CheckContext) -> None:
    """Report every invalid size."""
    for skill in context.symbols.skills.values():
        for each in skill.sizes:
            _declared(context, each)
        _named(context, skill)
    for declaration in context.symbols.sizes.values():
        _given(context, declaration)
    for first, again in context.symbols.sizes_again:
        nearer, other = (again, first) if first.span.file == again.span.file else (first, again)
        context.report.add(
            codes.DUPLICATE_NAME,
            nearer.skill.span,
            f"the sizes of `{nearer.skill.text}` are given twice",
            help="keep one of them: a skill has one contract in a program",
            labels=[(other.skill.span, "also given here")],
        )


def _declared(context: CheckContext, size: ParameterDecl) -> None:
    name, default = size.name.text, size.default
    argument = _argument(context, size)
    if argument is None:
        numbers = [each for each, type in NAMED.items() if type.kind is Kind.NUMBER]
        context.report.add(
            codes.BAD_PARAMETER,
            size.type.span if not size.choices else size.span,
            f"the size `{name}` is not a number",
            help="the types of sizes are " + ", ".join(f"`{each}`" for each in numbers),
        )
    elif size.range is None:
        no_range(context, size)
    elif not isinstance(default, Quantity):
        context.report.add(
            codes.BAD_PARAMETER,
            size.span if default is None else default.span,
            f"the size `{name}` has no default"
            if default is None
            else f"the default of the size `{name}` is not a number",
            help="write a default with its unit, such as `= 60 m`; a program may change it",
        )
    else:
        check_range(context, argument, size.range)
        bind_value(context.scope(), argument, default)


def _argument(context: CheckContext, size: ParameterDecl) -> Argument | None:
    """A size as an argument; None if it is not a number."""
    type = None if size.choices else NAMED.get(size.type.text)
    if type is None or type.kind is not Kind.NUMBER:
        return None
    unheard = Scope(context.symbols, Report(context.report.sources))
    low, high = (None if size.range is None else whole_range(unheard, size.range, type)) or (None, None)
    return Argument(size, type, low, high)


def _named(context: CheckContext, skill: SkillDecl) -> None:
    """Report each part of a contract that names an unknown size."""
    for each in skill.sized:
        unknown_size(context, skill, each.size)


def unknown_size(context: CheckContext, skill: SkillDecl, size: Reference) -> None:
    """Report a name that is not a size of the skill; findings on a known size are reported at its declaration."""
    known = [each.name.text for each in skill.sizes]
    if size.name not in known:
        context.report.add(
            codes.UNKNOWN_NAME,
            size.span,
            f"`{size.name}` is not a size of `{skill.name.text}`",
            help=suggestion(size.name, known) or "write a number with its unit, or declare it: `sizes (... = ...)`",
            fix=correction(context.report, size.span, size.name, known),
        )


def _given(context: CheckContext, declaration: SizesDecl) -> None:
    skill = find_skill(context, declaration.skill)
    if skill is None:
        return
    known = {size.name.text: size for size in reversed(skill.sizes)}
    takes = "its sizes are " + ", ".join(f"`{size.name.text}`" for size in skill.sizes) if known else "it has none"
    seen: dict[str, GivenSize] = {}
    for each in declaration.given:
        name = each.name.text
        first = seen.setdefault(name, each)
        if name not in known:
            context.report.add(
                codes.UNKNOWN_ARGUMENT,
                each.name.span,
                f"`{skill.name.text}` has no size `{name}`",
                help=suggestion(name, known) or takes,
                fix=correction(context.report, each.name.span, name, known),
                labels=[(skill.name.span, f"`{skill.name.text}` is declared here")],
            )
        elif first is not each:
            context.report.add_twice(codes.DUPLICATE_ARGUMENT, each.name.span, f"`{name}`", "given", first.name.span)
        else:
            argument = _argument(context, known[name])
            if argument is not None:
                bind_value(context.scope(), argument, each.value)
