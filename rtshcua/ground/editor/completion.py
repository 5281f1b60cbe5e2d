"""What may be written at a place: words and marks by the parser's table, names by what the place asks for."""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from rtshcua.ground.checker.checks.contracts import CLASSES, RECORDS
from rtshcua.ground.checker.checks.policies import SOURCES
from rtshcua.ground.checker.checks.roles import OPERATOR
from rtshcua.ground.checker.checks.scenarios import ENDS
from rtshcua.ground.checker.faults import NAMED as NAMED_FAULTS
from rtshcua.ground.checker.scope import LOCAL_TIME, PHASE, parameter_type, signal_type
from rtshcua.ground.checker.types import NAMED, Type
from rtshcua.ground.editor.desk import Desk, View
from rtshcua.ground.editor.imports import import_paths, quoted
from rtshcua.ground.editor.meanings import KEYWORDS, REASONS, TYPES
from rtshcua.ground.editor.pieces import Cut
from rtshcua.ground.editor.places import Asked, Call, Wanted, asked, before, call_of, sizing, wanted
from rtshcua.ground.editor.syntax import Token, inside_comment_or_text
from rtshcua.ground.editor.targets import Sort
from rtshcua.ground.language.build.literals import DAYS
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.faults import FaultField as FaultParameter
from rtshcua.model.faults import parameters
from rtshcua.model.ir.skills import Parameter, SkillDecl
from rtshcua.model.quantity import UNITS, Dimension
from rtshcua.model.scenario import FLAVOURS

_WORD = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_."
_NAMES = {"<NAME>", "<LINK_NAME>", "<REASON>"}
_COMPARING = ("==", "!=", "<", "<=", ">", ">=", "in", "=")
#: kinds of token that are words where they stand, and how they are written
_WRITTEN = {
    "<LOCAL_TIME>": (LOCAL_TIME,), "<_GROW>": ("grow",), "<_CIRCLE>": ("circle",), "<_POLYGON>": ("polygon",),
    "<_CORRIDOR>": ("corridor",), "<COMBINE>": ("union", "difference"), "<FUNCTION>": ("abs", "min", "max"),
    "<_REPEAT>": ("repeat",), "<_RISING>": ("rising",), "<_FALLING>": ("falling",), "<_ONE_OF>": ("one of",),
    "<_ON_INADMISSIBLE>": ("on inadmissible",),
}  # fmt: skip


class Item(NamedTuple):
    """One proposal: what is inserted, what kind of thing it is, and a few words about it."""

    text: str
    kind: str
    detail: str = ""
    start: int = 0  # where the text that it replaces begins


def complete(desk: Desk, view: View, cut: Cut, offset: int, dialect: Dialect) -> tuple[Item, ...]:
    """Proposals for a place, each once; filtering by what was typed is the editor's."""
    text = cut.source.text
    since = max((piece.start for piece in cut.pieces if piece.firm and piece.start <= offset), default=0)
    path = quoted(text, offset, since)
    if path is not None:
        return tuple(Item(each, "file", start=path.start) for each in import_paths(desk, view, path, cut.source.file))
    if inside_comment_or_text(text, offset, since):
        return ()
    start = offset
    while start > since and text[start - 1] in _WORD:
        start -= 1
    if start < offset and text[start].isdigit():  # `20` or `20m`: a unit is asked behind the digits
        while start < offset and text[start] in "0123456789_.":
            start += 1
    written = before(text, start, since)
    here = asked(cut, start)
    found = _Proposals(view, dialect, written, here)
    dot = text.rfind(".", start, offset)
    items = found.items() if dot < 0 or wanted(written) is not Wanted.MESSAGE else found.fields(text[start:dot])
    return tuple(dict.fromkeys(item._replace(start=start) for item in items))


class _Own(NamedTuple):
    """A parameter that is visible at a place."""

    name: str
    kind: str
    type: Type | None

    @staticmethod
    def of(parameter: Parameter) -> "_Own":
        """A parameter that was read."""
        return _Own(parameter.name.text, parameter.type.text, parameter_type(parameter))


