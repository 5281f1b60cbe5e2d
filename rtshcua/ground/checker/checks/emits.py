"""Check the commands to payload that skills emit: each may be emitted, its addressee understands it, its parameters
exist and are numbers of their units, and its time and its success fit the skill.
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.checks.accepts import UNSET, scale_of
from rtshcua.ground.checker.checks.parameters import unknown_size
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of
from rtshcua.ground.checker.name_scope import Argument
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import POSITION, Kind, Type, number
from rtshcua.mavlink.dialect import Field
from rtshcua.mavlink.parameters import NAN, nearest_bits, value_of
from rtshcua.model.flat.contract import Addressee, EmissionMoment, EmissionSuccess, NumberOrigin
from rtshcua.model.flat.limits import MAX_EMISSIONS, MAX_PAYLOAD_WAIT, MAX_SERVOS, MAX_VALUE, MIN_EMISSION_INTERVAL
from rtshcua.model.ir.expression import Quantity, Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import VehicleDecl
from rtshcua.model.ir.skills import EmitsDecl, EmittedParameter, SkillDecl
from rtshcua.model.quantity import Datum, Dimension, display

ADDRESSEES: Final[Mapping[str, Addressee]] = {each.name.lower(): each for each in Addressee}
SUCCESSES: Final[Mapping[str, EmissionSuccess]] = {each.name.lower(): each for each in EmissionSuccess}
ONCE: Final = {"begin": EmissionMoment.BEGIN, "end": EmissionMoment.END}
EACH: Final = {"turn": EmissionMoment.TURN, "waypoint": EmissionMoment.WAYPOINT}
#: the motions with a path, by what happens at each point of it
_WITH: Final = {EmissionMoment.TURN: ("cover",), EmissionMoment.WAYPOINT: ("cover", "fly")}
#: us: how long the effect of a command is awaited, if the skill does not say
WAITS_US: Final = 3_000_000
SERVO: Final = "MAV_CMD_DO_SET_SERVO"
#: the greatest integer below which a float of 32 bits has all of them
_WHOLE: Final = 1 << 24
_FULL_TURN: Final = 3_600_000_000  # 1e-7 degree


class Emittable(NamedTuple):
    """A command that skills may emit: to whom, which parameters it needs, which are not a number if they are unset (all
    others are 0 then), and what may show its success.
    """

    to: tuple[str, ...]
    needs: tuple[str, ...] = ()
    unset: tuple[str, ...] = ()
    shown_by: tuple[EmissionSuccess, ...] = ()


_CAMERA: Final = ("camera", "vehicle")
_GIMBAL: Final = ("gimbal", "vehicle")
_ALL: Final = (EmissionSuccess.ALL_IMAGES,)
_IMAGE: Final = (EmissionSuccess.IMAGE, *_ALL)
_ATTITUDE: Final = (EmissionSuccess.ATTITUDE,)
_PLACE: Final = ("param5", "param6", "param7")
#: every other command is refused: most move or arm the vehicle, or change its parameters
EMITTABLE: Final[Mapping[str, Emittable]] = MappingProxyType(
    {
        "MAV_CMD_IMAGE_START_CAPTURE": Emittable(_CAMERA, ("param3",), ("param7",), _IMAGE),
        "MAV_CMD_IMAGE_STOP_CAPTURE": Emittable(_CAMERA, (), ("param2", "param3", "param4", "param7")),
        "MAV_CMD_VIDEO_START_CAPTURE": Emittable(_CAMERA, (), ("param4", "param7")),
        "MAV_CMD_VIDEO_STOP_CAPTURE": Emittable(_CAMERA, (), ("param3", "param4", "param7")),
        "MAV_CMD_SET_CAMERA_MODE": Emittable(_CAMERA, ("param2",), ("param3", "param4", "param7")),
        "MAV_CMD_SET_CAMERA_ZOOM": Emittable(_CAMERA, ("param1", "param2"), ("param4", "param7")),
        "MAV_CMD_SET_CAMERA_FOCUS": Emittable(_CAMERA, ("param1",), ("param4", "param7")),
        "MAV_CMD_DO_DIGICAM_CONTROL": Emittable(_CAMERA, (), (), _IMAGE),
        "MAV_CMD_DO_TRIGGER_CONTROL": Emittable(_CAMERA, ("param1",), (), _ALL),
        "MAV_CMD_DO_SET_CAM_TRIGG_DIST": Emittable(_CAMERA, ("param1",), (), _ALL),
        "MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW": Emittable(
            _GIMBAL, (), ("param1", "param2", "param3", "param4"), _ATTITUDE
        ),
        "MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE": Emittable(_GIMBAL, ("param1", "param2", "param3", "param4")),
        "MAV_CMD_DO_MOUNT_CONTROL": Emittable(_GIMBAL, ("param7",), (), _ATTITUDE),
        "MAV_CMD_DO_SET_ROI_LOCATION": Emittable(_GIMBAL, _PLACE),
        "MAV_CMD_DO_SET_ROI_NONE": Emittable(_GIMBAL),
        "MAV_CMD_DO_GRIPPER": Emittable(("vehicle",), ("param2",)),
        "MAV_CMD_DO_WINCH": Emittable(("vehicle",), ("param2",)),
        SERVO: Emittable(("vehicle",), ("param1", "param2")),
    }
)
#: parameters that the dialect explains in words alone: the angles of a mount
_IN_WORDS: Final[Mapping[str, Mapping[str, Field]]] = {
    "MAV_CMD_DO_MOUNT_CONTROL": {
        f"param{index}": Field("float", 0, "deg", None, label)
        for index, label in enumerate(("Pitch", "Roll", "Yaw"), start=1)
    }
}
#: the greatest difference between a number and the float that is sent, in canonical units
_PRECISION: Final[Mapping[Dimension, int]] = {
    Dimension.COUNT: 0,
    Dimension.LENGTH: 10,
    Dimension.ALTITUDE: 10,
    Dimension.SPEED: 10,
    Dimension.DURATION: 1_000,
    Dimension.ANGLE: 10_000,  # 0.001 degree
    Dimension.RATIO: 1,
    Dimension.VOLTAGE: 1,
}


class SentNumber(NamedTuple):
    """A parameter as it is sent: `EmissionParameter`, with the name of the skill's parameter instead of its cell."""

    origin: NumberOrigin
    name: str | None
    value: int


