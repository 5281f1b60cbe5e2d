"""Actions for skills: parameters, contract, motion and fallback chain."""

from itertools import chain
from typing import Final, NamedTuple

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.reader import Action, Part, Reader, node, part, several
from rtshcua.model.ir.expression import Condition, Junction, Quantity, Range, Reference, Value
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import (
    ClauseDecl,
    GivenSize,
    LinkDecl,
    MotionDecl,
    ParameterDecl,
    Sized,
    SizesDecl,
    SkillDecl,
)


class FurtherName(NamedTuple):
    """A further name of a `one of`, with the default if it is written here."""

    span: Span
    name: Name
    default: Name | None


#: the parts of a skill that may be a size, by their first keyword
_SIZED: Final = {"deadline": "deadline", "valid": "validity", "lasts": "duration", "grace": "grace", "energy": "energy"}
#: parts of a skill that may repeat: all of them apply
_CLAUSES = ("require", "assume", "maintain")


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
    "cover_area": part("motion", node(MotionDecl, "target", "altitude", "pattern", "speed", kind="cover")),
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
}


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
    found = reader.parts("skill", name, given, listed=_CLAUSES)
    validity, phases = found.get("valid", (None, ()))
    amounts = {"validity": validity} | {part: found.get(word) for word, part in _SIZED.items() if word != "valid"}
    plain = {part: None if isinstance(amount, Sized) else amount for part, amount in amounts.items()}
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
            sized=tuple(amount for amount in amounts.values() if isinstance(amount, Sized)),
        ),
        name,
    )
