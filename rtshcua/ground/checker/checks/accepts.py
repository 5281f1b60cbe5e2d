"""Check what skills accept of MAVLink: it exists, each argument is read from a field that measures it, and no two
skills stand for the same.
"""

from collections.abc import Iterator, Mapping
from enum import IntEnum
from itertools import combinations
from typing import Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.checks.signals import PLACE_UNIT, sentinel
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import Argument
from rtshcua.ground.checker.ranges import INTEGERS
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import HEIGHT, POSITION, Kind
from rtshcua.mavlink.dialect import DATUM, Dialect, Field
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.mavlink.quantise import UNITS
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import AcceptsDecl, FixedFieldDecl, SkillDecl, SourcedArgument
from rtshcua.model.quantity import Dimension
from rtshcua.model.scenario import FLAVOURS

#: the flight modes by autopilot
MODES: Final[Mapping[str, type[IntEnum]]] = dict(zip(FLAVOURS, (Px4Mode, CopterMode), strict=True))
#: the value of a field that says nothing: NaN, or INT32_MAX of an integer
UNSET: Final = "unset"
#: the fields that say what the altitude of a message is above
FRAMES: Final = ("frame", "coordinate_frame")
#: the greatest integer below which a float of 32 bits has all of them
_WHOLE: Final = 1 << 24
#: the motions that a client means by a command or a mode; of others nothing is known
_MEANT: Final[Mapping[str, tuple[str, ...]]] = {
    **dict.fromkeys(("MAV_CMD_NAV_TAKEOFF", "TAKEOFF"), ("climb",)),
    **dict.fromkeys(("MAV_CMD_NAV_LAND", "LAND", "PRECISION_LAND"), ("land",)),
    **dict.fromkeys(("MAV_CMD_NAV_RETURN_TO_LAUNCH", "RTL", "SMART_RTL", "RETURN"), ("home",)),
    **dict.fromkeys(
        ("MAV_CMD_NAV_WAYPOINT", "MAV_CMD_DO_REPOSITION", "SET_POSITION_TARGET_GLOBAL_INT"), ("fly", "hold")
    ),
    **dict.fromkeys(("MAV_CMD_NAV_LOITER_UNLIM", "MAV_CMD_NAV_LOITER_TIME"), ("hold", "fly")),
    **dict.fromkeys(("MAV_CMD_DO_PAUSE_CONTINUE", "HOLD", "LOITER", "POSHOLD", "BRAKE"), ("hold",)),
}
_MOTIONS: Final = {
    "climb": "a climb",
    "land": "a landing",
    "home": "a return",
    "fly": "a flight to a place",
    "hold": "a hover",
}


class Trigger(NamedTuple):
    """What matches: the number, the autopilots, and by field a value under a mask, or None for unset.

    The fields of `needed` must not be unset.
    """

    kind: str
    number: int
    autopilots: tuple[str, ...]
    fixed: tuple[tuple[str, tuple[int, int] | None], ...]
    needed: frozenset[str]

    def excludes(self, other: "Trigger") -> bool:
        """Whether nothing matches both."""
        if (self.kind, self.number) != (other.kind, other.number) or set(self.autopilots).isdisjoint(other.autopilots):
            return True
        for field, value in self.fixed:
            if value is None and field in other.needed:
                return True
            if any(field == name and _differ(value, another) for name, another in other.fixed):
                return True
        return any(value is None and field in self.needed for field, value in other.fixed)


def _differ(one: tuple[int, int] | None, other: tuple[int, int] | None) -> bool:
    """Whether no value of a field fulfils both conditions."""
    if one is None or other is None:
        return one is not other
    return bool((one[0] ^ other[0]) & one[1] & other[1])


def check_accepts(context: CheckContext) -> None:
    """Report everything accepted that does not exist, or does not fit its skill; then what two skills accept."""
    triggers: list[tuple[SkillDecl, AcceptsDecl, Trigger]] = []
    for skill in context.symbols.skills.values():
        for accepts in skill.accepts:
            before = len(context.report.found)
            if _exists(context, accepts):
                _motion(context, skill, accepts)
                for fixed in accepts.where:
                    _fixed(context, accepts, fixed)
                _arguments(context, skill, accepts)
            if len(context.report.found) == before:
                triggers.append((skill, accepts, trigger(context.dialect, accepts)))
    for (owner, first, one), (skill, again, other) in combinations(triggers, 2):
        if one == other if skill is owner else not one.excludes(other):
            _twice(context, first, again)


