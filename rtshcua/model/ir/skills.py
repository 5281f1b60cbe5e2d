"""Skill contracts: the bounded capabilities of section 2, and their fallback chains."""

from typing import Literal

from rtshcua.model.ir.expression import Condition, Quantity, Range, Reference, Value
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import OpticalLength


class ParameterDecl(Node):
    """`altitude: altitude in 5 m .. 60 m = 20 m`, `area: zone`, `target: position`, `pattern: one of grid, orbit =
    grid`.
    """

    name: Name
    type: Name  # a dimension, `zone`, `position`, or `choice` for `one of`
    range: Range | None
    choices: tuple[Name, ...]
    default: Value | None


class MotionDecl(Node):
    """Where the skill takes the vehicle, so that its planned volume is known before the flight.

    `climb to altitude` straight up; `fly to target at altitude`; `cover area at altitude` by a survey path; `cover
    area from lowest to altitude every step` by one path at several heights; `fly home` and land there; `hold`
    position; `land` here.
    """

    kind: Literal["climb", "fly", "cover", "home", "hold", "land"]
    target: Name | None  # a parameter of type position or zone
    altitude: Name | None  # a parameter of type altitude
    speed: Name | None  # a parameter of type speed
    pattern: Name | None  # a choice parameter
    time: Name | None = None  # a parameter of type duration: `hold for time`
    lowest: Name | None = None  # a parameter of type altitude; `altitude` is then the highest
    every: Name | None = None  # a parameter of type length: the greatest distance of two heights
    facing: Literal["inward"] | None = None
    distance: Name | None = None  # a parameter of type length: from the structure that a pattern looks at


class ArgumentValue(Node):
    """`altitude = 20 m`, or a positional argument (`name` is None)."""

    name: Name | None
    value: Value


class LinkDecl(Node):
    """One link of a fallback or contingency chain: `hover for 20 s`."""

    skill: Name
    arguments: tuple[ArgumentValue, ...]
    limit: Quantity | None


class ClauseDecl(Node):
    """One condition of `require`, `assume` or `maintain`; a top-level `and` is already split into clauses.

    With `where_fitted` (`assume obstacle.distance > 3 m where fitted`) the clause is left out for a vehicle
    without a signal that it reads.
    """

    condition: Condition
    where_fitted: bool = False


class FixedFieldDecl(Node):
    """`param1 = 0`, `type_mask has 504`, `param7 = unset`: a condition on a field of what a skill accepts."""

    field: Name
    relation: Literal["=", "has", "lacks"]
    value: Name  # a number, an enumerator of the dialect, or `unset`


class Substitute(Node):
    """The value of an argument whose field is unset: `default`, `here`, `parameter MIS_TAKEOFF_ALT above home`."""

    kind: Literal["default", "here", "parameter"]
    parameter: Name | None = None  # of the autopilot
    datum: Literal["home", "sea"] | None = None


class SourcedArgument(Node):
    """`altitude = param7 above sea or parameter MIS_TAKEOFF_ALT above home`, `target = (param5, param6)`."""

    parameter: Name
    fields: tuple[Name, ...]  # latitude and longitude of a position; none: always the substitute
    datum: Literal["home", "sea", "frame"] | None  # `frame`: that of the message
    substitute: Substitute | None


class AcceptsDecl(Node):
    """`accepts MAV_CMD_NAV_TAKEOFF on ardupilot with altitude = param7 above home`.

    What a MAVLink client sends to a gateway, and the skill stands for. It is used on the ground alone.
    """

    kind: Literal["command", "item", "message", "mode"]
    name: Name
    autopilot: Name | None  # None: any
    where: tuple[FixedFieldDecl, ...]
    arguments: tuple[SourcedArgument, ...]


class EmittedParameter(Node):
    """`param3 = 1`, `param1 = pitch`, `param5 = unset`, `(param5, param6) = target`: a parameter of a command."""

    fields: tuple[Name, ...]  # latitude and longitude, for a parameter of the skill that is a position
    value: Quantity | Reference  # a name: of a parameter of the skill, of an enumerator of the dialect, or `unset`


class SuccessDecl(Node):
    """`succeeds with attitude within 2 deg within 3 s`: what shows that a command to payload had its effect."""

    by: Name  # image, attitude, acknowledgement
    limits: tuple[Quantity, ...]  # a time, and an angle of an attitude


class EmitsDecl(Node):
    """`emits MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every 10 m`: a command to payload."""

    command: Name
    addressee: Name  # camera, gimbal, vehicle
    parameters: tuple[EmittedParameter, ...]
    once: Name | None  # `at begin`, `at end`
    each: Name | None  # `at each turn`, `at each waypoint`
    every: Quantity | Reference | None  # one of these three; a name: of a size
    success: SuccessDecl | None
    required: bool  # its failure is that of the step


class PicturesDecl(Node):
    """`pictures by mapper every 10 m resolution 2 cm overlap 80 % forward 70 % side blur 50 % relief 5 m`.

    What the pictures of a survey must show, proved from the vehicle's camera and the planned path, on the ground alone.
    """

    camera: Name
    every: Quantity | None  # a length along the path, or a duration
    resolution: OpticalLength | Quantity | None  # the most that a pixel may show; a length if it is a size
    forward: Quantity | None
    side: Quantity | None
    blur: Quantity | None  # the most that a picture may smear, in shares of a pixel
    relief: Quantity | None  # how far the ground may lie above or below home

    @property
    def resolution_um(self) -> int | None:
        """The resolution in um."""
        written = self.resolution
        if written is None:
            return None
        return written.value if isinstance(written, OpticalLength) else written.value * 1_000


class Sized(Node):
    """`lasts at most longest`: a part of a contract, or of its `pictures`, whose value is one of the skill's sizes."""

    part: Literal[
        "deadline", "validity", "duration", "grace", "energy",
        "every", "resolution", "forward", "side", "blur", "relief",
    ]  # fmt: skip
    size: Reference


class SkillDecl(Node, kw_only=True):
    """A skill contract. None or an empty tuple means: not written (the checker reports the required fields).

    `sizes` are numbers that a program may set (`SizesDecl`), each with a default; `sized` are the parts that name
    one. `checker/symbols.py` substitutes the values, and `sized` is then empty. `accepts` and `pictures` are no part of
    the contract.
    """

    name: Name
    parameters: tuple[ParameterDecl, ...]
    motion: MotionDecl | None
    timing_class: Name | None  # semantic, tactical, reflex
    deadline: Quantity | None
    validity: Quantity | None
    phases: tuple[Name, ...]  # `during a, b`; empty: any phase
    duration: Quantity | None  # `lasts at most 5 min`
    grace: Quantity | None  # how long a clause may be UNKNOWN while the skill runs
    require: tuple[ClauseDecl, ...]
    assume: tuple[ClauseDecl, ...]
    maintain: tuple[ClauseDecl, ...]
    fallback: tuple[LinkDecl, ...]
    energy: Quantity | None
    record: tuple[Name, ...]
    sizes: tuple[ParameterDecl, ...] = ()
    sized: tuple[Sized, ...] = ()
    accepts: tuple[AcceptsDecl, ...] = ()
    pictures: PicturesDecl | None = None
    emits: tuple[EmitsDecl, ...] = ()


class GivenSize(Node):
    """`highest = 120 m`."""

    name: Name
    value: Quantity


class SizesDecl(Node):
    """`sizes goto(highest = 120 m, longest = 6 min)`: the values of a skill's sizes in a program."""

    skill: Name
    given: tuple[GivenSize, ...]
