"""Code completion: keywords from the parser's table, names by their use, import paths, and signatures."""

import posixpath
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from rtshcua.ground.checker.checks.accepts import MODES
from rtshcua.ground.checker.checks.contracts import CLASSES, RECORDS
from rtshcua.ground.checker.checks.emits import EMITTABLE
from rtshcua.ground.checker.checks.policies import SOURCES
from rtshcua.ground.checker.checks.roles import OPERATOR
from rtshcua.ground.checker.checks.scenarios import ENDS
from rtshcua.ground.checker.faults import NAMED as NAMED_FAULTS
from rtshcua.ground.checker.name_scope import LOCAL_TIME, PHASE, parameter_type, signal_type
from rtshcua.ground.checker.types import NAMED, Type
from rtshcua.ground.editor.cursor_context import (
    AcceptedSymbols,
    NameUse,
    OpenCall,
    accepted_symbols,
    accepts_before,
    in_sizes,
    last_declaration_start,
    name_use,
    open_call,
    tokens_before,
)
from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.keyword_help import KEYWORDS, REASONS, TYPES
from rtshcua.ground.editor.occurrences import NameKind, owned, parameters_owner
from rtshcua.ground.editor.syntax import Token, inside_comment_or_text, note_before, tokens
from rtshcua.ground.editor.workspace import ProgramView, Workspace
from rtshcua.ground.language.build.literals import DAYS
from rtshcua.ground.language.paths import LIBRARY, SHELVES, pack_of
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.faults import FaultField, parameters
from rtshcua.model.ir.policies import TemplateDecl
from rtshcua.model.ir.skills import ParameterDecl, SkillDecl
from rtshcua.model.quantity import UNITS, Dimension
from rtshcua.model.scenario import FLAVOURS

_ENDINGS = {"import": (".rts",), "from": (".geojson", ".json")}


class ImportPath(NamedTuple):
    """The part of a path before the cursor, its start, and the keyword before the path."""

    text: str
    start: int
    keyword: str


def import_path_at(text: str, offset: int, since: int) -> ImportPath | None:
    """Return the path at an offset; None if there is none."""
    last = ""
    for token in tokens(text, since, offset):
        if token.kind == "string" and token.start < offset and (offset < token.end or not _is_closed(token)):
            return ImportPath(text[token.start + 1 : offset], token.start + 1, last) if last in _ENDINGS else None
        if token.kind != "comment":
            last = token.text
    return None


def _is_closed(token: Token) -> bool:
    return len(token.text) > 1 and token.text.endswith('"')


def import_paths(workspace: Workspace, view: ProgramView, path: ImportPath, file: str) -> Iterator[str]:
    """Yield full paths that begin with the written part: in the library, in packs, and relative to this file."""
    endings = _ENDINGS[path.keyword]
    folder = path.text.rpartition("/")[0]
    written = f"{folder}/" if folder else ""
    pack = pack_of(path.text)
    if pack is not None:
        names = _names_in_pack(workspace, pack, folder.removeprefix(f"{pack}:"))
        yield from _continued_paths(written or f"{pack}:", names, endings)
        return
    if not folder and path.keyword == "import":
        yield from (f"{LIBRARY}{shelf}/" for shelf in SHELVES)
    siblings = workspace.names_in(posixpath.join(posixpath.dirname(file) or ".", written) or ".")
    yield from _continued_paths(written, [each for each in siblings if each != posixpath.basename(file)], endings)
    if not folder:
        yield "../"


def _names_in_pack(workspace: Workspace, pack: str, folder: str) -> list[str]:
    root = workspace.folder(pack)
    if root is None or ".." in folder.split("/"):
        return []
    return [
        each for each in workspace.names_in(posixpath.join(root, folder)) if folder or pack != "lib" or each in SHELVES
    ]


def _continued_paths(written: str, names: list[str], endings: tuple[str, ...]) -> Iterator[str]:
    for name in names:
        if name.endswith(endings):
            yield written + name
        elif "." not in name:
            yield f"{written}{name}/"


_WORD = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_."
_NAMES = {"<NAME>", "<LINK_NAME>", "<REASON>"}
_COMPARING = ("==", "!=", "<", "<=", ">", ">=", "in", "=")
#: kinds of tokens that are keywords only in some places, and their texts
_WRITTEN = {
    "<LOCAL_TIME>": (LOCAL_TIME,), "<_GROW>": ("grow",), "<_CIRCLE>": ("circle",), "<_POLYGON>": ("polygon",),
    "<_CORRIDOR>": ("corridor",), "<COMBINE>": ("union", "difference"), "<FUNCTION>": ("abs", "min", "max"),
    "<_REPEAT>": ("repeat",), "<_RISING>": ("rising",), "<_FALLING>": ("falling",), "<_ONE_OF>": ("one of",),
    "<_ON_INADMISSIBLE>": ("on inadmissible",),
}  # fmt: skip


