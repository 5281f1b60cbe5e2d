"""From a specification that follows its schema to the IR of a mission, with the places of its JSON text."""

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.agent.json_tree import Path, Tree
from rtshcua.ground.agent.schema import SpecificationShape, StepShape
from rtshcua.ground.agent.values import parse_value
from rtshcua.model.ir.missions import MissionDecl, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import ArgumentValue

_RESERVED = frozenset({"and", "or", "not", "in", "inside", "outside", "any"})


def mission_of(
    shape: SpecificationShape, tree: Tree, source: Source
) -> tuple[MissionDecl | None, tuple[Diagnostic, ...]]:
    """The mission, or None, and what its values say wrong."""
    made = _Maker(tree, source)
    mission = made.mission(shape)
    return (None if made.found else mission), tuple(made.found)


class _Maker:
    """Makes the nodes of one specification."""

    def __init__(self, tree: Tree, source: Source) -> None:
        self.tree = tree
        self.source = source
        self.found: list[Diagnostic] = []

    def mission(self, shape: SpecificationShape) -> MissionDecl:
        """The whole mission. The policy's place is that of its name and version together."""
        phases = tuple(
            Phase(
                span=self.tree.spans["phases", number],
                name=self.name(phase.name, ("phases", number, "name")),
                steps=tuple(
                    self.step(step, ("phases", number, "steps", index)) for index, step in enumerate(phase.steps)
                ),
            )
            for number, phase in enumerate(shape.phases)
        )
        by = shape.proposed_by
        return MissionDecl(
            span=self.tree.spans[()],
            name=self.name(shape.name, ("name",)),
            policy=Name(span=self.tree.spans["policy",], text=self.name(shape.policy.name, ("policy", "name")).text),
            policy_version=shape.policy.version,
            vehicle=self.name(shape.vehicle, ("vehicle",)),
            intent=shape.intent,
            source=self.name(by.source, ("proposed_by", "source")),
            proposer=self.name(by.name, ("proposed_by", "name")),
            role=self.name(by.role, ("proposed_by", "role")),
            phases=phases,
        )

    def step(self, shape: StepShape, path: Path) -> Step:
        """One step; an argument that says nothing sensible is reported and left out."""
        arguments: list[ArgumentValue] = []
        for key, text in shape.arguments.items():
            here = (*path, "arguments", key)
            place = self.tree.spans[here]
            offsets = string_offsets(self.source.text, place)
            value, found = parse_value(text, Span(place.file, place.start + 1, place.end - 1), offsets.__getitem__)
            self.found += found
            if value is not None:
                name = Name(span=self.tree.keys[here], text=key)
                arguments.append(ArgumentValue(span=place, name=name, value=value))
        return Step(
            span=self.tree.spans[path],
            skill=self.name(shape.skill, (*path, "skill")),
            arguments=tuple(arguments),
            on_inadmissible=shape.on_inadmissible,
        )

    def name(self, text: str, path: Path) -> Name:
        """A name with its place; the language's reserved words are none."""
        span = self.tree.spans[path]
        if text in _RESERVED:
            message = f"`{text}` is a word of the language, and no name"
            self.found.append(Diagnostic(codes.SPECIFICATION_SHAPE, message, span, "choose another name"))
        return Name(span=span, text=text)


def string_offsets(text: str, place: Span) -> list[int]:
    """Where each character of a JSON string stands in the text, and where the string ends."""
    offsets: list[int] = []
    at, end = place.start + 1, place.end - 1
    while at < end:
        offsets.append(at)
        if text[at] != "\\":
            at += 1
        elif text[at + 1] != "u":
            at += 2
        else:
            pair = 0xD800 <= int(text[at + 2 : at + 6], 16) < 0xDC00
            at += 12 if pair else 6
    return [*offsets, end]
