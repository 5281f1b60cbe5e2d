"""The scope of names at one place: parameters of the current skill, signals, zones, and entries of zones."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import Symbols, correction, suggestion
from rtshcua.ground.checker.types import NAMED, POSITION, ZONE, Enumeration, Kind, Type, number
from rtshcua.mavlink.dialect import DATUM
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import ENTRY, ZoneDecl
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.skills import ParameterDecl
from rtshcua.model.quantity import Dimension

LOCAL_TIME = "local time"
#: the name of the mission's phase in conditions
PHASE = "phase"


@dataclass(frozen=True, slots=True)
class Argument:
    """A parameter as seen inside its skill, or by a rule; `low` and `high` if it has a range."""

    declaration: ParameterDecl
    type: Type
    low: int | None = None
    high: int | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """The declared entry of a zone."""

    zone: ZoneDecl
    place: Coordinates


@dataclass(slots=True)
class Scope:
    """The names that are visible at one place; parameters are found first."""

    symbols: Symbols
    report: Report
    arguments: Mapping[str, Argument] = field(default_factory=dict)

    def find(self, name: str) -> Argument | SignalDecl | ZoneDecl | Entry | None:
        """Return the declaration that `name` refers to as a value, or None."""
        argument = self.arguments.get(name)
        if argument is not None:
            return argument
        signal = self.symbols.signals.get(name)
        if signal is not None:
            return signal
        zone = self.symbols.zones.get(name)
        if zone is not None:
            return zone
        if name.endswith(ENTRY):
            zone = self.symbols.zones.get(name.removesuffix(ENTRY))
            if zone is not None and zone.entry is not None:
                return Entry(zone, zone.entry)
        return None

    def type_of(self, found: Argument | SignalDecl | ZoneDecl | Entry) -> Type | None:
        """Return the type of a declaration; None if the declaration has findings itself."""
        if isinstance(found, Argument):
            return found.type
        if isinstance(found, SignalDecl):
            return signal_type(self.symbols, found)
        return ZONE if isinstance(found, ZoneDecl) else POSITION

    def unknown(self, span: Span, name: str) -> None:
        """Report a name that is not a value here."""
        if name in self.symbols.broken or name.removesuffix(ENTRY) in self.symbols.broken:
            return
        kind = self.symbols.kind_of(name)
        if kind is not None:
            of_type = [each.name.text for each in self.symbols.signals.values() if each.type.text == name]
            self.report.add(
                codes.WRONG_KIND,
                span,
                f"`{name}` is {kind}, not a value",
                help=None
                if not of_type
                else f"did you mean the signal `{of_type[0]}` of this type?"
                if len(of_type) == 1
                else f"the signals of this type are {listed(of_type)}",
                labels=[(self.symbols.declared[name].name.span, "declared here")],
                fix=(span, of_type[0], f"write `{of_type[0]}`") if len(of_type) == 1 else None,
            )
            return
        zone = self.symbols.zones.get(name.removesuffix(ENTRY)) if name.endswith(ENTRY) else None
        if zone is not None:
            self.report.add(
                codes.NO_ENTRY,
                span,
                f"the zone `{zone.name.text}` has no entry",
                help="add `entry` and its coordinates to the zone",
                labels=[(zone.name.span, "declared here")],
            )
            return
        zone = self.symbols.zones.get(name.rpartition(".")[0])
        if zone is not None:
            entry = f"{zone.name.text}{ENTRY}"
            self.report.add(
                codes.UNKNOWN_NAME,
                span,
                f"a zone has no `{name.rpartition('.')[2]}`",
                help=f"a zone has one named place, its entry: write `{entry}`",
                labels=[(zone.name.span, "the zone is declared here")],
                fix=(span, entry, f"write `{entry}`"),
            )
            return
        for enum in self.symbols.enums.values():
            if any(member.name.text == name for member in enum.members):
                self.report.add(
                    codes.WRONG_KIND,
                    span,
                    f"`{name}` is a value of `{enum.name.text}`, which is not expected here",
                    help=f"compare it with a signal of the type `{enum.name.text}`",
                    labels=[(enum.name.span, "declared here")],
                )
                return
        known = [*self.arguments, *self.symbols.signals, *self.symbols.zones, LOCAL_TIME, PHASE]
        self.report.add(
            codes.UNKNOWN_NAME,
            span,
            f"`{name}` is not declared",
            help=suggestion(name, known),
            fix=correction(self.report, span, name, known),
        )


def enumeration_of(declaration: EnumDecl) -> Enumeration:
    """Return an `enum` as a set of values, ordered by value."""
    members = {member.name.text: member.value for member in declaration.members}
    return Enumeration(declaration.name.text, members, True, declaration.name.span)


def choices_of(parameter: ParameterDecl) -> Enumeration:
    """Return the choices of a `one of` parameter, numbered in source order."""
    members = {choice.text: ordinal for ordinal, choice in enumerate(parameter.choices)}
    return Enumeration(parameter.name.text, members, False, parameter.name.span)


def signal_type(symbols: Symbols, signal: SignalDecl) -> Type | None:
    """Return the type of a signal; the datum of an altitude is that of its field."""
    name = signal.type.text
    if name == Dimension.ALTITUDE.value:
        source = signal.sources[0]
        datum = DATUM.get((source.message.text, source.fields[0].text))
        return None if datum is None else number(Dimension.ALTITUDE, datum)
    named = NAMED.get(name)
    if named is not None:
        return None if named == ZONE else named
    declaration = symbols.enums.get(name)
    return None if declaration is None else Type(Kind.ENUMERATION, enumeration=enumeration_of(declaration))


def parameter_type(parameter: ParameterDecl) -> Type | None:
    """Return the type of a parameter, or None if the type is unknown."""
    if parameter.choices:
        return Type(Kind.ENUMERATION, enumeration=choices_of(parameter))
    return NAMED.get(parameter.type.text)
