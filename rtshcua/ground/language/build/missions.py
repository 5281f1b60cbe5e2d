"""Missions and imports: with these the builder is whole."""

from typing import Any

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.scenarios import Scenarios
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import Item, MissionDecl, Overrides, Phase, Repeat, Step
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.program import Import
from rtshcua.model.ir.skills import ArgumentValue, Parameter


class Builder(Scenarios):
    """Every action of the grammar."""

    def file(self, span: Span, *declarations: None) -> None:
        """The whole text; its declarations were kept as they ended."""

    def import_file(self, span: Span, path: str) -> None:
        """`import "lib:skills/goto.rts"`."""
        self.declare(Import(span=span, path=path))

    def argument(self, span: Span, *parts: Any) -> ArgumentValue:
        """`altitude = 20 m`, or a value by its place."""
        name, value = parts if len(parts) == 2 else (None, *parts)
        return ArgumentValue(span=span, name=name, value=value)

    def arguments(self, span: Span, *arguments: ArgumentValue) -> tuple[ArgumentValue, ...]:
        """Arguments with commas between them."""
        return arguments

    def step(
        self,
        span: Span,
        skill: Name,
        arguments: tuple[ArgumentValue, ...] | None,
        otherwise: Any,
        tighter: tuple[Span, tuple[Part, ...]] | None,
    ) -> Step:
        """`goto(bridge_a.entry, altitude = 20 m) on inadmissible skip { deadline 2 s }`."""
        return Step(
            span=span,
            skill=skill,
            arguments=arguments or (),
            on_inadmissible=otherwise or "abort",
            overrides=None if tighter is None else self._overrides(skill, *tighter),
        )

    def overrides(self, span: Span, *given: Part) -> tuple[Span, tuple[Part, ...]]:
        """`{ deadline 2 s }`, after a step."""
        return span, given

    def _overrides(self, skill: Name, span: Span, given: tuple[Part, ...]) -> Overrides:
        found = {key: part.value for key, part in self.parts("the step", skill, given).items()}
        for part in given:
            if part.key in ("require", "assume", "maintain") and any(clause.where_fitted for clause in part.value):
                self.report(
                    SYNTAX,
                    "`where fitted` says nothing in a step, whose mission names its vehicle",
                    part.span,
                    "leave `where fitted` out; if the vehicle is without the sensor, leave the clause out",
                )
        validity, phases = found.get("valid", (None, ()))
        return Overrides(
            span=span,
            deadline=found.get("deadline"),
            validity=validity,
            duration=found.get("lasts"),
            grace=found.get("grace"),
            energy=found.get("energy"),
            phases=phases,
            require=found.get("require", ()),
            assume=found.get("assume", ()),
            maintain=found.get("maintain", ()),
            record=found.get("record", ()),
        )

    def repeat(self, span: Span, count: Quantity, *items: Item) -> Node:
        """`repeat 3 { ... }`."""
        made = Repeat(span=span, count=count, items=items)
        return self.nested(made, *items, help="write one `repeat` with the product of the counts")

    def phase(self, span: Span, name: Name, *items: Item) -> Phase:
        """`phase inspection { ... }`."""
        self.undotted(name, "phase")
        return Phase(span=span, name=name, items=items)

    def most_steps(self, span: Span, count: int) -> Part:
        """`steps at most 40`."""
        return Part("steps", span, count)

    def intent(self, span: Span, text: str) -> Part:
        """`intent "Inspect bridge A."`."""
        return Part("intent", span, text)

    def proposed(self, span: Span, source: Name, proposer: Name, role: Name | None) -> Part:
        """`proposed by agent openclaw for role operator`."""
        return Part("proposed", span, (source, proposer, role))

    def mission(
        self,
        span: Span,
        name: Name,
        parameters: tuple[Parameter, ...] | None,
        policy: Name,
        version: int,
        vehicle: Name,
        *given: Phase | Part,
    ) -> None:
        """`mission inspect_bridge_a(height: altitude) under bridge_inspection@7 on quad { ... }`."""
        self.undotted(name, "mission")
        found = self.parts("mission", name, [part for part in given if isinstance(part, Part)])
        source, proposer, role = found["proposed"].value if "proposed" in found else (None, None, None)
        self.declare(
            MissionDecl(
                span=span,
                name=name,
                policy=policy,
                policy_version=version,
                vehicle=vehicle,
                intent=found["intent"].value if "intent" in found else None,
                source=source,
                proposer=proposer,
                role=role,
                phases=tuple(phase for phase in given if isinstance(phase, Phase)),
                parameters=parameters or (),
                most_time=found["lasts"].value if "lasts" in found else None,
                most_energy=found["energy"].value if "energy" in found else None,
                most_steps=found["steps"].value if "steps" in found else None,
            ),
            name,
        )
