"""The shape of a file: its declarations with what is in them, and what may be folded."""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.symbols import Declaration
from rtshcua.ground.editor.occurrences import declarations
from rtshcua.ground.editor.pieces import Cut
from rtshcua.ground.editor.syntax import tokens
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.policies import RoleDecl
from rtshcua.model.ir.program import Import
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.signals import EnumDecl
from rtshcua.model.ir.skills import SizesDecl
from rtshcua.model.ir.tests import TestDecl

#: what a declaration is, by its first word
KINDS = ("enum", "signal", "zone", "vehicle", "skill", "template", "policy", "mission", "nominal", "test", "scenario")


class Symbol(NamedTuple):
    """Something that has a name: what kind, where it is whole, where its name stands, and what is in it."""

    name: str
    kind: str
    whole: Span
    at: Span
    inner: tuple["Symbol", ...] = ()


class Fold(NamedTuple):
    """A range of characters over several lines; `kind` is empty, `comment` or `imports`."""

    start: int
    end: int
    kind: str = ""


def outline(cut: Cut) -> tuple[Symbol, ...]:
    """The declarations of a file, in the order of the text."""
    return tuple(symbol for each in declarations(cut.parsed.unit) for symbol in _symbols(cut, each))


def _symbols(cut: Cut, node: Declaration | Import | TestDecl | ScenarioDecl | RoleDecl | SizesDecl) -> Iterator[Symbol]:
    match node:
        case Import():
            return
        case RoleDecl():
            yield from (Symbol(name.text, "role", name.span, name.span) for name in node.names)
        case SizesDecl(skill=skill):
            given = tuple(Symbol(each.name.text, "parameter", each.span, each.name.span) for each in node.given)
            yield Symbol(f"sizes of {skill.text}", "skill", node.span, skill.span, given)
        case _:
            yield _symbol(cut, node)


def _symbol(cut: Cut, node: Declaration | TestDecl | ScenarioDecl) -> Symbol:
    name = node.name
    kind = next((kind for kind in KINDS if cut.source.text.startswith(kind, node.span.start)), "")
    return Symbol(name.text or kind, kind, node.span, name.span, tuple(_inner(node)))


def _inner(node: Node) -> Iterator[Symbol]:
    match node:
        case EnumDecl():
            for member in node.members:
                yield Symbol(member.name.text, "member", member.span, member.name.span)
        case MissionDecl():
            for phase in node.phases:
                yield Symbol(phase.name.text, "phase", phase.span, phase.name.span)
        case _:
            for parameter in getattr(node, "parameters", ()):
                yield Symbol(parameter.name.text, "parameter", parameter.span, parameter.name.span)


def folds(cut: Cut) -> tuple[Fold, ...]:
    """Blocks and lists in brackets, comments of several lines, and the imports, as far as they go over lines."""
    text = cut.source.text
    found: list[Fold] = []
    opened: list[int] = []
    note: tuple[int, int] | None = None  # comments, line after line
    for token in tokens(text):
        if token.kind == "comment" and token.text.startswith("//"):
            follows = note is not None and text[note[1] : token.start].count("\n") == 1
            note = (note[0] if follows and note is not None else token.start, token.end)
            continue
        if note is not None:
            found.append(Fold(*note, "comment"))
            note = None
        if token.kind == "comment":
            found.append(Fold(token.start, token.end, "comment"))
        elif token.text in ("{", "("):
            opened.append(token.end)
        elif token.text in ("}", ")") and opened:
            found.append(Fold(opened.pop(), token.start))
    if note is not None:
        found.append(Fold(*note, "comment"))
    imports = cut.parsed.unit.imports
    if len(imports) > 1:
        found.append(Fold(imports[0].span.start, imports[-1].span.end, "imports"))
    return tuple(each for each in found if "\n" in text[each.start : each.end])
