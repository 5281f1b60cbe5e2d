"""What a person sees who points at something: what it is, in Markdown."""

from collections.abc import Iterator
from inspect import getdoc
from typing import NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.faults import NAMED, example
from rtshcua.ground.checker.symbols import WORDS, Declaration
from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.meanings import KEYWORDS, REASONS, TYPES
from rtshcua.ground.editor.occurrences import at
from rtshcua.ground.editor.quantities import told_number
from rtshcua.ground.editor.sizes import size_of
from rtshcua.ground.editor.syntax import note_before, path_to, token_at
from rtshcua.ground.editor.targets import Occurrence, Sort, Target
from rtshcua.mavlink.dialect import DATUM, Dialect
from rtshcua.model.faults import parameters
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import Parameter, SkillDecl
from rtshcua.model.quantity import Dimension, display

_LONG = 40  # lines of a declaration that are shown


class Hover(NamedTuple):
    """Markdown, and the text that it is about."""

    text: str
    span: Span


def hover(view: View, file: str, offset: int, dialect: Dialect) -> Hover | None:
    """What stands at a place; None where nothing does that could be explained."""
    found = at(view.occurrences(file), offset)
    said = list(dict.fromkeys(text for each in found if (text := told(view, each.target, dialect))))
    if said:
        return Hover("\n\n---\n\n".join(said[:3]), found[0].span)
    unit = view.units.get(file)
    path = () if unit is None else path_to(unit, offset)
    if path and isinstance(path[-1], Quantity):
        return Hover(told_number(path[-1]), path[-1].span)
    return _word(view, file, offset, found)


def _word(view: View, file: str, offset: int, found: tuple[Occurrence, ...]) -> Hover | None:
    token = token_at(view.text(file), offset)
    if token is None or token.kind not in ("word", "mark"):
        return None
    span = Span(file, token.start, token.end)
    word = found[0].target.name if found else token.text
    declared = view.symbols.declared.get(word)
    if declared is not None:
        return Hover(_declaration(view, declared, None), span)
    meaning = KEYWORDS.get(word)
    return None if meaning is None else Hover(f"`{word}`: {meaning}", span)


def told(view: View, target: Target, dialect: Dialect) -> str | None:
    """A target in words."""
    match target.sort:
        case Sort.DECLARED:
            declared = view.symbols.declared.get(target.name)
            return None if declared is None else _declaration(view, declared, dialect)
        case Sort.PARAMETER:
            parameter = parameter_of(view, target.owner, target.name)
            return None if parameter is None else _parameter(view, parameter, target.owner)
        case Sort.MEMBER:
            enum = view.symbols.enums.get(target.owner)
            value = next((each.value for each in enum.members if each.name.text == target.name), None) if enum else None
            return f"`{target.name}` = {value}, a value of `{target.owner}`"
        case Sort.CHOICE:
            skill, _, parameter_name = target.owner.partition(".")
            return f"`{target.name}`: a choice for `{parameter_name}` of `{skill}`"
        case Sort.PHASE:
            return f"phase `{target.name}`: a stretch of a mission"
        case Sort.ROLE:
            return f"role `{target.name}`. {KEYWORDS['role']}"
        case Sort.REASON:
            meaning = REASONS.get(target.name)
            return f"`{target.name}`" if meaning is None else f"`{target.name}`: {meaning}"
        case Sort.TYPE:
            return f"`{target.name}`: {TYPES[target.name]}" if target.name in TYPES else None
        case Sort.FIELD | Sort.MESSAGE | Sort.DIALECT_ENUM:
            return _dialect(target, dialect)
        case Sort.SOURCE | Sort.CLASS | Sort.RECORD | Sort.WORD:
            meaning = KEYWORDS.get(target.name)
            return f"{target.sort.value} `{target.name}`" + ("" if meaning is None else f": {meaning}")
        case Sort.FAULT:
            return _fault(target.name)
        case Sort.IMPORT:
            return _import(view, target)
        case _:
            return f"{target.sort.value} `{target.name}`"


def parameter_of(view: View, owner: str, name: str) -> Parameter | None:
    """A parameter by its owner's name and its own."""
    symbols = view.symbols
    declared = symbols.skills.get(owner) or symbols.templates.get(owner) or symbols.missions.get(owner)
    parameters = () if declared is None else declared.parameters
    if isinstance(declared, SkillDecl):
        parameters += declared.sizes
    return next((each for each in parameters if each.name.text == name), None)


def _declaration(view: View, declared: Declaration, dialect: Dialect | None) -> str:
    source = view.slice(declared.span)
    lines = source.split("\n")
    if len(lines) > _LONG:
        source = "\n".join([*lines[:_LONG], "..."])
    parts = [f"```rts\n{source}\n```", *_facts(view, declared, dialect)]
    note = note_before(view.text(declared.span.file), declared.span.start)
    parts += [note] if note else []
    parts.append(f"{WORDS[type(declared)]} of `{view.program.stable.get(declared.span.file, declared.span.file)}`")
    return "\n\n".join(parts)


