"""Skill contracts."""

from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.vehicles import Vehicles
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.expression import Condition, Quantity, Range, Reference, Value
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import (
    ArgumentValue,
    GivenSize,
    LinkDecl,
    Motion,
    Parameter,
    Sized,
    SizesDecl,
    SkillDecl,
)


class Choice(NamedTuple):
    """A further name of the `one of` before it, perhaps with the default."""

    span: Span
    name: Name
    default: Name | None


#: the parts of a skill that a size may stand in, by their first words
_SIZED: Final = {"deadline": "deadline", "valid": "validity", "lasts": "duration", "grace": "grace", "energy": "energy"}
#: parts of a skill that may be written several times: all of them hold
_CLAUSES = ("require", "assume", "maintain")


class Skills(Vehicles):
    """Capabilities, what they need, and what flies when they end early."""

    def parameter(self, span: Span, name: Name, type: Name, range: Range | None, default: Value | None) -> Parameter:
        """`altitude: altitude in 5 m .. 60 m = 20 m`."""
        self.undotted(name, "parameter")
        return Parameter(span=span, name=name, type=type, range=range, choices=(), default=default)

    def choice_type(self, span: Span) -> Name:
        """`one of`, as a type."""
        return Name(span=span, text="choice")

    def one_of(self, span: Span, name: Name, type: Name, first: Name, default: Name | None) -> Parameter:
        """`pattern: one of grid`, whose further names follow as items of their own."""
        self.undotted(name, "parameter")
        return self._choices(span, name, type, (first,), default)

    def choice(self, span: Span, name: Name, default: Name | None) -> Choice:
        """`, orbit = grid`, the next name of a `one of`."""
        return Choice(span, name, default)

    def parameters(self, span: Span, *items: Parameter | Choice) -> tuple[Parameter, ...]:
        """The parameters, each `one of` with all its names."""
        made: list[Parameter] = []
        for item in items:
            last = made[-1] if made else None
            if isinstance(item, Parameter):
                made.append(item)
            elif last is not None and last.choices and last.default is None:
                names = (*last.choices, item.name)
                made[-1] = self._choices(last.span.to(item.span), last.name, last.type, names, item.default)
            else:
                name = short(item.name.text)
                help = f"write its type, as in `{name}: speed`"
                self.report(SYNTAX, f"the parameter `{name}` has no type", item.span, help)
        return tuple(made)

    def _choices(self, span: Span, name: Name, type: Name, names: tuple[Name, ...], default: Name | None) -> Parameter:
        value = Reference(span=default.span, name=default.text) if default else None
        return Parameter(span=span, name=name, type=type, range=None, choices=names, default=value)

    def climb_to(self, span: Span, altitude: Name) -> Part:
        """`motion climb to altitude`."""
        return self._motion(span, "climb", altitude=altitude)

    def fly_to(self, span: Span, target: Name, altitude: Name, speed: Name | None) -> Part:
        """`motion fly to target at altitude speed speed`."""
        return self._motion(span, "fly", target, altitude, speed)

    def cover_area(self, span: Span, target: Name, altitude: Name, pattern: Name | None, speed: Name | None) -> Part:
        """`motion cover area at altitude pattern pattern speed speed`."""
        return self._motion(span, "cover", target, altitude, speed, pattern)

    def hold_for(self, span: Span, kind: Any, time: Name) -> Part:
        """`motion hold for time`."""
        return self._motion(span, kind, time=time)

    def stay(self, span: Span, kind: Any) -> Part:
        """`motion home`, `motion hold`, `motion land`."""
        return self._motion(span, kind)

    def _motion(
        self,
        span: Span,
        kind: Literal["climb", "fly", "cover", "home", "hold", "land"],
        target: Name | None = None,
        altitude: Name | None = None,
        speed: Name | None = None,
        pattern: Name | None = None,
        time: Name | None = None,
    ) -> Part:
        motion = Motion(span=span, kind=kind, target=target, altitude=altitude, speed=speed, pattern=pattern, time=time)
        return Part("motion", span, motion)

    def timing_class(self, span: Span, name: Name) -> Part:
        """`class tactical`."""
        return Part("class", span, name)

    def deadline(self, span: Span, time: Quantity) -> Part:
        """`deadline 2 s`."""
        return Part("deadline", span, time)

    def validity(self, span: Span, time: Quantity, phases: tuple[Name, ...] | None) -> Part:
        """`valid for 10 min during inspection`."""
        return Part("valid", span, (time, phases or ()))

    def duration(self, span: Span, time: Quantity) -> Part:
        """`lasts at most 5 min`."""
        return Part("lasts", span, time)

    def grace(self, span: Span, time: Quantity) -> Part:
        """`grace 500 ms`."""
        return Part("grace", span, time)

    def require(self, span: Span, condition: Condition, fitted: bool | None) -> Part:
        """`require battery > 35 %`."""
        return Part("require", span, self.clauses(condition, fitted is True))

    def assume(self, span: Span, condition: Condition, fitted: bool | None) -> Part:
        """`assume wind.speed < 10 m/s`."""
        return Part("assume", span, self.clauses(condition, fitted is True))

    def maintain(self, span: Span, condition: Condition, fitted: bool | None) -> Part:
        """`maintain height <= 60 m`."""
        return Part("maintain", span, self.clauses(condition, fitted is True))

    def where_fitted(self, span: Span) -> bool:
        """`where fitted`, after a condition."""
        return True

    def fallback(self, span: Span, links: tuple[LinkDecl, ...]) -> Part:
        """`fallback hover for 20 s, return_home, emergency_land`."""
        return Part("fallback", span, links)

    def energy(self, span: Span, charge: Quantity) -> Part:
        """`energy at most 18 %`."""
        return Part("energy", span, charge)

    def record(self, span: Span, names: tuple[Name, ...]) -> Part:
        """`record intent, decision`."""
        return Part("record", span, names)

    def links(self, span: Span, *links: LinkDecl) -> tuple[LinkDecl, ...]:
        """A chain of links."""
        return links

    def link(
        self, span: Span, skill: Name, arguments: tuple[ArgumentValue, ...] | None, limit: Quantity | None
    ) -> LinkDecl:
        """`hover for 20 s`."""
        return LinkDecl(span=span, skill=skill, arguments=arguments or (), limit=limit)

    def sized(self, span: Span, word: str, size: Reference, phases: tuple[Name, ...] | None = None) -> Part:
        """`lasts at most longest`, where `longest` is one of the skill's sizes."""
        made = Sized(span=span, part=_SIZED[str(word)], size=size)  # type: ignore[arg-type]
        return Part(str(word), span, (made, phases or ()) if word == "valid" else made)

    def own_sizes(self, span: Span, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
        """`sizes (highest: altitude in 10 m .. 500 m = 60 m)`, of a skill."""
        return parameters

    def given_size(self, span: Span, name: Name, value: Quantity) -> GivenSize:
        """`highest = 120 m`."""
        return GivenSize(span=span, name=name, value=value)

    def sizes(self, span: Span, skill: Name, *given: GivenSize) -> None:
        """`sizes goto(highest = 120 m, longest = 6 min)`."""
        self.declare(SizesDecl(span=span, skill=skill, given=given))

    def skill(
        self,
        span: Span,
        name: Name,
        parameters: tuple[Parameter, ...] | None,
        sizes: tuple[Parameter, ...] | None,
        *given: Part,
    ) -> None:
        """`skill hover() { ... }`."""
        self.undotted(name, "skill")
        found = {key: part.value for key, part in self.parts("skill", name, _joined(given)).items()}
        validity, phases = found.get("valid", (None, ()))
        amounts = {"validity": validity} | {part: found.get(word) for word, part in _SIZED.items() if word != "valid"}
        plain = {part: None if isinstance(amount, Sized) else amount for part, amount in amounts.items()}
        self.declare(
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
                require=found.get("require", ()),
                assume=found.get("assume", ()),
                maintain=found.get("maintain", ()),
                fallback=found.get("fallback", ()),
                energy=plain["energy"],
                record=found.get("record", ()),
                sizes=sizes or (),
                sized=tuple(amount for amount in amounts.values() if isinstance(amount, Sized)),
            ),
            name,
        )


def _joined(given: Sequence[Part]) -> list[Part]:
    """The parts of a skill, with all of its clauses of one kind in one part: at the first, in source order."""
    joined: dict[str, Part] = {}
    for part in given:
        first = joined.get(part.key)
        if first is not None and part.key in _CLAUSES:
            joined[part.key] = Part(part.key, first.span, (*first.value, *part.value))
        else:
            joined[part.key if part.key in _CLAUSES else f"{part.key} {part.span.start}"] = part
    return list(joined.values())