class CompletionItem(NamedTuple):
    """A proposal: the inserted text, its kind, and a short description."""

    text: str
    kind: str
    detail: str = ""
    start: int = 0  # of the text that it replaces


def complete(
    workspace: Workspace, view: ProgramView, cut: ParsedText, offset: int, dialect: Dialect
) -> tuple[CompletionItem, ...]:
    """Return the distinct proposals at an offset. The editor filters them by the typed text."""
    text = cut.source.text
    since = last_declaration_start(cut, offset)
    path = import_path_at(text, offset, since)
    if path is not None:
        return tuple(
            CompletionItem(each, "file", start=path.start)
            for each in import_paths(workspace, view, path, cut.source.file)
        )
    if inside_comment_or_text(text, offset, since):
        return ()
    start = offset
    while start > since and text[start - 1] in _WORD:
        start -= 1
    if start < offset and text[start].isdigit():  # `20` or `20m`: propose a unit after the digits
        while start < offset and text[start] in "0123456789_.":
            start += 1
    written = tokens_before(text, start, since)
    here = accepted_symbols(cut, start)
    found = _Proposals(view, dialect, written, here)
    dot = text.rfind(".", start, offset)
    items = found.items() if dot < 0 or name_use(written) is not NameUse.MESSAGE else found.fields(text[start:dot])
    return tuple(dict.fromkeys(item._replace(start=start) for item in items))


class _VisibleParameter(NamedTuple):
    """A parameter that is visible at the cursor."""

    name: str
    kind: str
    type: Type | None

    @staticmethod
    def of(parameter: ParameterDecl) -> "_VisibleParameter":
        """Make it from a declaration."""
        return _VisibleParameter(parameter.name.text, parameter.type.text, parameter_type(parameter))


