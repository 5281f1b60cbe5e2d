"""Which commands, mission items, messages and flight modes of MAVLink stand for a skill: the lowered `accepts` lines.

The table is used on the ground alone; no bundle carries it. A skill may have several rows. At most one skill has a row
for a given trigger (`kind`, `number`, autopilot, `fixed` fields), so the first row that matches is the only skill.
"""

from typing import Final, NamedTuple

#: `kind` of a row. A COMMAND stands for COMMAND_LONG and COMMAND_INT; an ITEM for MISSION_ITEM and MISSION_ITEM_INT, in
#: an upload or alone (ArduPilot's guided item, `current` = 2); a MODE for SET_MODE and DO_SET_MODE
COMMAND: Final = "command"
ITEM: Final = "item"
MESSAGE: Final = "message"
MODE: Final = "mode"


class FixedField(NamedTuple):
    """A field that must have a value, or the row does not match: `where type_mask has X_IGNORE`.

    Matches if `value & mask == self.value`; `mask` is -1 for the whole value. A field that is a float matches if it is
    equal to the value; NaN equals nothing.
    """

    field: str
    value: int
    mask: int = -1


class ArgumentSource(NamedTuple):
    """The field, or the two fields of a position, from which one argument of the skill is read.

    Of a command and an item the fields are `param1` .. `param7`, and `scale` is that of COMMAND_LONG and MISSION_ITEM.
    COMMAND_INT and MISSION_ITEM_INT have `x`, `y`, `z` in the place of `param5`, `param6`, `param7`; their `x` and `y`
    of a position are in 1e-7 degree already (scale 1). Of a message, the fields are the message's own.
    """

    parameter: str
    fields: tuple[str, ...]  # one; latitude and longitude of a position
    scale: int  # canonical units (mm, mm/s, us, 1e-7 degree, 1/10000) in one unit of the field
    # of an altitude: "home", "sea", or "frame": by the frame field. A COMMAND_LONG has no frame: then above sea on PX4,
    # and refused on ArduPilot, as these autopilots read it themselves. "" for all other arguments
    datum: str
    # what NaN (INT32_MAX of an integer, a negative speed) means: "default" (of the skill), "here" (the position or the
    # height at which the vehicle is), "MIS_TAKEOFF_ALT above home" (this parameter of the autopilot, in the unit of the
    # field), or "" (refused)
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