def _twice(context: CheckContext, first: AcceptsDecl, again: AcceptsDecl) -> None:
    if first.span.file != again.span.file:
        first, again = again, first  # the files to compile come before what they import
    context.report.add(
        codes.ACCEPTED_TWICE,
        again.name.span,
        f"`{again.name.text}` is accepted twice, and nothing tells which of both is meant",
        help="keep one of them, or add to both a `where` that tells them apart, or `on` an autopilot",
        labels=[(first.name.span, "also accepted here")],
    )


def fields_of(dialect: Dialect, accepts: AcceptsDecl) -> Mapping[str, Field]:
    """The fields that can be read: `param1` .. `param7` with a meaning of a command, or those of a message."""
    if accepts.kind == "message":
        return dialect.messages[accepts.name.text].fields
    return {} if accepts.kind == "mode" else dialect.commands[accepts.name.text]


def number_of(dialect: Dialect, accepts: AcceptsDecl) -> int:
    """The number of the command or the message, or the custom mode."""
    name = accepts.name.text
    if accepts.kind == "message":
        return dialect.messages[name].id
    if accepts.kind == "mode" and accepts.autopilot is not None:
        return int(MODES[accepts.autopilot.text][name])
    return dialect.enums["MAV_CMD"][name]


def fixed_value(dialect: Dialect, field: Field, fixed: FixedFieldDecl) -> tuple[int, int] | None:
    """The value and the mask of a condition on a field; None if it is unset or invalid."""
    members = {} if field.enum is None else dialect.enums.get(field.enum, {})
    value = None if fixed.value.text == UNSET else sentinel(fixed.value.text, members)
    if value is None:
        return None
    return {"=": (value, -1), "has": (value, value), "lacks": (0, value)}[fixed.relation]


def trigger(dialect: Dialect, accepts: AcceptsDecl) -> Trigger:
    """What a valid declaration matches."""
    fields = fields_of(dialect, accepts)
    return Trigger(
        accepts.kind,
        number_of(dialect, accepts),
        FLAVOURS if accepts.autopilot is None else (accepts.autopilot.text,),
        tuple((each.field.text, fixed_value(dialect, fields[each.field.text], each)) for each in accepts.where),
        frozenset(field.text for each in accepts.arguments if each.substitute is None for field in each.fields),
    )


def scale_of(unit: str, dimension: Dimension | None) -> int | None:
    """Canonical units in one unit of the dialect, for a position if there is no dimension; None if they do not fit."""
    units = UNITS[Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension or Dimension.ANGLE]
    if dimension is None and unit not in (PLACE_UNIT, "deg"):
        return None
    numerator, denominator = units.get(unit, (0, 0))
    return numerator if denominator == 1 else None


def _exists(context: CheckContext, accepts: AcceptsDecl) -> bool:
    """Whether the command, the message or the mode exists; reports it if not."""
    report, dialect, name, autopilot = context.report, context.dialect, accepts.name, accepts.autopilot
    help: str | None
    if autopilot is not None and autopilot.text not in FLAVOURS:
        report.add(
            codes.UNKNOWN_MODE,
            autopilot.span,
            f"unknown autopilot `{autopilot.text}`",
            help=suggestion(autopilot.text, FLAVOURS) or f"the autopilots are {listed(FLAVOURS)}",
            fix=correction(report, autopilot.span, autopilot.text, FLAVOURS),
        )
        return False
    if accepts.kind == "mode":
        if autopilot is None:
            help = f"add the autopilot: `mode {name.text} on {FLAVOURS[0]}`"
            report.add(codes.UNKNOWN_MODE, name.span, "each autopilot has modes of its own", help=help)
            return False
        code, known = codes.UNKNOWN_MODE, list(MODES[autopilot.text].__members__)
        what = f"`{autopilot.text}` has no mode"
    elif accepts.kind == "message":
        code, what, known = codes.UNKNOWN_MESSAGE, "the dialect has no message", list(dialect.messages)
    else:
        code, what, known = codes.UNKNOWN_COMMAND, "the dialect has no command", list(dialect.commands)
    if name.text in known:
        return True
    help = suggestion(name.text, known) or (f"its modes are {listed(known)}" if accepts.kind == "mode" else None)
    report.add(code, name.span, f"{what} `{name.text}`", help=help, fix=correction(report, name.span, name.text, known))
    return False


