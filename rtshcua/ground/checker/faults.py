"""Check the faults of scenarios against the known kinds of faults."""

from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of, size
from rtshcua.ground.checker.fitting import stored
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import COUNT, EXAMPLES, number
from rtshcua.ground.checker.values import typed
from rtshcua.model.faults import (
    KINDS,
    SIGNED,
    WORD_TYPES,
    YES_NO,
    CameraCounter,
    Direction,
    Fault,
    FaultField,
    FlightMode,
    Voice,
    parameters,
)
from rtshcua.model.ir.expression import Reference, Value
from rtshcua.model.ir.scenarios import FaultCall
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.quantity import Dimension, display

#: the kinds of faults by their names in sources
NAMED = {name.replace("-", "_"): kind for name, kind in KINDS.items()}
WHOLE = 10_000  # 100 %
FULL_TURN = 360
#: the most copies of a document
MAX_COPIES = 1_000


def fault_of(context: CheckContext, call: FaultCall) -> Fault | None:
    """Return the fault of a source, at time 0; None after a finding."""
    if not one_of(context, codes.UNKNOWN_FAULT, call.name, NAMED, "fault"):
        return None
    kind = NAMED[call.name.text]
    before = len(context.report.found)
    known = {each.name: each for each in parameters(kind)}
    given = _given(context, call, known)
    values = {known[name].field: _value(context, call, known[name], one.value) for name, one in given.items()}
    missing = [name for name, each in known.items() if each.needed and name not in given]
    if missing and len(context.report.found) == before:
        context.report.add(
            codes.MISSING_ARGUMENT,
            call.span,
            f"`{call.name.text}` lacks {' and '.join(f'`{name}`' for name in missing)}",
            help=f"add {', '.join(f'`{name} = {example(known[name])}`' for name in missing)}",
        )
    return kind(at_us=0, **values) if len(context.report.found) == before else None


def is_fitted(context: CheckContext, call: FaultCall) -> bool:
    """Return whether `camera()` or `camera(fitted = no)` fits the equipment; meaningless after a finding."""
    known = {"fitted": FaultField("fitted", "fitted", None, YES_NO, is_count=False, is_name=False, needed=False)}
    given = _given(context, call, known).get("fitted")
    return given is None or _value(context, call, known["fitted"], given.value) is True


def example(parameter: FaultField) -> str:
    """An example of an accepted value."""
    if parameter.words:
        return parameter.words[0]
    if parameter.is_name:
        return "..."
    dimension = Dimension.COUNT if parameter.unit is None else parameter.unit.dimension or Dimension.COUNT
    return EXAMPLES[dimension]


def _given(context: CheckContext, call: FaultCall, known: dict[str, FaultField]) -> dict[str, ArgumentValue]:
    """The arguments by the name of their parameter; reports all others."""
    report, given = context.report, dict[str, ArgumentValue]()
    takes = f"its arguments are {listed(known)}" if known else "it takes no arguments"
    for argument in call.arguments:
        if argument.name is None:
            only = next(iter(known)) if len(known) == 1 else None
            report.add(
                codes.TOO_MANY_ARGUMENTS,
                argument.span,
                f"an argument of `{call.name.text}` lacks its name",
                help=takes if only is None else f"write `{only} = {report.text(argument.span)}`",
                fix=None
                if only is None
                else (argument.span, f"{only} = {report.raw(argument.span)}", f"add `{only} =`"),
            )
            continue
        name = argument.name.text
        if name not in known:
            report.add(
                codes.UNKNOWN_ARGUMENT,
                argument.name.span,
                f"`{call.name.text}` has no argument `{name}`",
                help=suggestion(name, known) or takes,
                fix=correction(report, argument.name.span, name, known),
            )
            continue
        first = given.setdefault(name, argument)
        if first is not argument:
            report.add_twice(codes.DUPLICATE_ARGUMENT, argument.span, f"`{name}`", "given", first.span)
    return given


