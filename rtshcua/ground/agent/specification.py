"""A mission specification to the same IR that a source gives, every finding with a JSON Pointer (RFC 6901).

Spans are places in the JSON text itself. A specification comes from an agent, so it may import from the shipped library
only: the policy's own sources are named by whoever runs the compiler, never by the agent that is bound by them.
"""

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from pydantic import ValidationError

from rtshcua.diagnostics.codes import HIDDEN_CHARACTER, IMPORT_PATH, NO_SUCH_FILE
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import hiding, visible
from rtshcua.diagnostics.kinds import foreign
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.agent.json_tree import Tree, read_json
from rtshcua.ground.agent.mission import mission_of
from rtshcua.ground.agent.pointers import Places, pointer
from rtshcua.ground.agent.schema import SpecificationShape
from rtshcua.ground.agent.shape import shape_errors, uncounted
from rtshcua.ground.language.faults import not_a_source
from rtshcua.ground.language.load import Listing, Program, Read, load, no_packs
from rtshcua.ground.language.paths import Packs, imported, on_a_shelf, shown, stable
from rtshcua.ground.pipeline.pins import PROPOSED, Pins, claims
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.program import Import, Unit

#: findings on one specification: what is wrong a hundred times over is not mended by reading it all
MAX_FINDINGS = 100

_CONTROL = re.compile(r"[\t\n\f\r]")  # white space in sources, and in no text of a specification


@dataclass(frozen=True, slots=True)
class Specification:
    """A specification as a unit of a program; the unit has no mission where the specification has errors."""

    source: Source
    tree: Tree | None
    unit: Unit
    diagnostics: tuple[Diagnostic, ...]

    def pointed(self, diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
        """The findings, those on this specification with a JSON Pointer to the value they are about."""
        places = None if self.tree is None else Places(self.tree)
        return tuple(self._pointed(diagnostic, places) for diagnostic in diagnostics)

    def _pointed(self, diagnostic: Diagnostic, places: Places | None) -> Diagnostic:
        span = diagnostic.span
        if span is None or span.file != self.source.file or diagnostic.pointer is not None:
            return diagnostic
        return replace(diagnostic, pointer="" if places is None else pointer(places.innermost(span)))


def parse_specification(file: str, data: bytes) -> Specification:
    """The specification that `data` is; never raises for what it says."""
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


def _hiding(source: Source, tree: Tree) -> Iterator[Diagnostic]:
    """The texts that hold a control character, or one that hides or reorders what a person reads."""
    for span in (*tree.keys.values(), *tree.spans.values()):
        written = source.text[span.start : span.end]
        if written.startswith('"'):
            text = json.loads(written)
            control = _CONTROL.search(text)
            at = hiding(text) if control is None else control.start()
            if at is not None:
                message = f"`{visible(text[at])}` hides or reorders what a person reads"
                help = "a specification has no control characters and nothing invisible in its texts"
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
    """A program of a specification and the sources that it is checked against.

    `policies` are sources named by the caller, beside what the specification imports from the library. What it claims
    beyond `pins` is a finding: an agent's word is no authority. The program's findings include the specification's;
    pass what compiling it finds through `Specification.pointed`.
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
            message = f"`{each.path}` is not of the library that ships"
            help = "a specification imports from `lib:policies/`, `lib:skills/` and `lib:missions/`, without `..`"
            found += specification.pointed([Diagnostic(IMPORT_PATH, message, each.span, help)])
            continue
        try:
            if resolved is not None:
                read(resolved)
                wanted.append(resolved)
                continue
            why = "there is no library here"
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
    source: Source, tree: Tree | None, unit: Unit | None, found: tuple[Diagnostic, ...]
) -> Specification:
    whole = Span(source.file, 0, len(source.text))
    if len(found) > MAX_FINDINGS + 1:
        found = (*found[:MAX_FINDINGS], uncounted(len(found) - MAX_FINDINGS, source.file))
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