class _Proposals:
    def __init__(self, view: ProgramView, dialect: Dialect, written: list[Token], here: AcceptedSymbols) -> None:
        self.view, self.symbols, self.dialect, self.written, self.here = view, view.symbols, dialect, written, here

    def items(self) -> Iterator[CompletionItem]:
        """Yield names, then units, then keywords."""
        call = open_call(self.written)
        if self.here.symbols & _NAMES:
            yield from self._named(name_use(self.written), call)
        if "<FAULT>" in self.here.symbols:
            for name, fault in NAMED_FAULTS.items():
                yield CompletionItem(f"{name}(", "fault", ", ".join(each.name for each in parameters(fault)))
        if "<UNIT>" in self.here.symbols:
            yield from self._units(call)
        for word in self.here.words:
            yield CompletionItem(word, "keyword", KEYWORDS.get(word.split(" ", maxsplit=1)[0], ""))
        for symbol, words in _WRITTEN.items():
            if symbol in self.here.symbols:
                yield from (CompletionItem(word, "keyword", KEYWORDS.get(word, "")) for word in words)

    def fields(self, message: str) -> Iterator[CompletionItem]:
        """Yield the fields of a message of the dialect."""
        known = self.dialect.messages.get(message)
        for name, field in () if known is None else known.fields.items():
            yield CompletionItem(f"{message}.{name}", "field", field.unit)

    def _named(self, use: NameUse, call: OpenCall | None) -> Iterator[CompletionItem]:
        symbols = self.symbols
        tables: Mapping[NameUse, Iterable[str]] = {
            NameUse.SKILL: symbols.skills, NameUse.ZONE: symbols.zones, NameUse.POLICY: symbols.policies,
            NameUse.VEHICLE: symbols.vehicles, NameUse.TEMPLATE: symbols.templates, NameUse.SIGNAL: symbols.signals,
            NameUse.CLASS: CLASSES, NameUse.RECORD: RECORDS, NameUse.SOURCE: SOURCES, NameUse.REASON: REASONS,
            NameUse.ROLE: (OPERATOR, *symbols.roles), NameUse.PHASE: self._all(NameKind.PHASE),
            NameUse.CAMERA: self._all(NameKind.CAMERA), NameUse.MESSAGE: self.dialect.messages,
            NameUse.DIALECT_ENUM: self.dialect.enums, NameUse.TYPE: (*TYPES, *symbols.enums),
            NameUse.MISSION: symbols.missions, NameUse.AUTOPILOT: FLAVOURS, NameUse.ENDING: ENDS,
            NameUse.DAY: DAYS, NameUse.NOTHING: (),
            NameUse.NOMINAL: [each.name.text for unit in self.view.units.values() for each in unit.nominals],
        }  # fmt: skip
        match use:
            case NameUse.STEP:
                yield from (
                    CompletionItem(f"{name}(", "skill", self._takes(skill)) for name, skill in symbols.skills.items()
                )
            case NameUse.VALUE:
                yield from self._values()
            case NameUse.COMPARED:
                yield from self._members()
                yield from self._values()
            case NameUse.ARGUMENT:
                yield from self._arguments(call)
            case NameUse.COMMAND | NameUse.MODE | NameUse.FIELD:
                yield from self._accepted(use)
            case NameUse.PARAMETER:
                yield from self._parameters()
            case _:
                yield from (CompletionItem(name, use.value, KEYWORDS.get(name, "")) for name in tables[use])
                if use is NameUse.ZONE:
                    zones = (each for each in self._own() if each.kind == "zone")
                    yield from (CompletionItem(each.name, "parameter", "zone") for each in zones)

    def _accepted(self, use: NameUse) -> Iterator[CompletionItem]:
        """The names of MAVLink in an `accepts`: commands, modes, and fields of its command or message."""
        emits = accepts_before(self.written, "emits")
        if use is NameUse.COMMAND:
            yield from (CompletionItem(name, use.value) for name in (EMITTABLE if emits else self.dialect.commands))
            return
        if use is NameUse.MODE:
            yield from _modes()
            return
        names = [token.text for token in emits or accepts_before(self.written)]
        commands, messages = self.dialect.commands, self.dialect.messages
        declared = [messages[name].fields for name in names if name in messages]
        declared += [commands[name] for name in names if name in commands]
        for name, field in declared[0].items() if declared else ():
            yield CompletionItem(name, "field", " ".join(filter(None, (field.label, field.unit))))

    def _parameters(self) -> Iterator[CompletionItem]:
        """The visible parameters."""
        yield from (CompletionItem(each.name, "parameter", each.kind) for each in self._own())

    def _values(self) -> Iterator[CompletionItem]:
        yield from self._parameters()
        for name, signal in self.symbols.signals.items():
            yield CompletionItem(name, "signal", signal.type.text)
        for name, zone in self.symbols.zones.items():
            yield CompletionItem(name, "zone")
            if zone.entry is not None:
                yield CompletionItem(f"{name}.entry", "zone", "position")
        yield CompletionItem(PHASE, "keyword", KEYWORDS[PHASE])

    def _members(self) -> Iterator[CompletionItem]:
        """The possible values of the compared subject, or of a cell's subject."""
        subject = self._subject()
        if subject == PHASE:
            yield from (CompletionItem(name, "phase") for name in self._all(NameKind.PHASE))
        type = self._type_of(subject)
        if type is not None and type.enumeration is not None:
            for name, value in type.enumeration.members.items():
                yield CompletionItem(name, "member", f"{type.enumeration.name} = {value}")

    def _fault_fields(self, call: OpenCall | None) -> Mapping[str, FaultField] | None:
        """The fields of the fault whose arguments contain the cursor; None if there is none."""
        fault = None if call is None or self.written[0].text != "scenario" else NAMED_FAULTS.get(call.name)
        return None if fault is None else {each.name: each for each in parameters(fault)}

    def _arguments(self, call: OpenCall | None) -> Iterator[CompletionItem]:
        declared = None if call is None else _called(self.view, call)
        begins = bool(self.written) and self.written[-1].text in ("(", ",")
        fields = self._fault_fields(call)
        if call is None or (fields is None and declared is None):
            yield from self._values()
        elif fields is not None:
            field = fields.get(call.argument or "")
            if begins:
                yield from (CompletionItem(f"{name} = ", "parameter") for name in fields if name not in call.named)
            elif field is not None:
                yield from (CompletionItem(word, "member") for word in field.words)
        elif declared is not None:
            yield from self._arguments_of(declared, call, begins=begins)

    def _arguments_of(
        self, declared: SkillDecl | TemplateDecl, call: OpenCall, *, begins: bool
    ) -> Iterator[CompletionItem]:
        """Names of arguments where one begins, then the values for the present one."""
        parameters = _accepted_arguments(declared, self.written)
        for each in parameters if begins else ():
            if each.name.text not in call.named:
                yield CompletionItem(f"{each.name.text} = ", "parameter", each.type.text)
        here = {each.name.text: each for each in parameters}.get(call.argument or "")
        if here is None and call.position < len(parameters):
            here = parameters[call.position]
        yield from self._values() if here is None else self._fitting(here)

    def _fitting(self, parameter: ParameterDecl) -> Iterator[CompletionItem]:
        kind = parameter.type.text
        yield from (CompletionItem(choice.text, "member", parameter.name.text) for choice in parameter.choices)
        if kind == "zone":
            yield from (CompletionItem(name, "zone") for name in self.symbols.zones)
        if kind == "position":
            entries = (name for name, zone in self.symbols.zones.items() if zone.entry is not None)
            yield from (CompletionItem(f"{name}.entry", "zone", "position") for name in entries)
        if kind == "role":
            yield from (CompletionItem(name, "role") for name in (OPERATOR, *self.symbols.roles))
        yield from (CompletionItem(each.name, "parameter", each.kind) for each in self._own())

    def _units(self, call: OpenCall | None) -> Iterator[CompletionItem]:
        type = self._type_of(self._subject())
        dimension = None if type is None else type.dimension
        field = (self._fault_fields(call) or {}).get("" if call is None else call.argument or "")
        if field is not None and field.unit is not None:
            dimension = field.unit.dimension
        wanted = Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension
        for name, unit in UNITS.items():
            if wanted in (None, unit.dimension):
                yield CompletionItem(name, "unit", unit.dimension.value)

    def _subject(self) -> str:
        """The name that is compared with, or assigned, the value at the cursor."""
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

    def _own(self) -> tuple[_VisibleParameter, ...]:
        """The visible parameters: of the declaration, or of the skills that the rule names."""
        names = [token.text for token in self.written if token.kind == "word"]
        if names and names[0] in ("skill", "template", "mission") and len(names) > 1:
            declared = parameters_owner(self.symbols, names[1])
            return tuple(self._incomplete_own() if declared is None else map(_VisibleParameter.of, owned(declared)))
        rules = ("permit", "forbid", "confirm", "degrade", "delegate")
        last = max((at for at, name in enumerate(names) if name in rules), default=len(names))
        skills = [self.symbols.skills[each] for each in names[last:] if each in self.symbols.skills]
        return tuple(_VisibleParameter.of(parameter) for skill in skills for parameter in skill.parameters)

    def _incomplete_own(self) -> Iterator[_VisibleParameter]:
        """The parameters of an incomplete declaration."""
        for name, colon, kind in zip(self.written, self.written[1:], self.written[2:], strict=False):
            if colon.text == "{":
                return
            if colon.text == ":" and name.kind == kind.kind == "word":
                yield _VisibleParameter(name.text, kind.text, NAMED.get(kind.text))

    def _all(self, kind: NameKind) -> tuple[str, ...]:
        """All names of a kind in the program."""
        found = (each.target for file in self.view.units for each in self.view.occurrences(file))
        return tuple(dict.fromkeys(target.name for target in found if target.kind is kind))

    def _takes(self, skill: SkillDecl) -> str:
        return ", ".join(each.name.text for each in skill.parameters)


