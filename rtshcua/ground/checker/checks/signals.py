"""Check enumerations and signals against the MAVLink dialect."""

from collections.abc import Mapping

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import quantity, size
from rtshcua.ground.checker.name_scope import signal_type
from rtshcua.ground.checker.ranges import INTEGERS, reported
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import NAMED, POSITION, SPEED, ZONE, Kind, Type
from rtshcua.mavlink.dialect import DATUM, Dialect, Field, Message
from rtshcua.mavlink.quantise import UNITS
from rtshcua.model.flat.limits import MAX_STALE
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.signals import EnumDecl, Selected, SignalDecl, SourceDecl
from rtshcua.model.quantity import Dimension

PLACE_UNIT = "degE7"
#: the field for the direction of a sensor
_DIRECTION = "orientation"


def check_signals(context: CheckContext) -> None:
    """Report every enumeration and signal that contradicts the dialect."""
    for enum in context.symbols.enums.values():
        _enum(context, enum)
    for signal in context.symbols.signals.values():
        _signal(context, signal)


def _enum(context: CheckContext, enum: EnumDecl) -> None:
    report = context.report
    values: dict[int, Name] = {}
    for member in enum.members:
        size(context, member, Dimension.COUNT, member.value)
        first = values.setdefault(member.value, member.name)
        if first is not member.name:
            report.add(
                codes.ENUM_VALUE,
                member.span,
                f"`{member.name.text}` and `{first.text}` have the same value",
                labels=[(first.span, "first used here")],
            )
    if enum.dialect is None:
        return
    entries = context.dialect.enums.get(enum.dialect.text)
    if entries is None:
        report.add(
            codes.UNKNOWN_ENUM,
            enum.dialect.span,
            f"the dialect has no enumeration `{enum.dialect.text}`",
            help=suggestion(enum.dialect.text, context.dialect.enums),
            fix=correction(report, enum.dialect.span, enum.dialect.text, context.dialect.enums),
        )
        return
    known = set(entries.values())
    for member in enum.members:
        if member.value not in known:
            listed = ", ".join(f"{value} ({name})" for name, value in sorted(entries.items(), key=lambda e: e[1])[:12])
            report.add(
                codes.ENUM_VALUE,
                member.span,
                f"`{enum.dialect.text}` has no value {member.value}",
                help=f"its values are {listed}",
            )


def _signal(context: CheckContext, signal: SignalDecl) -> None:
    quantity(context, signal.stale_after, Dimension.DURATION, most=MAX_STALE)
    quantity(context, signal.every, Dimension.DURATION, most=MAX_STALE)
    name = signal.type.text
    known = NAMED.get(name)
    if known == ZONE or (known is None and name not in context.symbols.enums):
        types = [*(each for each in NAMED if NAMED[each] != ZONE), *context.symbols.enums]
        context.report.add(
            codes.SIGNAL_TYPE,
            signal.type.span,
            f"a signal cannot have the type `{name}`",
            help=suggestion(name, types) or "the types of signals are " + ", ".join(f"`{each}`" for each in types),
            fix=correction(context.report, signal.type.span, name, types),
        )
        return
    type = signal_type(context.symbols, signal)
    before = len(context.report.found)
    for source in signal.sources:
        _source(context, signal, source, type)
    if len(context.report.found) == before and type is not None and type.dimension is not None:
        context.symbols.ranges[signal.name.text] = reported(context.dialect, signal, type.dimension)


