"""Reads a mission specification into the IR of a mission; every finding has a JSON Pointer (RFC 6901).

Spans are places in the JSON text. A specification comes from an agent, so it may import from the shipped library only.
The person who runs the compiler names the policy's own sources.
"""

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from pydantic import ValidationError

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import HIDDEN_CHARACTER, IMPORT_PATH, NO_SUCH_FILE
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import hiding, visible
from rtshcua.diagnostics.kinds import foreign
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.agent.json_tree import JsonPlaces, JsonTree, Path, pointer, read_json
from rtshcua.ground.agent.specification_schema import (
    RESERVED,
    OverridesShape,
    SpecificationShape,
    StepShape,
    more_findings,
    shape_errors,
)
from rtshcua.ground.checker.agent_values import Moved, parse_clauses, parse_quantity, parse_value
from rtshcua.ground.language.file_findings import not_a_source
from rtshcua.ground.language.load import Listing, Program, Read, load, no_packs
from rtshcua.ground.language.paths import Packs, imported, on_a_shelf, shown, stable
from rtshcua.ground.pipeline.pins import PROPOSED, Pins, claims
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import MissionDecl, Overrides, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.program import Import, Unit
from rtshcua.model.ir.skills import ArgumentValue, ClauseDecl


def mission_of(
    shape: SpecificationShape, tree: JsonTree, source: Source
) -> tuple[MissionDecl | None, tuple[Diagnostic, ...]]:
    """Return the mission, None if a value is wrong, and the findings about its values."""
    made = _MissionBuilder(tree, source)
    mission = made.mission(shape)
    return (None if made.found else mission), tuple(made.found)


class _MissionBuilder:
    """Builds the IR nodes of one specification and collects findings."""

    def __init__(self, tree: JsonTree, source: Source) -> None:
        self.tree = tree
        self.source = source
        self.found: list[Diagnostic] = []

    def mission(self, shape: SpecificationShape) -> MissionDecl:
        """Build the mission. The span of the policy covers its name and version."""
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
        """Build a step. An argument that cannot be parsed is reported and omitted."""
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
        """Build the overrides of a step. A value that cannot be parsed is reported and omitted."""
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

    def quantity(self, keyword: str, text: str | None, path: Path) -> Quantity | None:
        """Build the quantity of an override, if there is one."""
        if text is None:
            return None
        value, found = parse_quantity(keyword, text, *self.within(path))
        self.found += found
        return value

    def clauses(self, keyword: str, texts: Sequence[str], path: Path) -> tuple[ClauseDecl, ...]:
        """Build the clauses of an override."""
        clauses: list[ClauseDecl] = []
        for number, text in enumerate(texts):
            some, found = parse_clauses(keyword, text, *self.within((*path, number)))
            clauses += some
            self.found += found
        return tuple(clauses)

    def within(self, path: Path) -> tuple[Span, Moved]:
        """Return the span of a string between its quotes, and a function from its offsets to those of the source."""
        place = self.tree.spans[path]
        return Span(place.file, place.start + 1, place.end - 1), string_offsets(self.source.text, place).__getitem__

    def name(self, text: str, path: Path) -> Name:
        """Build a name. A reserved word of the language is reported."""
        span = self.tree.spans[path]
        if text in RESERVED:
            message = f"`{text}` is a reserved word and cannot be used as a name"
            self.found.append(Diagnostic(codes.SPECIFICATION_SHAPE, message, span, "choose another name"))
        return Name(span=span, text=text)


def string_offsets(text: str, place: Span) -> list[int]:
    """The offsets in `text` of each character of a JSON string, and of its end."""
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


#: the most findings that are listed for one specification
MAX_FINDINGS = 100

_CONTROL = re.compile(r"[\t\n\f\r]")  # white space that sources may have, but not the strings of a specification


