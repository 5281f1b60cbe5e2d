"""Actions for skills: parameters, contract, motion and fallback chain."""

import re
from itertools import chain
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.reader import Action, Part, Reader, node, part, several
from rtshcua.model.ir.expression import Condition, Junction, Quantity, Range, Reference, Value
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import (
    AcceptsDecl,
    ClauseDecl,
    EmitsDecl,
    EmittedParameter,
    FixedFieldDecl,
    GivenSize,
    LinkDecl,
    MotionDecl,
    ParameterDecl,
    PicturesDecl,
    Sized,
    SizesDecl,
    SkillDecl,
    SourcedArgument,
    Substitute,
    SuccessDecl,
)


class FurtherName(NamedTuple):
    """A further name of a `one of`, with the default if it is written here."""

    span: Span
    name: Name
    default: Name | None


#: the parts of a skill that may be a size, by their first keyword
_SIZED: Final = {"deadline": "deadline", "valid": "validity", "lasts": "duration", "grace": "grace", "energy": "energy"}
#: parts of a skill that may repeat: all of them apply
_REPEATED = ("require", "assume", "maintain", "accepts", "emits")
#: the form of a parameter's name on both autopilots; MAVLink has 16 characters for it
_AUTOPILOT_PARAMETER: Final = re.compile(r"[A-Z][A-Z0-9_]{0,15}")


def _clauses(condition: Condition, where_fitted: bool) -> tuple[ClauseDecl, ...]:
    """Split a top-level `and`, so that a refusal can name the operand that decided."""
    if isinstance(condition, Junction) and condition.operator == "and":
        return tuple(clause for operand in condition.operands for clause in _clauses(operand, where_fitted))
    return (ClauseDecl(span=condition.span, condition=condition, where_fitted=where_fitted),)


def _clauses_of(reader: Reader, span: Span, condition: Condition, fitted: bool | None) -> tuple[ClauseDecl, ...]:
    """`battery > 35 % and height < 60 m where fitted`."""
    return _clauses(condition, fitted is True)


FORMS: dict[str, Action] = {
    "climb_to": part("motion", node(MotionDecl, "altitude", kind="climb")),
    "fly_to": part("motion", node(MotionDecl, "target", "altitude", "speed", kind="fly")),
    "cover_area": part(
        "motion", node(MotionDecl, "target", "altitude", "distance", "pattern", "facing", "speed", kind="cover")
    ),
    "cover_levels": part(
        "motion",
        node(
            MotionDecl,
            *("target", "lowest", "altitude", "every", "distance", "pattern", "facing", "speed"),
            kind="cover",
        ),
    ),
    "hold_for": part("motion", node(MotionDecl, "kind", "time")),
    "stay": part("motion", node(MotionDecl, "kind")),
    "timing_class": part("class"),
    "deadline": part("deadline"),
    "duration": part("lasts"),
    "grace": part("grace"),
    "require": part("require", _clauses_of),
    "assume": part("assume", _clauses_of),
    "maintain": part("maintain", _clauses_of),
    "fallback": part("fallback"),
    "energy": part("energy"),
    "record": part("record"),
    "links": several,
    "link": node(LinkDecl, "skill", "arguments", "limit", arguments=()),
    "given_size": node(GivenSize, "name", "value"),
    "fixed_fields": several,
    "sourced_arguments": several,
    "substitute": node(Substitute, "kind"),
    "emitted_parameters": several,
}


class FieldSource(NamedTuple):
    """The fields of an argument, and the datum of an altitude."""

    fields: tuple[Name, ...]
    datum: Any = None


def fixed_field(reader: Reader, span: Span, field: Name, relation: Any, value: Name) -> FixedFieldDecl:
    """`param1 = 0`."""
    reader.undotted(field, "field")
    return FixedFieldDecl(span=span, field=field, relation=relation, value=value)


def reference_datum(reader: Reader, span: Span, word: str) -> str:
    """`above home`, `in frame`."""
    return word


def field_source(reader: Reader, span: Span, field: Name, datum: str | None) -> FieldSource:
    """`param7 above home`."""
    reader.undotted(field, "field")
    return FieldSource((field,), datum)


def field_pair(reader: Reader, span: Span, *fields: Name) -> FieldSource:
    """`(param5, param6)`."""
    for field in fields:
        reader.undotted(field, "field")
    return FieldSource(fields)


def parameter_substitute(reader: Reader, span: Span, parameter: Name, datum: Any) -> Substitute:
    """`parameter MIS_TAKEOFF_ALT above home`."""
    if _AUTOPILOT_PARAMETER.fullmatch(parameter.text) is None:
        found = f"`{short(parameter.text)}` is not a parameter of an autopilot"
        help = "write at most 16 capital letters, digits and `_`, as in `MIS_TAKEOFF_ALT`"
        reader.report(SYNTAX, found, parameter.span, help)
    return Substitute(span=span, kind="parameter", parameter=parameter, datum=datum)