def _motion(context: CheckContext, skill: SkillDecl, accepts: AcceptsDecl) -> None:
    """Report a command that means another motion than the skill's."""
    meant = _MEANT.get(accepts.name.text)
    if meant is None or skill.motion is None or skill.motion.kind in meant:
        return
    context.report.add(
        codes.OTHER_MOTION,
        accepts.name.span,
        f"who sends `{accepts.name.text}` means {' or '.join(_MOTIONS[each] for each in meant)}",
        help=f"accept it in a skill with `motion {meant[0]}`",
        labels=[(skill.motion.span, f"the motion of `{skill.name.text}`")],
    )


def _field(context: CheckContext, accepts: AcceptsDecl, name: Name) -> Field | None:
    """A single number among the fields; reports anything else."""
    fields = fields_of(context.dialect, accepts)
    field = fields.get(name.text)
    if field is None:
        has = f"it has {listed(fields)}" if fields else "it has none"
        context.report.add(
            codes.UNKNOWN_FIELD,
            name.span,
            f"`{accepts.name.text}` has no field `{name.text}`",
            help=suggestion(name.text, fields, accepts.name.text) or has,
            fix=correction(context.report, name.span, name.text, fields, accepts.name.text),
        )
    elif field.length or field.type == "char":
        what = "text" if field.type == "char" else f"an array of {field.length} numbers"
        help = "choose a field that is a single number"
        context.report.add(codes.FIELD_TYPE, name.span, f"`{name.text}` is {what}", help=help)
    else:
        return field
    return None


def _fixed(context: CheckContext, accepts: AcceptsDecl, fixed: FixedFieldDecl) -> None:
    """Report a value that the field cannot have, and bits of a float."""
    field = _field(context, accepts, fixed.field)
    if field is None:
        return
    bits = fixed.relation != "="
    if bits and accepts.kind == "message" and field.type not in INTEGERS:
        help = "compare the whole field: `=`"
        context.report.add(codes.FIELD_TYPE, fixed.field.span, f"`{fixed.field.text}` has no bits", help=help)
        return
    low, high = INTEGERS.get(field.type, (-_WHOLE, _WHOLE))
    if fixed.value.text == UNSET and not bits and field.type in ("float", "double", "int32_t"):
        return
    value = fixed_value(context.dialect, field, fixed)
    if value is None or not low <= value[0] <= high or not -1 <= value[1] <= high:
        members = {} if field.enum is None else context.dialect.enums.get(field.enum, {})
        context.report.add(
            codes.UNKNOWN_AT,
            fixed.value.span,
            f"`{fixed.value.text}` is not a value of `{fixed.field.text}`",
            help=suggestion(fixed.value.text, members)
            or (f"its values are {listed(members)}" if members else f"its values go from {low} to {high}"),
        )


def _arguments(context: CheckContext, skill: SkillDecl, accepts: AcceptsDecl) -> None:
    """Report arguments that the skill does not have, has twice, or needs and does not get."""
    report, known = context.report, context.arguments(skill)
    given: dict[str, Name] = {}
    for each in accepts.arguments:
        name, argument = each.parameter, known.get(each.parameter.text)
        first = given.setdefault(name.text, name)
        if argument is None:
            report.add(
                codes.UNKNOWN_ARGUMENT,
                name.span,
                f"`{skill.name.text}` has no parameter `{name.text}`",
                help=suggestion(name.text, known),
                fix=correction(report, name.span, name.text, known),
                labels=[(skill.name.span, f"`{skill.name.text}` is declared here")],
            )
        elif first is not name:
            report.add_twice(codes.DUPLICATE_ARGUMENT, name.span, f"`{name.text}`", "given", first.span)
        else:
            _argument(context, accepts, each, argument)
    for missing in skill.parameters:
        if missing.default is None and missing.name.text not in given:
            report.add(
                codes.MISSING_ARGUMENT,
                accepts.name.span,
                f"`{accepts.name.text}` gives no `{missing.name.text}`, which `{skill.name.text}` needs",
                help=f"add the field to read it from: `with {missing.name.text} = ...`, or give it a default",
                labels=[(missing.span, "declared without a default")],
            )