def _called(view: ProgramView, call: OpenCall) -> SkillDecl | TemplateDecl | None:
    return view.symbols.skills.get(call.name) or view.symbols.templates.get(call.name)


def _modes() -> Iterator[CompletionItem]:
    """The flight modes of both autopilots."""
    for autopilot, modes in MODES.items():
        yield from (CompletionItem(name, NameUse.MODE.value, autopilot) for name in modes.__members__)


def _accepted_arguments(declared: SkillDecl | TemplateDecl, written: list[Token]) -> tuple[ParameterDecl, ...]:
    """The parameters of a called skill or template; in a `sizes` declaration the sizes of the skill."""
    return declared.sizes if isinstance(declared, SkillDecl) and in_sizes(written) else declared.parameters


class Signature(NamedTuple):
    """The declaration of a called skill or template, its parameters, and the index of the present one."""

    label: str
    parameters: tuple[str, ...]
    active: int
    note: str


def signature(view: ProgramView, cut: ParsedText, offset: int) -> Signature | None:
    """Return the signature of the call at an offset; None if there is none."""
    written = tokens_before(cut.source.text, offset, last_declaration_start(cut, offset))
    call = open_call(written)
    declared = None if call is None else _called(view, call)
    if call is None or declared is None:
        return None
    accepted = _accepted_arguments(declared, written)
    parameters = tuple(" ".join(view.slice(each.span).split()) for each in accepted)
    names = [each.name.text for each in accepted]
    active = names.index(call.argument) if call.argument in names else call.position
    note = note_before(view.text(declared.span.file), declared.span.start)
    return Signature(f"{call.name}({', '.join(parameters)})", parameters, min(active, len(names)), note)