def sourced_argument(
    reader: Reader, span: Span, parameter: Name, source: FieldSource, substitute: Substitute | None
) -> SourcedArgument:
    """`altitude = param7 above home or here`."""
    reader.undotted(parameter, "parameter")
    fields, datum = source
    return SourcedArgument(span=span, parameter=parameter, fields=fields, datum=datum, substitute=substitute)


def substituted_argument(reader: Reader, span: Span, parameter: Name, substitute: Substitute) -> SourcedArgument:
    """`target = here`, from no field."""
    reader.undotted(parameter, "parameter")
    return SourcedArgument(span=span, parameter=parameter, fields=(), datum=None, substitute=substitute)


def accepts(
    reader: Reader,
    span: Span,
    kind: Any,
    name: Name,
    autopilot: Name | None,
    where: tuple[FixedFieldDecl, ...] | None,
    arguments: tuple[SourcedArgument, ...] | None,
) -> Part:
    """`accepts mode RTL on ardupilot`."""
    for each in filter(None, (name, autopilot)):
        reader.undotted(each, "command")
    kind = kind or "command"
    made = AcceptsDecl(
        span=span, kind=kind, name=name, autopilot=autopilot, where=where or (), arguments=arguments or ()
    )
    return Part("accepts", span, made)


class EmissionTime(NamedTuple):
    """When a command to payload is sent."""

    once: Name | None = None
    each: Name | None = None
    every: Quantity | Reference | None = None


def emitted_parameter(reader: Reader, span: Span, field: Name, value: Quantity | Reference) -> EmittedParameter:
    """`param3 = 1`, `param1 = pitch`."""
    reader.undotted(field, "parameter")
    return EmittedParameter(span=span, fields=(field,), value=value)


def emitted_place(reader: Reader, span: Span, latitude: Name, longitude: Name, value: Reference) -> EmittedParameter:
    """`(param5, param6) = target`."""
    for each in (latitude, longitude):
        reader.undotted(each, "parameter")
    return EmittedParameter(span=span, fields=(latitude, longitude), value=value)


def once(reader: Reader, span: Span, name: Name) -> EmissionTime:
    """`at begin`."""
    return EmissionTime(once=name)


def each_time(reader: Reader, span: Span, name: Name) -> EmissionTime:
    """`at each turn`."""
    return EmissionTime(each=name)


def repeatedly(reader: Reader, span: Span, every: Quantity | Reference) -> EmissionTime:
    """`every 10 m`, `every spacing`."""
    return EmissionTime(every=every)


def limit(reader: Reader, span: Span, quantity: Quantity) -> Quantity:
    """`within 3 s`."""
    return quantity


def success(reader: Reader, span: Span, by: Name, *limits: Quantity) -> SuccessDecl:
    """`succeeds with attitude within 2 deg within 3 s`."""
    return SuccessDecl(span=span, by=by, limits=limits)


def emits(
    reader: Reader,
    span: Span,
    command: Name,
    addressee: Name,
    parameters: tuple[EmittedParameter, ...] | None,
    time: EmissionTime,
    success: SuccessDecl | None,
    required: Any,
) -> Part:
    """`emits MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every 10 m`."""
    for each in (command, addressee):
        reader.undotted(each, "command")
    made = EmitsDecl(
        span=span,
        command=command,
        addressee=addressee,
        parameters=parameters or (),
        once=time.once,
        each=time.each,
        every=time.every,
        success=success,
        required=required is not None,
    )
    return Part("emits", span, made)


def parameter(
    reader: Reader, span: Span, name: Name, type: Name, range: Range | None, default: Value | None
) -> ParameterDecl:
    """`altitude: altitude in 5 m .. 60 m = 20 m`."""
    reader.undotted(name, "parameter")
    return ParameterDecl(span=span, name=name, type=type, range=range, choices=(), default=default)


def choice_type(reader: Reader, span: Span) -> Name:
    """`one of`, as a type."""
    return Name(span=span, text="choice")


def one_of(reader: Reader, span: Span, name: Name, type: Name, first: Name, default: Name | None) -> ParameterDecl:
    """`pattern: one of grid`; further names follow as separate items."""
    reader.undotted(name, "parameter")
    return _choices(span, name, type, (first,), default)


def choice(reader: Reader, span: Span, name: Name, default: Name | None) -> FurtherName:
    """`, orbit = grid`, the next name of a `one of`."""
    return FurtherName(span, name, default)


