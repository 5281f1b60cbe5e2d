"""Which commands, mission items, messages and flight modes of MAVLink stand for a skill: the lowered `accepts` lines.

The table is used on the ground alone; no bundle carries it. A skill may have several rows: the first that matches
counts. Rows of different skills never match the same frame (E0418).
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from rtshcua.ground.checker.checks.accepts import fields_of, fixed_value, number_of, scale_of
from rtshcua.ground.checker.name_scope import parameter_type
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.language.load import Program
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.skills import AcceptsDecl, FixedFieldDecl, SkillDecl, SourcedArgument, Substitute
from rtshcua.model.quantity import Dimension

#: `kind` of a row. A COMMAND stands for COMMAND_LONG and COMMAND_INT; an ITEM for MISSION_ITEM and MISSION_ITEM_INT, in
#: an upload or alone (ArduPilot's guided item, `current` = 2); a MODE for SET_MODE and DO_SET_MODE
COMMAND: Final = "command"
ITEM: Final = "item"
MESSAGE: Final = "message"
MODE: Final = "mode"


class FixedField(NamedTuple):
    """A field that must have a value, or the row does not match: `where type_mask has 504`.

    Matches if `value & mask == self.value`; `mask` is -1 for the whole value. A field that is a float matches if it is
    equal to the value; NaN equals nothing. A `value` of None matches a field that is unset: NaN, or INT32_MAX of an
    integer (also `x` and `y` for `param5` and `param6`).
    """

    field: str
    value: int | None
    mask: int = -1


class ArgumentSource(NamedTuple):
    """The field, or the two fields of a position, from which one argument of the skill is read. Without a field it is
    always what `otherwise` says.

    Of a command and an item the fields are `param1` .. `param7`, and `scale` is that of COMMAND_LONG and MISSION_ITEM.
    COMMAND_INT and MISSION_ITEM_INT have `x`, `y`, `z` in the place of `param5`, `param6`, `param7`; their `x` and `y`
    of a position are in 1e-7 degree already (scale 1). Of a message, the fields are the message's own.
    """

    parameter: str
    fields: tuple[str, ...]  # one; latitude and longitude of a position; or none
    scale: int  # canonical units (mm, mm/s, us, 1e-7 degree, 1/10000) in one unit of the field
    # of an altitude: "home", "sea", or "frame": by the frame field. A COMMAND_LONG has no frame: then above sea on PX4,
    # and refused on ArduPilot, as these autopilots read it themselves. "" for all other arguments
    datum: str
    # what an unset field means (NaN, INT32_MAX of an integer; of a speed zero and less, too): "default" (of the skill),
    # "here" (the position or the height at which the vehicle is), "MIS_TAKEOFF_ALT above home" (this parameter of the
    # autopilot, in m, m/s, s, deg, V or %), or "": then the row does not match
    otherwise: str


class AcceptedCommand(NamedTuple):
    """One row: what a client sends, and the skill with its arguments. Parameters that no argument names keep their
    defaults; other fields of the frame are ignored.
    """

    skill: str
    kind: str  # COMMAND, ITEM, MESSAGE, MODE
    name: str  # MAV_CMD_..., the message's name, or the mode's name in `mavlink/modes.py`: RETURN, RTL
    number: int  # of the command or the message; `custom_mode` of the mode
    autopilot: str  # "px4", "ardupilot", or "" for both
    fixed: tuple[FixedField, ...]
    arguments: tuple[ArgumentSource, ...]


#: the unit of an autopilot's parameter, by the dimension of the argument
UNITS_OF_PARAMETERS: Final = {
    Dimension.LENGTH: "m",
    Dimension.ALTITUDE: "m",
    Dimension.SPEED: "m/s",
    Dimension.DURATION: "s",
    Dimension.ANGLE: "deg",
    Dimension.VOLTAGE: "V",
    Dimension.RATIO: "%",
    Dimension.COUNT: "",
}


def accepted_commands(program: Program, dialect: Dialect, policy: Policy) -> tuple[AcceptedCommand, ...]:
    """The rows of the skills of a policy, in the order of the sources. The program has no errors."""
    known = {contract.name for contract in policy.contracts}
    skills = collect(program.units, program.broken).skills.values()
    return tuple(row for skill in skills if skill.name.text in known for row in rows_of(skill, dialect))


def rows_of(skill: SkillDecl, dialect: Dialect) -> Iterator[AcceptedCommand]:
    """Yield the rows of a skill without errors."""
    for accepts in skill.accepts:
        yield AcceptedCommand(
            skill.name.text,
            accepts.kind,
            accepts.name.text,
            number_of(dialect, accepts),
            "" if accepts.autopilot is None else accepts.autopilot.text,
            tuple(_fixed(dialect, accepts, each) for each in accepts.where),
            tuple(_source(dialect, skill, accepts, each) for each in accepts.arguments),
        )


def _fixed(dialect: Dialect, accepts: AcceptsDecl, fixed: FixedFieldDecl) -> FixedField:
    found = fixed_value(dialect, fields_of(dialect, accepts)[fixed.field.text], fixed)
    return FixedField(fixed.field.text, None) if found is None else FixedField(fixed.field.text, *found)


def _source(dialect: Dialect, skill: SkillDecl, accepts: AcceptsDecl, source: SourcedArgument) -> ArgumentSource:
    declared = next(each for each in skill.parameters if each.name.text == source.parameter.text)
    type = parameter_type(declared)
    dimension = None if type is None else type.dimension
    fields = fields_of(dialect, accepts)
    unit = "degE7" if dimension is None else UNITS_OF_PARAMETERS[dimension]
    if source.fields:
        unit = fields[source.fields[0].text].unit
    scale = scale_of(unit, dimension)
    assert scale is not None, source
    names = tuple(field.text for field in source.fields)
    return ArgumentSource(source.parameter.text, names, scale, source.datum or "", _otherwise(source.substitute))


def _otherwise(substitute: Substitute | None) -> str:
    if substitute is None:
        return ""
    if substitute.parameter is None:
        return substitute.kind
    return substitute.parameter.text + ("" if substitute.datum is None else f" above {substitute.datum}")