@dataclass(frozen=True, slots=True)
class Specification:
    """A specification as a unit of a program; the unit has no mission if the specification has errors."""

    source: Source
    tree: JsonTree | None
    unit: Unit
    diagnostics: tuple[Diagnostic, ...]

    def pointed(self, diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
        """Return the findings, with a JSON Pointer to the value in each finding about this specification."""
        places = None if self.tree is None else JsonPlaces(self.tree)
        return tuple(self._pointed(diagnostic, places) for diagnostic in diagnostics)

    def _pointed(self, diagnostic: Diagnostic, places: JsonPlaces | None) -> Diagnostic:
        span = diagnostic.span
        if span is None or span.file != self.source.file or diagnostic.pointer is not None:
            return diagnostic
        return replace(diagnostic, pointer="" if places is None else pointer(places.innermost(span)))


def parse_specification(file: str, data: bytes) -> Specification:
    """Parse a specification. Errors become findings, never exceptions."""
    kind = foreign(data)
    if kind is not None:
        source = Source(file, data.decode("utf-8", "replace"))
        return _specification(source, None, None, (not_a_source(file, kind),))
    source, tree, found = read_json(file, data)
    if tree is None or found:
        return _specification(source, tree, None, found)
    found = tuple(_hiding(source, tree))
    if found:
        return _specification(source, tree, None, found)
    try:
        shape = SpecificationShape.model_validate(tree.value)
    except ValidationError as error:
        return _specification(source, tree, None, shape_errors(error, tree, MAX_FINDINGS))
    mission, found = mission_of(shape, tree, source)
    imports = tuple(Import(span=tree.spans["imports", number], path=path) for number, path in enumerate(shape.imports))
    unit = _unit(Span(file, 0, len(source.text)), imports, () if mission is None else (mission,))
    return _specification(source, tree, unit, found)


def _hiding(source: Source, tree: JsonTree) -> Iterator[Diagnostic]:
    """Yield a finding for each string with a control, invisible or reordering character."""
    for span in (*tree.keys.values(), *tree.spans.values()):
        written = source.text[span.start : span.end]
        if written.startswith('"'):
            text = json.loads(written)
            control = _CONTROL.search(text)
            at = hiding(text) if control is None else control.start()
            if at is not None:
                message = f"`{visible(text[at])}` hides or reorders the displayed text"
                help = "remove control characters and invisible characters from the strings of the specification"
                yield Diagnostic(HIDDEN_CHARACTER, message, span, help)


def load_specification(
    path: str,
    policies: Sequence[str],
    read: Read,
    library: str | None,
    listing: Listing | None = None,
    packs: Packs = no_packs,
    pins: Pins = PROPOSED,
) -> tuple[Program, Specification]:
    """Load a specification with the sources against which it is checked.

    `policies` are sources that the caller names, in addition to the specification's imports from the library. A claim
    beyond `pins` is a finding. The findings of the program include those of the specification. Pass the findings of
    compilation through `Specification.pointed`.
    """
    name = shown(path)
    try:
        specification = parse_specification(name, read(path))
    except OSError as error:
        message = f"cannot read `{path}`: {(error.strerror or 'it is unreadable').lower()}"
        specification = _specification(Source(name, ""), None, None, (Diagnostic(NO_SUCH_FILE, message),))
    found = list(specification.diagnostics)
    found += [each for mission in specification.unit.missions for each in claims(mission, pins)]
    folders = {} if library is None else {"lib": library}
    wanted: list[str] = []
    for each in specification.unit.imports:
        resolved = imported(each.path, path, folders.get)
        if not on_a_shelf(each.path):
            message = f"`{each.path}` is not in the shipped library"
            help = "import from `lib:policies/`, `lib:skills/` or `lib:missions/`, without `..`"
            found += specification.pointed([Diagnostic(IMPORT_PATH, message, each.span, help)])
            continue
        try:
            if resolved is not None:
                read(resolved)
                wanted.append(resolved)
                continue
            why = "the shipped library is not installed"
        except OSError as error:
            why = (error.strerror or "it is unreadable").lower()
        found += specification.pointed([Diagnostic(NO_SUCH_FILE, f"cannot read `{each.path}`: {why}", each.span)])
    program = load([*wanted, *policies], read, library, listing, packs=packs)
    return (
        Program(
            units=(specification.unit, *program.units),
            sources={name: specification.source, **program.sources},
            diagnostics=(*found, *program.diagnostics),
            broken=program.broken,
            stable={name: stable(path, folders, path), **program.stable},
            data=program.data,
            data_names=program.data_names,
            whole=program.whole,
        ),
        specification,
    )


def _specification(
    source: Source, tree: JsonTree | None, unit: Unit | None, found: tuple[Diagnostic, ...]
) -> Specification:
    whole = Span(source.file, 0, len(source.text))
    if len(found) > MAX_FINDINGS + 1:
        found = (*found[:MAX_FINDINGS], more_findings(len(found) - MAX_FINDINGS, source.file))
    specification = Specification(source, tree, unit or _unit(whole, (), ()), ())
    return replace(specification, diagnostics=specification.pointed(found))


def _unit(span: Span, imports: tuple[Import, ...], missions: tuple[MissionDecl, ...]) -> Unit:
    return Unit(
        span=span,
        file=span.file,
        imports=imports,
        enums=(),
        signals=(),
        zones=(),
        vehicles=(),
        skills=(),
        policies=(),
        missions=missions,
    )
