"""The structure of a file: the outline of its declarations, folding ranges, and semantic tokens."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import Declaration
from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.occurrences import NameKind, declarations
from rtshcua.ground.editor.syntax import tokens
from rtshcua.ground.editor.workspace import ProgramView
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RoleDecl, TemplateDecl
from rtshcua.model.ir.program import Import
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import SizesDecl, SkillDecl
from rtshcua.model.ir.tests import TestDecl

#: the kinds of declarations, which are their first words
DECLARATION_KINDS = (
    "enum",
    "signal",
    "zone",
    "vehicle",
    "skill",
    "template",
    "policy",
    "mission",
    "nominal",
    "test",
    "scenario",
)


class OutlineSymbol(NamedTuple):
    """A named symbol: its kind, its whole span, the span of its name, and the symbols in it."""

    name: str
    kind: str
    whole: Span
    at: Span
    inner: tuple["OutlineSymbol", ...] = ()


class Fold(NamedTuple):
    """A range of characters over several lines; `kind` is empty, `comment` or `imports`."""

    start: int
    end: int
    kind: str = ""


def outline(cut: ParsedText) -> tuple[OutlineSymbol, ...]:
    """The declarations of a file, in source order."""
    return tuple(symbol for each in declarations(cut.parsed.unit) for symbol in _symbols(cut, each))


def _symbols(
    cut: ParsedText, node: Declaration | Import | TestDecl | ScenarioDecl | RoleDecl | SizesDecl
) -> Iterator[OutlineSymbol]:
    match node:
        case Import():
            return
        case RoleDecl():
            yield from (OutlineSymbol(name.text, "role", name.span, name.span) for name in node.names)
        case SizesDecl(skill=skill):
            sizes = tuple(OutlineSymbol(each.name.text, "parameter", each.span, each.name.span) for each in node.given)
            yield OutlineSymbol(f"sizes of {skill.text}", "skill", node.span, skill.span, sizes)
        case _:
            yield _symbol(cut, node)


def _symbol(cut: ParsedText, node: Declaration | TestDecl | ScenarioDecl) -> OutlineSymbol:
    name = node.name
    kind = next((kind for kind in DECLARATION_KINDS if cut.source.text.startswith(kind, node.span.start)), "")
    return OutlineSymbol(name.text or kind, kind, node.span, name.span, tuple(_inner(node)))


def _inner(node: Node) -> Iterator[OutlineSymbol]:
    match node:
        case EnumDecl():
            for member in node.members:
                yield OutlineSymbol(member.name.text, "member", member.span, member.name.span)
        case MissionDecl():
            for phase in node.phases:
                yield OutlineSymbol(phase.name.text, "phase", phase.span, phase.name.span)
        case _:
            for parameter in getattr(node, "parameters", ()):
                yield OutlineSymbol(parameter.name.text, "parameter", parameter.span, parameter.name.span)


def folds(cut: ParsedText) -> tuple[Fold, ...]:
    """The blocks, lists in brackets, comments and imports that span several lines."""
    text = cut.source.text
    found: list[Fold] = []
    opened: list[int] = []
    note_end = -1  # the end of a run of line comments, -1 if the last token was none
    for token in tokens(text):
        of_a_line = token.text.startswith("//")
        if of_a_line and note_end >= 0 and text[note_end : token.start].count("\n") == 1:
            found[-1] = found[-1]._replace(end=token.end)
        elif token.kind == "comment":
            found.append(Fold(token.start, token.end, "comment"))
        elif token.text in ("{", "("):
            opened.append(token.end)
        elif token.text in ("}", ")") and opened:
            found.append(Fold(opened.pop(), token.start))
        note_end = token.end if of_a_line else -1
    imports = cut.parsed.unit.imports
    if len(imports) > 1:
        found.append(Fold(imports[0].span.start, imports[-1].span.end, "imports"))
    return tuple(each for each in found if "\n" in text[each.start : each.end])


#: the kinds by number; these names of the protocol have colours in every theme
TOKEN_KINDS: Final = ("function", "variable", "parameter", "enumMember", "enum", "type", "class", "namespace", "macro",
                "property", "keyword", "struct")  # fmt: skip

_BY_DECLARATION: Final = {
    SkillDecl: "function", SignalDecl: "variable", EnumDecl: "enum", ZoneDecl: "class", VehicleDecl: "struct",
    TemplateDecl: "macro", PolicyDecl: "namespace", MissionDecl: "namespace",
}  # fmt: skip
_BY_NAME_KIND: Final = {
    NameKind.PARAMETER: "parameter", NameKind.MEMBER: "enumMember", NameKind.CHOICE: "enumMember",
    NameKind.PHASE: "property", NameKind.CAMERA: "property",
    NameKind.ROLE: "type", NameKind.SOURCE: "enumMember", NameKind.CLASS: "enumMember", NameKind.RECORD: "enumMember",
    NameKind.TYPE: "type", NameKind.MESSAGE: "struct", NameKind.FIELD: "property", NameKind.DIALECT_ENUM: "enum",
    NameKind.REASON: "enumMember", NameKind.WORD: "keyword", NameKind.FAULT: "function",
    NameKind.COMMAND: "struct", NameKind.MODE: "enumMember",
}  # fmt: skip


class SemanticToken(NamedTuple):
    """A range of characters, the number of its kind in `TOKEN_KINDS`, and whether it declares the name."""

    start: int
    end: int
    kind: int
    declares: bool


def semantic_tokens(view: ProgramView, file: str) -> tuple[SemanticToken, ...]:
    """The names of a file, in source order, without overlaps."""
    found: list[SemanticToken] = []
    end = 0
    for each in view.occurrences(file):
        if each.span.start < end or each.target.kind in (NameKind.IMPORT, NameKind.PROPOSER):
            continue
        if each.target.kind is NameKind.DECLARED:
            declared = view.symbols.declared.get(each.target.name)
            kind = None if declared is None else _BY_DECLARATION.get(type(declared))
        else:
            kind = _BY_NAME_KIND[each.target.kind]
        if kind is not None:
            found.append(SemanticToken(each.span.start, each.span.end, TOKEN_KINDS.index(kind), each.declares))
            end = each.span.end
    return tuple(found)
