"""E0201, E0601, E0602, E0605, E0607: sizes of skills are numbers with a default, and given within their ranges."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.checks.parameters import check_range, no_range
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import NAMED, Kind
from rtshcua.ground.checker.values import whole_range
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.skills import GivenSize, Parameter, SizesDecl, SkillDecl


def check_sizes(context: Context) -> None:
    """Report every size that no contract could be checked with."""
    for skill in context.symbols.skills.values():
        for size in skill.sizes:
            _declared(context, size)
        _named(context, skill)
    for declaration in context.symbols.sizes.values():
        _given(context, declaration)
    for first, again in context.symbols.sizes_again:
        nearer, other = (again, first) if first.span.file == again.span.file else (first, again)
        context.report.add(
            codes.DUPLICATE_NAME,
            nearer.skill.span,
            f"the sizes of `{nearer.skill.text}` are given twice",
            help="give them once: a skill has one contract in a program",
            labels=[(other.skill.span, "also given here")],
        )


def _declared(context: Context, size: Parameter) -> None:
    name, default = size.name.text, size.default
    argument = _argument(context, size)
    if argument is None:
        numbers = [each for each, type in NAMED.items() if type.kind is Kind.NUMBER]
        context.report.add(
            codes.BAD_PARAMETER,
            size.type.span if not size.choices else size.span,
            f"the size `{name}` is no number",
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
            else f"the default of the size `{name}` is no number",
            help="write the number with its unit that counts where no program gives another, such as `= 60 m`",
        )
    else:
        check_range(context, argument, size.range)
        bind_value(context.scope(), argument, default)


def _argument(context: Context, size: Parameter) -> Argument | None:
    """A size as an argument is seen; None where it is no number."""
    type = None if size.choices else NAMED.get(size.type.text)
    if type is None or type.kind is not Kind.NUMBER:
        return None
    unheard = Scope(context.symbols, Report(context.report.sources))
    low, high = (None if size.range is None else whole_range(unheard, size.range, type)) or (None, None)
    return Argument(size, type, low, high)


def _named(context: Context, skill: SkillDecl) -> None:
    """Report each part of a contract that names what is no size of it."""
    known = [size.name.text for size in skill.sizes]
    for each in skill.sized:
        name, span = each.size.name, each.size.span
        if name not in known:  # else what is wrong with that size is reported where it is declared
            context.report.add(
                codes.UNKNOWN_NAME,
                span,
                f"`{name}` is no size of `{skill.name.text}`",
                help=suggestion(name, known) or "write a number with its unit, or declare it: `sizes (... = ...)`",
                fix=correction(context.report, span, name, known),
            )


def _given(context: Context, declaration: SizesDecl) -> None:
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
            context.report.add(
                codes.DUPLICATE_ARGUMENT,
                each.name.span,
                f"`{name}` is given twice",
                labels=[(first.name.span, "first given here")],
            )
        else:
            argument = _argument(context, known[name])
            if argument is not None:
                bind_value(context.scope(), argument, each.value)