def check_emits(context: CheckContext) -> None:
    """Report each command that a skill may not emit, or that does not fit its addressee, its parameters."""
    for skill in context.symbols.skills.values():
        for emits in skill.emits[MAX_EMISSIONS:]:
            help = f"a skill emits at most {MAX_EMISSIONS} commands"
            context.report.add(codes.EMISSION_FORM, emits.span, f"`{skill.name.text}` emits too many", help=help)
        for emits in skill.emits:
            if _may_be_emitted(context, emits):
                _time(context, skill, emits)
                _success(context, emits)
                sent_numbers(context, skill, emits)
    for vehicle in context.symbols.vehicles.values():
        for servo in vehicle.servos:
            if not 1 <= servo.value <= MAX_SERVOS:
                help = f"outputs have numbers from 1 to {MAX_SERVOS}"
                context.report.add(codes.NUMBER_SIZE, servo.span, f"there is no servo output {servo.value}", help=help)


def check_payload(context: CheckContext, vehicle: VehicleDecl, skill: SkillDecl) -> None:
    """Report each servo output that a skill sets and the vehicle does not declare free, and distances that the vehicle
    flies in less than the shortest interval.
    """
    free = [servo.value for servo in vehicle.servos]
    for emits in skill.emits:
        every, moment = emits.every, moment_of(emits)
        if isinstance(every, Quantity) and moment is EmissionMoment.DISTANCE:
            shortest = -(-MIN_EMISSION_INTERVAL * vehicle.speed.value // 1_000_000)
            if every.value < shortest:
                help = f"at its greatest speed it flies {display(shortest, Dimension.LENGTH)} in the shortest interval"
                context.report.add(codes.EMISSION_FORM, every.span, "payload is commanded too often", help=help)
        for each in emits.parameters:
            if emits.command.text != SERVO or each.fields[0].text != "param1":
                continue
            if isinstance(each.value, Quantity) and each.value.value in free:
                continue
            context.report.add(
                codes.SERVO_NOT_FREE,
                each.span,
                f"`{skill.name.text}` sets a servo output that `{vehicle.name.text}` does not declare free",
                help="write the number of the output, and declare it in the vehicle, as in `servos 9, 10`, if it "
                "drives no motor and no control surface",
                labels=[(vehicle.name.span, "the vehicle")],
            )


def _may_be_emitted(context: CheckContext, emits: EmitsDecl) -> bool:
    """Whether a command exists, may be emitted, and is for its addressee; reports it if not."""
    report, name, to = context.report, emits.command, emits.addressee
    known = context.dialect.enums["MAV_CMD"]
    if name.text not in known:
        report.add(
            codes.UNKNOWN_COMMAND,
            name.span,
            f"the dialect has no command `{name.text}`",
            help=suggestion(name.text, EMITTABLE),
            fix=correction(report, name.span, name.text, EMITTABLE),
        )
        return False
    if name.text not in EMITTABLE:
        help = f"skills emit {listed([each.removeprefix('MAV_CMD_') for each in EMITTABLE])}"
        report.add(codes.NEVER_EMITTED, name.span, f"no skill may emit `{name.text}`", help=help)
        return False
    if not one_of(context, codes.EMISSION_FORM, to, ADDRESSEES, "addressee"):
        return False
    understood = EMITTABLE[name.text].to
    if to.text not in understood:
        report.add(
            codes.EMISSION_FORM,
            to.span,
            f"`{name.text}` is not for a {to.text}",
            help=f"write `to {understood[0]}`",
            fix=correction(report, to.span, to.text, understood) if len(understood) == 1 else None,
        )
    return True


def moment_of(emits: EmitsDecl) -> EmissionMoment | None:
    """When a command is sent; None if that is unknown."""
    if isinstance(emits.every, Quantity):
        of_time = emits.every.dimension is Dimension.DURATION
        return EmissionMoment.TIME if of_time else EmissionMoment.DISTANCE
    if emits.every is not None:  # a name that is no size
        return None
    named, known = _named_moment(emits)
    return known.get(named.text)


def _named_moment(emits: EmitsDecl) -> tuple[Name, Mapping[str, EmissionMoment]]:
    """The written moment of a command that is not repeated, and those that exist."""
    if emits.each is not None:
        return emits.each, EACH
    assert emits.once is not None
    return emits.once, ONCE


def _time(context: CheckContext, skill: SkillDecl, emits: EmitsDecl) -> None:
    """Report a moment that does not exist, or not in this skill, and intervals that are none."""
    report, every, moment = context.report, emits.every, moment_of(emits)
    if isinstance(every, Reference):
        unknown_size(context, skill, every)
        return
    if every is not None:
        if every.dimension not in (Dimension.DURATION, Dimension.LENGTH):
            help = "write a distance or a time, as in `every 10 m` or `every 2 s`"
            report.add(codes.DIMENSION_MISMATCH, every.span, "a command is repeated by distance or by time", help=help)
        elif not 0 < every.value <= MAX_VALUE:
            report.add(codes.NOT_POSITIVE, every.span, f"`{report.text(every.span)}` must be above zero")
        elif moment is EmissionMoment.TIME and every.value < MIN_EMISSION_INTERVAL:
            help = f"the shortest interval is {display(MIN_EMISSION_INTERVAL, Dimension.DURATION)}"
            report.add(codes.EMISSION_FORM, every.span, "payload is commanded too often", help=help)
        return
    named, known = _named_moment(emits)
    if not one_of(context, codes.EMISSION_FORM, named, known, "moment") or moment is None:
        return
    motions = _WITH.get(moment)
    if motions is not None and skill.motion is not None and skill.motion.kind not in motions:
        report.add(
            codes.EMISSION_FORM,
            named.span,
            f"`{skill.name.text}` has no {named.text}s",
            help=f"only skills with `motion {' or '.join(motions)}` have {named.text}s",
            labels=[(skill.motion.span, "the motion")],
        )


def _success(context: CheckContext, emits: EmitsDecl) -> None:
    """Report a success that the command cannot have, and limits that do not fit it."""
    success, report = emits.success, context.report
    if success is None or not one_of(context, codes.EMISSION_FORM, success.by, SUCCESSES, "success"):
        return
    by = SUCCESSES[success.by.text]
    if by is not EmissionSuccess.ACKNOWLEDGEMENT and by not in EMITTABLE[emits.command.text].shown_by:
        help = "write `succeeds with acknowledgement within 3 s`"
        report.add(
            codes.EMISSION_FORM, success.by.span, f"no {success.by.text} follows `{emits.command.text}`", help=help
        )
    wanted = {Dimension.DURATION: ("a time", MAX_PAYLOAD_WAIT)}
    if by is EmissionSuccess.ATTITUDE:
        wanted[Dimension.ANGLE] = ("an angle", _FULL_TURN // 2)
    for limit in success.limits:
        what, most = wanted.pop(limit.dimension, ("", 0))
        if not what:
            help = "write the time, and the angle of an attitude, once: `within 2 deg within 3 s`"
            report.add(codes.EMISSION_FORM, limit.span, f"`{report.text(limit.span)}` limits nothing here", help=help)
        elif not 0 < limit.value <= most:
            help = f"write {what} up to {display(most, limit.dimension)}"
            report.add(codes.NUMBER_SIZE, limit.span, f"`{report.text(limit.span)}` is out of range", help=help)
    for what, _ in wanted.values():
        report.add(codes.EMISSION_FORM, success.span, f"the success has no limit that is {what}")


def limit_of(emits: EmitsDecl, dimension: Dimension, otherwise: int) -> int:
    """The limit of a dimension in which success must be seen."""
    limits = () if emits.success is None else emits.success.limits
    return next((each.value for each in limits if each.dimension is dimension), otherwise)


def sent_numbers(context: CheckContext, skill: SkillDecl, emits: EmitsDecl) -> tuple[SentNumber, ...]:
    """All seven parameters of a command that may be emitted; reports each that cannot be sent."""
    of, known = EMITTABLE[emits.command.text], context.dialect.commands.get(emits.command.text, {})
    fields = {**known, **_IN_WORDS.get(emits.command.text, {})}
    sent: dict[str, SentNumber] = {}
    given: dict[str, Name] = {}
    for each in emits.parameters:
        before = len(context.report.found)
        for field in each.fields:
            _exists(context, emits, field, fields)
            first = given.setdefault(field.text, field)
            if first is not field:
                context.report.add_twice(codes.DUPLICATE_ARGUMENT, field.span, f"`{field.text}`", "given", first.span)
        if len(context.report.found) == before:
            found = tuple(_numbers(context, skill, emits, each, fields))
            sent |= {field.text: value for field, value in zip(each.fields, found, strict=False)}
    for need in of.needs:
        if need not in given:
            context.report.add(
                codes.MISSING_ARGUMENT,
                emits.command.span,
                f"`{emits.command.text}` needs `{need}`" + (f", {fields[need].label}" if need in fields else ""),
                help=f"add it: `with {need} = ...`",
            )
    unset = {name: NAN if name in of.unset else 0 for name in (f"param{index}" for index in range(1, 8))}
    return tuple(sent.get(name, SentNumber(NumberOrigin.CONSTANT, None, bits)) for name, bits in unset.items())


def _exists(context: CheckContext, emits: EmitsDecl, field: Name, fields: Mapping[str, Field]) -> None:
    if field.text not in fields:
        has = f"it has {listed(fields)}" if fields else "it has none"
        context.report.add(
            codes.UNKNOWN_FIELD,
            field.span,
            f"`{emits.command.text}` has no parameter `{field.text}`, or reserves it",
            help=suggestion(field.text, fields, emits.command.text) or has,
            fix=correction(context.report, field.span, field.text, fields, emits.command.text),
        )


def _numbers(
    context: CheckContext, skill: SkillDecl, emits: EmitsDecl, given: EmittedParameter, fields: Mapping[str, Field]
) -> Iterator[SentNumber]:
    """What is sent of existing parameters: two for a place, else one; reports what cannot be sent."""
    value, labels = given.value, tuple(fields[each.text].label for each in given.fields)
    if isinstance(value, Quantity):
        yield from _constant(context, emits, value, given.fields[0], fields)
        return
    argument = context.arguments(skill).get(value.name)
    field = fields[given.fields[0].text]
    if argument is not None:
        if argument.type == POSITION and labels == ("Latitude", "Longitude"):
            yield SentNumber(NumberOrigin.LATITUDE, value.name, 0)
            yield SentNumber(NumberOrigin.LONGITUDE, value.name, 0)
        elif argument.type == POSITION or len(labels) == 2 or labels[0] in ("Latitude", "Longitude"):
            help = "write `(param5, param6) = ...` with a parameter of the skill that is a position"
            context.report.add(codes.FIELD_COUNT, given.span, "a place is latitude and longitude", help=help)
        else:
            yield from _argument(context, emits, value, argument, given.fields[0], field)
        return
    members = {} if field.enum is None else context.dialect.enums.get(field.enum, {})
    if value.name == UNSET and len(given.fields) == 1:
        unset = given.fields[0].text in EMITTABLE[emits.command.text].unset
        yield SentNumber(NumberOrigin.CONSTANT, None, NAN if unset else 0)
    elif value.name in members and len(given.fields) == 1:
        yield SentNumber(NumberOrigin.CONSTANT, None, nearest_bits(members[value.name], 1))
    else:
        known = [*context.arguments(skill), *members]
        context.report.add(
            codes.UNKNOWN_ARGUMENT,
            value.span,
            f"`{value.name}` is no parameter of `{skill.name.text}`, and no value of `{given.fields[0].text}`",
            help=suggestion(value.name, known),
            fix=correction(context.report, value.span, value.name, known),
        )


def _constant(
    context: CheckContext, emits: EmitsDecl, value: Quantity, field: Name, fields: Mapping[str, Field]
) -> Iterator[SentNumber]:
    is_height = fields[field.text].label == "Altitude"
    plain = value.dimension is Dimension.LENGTH and is_height
    dimension = Dimension.ALTITUDE if plain else value.dimension
    if is_height and value.datum is Datum.SEA:
        help = "write a height above home: it is sent as the autopilot expects it"
        context.report.add(codes.FIELD_DATUM, value.span, "a height is converted from one above home", help=help)
        return
    type = number(dimension, value.datum if dimension is Dimension.ALTITUDE else None)
    scale = _scale(context, emits, value, type, field, fields[field.text])
    if scale is not None and _is_precise(context, value, value.value, scale, dimension):
        if is_height:
            yield SentNumber(NumberOrigin.HEIGHT, None, value.value)
        else:
            yield SentNumber(NumberOrigin.CONSTANT, None, nearest_bits(value.value, scale))


def _argument(
    context: CheckContext, emits: EmitsDecl, written: Node, argument: Argument, field: Name, of: Field
) -> Iterator[SentNumber]:
    type, name = argument.type, argument.declaration.name.text
    if type.kind is not Kind.NUMBER or type.dimension is None:
        help = "send a number, or write the constant that is meant"
        context.report.add(codes.WRONG_TYPE, written.span, f"`{name}` is {type.describe()}", help=help)
        return
    scale = _scale(context, emits, written, type, field, of)
    if scale is None or argument.low is None or argument.high is None:
        return
    largest = max(argument.low, argument.high, key=abs)
    if _is_precise(context, written, largest, scale, type.dimension, any_below=True):
        if of.label == "Altitude":
            yield SentNumber(NumberOrigin.HEIGHT, name, 0)
        else:
            yield SentNumber(NumberOrigin.ARGUMENT, name, scale)


def _scale(context: CheckContext, emits: EmitsDecl, written: Node, type: Type, field: Name, of: Field) -> int | None:
    """Canonical units in the unit of a parameter; reports a number that has another dimension."""
    is_height = of.label == "Altitude"
    scale = scale_of(of.unit, type.dimension)
    if scale is not None and is_height == (type.dimension is Dimension.ALTITUDE):
        return scale
    has = f"is in `{of.unit}`" if of.unit else "has no unit"
    context.report.add(
        codes.FIELD_UNIT,
        written.span,
        f"`{field.text}` of `{emits.command.text}` {has}, which does not fit {type.describe()}",
        help="write a height above home" if is_height else "write a number with a unit of the same kind",
    )
    return None


def _is_precise(
    context: CheckContext, written: Node, value: int, scale: int, dimension: Dimension, *, any_below: bool = False
) -> bool:
    """Whether the float that is sent for a number is near enough to it, or with `any_below` that of each smaller number
    too; reports it if not.
    """
    precision = _PRECISION[dimension]
    if any_below and not precision:
        if abs(value) <= _WHOLE:
            return True
    elif abs(value) <= MAX_VALUE:
        bits = nearest_bits(value, scale)
        sent, above = Fraction(value_of(bits)) * scale, Fraction(value_of(bits + 1)) * scale
        if (abs(above - sent) / 2 if any_below else abs(sent - value)) <= precision:
            return True
    context.report.add(
        codes.EMITTED_NUMBER,
        written.span,
        f"{display(value, dimension)} is too large to be sent precisely",
        help="a parameter is a float of 32 bits: it holds whole numbers up to 16777216 (2 to the power of 24)"
        if dimension is Dimension.COUNT
        else f"a float of 32 bits must hold it within {display(precision, dimension)}",
    )
    return False
