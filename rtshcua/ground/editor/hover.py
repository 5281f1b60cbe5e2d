"""Hover texts in Markdown: declarations, quantities in other units, and sizes of zones."""

from collections.abc import Iterator
from fractions import Fraction
from inspect import getdoc
from typing import NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.accepts import MODES
from rtshcua.ground.checker.faults import NAMED, example
from rtshcua.ground.checker.geojson import DataFiles
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import WORDS, Declaration
from rtshcua.ground.editor.keyword_help import KEYWORDS, REASONS, TYPES
from rtshcua.ground.editor.occurrences import NameKind, NameTarget, Occurrence, at, owned, parameters_owner
from rtshcua.ground.editor.syntax import nodes_in, note_before, path_to, token_at
from rtshcua.ground.editor.workspace import ProgramView
from rtshcua.ground.geometry.polygons import doubled_area
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.geometry.shapes import RoundArea, Shape, bounds
from rtshcua.ground.language.exact_values import CANONICAL
from rtshcua.ground.lower.ground_plan import GroundPlans
from rtshcua.mavlink.dialect import DATUM, Dialect, Field
from rtshcua.model.faults import parameters
from rtshcua.model.ir.expression import Coordinates, Quantity, Reference
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import ParameterDecl, SkillDecl
from rtshcua.model.quantity import UNITS, Dimension, UnitOfMeasure, display

_DIGITS = 6  # decimals of a converted value


def quantity_in_units(node: Quantity) -> str:
    """Describe a quantity in its canonical unit and in all other units."""
    dimension = Dimension.LENGTH if node.dimension is Dimension.ALTITUDE else node.dimension
    datum = "" if node.datum is None else f" above {node.datum.value}"
    if dimension is Dimension.COUNT:
        return f"a plain number: {node.value}"
    others = [f"{converted(node.value, unit)} {name}" for name, unit in UNITS.items() if unit.dimension is dimension]
    kind = "altitude" if node.datum is not None else dimension.value
    return f"{kind}{datum}, kept as {node.value} {CANONICAL[dimension]}\n\n" + " = ".join(others)


def converted(value: int, unit: UnitOfMeasure) -> str:
    """Write a canonical number in a unit, rounded to six decimals."""
    scaled, rest = divmod(abs(value) * unit.denominator * 10**_DIGITS, unit.numerator)
    about = "≈ " if rest else ""
    whole, fraction = divmod(scaled, 10**_DIGITS)
    digits = str(fraction).zfill(_DIGITS).rstrip("0")
    return f"{about}{'-' if value < 0 else ''}{whole}{'.' + digits if digits else ''}"


_PI = Fraction(355, 113)  # accurate to 3e-7, enough for an area
_MM2 = 1_000_000  # in a square metre


def size_of(view: ProgramView, zone: ZoneDecl) -> str | None:
    """Return the size of a zone, as in `120 m × 80 m, 9,400 m²`; None if its outline is not valid."""
    if _is_circular(view, zone):
        return None
    home = next((vehicle.home for vehicle in view.symbols.vehicles.values()), None) or next(
        (each for each in nodes_in(zone) if isinstance(each, Coordinates)), None
    )
    projection = projection_at(*(home.latitude, home.longitude) if home is not None else (0, 0))
    data = DataFiles(view.program.data, view.program.data_names)
    plans = GroundPlans(projection, view.symbols.zones, data, Report(view.program.sources))
    try:
        shape = plans.of(zone)
    except (KeyError, ValueError, AssertionError):  # a part is not declared, or gives no outline
        return None
    return None if shape is None else _size_in_words(shape)


def _size_in_words(shape: Shape) -> str:
    west, south, east, north = bounds(shape)
    return f"{_metres(east - west)} × {_metres(north - south)}, {_area(shape):,} m²"


def _metres(length: int) -> str:
    return f"{(length + 500) // 1000:,} m"


def _area(shape: Shape) -> int:
    if isinstance(shape, RoundArea):
        return int(_PI * shape.radius * shape.radius / _MM2)
    doubled = sum(doubled_area(ring) for ring in shape.rings)
    return abs(doubled) // (2 * _MM2)