def parameters(reader: Reader, span: Span, *items: ParameterDecl | FurtherName) -> tuple[ParameterDecl, ...]:
    """The parameters, each `one of` with all its names."""
    made: list[ParameterDecl] = []
    for item in items:
        last = made[-1] if made else None
        if isinstance(item, ParameterDecl):
            made.append(item)
        elif last is not None and last.choices and last.default is None:
            names = (*last.choices, item.name)
            made[-1] = _choices(last.span.to(item.span), last.name, last.type, names, item.default)
        else:
            name = short(item.name.text)
            help = f"write its type, as in `{name}: speed`"
            reader.report(SYNTAX, f"the parameter `{name}` has no type", item.span, help)
    return tuple(made)


def _choices(span: Span, name: Name, type: Name, names: tuple[Name, ...], default: Name | None) -> ParameterDecl:
    value = Reference(span=default.span, name=default.text) if default else None
    return ParameterDecl(span=span, name=name, type=type, range=None, choices=names, default=value)


def validity(reader: Reader, span: Span, time: Quantity, phases: tuple[Name, ...] | None) -> Part:
    """`valid for 10 min during inspection`."""
    return Part("valid", span, (time, phases or ()))


def where_fitted(reader: Reader, span: Span) -> bool:
    """`where fitted`, after a condition."""
    return True


def sized(reader: Reader, span: Span, word: str, size: Reference, phases: tuple[Name, ...] | None = None) -> Part:
    """`lasts at most longest`, where `longest` is one of the skill's sizes."""
    made = Sized(span=span, part=_SIZED[str(word)], size=size)  # type: ignore[arg-type]
    return Part(str(word), span, (made, phases or ()) if word == "valid" else made)


#: the parts of `pictures`, in their order
_SHOWN: Final = ("every", "resolution", "forward", "side", "blur", "relief")


def pictures(reader: Reader, span: Span, camera: Name, *shown: Any) -> Part:
    """`pictures by mapper every 10 m resolution finest overlap 80 % forward 70 % side`."""
    reader.undotted(camera, "camera")
    written = dict(zip(_SHOWN, shown, strict=True))
    sized = [
        Sized(span=each.span, part=name, size=each)  # type: ignore[arg-type]  # `zip` loses which texts these are
        for name, each in written.items()
        if isinstance(each, Reference)
    ]
    plain = {name: None if isinstance(each, Reference) else each for name, each in written.items()}
    return Part("pictures", span, (PicturesDecl(span=span, camera=camera, **plain), tuple(sized)))


def own_sizes(reader: Reader, span: Span, parameters: tuple[ParameterDecl, ...]) -> tuple[ParameterDecl, ...]:
    """`sizes (highest: altitude in 10 m .. 500 m = 60 m)`, of a skill."""
    return parameters


def sizes(reader: Reader, span: Span, skill: Name, *given: GivenSize) -> None:
    """`sizes goto(highest = 120 m, longest = 6 min)`."""
    reader.declare(SizesDecl(span=span, skill=skill, given=given))


def skill(
    reader: Reader,
    span: Span,
    name: Name,
    parameters: tuple[ParameterDecl, ...] | None,
    sizes: tuple[ParameterDecl, ...] | None,
    *given: Part,
) -> None:
    """`skill hover() { ... }`."""
    reader.undotted(name, "skill")
    found = reader.parts("skill", name, given, listed=_REPEATED)
    validity, phases = found.get("valid", (None, ()))
    amounts = {"validity": validity} | {part: found.get(word) for word, part in _SIZED.items() if word != "valid"}
    plain = {part: None if isinstance(amount, Sized) else amount for part, amount in amounts.items()}
    shown, sized_shown = found.get("pictures", (None, ()))
    reader.declare(
        SkillDecl(
            span=span,
            name=name,
            parameters=parameters or (),
            motion=found.get("motion"),
            timing_class=found.get("class"),
            deadline=plain["deadline"],
            validity=plain["validity"],
            phases=phases,
            duration=plain["duration"],
            grace=plain["grace"],
            require=tuple(chain.from_iterable(found["require"])),
            assume=tuple(chain.from_iterable(found["assume"])),
            maintain=tuple(chain.from_iterable(found["maintain"])),
            fallback=found.get("fallback", ()),
            energy=plain["energy"],
            record=found.get("record", ()),
            sizes=sizes or (),
            sized=(*(amount for amount in amounts.values() if isinstance(amount, Sized)), *sized_shown),
            accepts=tuple(found["accepts"]),
            pictures=shown,
            emits=tuple(found["emits"]),
        ),
        name,
    )
