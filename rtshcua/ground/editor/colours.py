"""Semantic tokens: what a name is, where a grammar of patterns could not tell."""

from typing import Final, NamedTuple

from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.targets import Sort
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, TemplateDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import SkillDecl

#: the kinds, by their number; names of the protocol, so that every theme has colours for them
KINDS: Final = ("function", "variable", "parameter", "enumMember", "enum", "type", "class", "namespace", "macro",
                "property", "keyword", "struct")  # fmt: skip

_DECLARED: Final = {
    SkillDecl: "function", SignalDecl: "variable", EnumDecl: "enum", ZoneDecl: "class", VehicleDecl: "struct",
    TemplateDecl: "macro", PolicyDecl: "namespace", MissionDecl: "namespace",
}  # fmt: skip
_SORTS: Final = {
    Sort.PARAMETER: "parameter", Sort.MEMBER: "enumMember", Sort.CHOICE: "enumMember", Sort.PHASE: "property",
    Sort.ROLE: "type", Sort.SOURCE: "enumMember", Sort.CLASS: "enumMember", Sort.RECORD: "enumMember",
    Sort.TYPE: "type", Sort.MESSAGE: "struct", Sort.FIELD: "property", Sort.DIALECT_ENUM: "enum",
    Sort.REASON: "enumMember", Sort.WORD: "keyword", Sort.FAULT: "function",
}  # fmt: skip


class Colour(NamedTuple):
    """A range of characters, its kind's number in `KINDS`, and whether it gives the name."""

    start: int
    end: int
    kind: int
    declares: bool


def colours(view: View, file: str) -> tuple[Colour, ...]:
    """The names of a file, in the order of the text, none over another."""
    found: list[Colour] = []
    end = 0
    for each in view.occurrences(file):
        if each.span.start < end or each.target.sort in (Sort.IMPORT, Sort.PROPOSER):
            continue
        if each.target.sort is Sort.DECLARED:
            declared = view.symbols.declared.get(each.target.name)
            kind = None if declared is None else _DECLARED.get(type(declared))
        else:
            kind = _SORTS[each.target.sort]
        if kind is not None:
            found.append(Colour(each.span.start, each.span.end, KINDS.index(kind), each.declares))
            end = each.span.end
    return tuple(found)