def _is_circular(view: ProgramView, zone: ZoneDecl) -> bool:
    """Whether a zone refers to itself or to an undeclared zone."""
    waiting = [(zone, frozenset({zone.name.text}))]
    while waiting:
        each, above = waiting.pop()
        for name in [part.name for part in nodes_in(each.shape) if isinstance(part, Reference)]:
            other = view.symbols.zones.get(name)
            if other is None or name in above:
                return True
            waiting.append((other, above | {name}))
    return False


_LONG = 40  # the most lines of a declaration that are shown


class Hover(NamedTuple):
    """A text in Markdown, and the span that it explains."""

    text: str
    span: Span


def hover(view: ProgramView, file: str, offset: int, dialect: Dialect) -> Hover | None:
    """Return the hover text at an offset; None if there is nothing to explain."""
    found = at(view.occurrences(file), offset)
    texts = list(dict.fromkeys(text for each in found if (text := describe(view, each.target, dialect))))
    if texts:
        return Hover("\n\n---\n\n".join(texts[:3]), found[0].span)
    unit = view.units.get(file)
    path = () if unit is None else path_to(unit, offset)
    if path and isinstance(path[-1], Quantity):
        return Hover(quantity_in_units(path[-1]), path[-1].span)
    return _hover_word(view, file, offset, found)


def _hover_word(view: ProgramView, file: str, offset: int, found: tuple[Occurrence, ...]) -> Hover | None:
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


def describe(view: ProgramView, target: NameTarget, dialect: Dialect) -> str | None:
    """Describe a target; None if it is not declared."""
    match target.kind:
        case NameKind.DECLARED:
            declared = view.symbols.declared.get(target.name)
            return None if declared is None else _declaration(view, declared, dialect)
        case NameKind.PARAMETER:
            return _parameter(view, target)
        case NameKind.MEMBER:
            return _member(view, target)
        case NameKind.CHOICE:
            skill, _, parameter_name = target.owner.partition(".")
            return f"`{target.name}`: a choice for `{parameter_name}` of `{skill}`"
        case NameKind.PHASE:
            return f"phase `{target.name}` of a mission"
        case NameKind.ROLE:
            return f"role `{target.name}`. {KEYWORDS['role']}"
        case NameKind.REASON:
            return _explained(f"`{target.name}`", REASONS.get(target.name))
        case NameKind.TYPE:
            return f"`{target.name}`: {TYPES[target.name]}" if target.name in TYPES else None
        case NameKind.FIELD | NameKind.MESSAGE | NameKind.DIALECT_ENUM | NameKind.COMMAND | NameKind.MODE:
            return _dialect(target, dialect)
        case NameKind.SOURCE | NameKind.CLASS | NameKind.RECORD | NameKind.WORD:
            return _explained(f"{target.kind.value} `{target.name}`", KEYWORDS.get(target.name))
        case NameKind.FAULT:
            return _fault(target.name)
        case NameKind.IMPORT:
            return _import(view, target)
        case _:
            return f"{target.kind.value} `{target.name}`"


def _explained(name: str, meaning: str | None) -> str:
    return name if meaning is None else f"{name}: {meaning}"


def parameter_of(view: ProgramView, owner: str, name: str) -> ParameterDecl | None:
    """The parameter of this owner and name."""
    parameters = owned(parameters_owner(view.symbols, owner))
    return next((each for each in parameters if each.name.text == name), None)


def _member(view: ProgramView, target: NameTarget) -> str:
    enum = view.symbols.enums.get(target.owner)
    values = {} if enum is None else {each.name.text: each.value for each in enum.members}
    return f"`{target.name}` = {values.get(target.name)}, a value of `{target.owner}`"


def _declaration(view: ProgramView, declared: Declaration, dialect: Dialect | None) -> str:
    source = view.slice(declared.span)
    lines = source.split("\n")
    if len(lines) > _LONG:
        source = "\n".join([*lines[:_LONG], "..."])
    parts = [f"```rts\n{source}\n```", *_facts(view, declared, dialect)]
    note = note_before(view.text(declared.span.file), declared.span.start)
    parts += [note] if note else []
    parts.append(f"{WORDS[type(declared)]} of `{view.program.stable.get(declared.span.file, declared.span.file)}`")
    return "\n\n".join(parts)


