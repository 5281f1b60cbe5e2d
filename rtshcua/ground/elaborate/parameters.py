"""Missions with parameters: the compiled instance, with given values (`--set height="20 m"`) or defaults, and the
checked instances.

The options are parsed by the language's own parser as a source of their own, one per line, so that findings can
underline them. A mission is checked with every zone and every choice of its parameters, and with both ends of every
range: at most `MAX_INSTANCES` instances, the defaults first, then each parameter changed alone, then combinations. A
mission with very many steps has fewer instances.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.agent_values import parse_value
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Bound, CheckContext, Instance
from rtshcua.ground.checker.name_scope import Argument, Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.substitution import names_in, substitute
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import Kind
from rtshcua.model.ir.expression import Coordinates, Quantity, Reference, Value
from rtshcua.model.ir.missions import MissionDecl, Phase
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import ENTRY, ZoneDecl
from rtshcua.model.quantity import display


def value_of(bound: Bound, argument: Argument, span: Span) -> Value:
    """Return the value node of a bound integer, zone or place."""
    if isinstance(bound, ZoneDecl):
        return Reference(span=span, name=bound.name.text)
    if isinstance(bound, Coordinates):
        return bound.copied(span=span)
    if argument.type.kind is Kind.ENUMERATION:
        return Reference(span=span, name=argument.declaration.choices[bound].text)
    assert argument.type.dimension is not None
    return Quantity(span=span, value=bound, dimension=argument.type.dimension, datum=argument.type.datum)


def bound_value(context: CheckContext, argument: Argument, written: Value, *, reporting: bool = True) -> Value | None:
    """Return the bound form of a written value; None after a finding. A default is reported at its declaration."""
    report = context.report if reporting else Report(context.report.sources)
    before = len(report.found)
    bound = bind_value(Scope(context.symbols, report), argument, written)
    if bound is None or len(report.found) > before:
        return None
    return value_of(bound, argument, written.span)


#: the file name of the options in findings
FILE = "--set"


@dataclass(frozen=True, slots=True)
class ParameterSettings:
    """The values by name, the text of the options, and the findings on it."""

    source: Source = Source(FILE, "")
    values: tuple[tuple[Name, Value], ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


def parse_settings(options: Sequence[str]) -> ParameterSettings:
    """Parse options of the form `name=value`."""
    texts = [" ".join(option.split()) for option in options]
    values: dict[str, tuple[Name, Value]] = {}
    found: list[Diagnostic] = []
    start = 0
    for text in texts:
        name, separator, written = text.partition("=")
        here = Name(span=Span(FILE, start, start + len(name.rstrip())), text=name.strip())
        at = start + len(name) + 1
        place = Span(FILE, at, start + len(text))
        start += len(text) + 1
        if not separator or not here.text or not written.strip():
            whole = Span(FILE, here.span.start, place.end)
            message = f"`{text}` is not a parameter with a value"
            found.append(Diagnostic(codes.SYNTAX, message, whole, 'write a name and a value, as in `height="20 m"`'))
            continue
        value, wrong = parse_value(written, place, at.__add__)
        found += wrong
        first = values.get(here.text)
        if first is not None:
            message = f"`{here.text}` is given twice"
            label = Label(first[0].span, "first given here")
            found.append(Diagnostic(codes.DUPLICATE_ARGUMENT, message, here.span, labels=(label,)))
        elif value is not None:
            values[here.text] = (here, value)
    return ParameterSettings(Source(FILE, "\n".join(texts)), tuple(values.values()), tuple(found))


#: the most combinations of values with which a mission is checked
MAX_INSTANCES = 64
#: the most steps of all instances together; the first instance is always checked
MOST_STEPS = 4_096


def assigned(context: CheckContext, mission: MissionDecl, settings: ParameterSettings) -> Instance | None:
    """Return the mission with the given values and its defaults; None after a finding."""
    before = len(context.report.found)
    given = _given(context, mission, settings)
    known = context.arguments(mission)
    values: dict[str, Value] = {}
    missing: list[str] = []
    for parameter in mission.parameters:
        name = parameter.name.text
        written = given.get(name, parameter.default)
        if name not in known:
            return None  # reported at its declaration
        value = None if written is None else bound_value(context, known[name], written, reporting=name in given)
        if value is not None:
            values[name] = value
        elif written is None and name not in {each.text for each, _ in settings.values}:
            missing.append(name)
    for name in missing:
        declared = known[name].declaration
        context.report.add(
            codes.MISSING_ARGUMENT,
            declared.span,
            f"the mission `{mission.name.text}` has no value for `{name}`",
            help=f"compile it with `--set {name}=...`, or declare a default",
        )
    if len(context.report.found) > before or len(values) < len(known):
        return None
    return _instance(mission, values)


def _given(context: CheckContext, mission: MissionDecl, settings: ParameterSettings) -> Mapping[str, Value]:
    context.report.found += settings.diagnostics
    known = {parameter.name.text for parameter in mission.parameters}
    for name, _ in settings.values:
        if name.text not in known:
            takes = "its parameters are " + ", ".join(f"`{each}`" for each in known) if known else "it has none"
            context.report.add(
                codes.UNKNOWN_ARGUMENT,
                name.span,
                f"the mission `{mission.name.text}` has no parameter `{name.text}`",
                help=suggestion(name.text, known) or takes,
                labels=[(mission.name.span, "declared here")],
            )
    return {name.text: value for name, value in settings.values if name.text in known}


def instances(context: CheckContext, mission: MissionDecl, files: frozenset[str]) -> Iterator[Instance]:
    """Yield the mission with each set of checked values; zones are those declared in `files`, the files of its policy.

    Nothing, with a note, if a position parameter has no default.
    """
    ranges: list[tuple[str, list[Value]]] = []
    known = context.arguments(mission)
    for name, argument in known.items():
        found = _candidates(context, mission, argument, files)
        if not found:
            if argument.type.kind is Kind.POSITION:
                context.report.found.append(
                    Diagnostic(
                        codes.UNDECIDED,
                        f"the mission `{mission.name.text}` was not checked: `{name}` has no value",
                        argument.declaration.span,
                        "declare a default position",
                    )
                )
            return
        ranges.append((name, found))
    if len(known) < len(mission.parameters):
        return
    names = [name for name, _ in ranges]
    steps = sum(len(phase.steps) for phase in mission.phases)
    most = max(1, min(MAX_INSTANCES, MOST_STEPS // max(steps, 1)))
    for numbers in islice(_combinations([found for _, found in ranges]), most):
        values = {name: found[number] for number, (name, found) in zip(numbers, ranges, strict=True)}
        yield _instance(mission, {name: values[name] for name in names})


def _combinations(ranges: Sequence[Sequence[Value]]) -> Iterator[tuple[int, ...]]:
    """The combinations of values, each once: all first ones, one changed at a time, all last ones, then the rest."""
    seen: set[tuple[int, ...]] = set()
    for each in _repeating([len(found) for found in ranges]):
        if each not in seen:
            seen.add(each)
            yield each


def _repeating(sizes: Sequence[int]) -> Iterator[tuple[int, ...]]:
    first = (0,) * len(sizes)
    yield first
    for place, size in enumerate(sizes):
        for number in range(1, size):
            yield (*first[:place], number, *first[place + 1 :])
    yield tuple(size - 1 for size in sizes)
    yield from product(*map(range, sizes))


def ambiguous(context: CheckContext, mission: MissionDecl) -> bool:
    """Whether a clause of a step reads a name that is both a mission parameter and something else; reports it."""
    own = {parameter.name.text: parameter for parameter in mission.parameters}
    before = len(context.report.found)
    for step in (step for phase in mission.phases for step in phase.steps if step.overrides is not None):
        assert step.overrides is not None
        skill = context.symbols.skills.get(step.skill.text)
        arguments = {} if skill is None else context.arguments(skill)
        for clause in step.overrides.clauses:
            for reference in references(clause.condition):
                name = reference.name
                if name in own and (name in arguments or name in context.symbols.signals):
                    other = f"an argument of `{step.skill.text}`" if name in arguments else "a signal"
                    context.report.add(
                        codes.SHADOWED_NAME,
                        reference.span,
                        f"`{name}` is both a parameter of the mission and {other}",
                        help="give the mission's parameter another name",
                        labels=[(own[name].span, "the mission's")],
                    )
    return len(context.report.found) > before


def _candidates(context: CheckContext, mission: MissionDecl, argument: Argument, files: frozenset[str]) -> list[Value]:
    """The values with which a parameter is checked, its default first."""
    parameter = argument.declaration
    default = parameter.default
    found: list[Value] = []
    if default is not None:
        value = bound_value(context, argument, default, reporting=False)
        found += [] if value is None else [value]
    at = parameter.span
    if argument.type.kind is Kind.NUMBER and argument.low is not None and argument.high is not None:
        found += [value_of(end, argument, at) for end in (argument.low, argument.high)]
    elif argument.type.kind is Kind.ENUMERATION:
        found += [value_of(ordinal, argument, at) for ordinal in range(len(parameter.choices))]
    elif argument.type.kind is Kind.ZONE:
        entered = parameter.name.text + ENTRY in names_in(mission)
        for zone in context.symbols.zones.values():
            if zone.span.file in files and (zone.entry is not None or not entered):
                found.append(value_of(zone, argument, at))
    once: dict[tuple[object, ...], Value] = {}
    for value in found:
        once.setdefault(_key(value), value)
    return list(once.values())


def _key(value: Value) -> tuple[object, ...]:
    if isinstance(value, Quantity):
        return (value.value,)
    if isinstance(value, Coordinates):
        return (value.latitude, value.longitude)
    assert isinstance(value, Reference)
    return (value.name,)


def _instance(mission: MissionDecl, values: Mapping[str, Value]) -> Instance:
    phases: tuple[Phase, ...] = tuple(substitute(phase, values) for phase in mission.phases)
    labels: list[tuple[Span, str]] = []
    for parameter in mission.parameters:
        value = values[parameter.name.text]
        labels.append((parameter.span, f"with `{parameter.name.text} = {_words(value)}`"))
    return Instance(mission.copied(phases=phases), tuple(labels))


def _words(value: Value) -> str:
    if isinstance(value, Quantity):
        return display(value.value, value.dimension)
    if isinstance(value, Reference):
        return value.name
    assert isinstance(value, Coordinates)
    return _place(value)


def _place(place: Coordinates) -> str:
    latitude, longitude = place.latitude, place.longitude
    north, east = "N" if latitude >= 0 else "S", "E" if longitude >= 0 else "W"
    return f"{_degrees(latitude)} {north}, {_degrees(longitude)} {east}"


def _degrees(value: int) -> str:
    whole, rest = divmod(abs(value), 10_000_000)
    fraction = str(rest).zfill(7).rstrip("0")
    return f"{whole}.{fraction}" if fraction else str(whole)
