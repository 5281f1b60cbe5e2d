"""Check the arguments of a step or a link against the parameters of its skill."""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.fitting import stored
from rtshcua.ground.checker.name_scope import Argument, Entry, Scope
from rtshcua.ground.checker.substitution import named_at
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import Kind
from rtshcua.ground.checker.values import typed
from rtshcua.model.ir.expression import Coordinates, Reference, Value
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.policies import TemplateDecl
from rtshcua.model.ir.skills import ArgumentValue, SkillDecl
from rtshcua.model.quantity import display


def bind_arguments(
    context: CheckContext, skill: SkillDecl, written: Sequence[ArgumentValue], span: Span
) -> tuple[Bound, ...] | None:
    """Return the value of every parameter of `skill`, with defaults; None after a finding. `span` is the whole call."""
    pairs = pair(context, skill, written, span)
    if pairs is None:
        return None
    known = context.arguments(skill)
    scope = context.scope()
    bound: list[Bound | None] = []
    for parameter in skill.parameters:
        argument = known.get(parameter.name.text)
        value = pairs.get(parameter.name.text, parameter.default)
        if argument is None or value is None:  # reported at the declaration, or as missing
            return None
        bound.append(bind_value(scope, argument, value))
    return None if None in bound else tuple(item for item in bound if item is not None)


def pair(
    context: CheckContext, skill: SkillDecl | TemplateDecl, written: Sequence[ArgumentValue], span: Span
) -> dict[str, Value] | None:
    """Return the written arguments by the name of their parameter; None after a finding."""
    report = context.report
    before = len(report.found)
    pairs: dict[str, ArgumentValue] = {}
    for position, argument in enumerate(written):
        name = _parameter_of(context, skill, written, position)
        first = argument if name is None else pairs.setdefault(name, argument)
        if first is not argument:
            report.add_twice(codes.DUPLICATE_ARGUMENT, argument.span, f"`{name}`", "given", first.span)
    missing = [p for p in skill.parameters if p.name.text not in pairs and p.default is None]
    if missing and len(report.found) == before:
        report.add(
            codes.MISSING_ARGUMENT,
            span,
            f"`{skill.name.text}` lacks {' and '.join(f'`{p.name.text}`' for p in missing)}",
            help="add " + ", ".join(f"`{p.name.text} = ...`" for p in missing),
            labels=[(p.span, f"`{p.name.text}` is declared here, without a default") for p in missing],
        )
    return None if len(report.found) > before else {name: argument.value for name, argument in pairs.items()}


def _parameter_of(
    context: CheckContext, skill: SkillDecl | TemplateDecl, written: Sequence[ArgumentValue], position: int
) -> str | None:
    """The name of the parameter of an argument; None after a finding."""
    report, argument = context.report, written[position]
    names = [parameter.name.text for parameter in skill.parameters]
    declared = [(skill.name.span, f"`{skill.name.text}` is declared here")]
    if argument.name is not None:
        name = argument.name.text
        if name in names:
            return name
        takes = "its parameters are " + ", ".join(f"`{each}`" for each in names) if names else "it takes no arguments"
        report.add(
            codes.UNKNOWN_ARGUMENT,
            argument.name.span,
            f"`{skill.name.text}` has no parameter `{name}`",
            help=suggestion(name, names) or takes,
            fix=correction(report, argument.name.span, name, names),
            labels=declared,
        )
        return None
    named = any(each.name is not None for each in written[:position])
    if not named and position < len(names):
        return names[position]
    report.add(
        codes.TOO_MANY_ARGUMENTS,
        argument.span,
        "a positional argument follows a named one"
        if named
        else f"`{skill.name.text}` takes {_count(len(names))}; this one is too many",
        help=_decimal(context, written, position) or ("write its name" if named else None),
        labels=declared,
    )
    return None


def _decimal(context: CheckContext, written: Sequence[ArgumentValue], position: int) -> str | None:
    """The help for `20,5 m`: a comma between two numbers, without a space."""
    if not position:
        return None
    whole, rest = context.report.text(written[position - 1].value.span), context.report.text(written[position].span)
    touching = written[position - 1].span.end + 1 == written[position].span.start
    if touching and whole.isdigit() and rest[:1].isdigit():
        return f"use a decimal point: write `{whole}.{rest}`"
    return None


def _count(number: int) -> str:
    return {0: "no arguments", 1: "1 argument"}.get(number, f"{number} arguments")


def bind_value(scope: Scope, argument: Argument, value: Value) -> Bound | None:
    """Return the constant value of an argument in its parameter's type and range; None after a finding."""
    name = argument.declaration.name.text
    found = typed(scope, value, argument.type, (argument.declaration.span, f"`{name}` is declared here"))
    if found is None:
        return None
    if argument.type.kind in (Kind.ZONE, Kind.POSITION):
        return _place(scope, value)
    if found.constant is None:
        scope.report.add(
            codes.NOT_CONSTANT,
            value.span,
            f"`{scope.report.text(value.span)}` is not known before the flight",
            help="write a constant, such as a number with its unit",
        )
        return None
    number = stored(scope, value, argument.type, found.constant)
    if number is not None and argument.type.kind is Kind.NUMBER:
        in_range(scope, argument, value, number)
    return number


def _place(scope: Scope, value: Value) -> Bound | None:
    if isinstance(value, Coordinates):
        return value
    found = scope.find(value.name) if isinstance(value, Reference) else None
    if isinstance(found, Entry):
        return found.place
    if isinstance(found, ZoneDecl):
        return found
    scope.report.add(
        codes.NOT_CONSTANT,
        value.span,
        f"`{scope.report.text(value.span)}` is not known before the flight",
        help="write coordinates, or a zone's entry such as `bridge.entry`",
    )
    return None


def _wider(scope: Scope, argument: Argument, value: Value, low: bool) -> str:
    """The help on a size of the skill that would extend the range, if its end is a size."""
    parameter = argument.declaration
    owner = next((each for each in scope.symbols.skills.values() if parameter in each.parameters), None)
    if owner is None or parameter.range is None or value.span.file.endswith(".json"):  # agents cannot set sizes
        return ""
    size = named_at(scope.report, owner, (parameter.range.low if low else parameter.range.high).span)
    written = scope.report.text(value.span)
    return "" if size is None else f"; `sizes {owner.name.text}({size} = {written})` extends the range"


def in_range(scope: Scope, argument: Argument, value: Value, constant: int) -> None:
    """Report a number outside its parameter's range, with the nearest accepted one."""
    low, high = argument.low, argument.high
    if low is None or high is None or low <= constant <= high:
        return
    dimension = argument.type.dimension
    assert dimension is not None
    nearest = display(low if constant < low else high, dimension)
    parameter = argument.declaration
    assert parameter.range is not None
    scope.report.add(
        codes.ARGUMENT_RANGE,
        value.span,
        f"`{display(constant, dimension)}` is outside the range of `{parameter.name.text}`, "
        f"{display(low, dimension)} .. {display(high, dimension)}",
        help=f"the nearest accepted value is `{nearest}`" + _wider(scope, argument, value, constant < low),
        labels=[(parameter.range.span, "the range is declared here")],
        fix=(value.span, nearest, f"write `{nearest}`"),
    )