def _facts(view: ProgramView, declared: Declaration, dialect: Dialect | None) -> Iterator[str]:
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
    if signal.every is not None:
        yield f"reported every {display(signal.every.value, Dimension.DURATION)}"
    yield f"unknown when older than {display(signal.stale_after.value, Dimension.DURATION)}"
    if signal.unknown_at:
        yield "unknown at " + ", ".join(f"`{each.text}`" for each in signal.unknown_at)


def _skill(view: ProgramView, skill: SkillDecl) -> Iterator[str]:
    def shown(keyword: str, quantity: Quantity | None) -> Iterator[str]:
        if quantity is not None:
            yield f"{keyword} {display(quantity.value, quantity.dimension)}"

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


def _parameter(view: ProgramView, target: NameTarget) -> str | None:
    parameter = parameter_of(view, target.owner, target.name)
    if parameter is None:
        return None
    source = " ".join(view.slice(parameter.span).split())
    parts = [f"```rts\n{source}\n```", f"parameter of `{target.owner}`"]
    if parameter.choices:
        parts.append("one of " + ", ".join(f"`{choice.text}`" for choice in parameter.choices))
    elif parameter.type.text in TYPES:
        parts.append(TYPES[parameter.type.text])
    if parameter.range is not None:
        parts.append(f"range {view.slice(parameter.range.span)}")
    default = None if parameter.default is None else view.slice(parameter.default.span)
    parts.append("required" if default is None else f"default `{default}`")
    return "\n\n".join(parts)


def _dialect(target: NameTarget, dialect: Dialect) -> str:
    if target.kind is NameKind.DIALECT_ENUM:
        values = dialect.enums.get(target.name)
        listed = "" if values is None else ": " + ", ".join(f"`{name}` = {value}" for name, value in values.items())
        return f"MAVLink enumeration `{target.name}`{listed}"
    if target.kind is NameKind.MESSAGE:
        message = dialect.messages.get(target.name)
        listed = "" if message is None else ": " + ", ".join(f"`{name}`" for name in message.fields)
        return f"MAVLink message `{target.name}`{listed}"
    if target.kind is NameKind.MODE:
        return _mode(target)
    if target.kind is NameKind.COMMAND:
        parameters = dialect.commands.get(target.name, {})
        listed = "".join(f"\n- {_command_field(name, each)}" for name, each in parameters.items())
        return f"MAVLink command `{target.name}`{listed}"
    field = dialect.commands.get(target.owner, {}).get(target.name)
    if field is not None:
        return f"MAVLink command `{target.owner}`, {_command_field(target.name, field)}"
    message = dialect.messages.get(target.owner)
    field = None if message is None else message.fields.get(target.name)
    if field is None:
        return f"MAVLink field `{target.owner}.{target.name}`"
    unit = f", in `{field.unit}`" if field.unit else ""
    values_of = f", values of `{field.enum}`" if field.enum else ""
    return f"MAVLink field `{target.owner}.{target.name}`: `{field.type}`{unit}{values_of}"


def _command_field(name: str, field: Field) -> str:
    """Describe a parameter of a command."""
    return f"`{name}`: {field.label}" + (f", in `{field.unit}`" if field.unit else "")


def _mode(target: NameTarget) -> str:
    """Describe a flight mode, whose owner is its autopilot."""
    modes = MODES.get(target.owner)
    number = None if modes is None else modes.__members__.get(target.name)
    shown = "" if number is None else f" of {target.owner}: `custom_mode` {int(number)}"
    return f"flight mode `{target.name}`{shown}"


def _fault(name: str) -> str | None:
    kind = NAMED.get(name)
    if kind is None:
        return None
    takes = [f"`{each.name} = {example(each)}`" + ("" if each.needed else " (optional)") for each in parameters(kind)]
    return f"fault `{name}`: {getdoc(kind)}\n\ntakes {', '.join(takes) or 'nothing'}"


def _import(view: ProgramView, target: NameTarget) -> str | None:
    unit = view.units.get(target.owner)
    each = next((one for one in unit.imports if one.path == target.name), None) if unit is not None else None
    file = None if each is None else view.imports.target(target.owner, each)
    declared = [] if file is None else [name for name, one in view.symbols.declared.items() if one.span.file == file]
    return None if file is None else f"`{file}` declares " + (", ".join(f"`{name}`" for name in declared) or "nothing")