class _Proposals:
    def __init__(self, view: View, dialect: Dialect, written: list[Token], here: Asked) -> None:
        self.view, self.symbols, self.dialect, self.written, self.here = view, view.symbols, dialect, written, here

    def items(self) -> Iterator[Item]:
        """Names first, then units, then words."""
        call = call_of(self.written)
        if self.here.symbols & _NAMES:
            yield from self._named(wanted(self.written), call)
        if "<FAULT>" in self.here.symbols:
            for name, fault in NAMED_FAULTS.items():
                yield Item(f"{name}(", "fault", ", ".join(each.name for each in parameters(fault)))
        if "<UNIT>" in self.here.symbols:
            yield from self._units(call)
        for word in self.here.words:
            yield Item(word, "keyword", KEYWORDS.get(word.split(" ", maxsplit=1)[0], ""))
        for symbol, words in _WRITTEN.items():
            if symbol in self.here.symbols:
                yield from (Item(word, "keyword", KEYWORDS.get(word, "")) for word in words)

    def fields(self, message: str) -> Iterator[Item]:
        """The fields of a message of the dialect."""
        known = self.dialect.messages.get(message)
        for name, field in () if known is None else known.fields.items():
            yield Item(f"{message}.{name}", "field", field.unit)

    def _named(self, what: Wanted, call: Call | None) -> Iterator[Item]:
        symbols = self.symbols
        tables: Mapping[Wanted, Iterable[str]] = {
            Wanted.SKILL: symbols.skills, Wanted.ZONE: symbols.zones, Wanted.POLICY: symbols.policies,
            Wanted.VEHICLE: symbols.vehicles, Wanted.TEMPLATE: symbols.templates, Wanted.SIGNAL: symbols.signals,
            Wanted.CLASS: CLASSES, Wanted.RECORD: RECORDS, Wanted.SOURCE: SOURCES, Wanted.REASON: REASONS,
            Wanted.ROLE: (OPERATOR, *symbols.roles), Wanted.PHASE: self._all(Sort.PHASE), Wanted.MESSAGE:
            self.dialect.messages, Wanted.DIALECT_ENUM: self.dialect.enums, Wanted.TYPE: (*TYPES, *symbols.enums),
            Wanted.MISSION: symbols.missions, Wanted.AUTOPILOT: FLAVOURS, Wanted.ENDING: ENDS,
            Wanted.DAY: DAYS,
            Wanted.NOMINAL: [each.name.text for unit in self.view.units.values() for each in unit.nominals],
        }  # fmt: skip
        match what:
            case Wanted.STEP:
                yield from (Item(f"{name}(", "skill", self._takes(skill)) for name, skill in symbols.skills.items())
            case Wanted.VALUE:
                yield from self._values()
            case Wanted.COMPARED:
                yield from self._members()
                yield from self._values()
            case Wanted.ARGUMENT:
                yield from self._arguments(call)
            case Wanted.PARAMETER:
                yield from (Item(each.name, "parameter", each.kind) for each in self._own())
            case Wanted.NOTHING:
                return
            case _:
                yield from (Item(name, what.value, KEYWORDS.get(name, "")) for name in tables[what])
                if what is Wanted.ZONE:
                    zones = (each for each in self._own() if each.kind == "zone")
                    yield from (Item(each.name, "parameter", "zone") for each in zones)

    def _values(self) -> Iterator[Item]:
        for each in self._own():
            yield Item(each.name, "parameter", each.kind)
        for name, signal in self.symbols.signals.items():
            yield Item(name, "signal", signal.type.text)
        for name, zone in self.symbols.zones.items():
            yield Item(name, "zone")
            if zone.entry is not None:
                yield Item(f"{name}.entry", "zone", "position")
        yield Item(PHASE, "keyword", KEYWORDS[PHASE])

    def _members(self) -> Iterator[Item]:
        """The values of what is compared, or of what a cell is about."""
        subject = self._subject()
        if subject == PHASE:
            yield from (Item(name, "phase") for name in self._all(Sort.PHASE))
        type = self._type_of(subject)
        if type is not None and type.enumeration is not None:
            for name, value in type.enumeration.members.items():
                yield Item(name, "member", f"{type.enumeration.name} = {value}")

    def _of_fault(self, call: Call | None) -> Mapping[str, FaultParameter] | None:
        """What may be said of the fault that a place is among the arguments of; None where it is in none."""
        fault = None if call is None or self.written[0].text != "scenario" else NAMED_FAULTS.get(call.name)
        return None if fault is None else {each.name: each for each in parameters(fault)}

    def _arguments(self, call: Call | None) -> Iterator[Item]:
        symbols, of_fault = self.symbols, self._of_fault(call)
        if call is not None and of_fault is not None:
            if self.written[-1].text in ("(", ","):
                yield from (Item(f"{name} = ", "parameter") for name in of_fault if name not in call.named)
            else:
                said = of_fault.get(call.argument or "")
                yield from (Item(word, "member") for word in (() if said is None else said.words))
            return
        owner = None if call is None else symbols.skills.get(call.name) or symbols.templates.get(call.name)
        if owner is not None and call is not None:
            parameters = owner.parameters
            if isinstance(owner, SkillDecl) and sizing(self.written):
                parameters = owner.sizes
            if self.written[-1].text in ("(", ","):
                for each in parameters:
                    if each.name.text not in call.named:
                        yield Item(f"{each.name.text} = ", "parameter", each.type.text)
            by_name = {each.name.text: each for each in parameters}
            place = by_name.get(call.argument or "")
            if place is None and call.position < len(parameters):
                place = parameters[call.position]
            if place is not None:
                yield from self._fitting(place)
                return
        yield from self._values()

    def _fitting(self, parameter: Parameter) -> Iterator[Item]:
        kind = parameter.type.text
        yield from (Item(choice.text, "member", parameter.name.text) for choice in parameter.choices)
        if kind == "zone":
            yield from (Item(name, "zone") for name in self.symbols.zones)
        if kind == "position":
            entries = (name for name, zone in self.symbols.zones.items() if zone.entry is not None)
            yield from (Item(f"{name}.entry", "zone", "position") for name in entries)
        if kind == "role":
            yield from (Item(name, "role") for name in (OPERATOR, *self.symbols.roles))
        yield from (Item(each.name, "parameter", each.kind) for each in self._own())

    def _units(self, call: Call | None) -> Iterator[Item]:
        type = self._type_of(self._subject())
        dimension = None if type is None else type.dimension
        said = (self._of_fault(call) or {}).get("" if call is None else call.argument or "")
        if said is not None and said.unit is not None:
            dimension = said.unit.dimension
        asked_for = Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension
        for name, unit in UNITS.items():
            if asked_for in (None, unit.dimension):
                yield Item(name, "unit", unit.dimension.value)

    def _subject(self) -> str:
        """The name that is compared with, or given, what stands here."""
        braces = [at for at, token in enumerate(self.written) if token.text == "{"]
        listing = bool(braces) and self.written[braces[-1] - 1].text == "in"  # `in {a, b, `
        for number in range(len(self.written) - 1, 0, -1):
            token = self.written[number]
            if token.text in _COMPARING:
                return self.written[number - 1].text
            if token.kind == "word" and token.text not in UNITS and not listing:
                break
        return ""

    def _type_of(self, name: str) -> Type | None:
        own = next((each for each in self._own() if each.name == name), None)
        if own is not None:
            return own.type
        signal = self.symbols.signals.get(name)
        return NAMED.get(name) if signal is None else signal_type(self.symbols, signal)

    def _own(self) -> tuple[_Own, ...]:
        """The parameters that are visible: of the declaration, or of the skills that the rule names."""
        names = [token.text for token in self.written if token.kind == "word"]
        if not names:
            return ()
        symbols = self.symbols
        if names[0] in ("skill", "template", "mission") and len(names) > 1:
            declared = symbols.skills.get(names[1]) or symbols.templates.get(names[1]) or symbols.missions.get(names[1])
            if declared is None:
                return tuple(self._written_own())
            sizes = declared.sizes if isinstance(declared, SkillDecl) else ()
            return tuple(map(_Own.of, (*declared.parameters, *sizes)))
        rules = ("permit", "forbid", "confirm", "degrade", "delegate")
        last = max((at for at, name in enumerate(names) if name in rules), default=None)
        skills = [] if last is None else [symbols.skills[each] for each in names[last:] if each in symbols.skills]
        return tuple(_Own.of(parameter) for skill in skills for parameter in skill.parameters)

    def _written_own(self) -> Iterator[_Own]:
        """The parameters of a declaration that is not whole."""
        for name, colon, kind in zip(self.written, self.written[1:], self.written[2:], strict=False):
            if colon.text == "{":
                return
            if colon.text == ":" and name.kind == kind.kind == "word":
                yield _Own(name.text, kind.text, NAMED.get(kind.text))

    def _all(self, sort: Sort) -> tuple[str, ...]:
        """All names of a sort that the program has anywhere."""
        found = (each.target for file in self.view.units for each in self.view.occurrences(file))
        return tuple(dict.fromkeys(target.name for target in found if target.sort is sort))

    def _takes(self, skill: SkillDecl) -> str:
        return ", ".join(each.name.text for each in skill.parameters)