def _argument(context: CheckContext, accepts: AcceptsDecl, source: SourcedArgument, argument: Argument) -> None:
    """Report a source that does not fit the type of the argument."""
    report, type, name = context.report, argument.type, source.parameter.text
    if type != POSITION and type.kind is not Kind.NUMBER:
        help = f"leave it out, so that its default counts: no field of MAVLink says {type.describe()}"
        report.add(codes.WRONG_TYPE, source.span, f"`{name}` is {type.describe()}, which no field is", help=help)
        return
    fields = [_field(context, accepts, field) for field in source.fields]
    expected = 2 if type == POSITION else 1
    if fields and len(fields) != expected:
        form = "a pair of fields, `(latitude, longitude)`" if type == POSITION else "one field"
        help = f"`{name}` is {type.describe()}"
        report.add(codes.FIELD_COUNT, source.span, f"`{name}` is read from {form}", help=help)
        return
    for written, field in zip(source.fields, fields, strict=True):
        if field is not None and scale_of(field.unit, type.dimension) is None:
            has = f"is in `{field.unit}`" if field.unit else "has no unit"
            fits = [unit for unit in _units(type.dimension) if unit]
            report.add(
                codes.FIELD_UNIT,
                written.span,
                f"`{written.text}` of `{accepts.name.text}` {has}, which does not fit {type.describe()}",
                help=f"read a field in {listed(fits)}" if fits else "read a field without a unit",
                labels=[(argument.declaration.span, "the parameter")],
            )
    _datum(context, accepts, source, altitude=type == HEIGHT)
    _substitute(context, source, argument)


def _units(dimension: Dimension | None) -> Iterator[str]:
    """The units of the dialect that fit a dimension."""
    every = {unit for units in UNITS.values() for unit in units}
    yield from (unit for unit in sorted(every) if scale_of(unit, dimension) is not None)


def _datum(context: CheckContext, accepts: AcceptsDecl, source: SourcedArgument, *, altitude: bool) -> None:
    """Report an altitude without a datum, with another one than its field has, and a datum of anything else."""
    report, substitute, name = context.report, source.substitute, source.parameter.text
    written = [*([source.datum] if source.fields else [])]
    if substitute is not None and substitute.kind == "parameter":
        written.append(substitute.datum)
    if not altitude:
        if any(written):
            help = "remove it: only an altitude is above something"
            report.add(codes.DATUM_NOT_ALLOWED, source.span, f"`{name}` is no altitude and has no datum", help=help)
        return
    if None in written:
        report.add(
            codes.FIELD_DATUM,
            source.span,
            f"the altitude `{name}` needs a datum",
            help="add `above home`, `above sea`, or `in frame`, which is that of the message",
        )
        return
    fields = fields_of(context.dialect, accepts)
    if source.datum == "frame" and accepts.kind == "message" and not any(frame in fields for frame in FRAMES):
        help = "write `above home` or `above sea`"
        report.add(codes.FIELD_DATUM, source.span, f"`{accepts.name.text}` has no field for a frame", help=help)
        return
    known = DATUM.get((accepts.name.text, source.fields[0].text)) if source.fields else None
    if known is not None and source.datum != known.value:
        help = f"write `above {known.value}`"
        report.add(codes.FIELD_DATUM, source.span, f"`{source.fields[0].text}` is above {known.value}", help=help)


def _substitute(context: CheckContext, source: SourcedArgument, argument: Argument) -> None:
    """Report a substitute that the argument cannot have."""
    report, substitute, name = context.report, source.substitute, source.parameter.text
    if substitute is None:
        return
    if substitute.kind == "default" and argument.declaration.default is None:
        report.add(
            codes.MISSING_ARGUMENT,
            substitute.span,
            f"`{name}` has no default",
            help="give the parameter a default, or write another value",
            labels=[(argument.declaration.span, "declared here")],
        )
    elif substitute.kind == "here" and argument.type not in (HEIGHT, POSITION):
        help = "write `default`, or a parameter of the autopilot"
        report.add(
            codes.WRONG_TYPE, substitute.span, f"`here` is a place or an altitude, `{name}` is neither", help=help
        )
    elif substitute.kind == "parameter" and argument.type == POSITION:
        help = "write `here`"
        report.add(codes.WRONG_TYPE, substitute.span, "no parameter of an autopilot is a position", help=help)
