"""From a specification that follows its schema to the IR of a mission, with the places of its JSON text."""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.agent.json_tree import Path, Tree
from rtshcua.ground.agent.schema import OverridesShape, SpecificationShape, StepShape
from rtshcua.ground.checker.agent_values import Moved, parse_clauses, parse_quantity, parse_value
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import MissionDecl, Overrides, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import ArgumentValue, Clause

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
                items=tuple(
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
            value, found = parse_value(text, *self.within(here))
            self.found += found
            if value is not None:
                name = Name(span=self.tree.keys[here], text=key)
                arguments.append(ArgumentValue(span=place, name=name, value=value))
        return Step(
            span=self.tree.spans[path],
            skill=self.name(shape.skill, (*path, "skill")),
            arguments=tuple(arguments),
            on_inadmissible=shape.on_inadmissible,
            overrides=None if shape.overrides is None else self.overrides(shape.overrides, (*path, "overrides")),
        )

    def overrides(self, shape: OverridesShape, path: Path) -> Overrides:
        """What a step is held to beyond its skill's contract; what says nothing sensible is reported and left out."""
        return Overrides(
            span=self.tree.spans[path],
            deadline=self.quantity("deadline", shape.deadline, (*path, "deadline")),
            validity=self.quantity("valid for", shape.valid_for, (*path, "valid_for")),
            duration=self.quantity("lasts at most", shape.lasts_at_most, (*path, "lasts_at_most")),
            grace=self.quantity("grace", shape.grace, (*path, "grace")),
            energy=self.quantity("energy at most", shape.energy_at_most, (*path, "energy_at_most")),
            phases=tuple(self.name(text, (*path, "during", at)) for at, text in enumerate(shape.during)),
            require=self.clauses("require", shape.require, (*path, "require")),
            assume=self.clauses("assume", shape.assume, (*path, "assume")),
            maintain=self.clauses("maintain", shape.maintain, (*path, "maintain")),
            record=tuple(self.name(text, (*path, "record", at)) for at, text in enumerate(shape.record)),
        )

    def quantity(self, words: str, text: str | None, path: Path) -> Quantity | None:
        """The quantity of an override, if it is given."""
        if text is None:
            return None
        value, found = parse_quantity(words, text, *self.within(path))
        self.found += found
        return value

    def clauses(self, words: str, texts: Sequence[str], path: Path) -> tuple[Clause, ...]:
        """The clauses of conditions."""
        clauses: list[Clause] = []
        for number, text in enumerate(texts):
            some, found = parse_clauses(words, text, *self.within((*path, number)))
            clauses += some
            self.found += found
        return tuple(clauses)

    def within(self, path: Path) -> tuple[Span, Moved]:
        """Where a text stands between its quotes, and where each of its characters does."""
        place = self.tree.spans[path]
        return Span(place.file, place.start + 1, place.end - 1), string_offsets(self.source.text, place).__getitem__

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
