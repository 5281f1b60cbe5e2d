"""E0607, E0605: a parameter's type, range and default belong together."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import size
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import EXAMPLES, NAMED, Kind
from rtshcua.ground.checker.values import typed_range
from rtshcua.model.ir.skills import Parameter


def check(context: Context) -> None:
    """Report every parameter whose arguments could not be checked before the flight."""
    for skill in context.symbols.skills.values():
        known = context.arguments(skill)
        scope = context.scope()
        for parameter in skill.parameters:
            argument = known.get(parameter.name.text)
            if argument is None:
                context.report.add(
                    codes.BAD_PARAMETER,
                    parameter.type.span,
                    f"no parameter can be of the type `{parameter.type.text}`",
                    help=suggestion(parameter.type.text, NAMED)
                    or "the types of parameters are " + ", ".join(f"`{name}`" for name in NAMED) + " and `one of ...`",
                )
                continue
            if argument.declaration is not parameter:
                continue  # a second one of the same name: reported as such
            numeric = argument.type.kind is Kind.NUMBER
            if numeric != (parameter.range is not None):
                _range(context, parameter)
            elif parameter.range is not None:
                ends = typed_range(scope, parameter.range, argument.type)
                if ends is not None and None in (ends[0].constant, ends[1].constant):
                    context.report.add(
                        codes.BAD_PARAMETER,
                        parameter.range.span,
                        "both ends of a parameter's range are written out",
                        help="write numbers with their units",
                    )
                elif ends is not None and argument.type.dimension is not None:
                    for end, (_, constant) in zip((parameter.range.low, parameter.range.high), ends, strict=True):
                        size(context, end, argument.type.dimension, constant or 0)
            if parameter.default is not None:
                bind_value(scope, argument, parameter.default)


def _range(context: Context, parameter: Parameter) -> None:
    name = parameter.name.text
    type = NAMED.get(parameter.type.text)
    if parameter.range is None and type is not None and type.dimension is not None:
        example = EXAMPLES[type.dimension]
        context.report.add(
            codes.BAD_PARAMETER,
            parameter.span,
            f"the parameter `{name}` has no range",
            help=f"say which values are accepted, such as `in 0 {example.partition(' ')[2]} .. {example}`".replace(
                "0  ..", "0 .."
            ),
        )
    elif parameter.range is not None:
        context.report.add(
            codes.BAD_PARAMETER, parameter.range.span, f"`{name}` is no number, so it has no range", help="leave it out"
        )