def _source(context: CheckContext, signal: SignalDecl, source: SourceDecl, type: Type | None) -> None:
    report, dialect = context.report, context.dialect
    message = dialect.messages.get(source.message.text)
    if message is None:
        report.add(
            codes.UNKNOWN_MESSAGE,
            source.message.span,
            f"the dialect has no message `{source.message.text}`",
            help=suggestion(source.message.text, dialect.messages),
            fix=correction(report, source.message.span, source.message.text, dialect.messages),
        )
        return
    if not _count(context, signal, source, type):
        return
    for name in source.fields:
        field = message.fields.get(name.text)
        if field is None:
            report.add(
                codes.UNKNOWN_FIELD,
                name.span,
                f"`{source.message.text}` has no field `{name.text}`",
                help=" ".join(
                    filter(None, (suggestion(name.text, message.fields, source.message.text), _fields(message)))
                ),
                fix=correction(report, name.span, name.text, message.fields, source.message.text),
            )
        elif field.length or field.type == "char":
            report.add(
                codes.FIELD_TYPE,
                name.span,
                f"`{name.text}` is {'text' if field.type == 'char' else f'an array of {field.length} numbers'}",
                help="choose a field that is a single number",
            )
        else:
            _field(context, signal, source, name, field, type)
            _sentinels(context, signal, field)
    _selector(context, source, message)


def _selector(context: CheckContext, source: SourceDecl, message: Message) -> None:
    """Check selected fields: integers with a valid value, and always a direction."""
    report, seen = context.report, set[str]()
    for each in source.where:
        name, value = each.field, each.value.text
        field = message.fields.get(name.text)
        if field is None:
            report.add(
                codes.UNKNOWN_FIELD,
                name.span,
                f"`{source.message.text}` has no field `{name.text}`",
                help=suggestion(name.text, message.fields, source.message.text) or _fields(message),
            )
        elif field.length or field.type not in INTEGERS:
            report.add(
                codes.FIELD_TYPE,
                name.span,
                f"`{name.text}` is not an integer field",
                help="select a message by an integer field, such as `orientation` or `id`",
            )
        elif name.text in seen:
            report.add(codes.UNSELECTED, name.span, f"`{name.text}` is selected twice", help="keep one of them")
        elif selected_value(context.dialect, source.message.text, each) is None:
            members = {} if field.enum is None else context.dialect.enums.get(field.enum, {})
            low, high = INTEGERS[field.type]
            report.add(
                codes.UNKNOWN_AT,
                each.value.span,
                f"`{value}` is not a value of `{source.message.text}.{name.text}`",
                help=suggestion(value, members)
                or (f"its values are {listed(members)}" if members else f"its values go from {low} to {high}"),
            )
        seen.add(name.text)
    field = message.fields.get(_DIRECTION)
    if field is not None and _DIRECTION not in seen:
        report.add(
            codes.UNSELECTED,
            source.span,
            f"`{source.message.text}` comes from sensors in different directions, and the source selects none",
            help="select a direction: `where orientation = MAV_SENSOR_ROTATION_NONE` is forward, "
            "`MAV_SENSOR_ROTATION_PITCH_270` is down",
        )


def selected_value(dialect: Dialect, message: str, selected: Selected) -> int | None:
    """Return the raw value of a selected field; None if it is invalid."""
    field = dialect.messages[message].fields[selected.field.text]
    value = sentinel(selected.value.text, {} if field.enum is None else dialect.enums.get(field.enum, {}))
    low, high = INTEGERS[field.type]
    return value if value is not None and low <= value <= high else None


def _fields(message: Message) -> str:
    return f"its fields are {listed(message.fields)}"


def _count(context: CheckContext, signal: SignalDecl, source: SourceDecl, type: Type | None) -> bool:
    """Check the number of fields: two for a position, one or two for a speed, else one."""
    given = len(source.fields)
    allowed = (2,) if type == POSITION else (1, 2) if type == SPEED else (1,)
    if given in allowed:
        return True
    what = "two fields, latitude and longitude" if type == POSITION else "one field"
    context.report.add(
        codes.FIELD_COUNT,
        source.span,
        f"a signal of type `{signal.type.text}` is read from {what}; the source has {given}",
        labels=[(signal.type.span, "this type")],
    )
    return False


