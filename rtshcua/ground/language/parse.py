"""Parse one text into the IR. Every error of the text is reported once, as a finding, never as an exception."""

import re
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

from rtshcua.diagnostics.codes import HIDDEN_CHARACTER, NOT_TEXT, TOO_MANY_FINDINGS
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import hiding, visible
from rtshcua.diagnostics.kinds import LOOKED_AT, FileKind, foreign
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.build.reader import MAX_FINDINGS, Enough, Reader
from rtshcua.ground.language.explain import explain
from rtshcua.ground.language.file_findings import MAX_SIZE, not_a_source, too_large, too_long
from rtshcua.ground.language.recovery import file_level, misread, pending, resume
from rtshcua.ground.language.size_limits import MAX_TOKENS
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RoleDecl, TemplateDecl
from rtshcua.model.ir.program import Import, Unit
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import SizesDecl, SkillDecl
from rtshcua.model.ir.tests import NominalDecl, TestDecl

T = TypeVar("T", bound=Node)

#: beginnings of other kinds of files that start with a letter
_FOREIGN = ("QGC WPL", "ULog", "PK", "c2sp.org/", "rtshcua/", "duty: ")
_TOKENS = re.compile(
    r"""//[^\n]*+ | /\*(?s:.)*?(?:\*/|\Z) | \s++
      | (?P<token>"[^"\\\n]*+(?:\\.[^"\\\n]*+){0,999}"? | [A-Za-z0-9_.]++ | .)""",
    re.VERBOSE,
)


@dataclass(frozen=True, slots=True)
class Parsed:
    """The declarations without errors, all findings in source order, and the names of the dropped declarations.

    With `broken` the checker does not report a name as unknown whose declaration has an error. `whole` is false if an
    import has an error: any name may then be declared in a file that was not read.
    """

    unit: Unit
    diagnostics: tuple[Diagnostic, ...]
    broken: frozenset[str]
    whole: bool = True


def parse(source: Source) -> Parsed:
    """Parse `source`. A text that is too large or not text gives one finding and no declarations."""
    reader = Reader(source)
    found = refused(source)
    if found is not None:
        reader.note(found)
    else:
        try:
            run(Automaton(reader), beginning(source))
        except Enough:
            help = f"correct the first {MAX_FINDINGS} errors, then check again"
            last = reader.diagnostics[-1].span
            reader.diagnostics.append(Diagnostic(TOO_MANY_FINDINGS, "the file has more errors", last, help))
    return parsed(source, reader.declarations, reader.diagnostics, frozenset(reader.broken), whole=reader.whole)


def parsed(
    source: Source, declarations: list[Node], found: list[Diagnostic], broken: frozenset[str], *, whole: bool
) -> Parsed:
    """The result of parsing a text, with the findings in source order."""
    ordered = tuple(sorted(found, key=lambda d: d.span.start if d.span else 0))
    return Parsed(_unit(source, declarations), ordered, broken, whole)


def refused(source: Source) -> Diagnostic | None:
    """The finding on a text that is not parsed at all; None if it is acceptable."""
    if len(source.text) > MAX_SIZE:
        return too_large(source.file, len(source.text))
    kind = _foreign(source)
    if kind is not None:
        return not_a_source(source.file, kind)
    nul = source.text.find("\0")
    if nul >= 0:
        help = "sources are plain UTF-8 text; this may be a compiled bundle"
        span = Span(source.file, nul, nul + 1)
        return Diagnostic(NOT_TEXT, "the file contains a NUL character", span, help)
    at = hiding(source.text, beginning(source))
    if at is not None:
        message = f"`{visible(source.text[at])}` is an invisible or reordering character"
        span = Span(source.file, at, at + 1)
        return Diagnostic(HIDDEN_CHARACTER, message, span, "remove it; comments and strings must not have it either")
    if len(source.text) > MAX_TOKENS and _exceeds(source.text, MAX_TOKENS):
        return too_long(source.file)
    return None


def _foreign(source: Source) -> FileKind | None:
    """The kind of a text that is not a source; most texts that start with a letter, as sources do, are not examined."""
    text = source.text
    if text[:1].isalpha() and not text.startswith(_FOREIGN):
        return None
    return foreign(text[:LOOKED_AT].encode("utf-8", "replace"), source.file)


def _exceeds(text: str, most: int) -> bool:
    """Whether a text has more than `most` tokens; stops at the limit."""
    tokens = (match for match in _TOKENS.finditer(text) if match.lastgroup)
    return next(islice(tokens, most, None), None) is not None


def beginning(source: Source) -> int:
    """The offset of the text after a byte order mark."""
    return 1 if source.text.startswith("\ufeff") else 0


def run(automaton: Automaton, start: int) -> None:
    """Parse from `start` to the end of the text, and recover after every failure."""
    reader = automaton.reader
    offset: int | None = start
    while offset is not None:
        failure = automaton.run(offset)
        if failure is None:
            return
        failure = misread(automaton, failure)
        reader.note(explain(automaton, failure))
        begun = pending(automaton)
        reader.whole = reader.whole and (begun is None or begun[0] != "import")
        offset = resume(automaton, failure.start)
        if offset is None or len(automaton.states) == file_level(automaton):
            if begun is not None and isinstance(begun[1], Name):
                reader.broken.add(begun[1].text)
            reader.settle()


def _unit(source: Source, declarations: list[Node]) -> Unit:
    def of(kind: type[T]) -> tuple[T, ...]:
        return tuple(node for node in declarations if isinstance(node, kind))

    return Unit(
        span=Span(source.file, 0, len(source.text)),
        file=source.file,
        imports=of(Import),
        enums=of(EnumDecl),
        signals=of(SignalDecl),
        zones=of(ZoneDecl),
        vehicles=of(VehicleDecl),
        skills=of(SkillDecl),
        policies=of(PolicyDecl),
        missions=of(MissionDecl),
        templates=of(TemplateDecl),
        nominals=of(NominalDecl),
        tests=of(TestDecl),
        scenarios=of(ScenarioDecl),
        roles=of(RoleDecl),
        sizes=of(SizesDecl),
    )