def _value(context: CheckContext, call: FaultCall, parameter: FaultField, value: Value) -> Any:
    """The value for the fault's field; meaningless after a finding."""
    if parameter.words:
        return _word(context, call, parameter, value)
    if parameter.is_name:
        return _name(context, parameter, value)
    return _number(context, parameter, value)


def _word(
    context: CheckContext, call: FaultCall, parameter: FaultField, value: Value
) -> FlightMode | Direction | Voice | CameraCounter | bool | None:
    word = value.name if isinstance(value, Reference) else None
    if word not in parameter.words:
        words = parameter.words
        context.report.add(
            codes.WRONG_TYPE if word is None else codes.UNKNOWN_MEMBER,
            value.span,
            f"`{context.report.text(value.span)}` is not a value of `{parameter.name}` of `{call.name.text}`",
            help=(None if word is None else suggestion(word, words)) or f"its values are {listed(words)}",
            fix=None if word is None else correction(context.report, value.span, word, words),
        )
        return None
    if parameter.words == YES_NO:
        return word == "yes"
    return WORD_TYPES[parameter.name](word)


def _name(context: CheckContext, parameter: FaultField, value: Value) -> str | None:
    if not isinstance(value, Reference):
        context.report.add(
            codes.WRONG_TYPE,
            value.span,
            f"`{context.report.text(value.span)}` is not a name, as `{parameter.name}` needs",
        )
        return None
    known = context.dialect.messages
    if parameter.name == "message" and value.name not in known:
        context.report.add(
            codes.UNKNOWN_MESSAGE,
            value.span,
            f"the dialect has no message `{value.name}`",
            help=suggestion(value.name, known),
            fix=correction(context.report, value.span, value.name, known),
        )
        return None
    return value.name


def _number(context: CheckContext, parameter: FaultField, value: Value) -> int | None:
    """A number in the unit of its field."""
    unit = parameter.unit
    dimension = Dimension.COUNT if unit is None else unit.dimension or Dimension.COUNT
    type = COUNT if dimension is Dimension.COUNT else number(dimension)
    found = typed(context.scope(), value, type)
    if found is None:
        return None
    if found.constant is None:
        context.report.add(
            codes.NOT_CONSTANT,
            value.span,
            f"`{context.report.text(value.span)}` is not known before the flight",
            help="write a number with its unit",
        )
        return None
    whole = stored(context.scope(), value, type, found.constant)
    if whole is None or not size(context, value, dimension, whole):
        return None
    written, canonical = context.report.text(value.span), 1 if unit is None else unit.canonical
    if whole % canonical:
        near = display(whole // canonical * canonical, dimension)
        context.report.add(
            codes.NOT_EXACT,
            value.span,
            f"`{written}` is finer than the resolution of `{parameter.name}`",
            help=f"the nearest lower value is `{near}`",
        )
        return None
    return whole // canonical if _fits(context, parameter, value, whole // canonical, dimension) else None


def _fits(context: CheckContext, parameter: FaultField, value: Value, least: int, dimension: Dimension) -> bool:
    """Whether a number is in the range of a field; reports it if not."""
    written = context.report.text(value.span)
    if least < 0 and parameter.name not in SIGNED:
        context.report.add(codes.NOT_POSITIVE, value.span, f"`{written}` must not be negative")
        return False
    most = {Dimension.RATIO: WHOLE, Dimension.ANGLE: FULL_TURN}.get(dimension)
    most = MAX_COPIES if parameter.name == "copies" else most
    if most is not None and least > most:
        canonical = 1 if parameter.unit is None else parameter.unit.canonical
        context.report.add(
            codes.NUMBER_SIZE,
            value.span,
            f"`{written}` exceeds the maximum of `{parameter.name}`",
            help=f"the maximum is {display(most * canonical, dimension)}",
        )
        return False
    return True