def _field(
    context: CheckContext, signal: SignalDecl, source: SourceDecl, name: Name, field: Field, type: Type | None
) -> None:
    """Check that the field has the quantity of the signal."""
    if signal.type.text == Dimension.ALTITUDE.value:
        _altitude(context, signal, source, name, field, type)
    elif type == POSITION:
        if field.unit != PLACE_UNIT:
            _unit(context, signal, name, field, (PLACE_UNIT,))
    elif type is not None and type.kind is Kind.ENUMERATION:
        _enumerated(context, signal, name, field)
    elif type is not None and type.dimension is not None and field.unit not in UNITS[type.dimension]:
        _unit(context, signal, name, field, tuple(UNITS[type.dimension]))


def _enumerated(context: CheckContext, signal: SignalDecl, name: Name, field: Field) -> None:
    enum = context.symbols.enums[signal.type.text]
    mirrored = None if enum.dialect is None else enum.dialect.text
    if mirrored is not None and mirrored not in context.dialect.enums:
        return  # reported at its declaration
    if field.unit or field.type in ("float", "double") or (mirrored is not None and field.enum != mirrored):
        has = f"has values of `{field.enum}`" if field.enum else "has no enumeration"
        help = f"declare an enumeration that mirrors it: `enum ... = {field.enum} {{ ... }}`" if field.enum else None
        context.report.add(
            codes.FIELD_ENUM,
            name.span,
            f"`{name.text}` {has}, but the signal is a `{signal.type.text}`",
            help=help,
            labels=[(enum.name.span, f"`{enum.name.text}` is declared here")],
        )


def _altitude(
    context: CheckContext, signal: SignalDecl, source: SourceDecl, name: Name, field: Field, type: Type | None
) -> None:
    if field.unit not in UNITS[Dimension.LENGTH]:
        _unit(context, signal, name, field, tuple(UNITS[Dimension.LENGTH]))
        return
    datum = DATUM.get((source.message.text, name.text))
    if datum is None:
        context.report.add(
            codes.FIELD_DATUM,
            name.span,
            f"the datum of `{source.message.text}.{name.text}` is unknown",
            help="read altitudes from "
            + ", ".join(f"`{message}.{each}`" for message, each in list(DATUM)[:2])
            + ", or declare a `length`",
        )
    elif type is not None and type.datum is not datum:
        context.report.add(
            codes.FIELD_DATUM,
            name.span,
            f"`{source.message.text}.{name.text}` is above {datum.value}, but the first source is not",
            labels=[(signal.sources[0].span, "the first source")],
        )


def _unit(context: CheckContext, signal: SignalDecl, name: Name, field: Field, accepted: tuple[str, ...]) -> None:
    fits = [each.value for each, units in UNITS.items() if field.unit in units]
    has = f"is in `{field.unit}`" if field.unit else "has no unit"
    words = ", ".join(f"`{unit}`" for unit in accepted if unit) or "no unit"
    context.report.add(
        codes.FIELD_UNIT,
        name.span,
        f"`{name.text}` {has}, which does not fit `{signal.type.text}`",
        help=f"declare the signal as `{fits[0]}`, or read a field in {words}" if fits else f"read a field in {words}",
        labels=[(signal.type.span, "this type")],
    )


def _sentinels(context: CheckContext, signal: SignalDecl, field: Field) -> None:
    enum = context.symbols.enums.get(signal.type.text)
    members = {} if enum is None else {member.name.text: member.value for member in enum.members}
    low, high = INTEGERS.get(field.type, (-(1 << 53), 1 << 53))
    for name in signal.unknown_at:
        value = sentinel(name.text, members)
        if value is None or not low <= value <= high:
            context.report.add(
                codes.UNKNOWN_AT,
                name.span,
                f"`{name.text}` is not a value of a field of type `{field.type}`",
                help=suggestion(name.text, members)
                or (f"its values are {listed(members)}; as numbers they " if members else "its values ")
                + f"go from {low} to {high}",
            )


def sentinel(text: str, members: Mapping[str, int]) -> int | None:
    """Return the raw value of an `unknown at` entry, or None."""
    if text in members:
        return members[text]
    digits = text.removeprefix("-")
    return int(text) if digits.isascii() and digits.isdigit() and len(digits) <= 20 else None