def _facts(view: View, declared: Declaration, dialect: Dialect | None) -> Iterator[str]:
    match declared:
        case SignalDecl():
            yield "; ".join(_signal(declared, dialect))
        case ZoneDecl():
            size = size_of(view, declared)
            if size is not None:
                yield f"size: {size}"
        case SkillDecl():
            yield "  \n".join(_skill(view, declared))
        case EnumDecl(dialect=mirrored) if mirrored is not None:
            yield f"mirrors MAVLink's `{mirrored.text}`"


def _signal(signal: SignalDecl, dialect: Dialect | None) -> Iterator[str]:
    name = signal.type.text
    datum = DATUM.get((signal.sources[0].message.text, signal.sources[0].fields[0].text))
    yield f"type `{name}`" + (f" above {datum.value}" if name == "altitude" and datum is not None else "")
    for source in signal.sources:
        for field in source.fields:
            message = None if dialect is None else dialect.messages.get(source.message.text)
            known = None if message is None else message.fields.get(field.text)
            unit = f" in `{known.unit}`" if known is not None and known.unit else ""
            yield f"MAVLink `{source.message.text}.{field.text}`{unit}"
    yield f"unknown when older than {display(signal.stale_after.value, Dimension.DURATION)}"
    if signal.unknown_at:
        yield "unknown at " + ", ".join(f"`{each.text}`" for each in signal.unknown_at)


def _skill(view: View, skill: SkillDecl) -> Iterator[str]:
    def shown(what: str, quantity: Quantity | None) -> Iterator[str]:
        if quantity is not None:
            yield f"{what} {display(quantity.value, quantity.dimension)}"

    times = [*shown("deadline", skill.deadline), *shown("valid for", skill.validity),
             *shown("lasts at most", skill.duration), *shown("energy at most", skill.energy)]  # fmt: skip
    kind = "" if skill.timing_class is None else f"{skill.timing_class.text} skill; "
    yield kind + ", ".join(times)
    for word, clauses in (("require", skill.require), ("assume", skill.assume), ("maintain", skill.maintain)):
        if clauses:
            yield f"{word} " + " and ".join(
                f"`{' '.join(view.slice(each.span).split())}`{' where fitted' if each.where_fitted else ''}"
                for each in clauses
            )
    if skill.fallback:
        yield "fallback " + ", ".join(f"`{view.slice(link.span)}`" for link in skill.fallback)


def _parameter(view: View, parameter: Parameter, owner: str) -> str:
    source = " ".join(view.slice(parameter.span).split())
    parts = [f"```rts\n{source}\n```", f"parameter of `{owner}`"]
    if parameter.choices:
        parts.append("one of " + ", ".join(f"`{choice.text}`" for choice in parameter.choices))
    elif parameter.type.text in TYPES:
        parts.append(TYPES[parameter.type.text])
    if parameter.range is not None:
        parts.append(f"range {view.slice(parameter.range.span)}")
    default = None if parameter.default is None else view.slice(parameter.default.span)
    parts.append("must be given" if default is None else f"default `{default}`")
    return "\n\n".join(parts)


def _dialect(target: Target, dialect: Dialect) -> str:
    if target.sort is Sort.DIALECT_ENUM:
        values = dialect.enums.get(target.name)
        listed = "" if values is None else ": " + ", ".join(f"`{name}` = {value}" for name, value in values.items())
        return f"MAVLink enumeration `{target.name}`{listed}"
    if target.sort is Sort.MESSAGE:
        message = dialect.messages.get(target.name)
        listed = "" if message is None else ": " + ", ".join(f"`{name}`" for name in message.fields)
        return f"MAVLink message `{target.name}`{listed}"
    message = dialect.messages.get(target.owner)
    field = None if message is None else message.fields.get(target.name)
    if field is None:
        return f"MAVLink field `{target.owner}.{target.name}`"
    unit = f", in `{field.unit}`" if field.unit else ""
    values_of = f", values of `{field.enum}`" if field.enum else ""
    return f"MAVLink field `{target.owner}.{target.name}`: `{field.type}`{unit}{values_of}"


def _fault(name: str) -> str | None:
    kind = NAMED.get(name)
    if kind is None:
        return None
    takes = [f"`{each.name} = {example(each)}`" + ("" if each.needed else " (optional)") for each in parameters(kind)]
    return f"fault `{name}`: {getdoc(kind)}\n\ntakes {', '.join(takes) or 'nothing'}"


def _import(view: View, target: Target) -> str | None:
    unit = view.units.get(target.owner)
    each = next((one for one in unit.imports if one.path == target.name), None) if unit is not None else None
    file = None if each is None else view.imports.target(target.owner, each)
    declared = [] if file is None else [name for name, one in view.symbols.declared.items() if one.span.file == file]
    return None if file is None else f"`{file}` declares " + (", ".join(f"`{name}`" for name in declared) or "nothing")
