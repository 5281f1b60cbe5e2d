"""Skill contracts, lowered."""

from enum import IntEnum
from typing import ClassVar

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.struct import Extended, Flat


class TimingClass(IntEnum):
    """Paper symbol `cls`: the speed class of a decision, which limits who may request it."""

    SEMANTIC = 0
    TACTICAL = 1
    REFLEX = 2


class SourceKind(IntEnum):
    """Paper symbol `src`: the source of a request."""

    AGENT = 0
    OPERATOR = 1
    ONBOARD = 2
    REFLEX = 3


class MotionKind(IntEnum):
    """Where a skill takes the vehicle."""

    HOLD = 0  # stay
    CLIMB = 1  # straight up to the altitude
    FLY = 2  # to one point at an altitude
    COVER = 3  # along a survey path within a zone at an altitude
    HOME = 4  # to home, and land there
    LAND = 5  # straight down


#: kinds of parameters: an integer quantity, an enumeration, a zone index, a place (two cells: local x, y in mm)
QUANTITY, CHOICE, ZONE, PLACE = 0, 1, 2, 3


class Parameter(Flat, frozen=True):
    """A parameter at argument cell `cell`; `low`, `high` bound a quantity, a choice's ordinal, or a zone's index."""

    name: str
    kind: int
    dimension: str
    cell: int
    low: int
    high: int
    labels: tuple[str, ...]


class Link(Flat, frozen=True):
    """One link of a chain: run `skill` with `arguments` for at most `limit_us` (0: until it ends by itself)."""

    skill: int
    arguments: tuple[int, ...]
    limit_us: int
    text: str
    source: int
    start: int
    end: int


class Facing(IntEnum):
    """Where the nose points on a survey path."""

    ALONG = 0  # along each leg
    INWARD = 1  # to the middle of the zone


class Motion(Extended, frozen=True):
    """The kind of motion, and the argument cells of its altitude, its speed and its holding time (-1: none).

    `lowest` is the argument cell of the lowest height of a survey path at several heights, whose highest one is the
    altitude (-1: all points are at the altitude). `facing` is a `Facing`.
    """

    LEAST: ClassVar[int] = 4

    kind: int
    altitude: int
    speed: int
    time: int = -1
    lowest: int = -1
    facing: int = 0


class Addressee(IntEnum):
    """The component that a command to payload is for."""

    VEHICLE = 0  # the autopilot
    CAMERA = 1
    GIMBAL = 2


class EmissionMoment(IntEnum):
    """When a command to payload is sent. The last two repeat it, by a distance in mm or a time in us."""

    BEGIN = 0
    END = 1
    TURN = 2  # at each point of the path between its first and its last
    WAYPOINT = 3  # at each point of the path
    DISTANCE = 4
    TIME = 5


class EmissionSuccess(IntEnum):
    """What shows that a command to payload had its effect."""

    ACKNOWLEDGEMENT = 0
    IMAGE = 1  # CAMERA_IMAGE_CAPTURED or CAMERA_FEEDBACK
    ATTITUDE = 2  # GIMBAL_DEVICE_ATTITUDE_STATUS, within a bound
    ALL_IMAGES = 3  # an acknowledgement, and at the end of the step no image of the flight is missing


class NumberOrigin(IntEnum):
    """Where a parameter of a command to payload comes from."""

    CONSTANT = 0
    ARGUMENT = 1
    LATITUDE = 2
    LONGITUDE = 3
    HEIGHT = 4


class EmissionParameter(Flat, frozen=True):
    """One of the seven parameters of a command to payload, a 32-bit float.

    `value` is its bits (`CONSTANT`, `cell` is -1), or what divides the argument at `cell` (`ARGUMENT`). A place at
    `cell` gives degrees, and `value` is 0. A height in mm above home is the argument at `cell`, or `value` if that is
    -1; it is sent in metres above what the autopilot expects.
    """

    origin: int
    cell: int
    value: int


class Emission(Flat, frozen=True):
    """A command (MAV_CMD) that a skill sends to payload while it flies.

    `amount` is the distance in mm or the time in us between two, 0 if it is not repeated. Success must be seen within
    `within_us`, of an attitude within `bound` (1e-7 degree, else 0). If it is `required` (1), its failure is that of
    the step.
    """

    command: int
    addressee: int
    parameters: tuple[EmissionParameter, ...]
    moment: int
    amount: int
    success: int
    bound: int
    within_us: int
    required: int
    text: str


class Contract(Extended, frozen=True):
    """A skill contract (section 2: `op`, `pre`, `ddl`, `vw`, `sc`, `inv`, `f_b`, `ev`). Times in us, energy in
    1/10000.

    `phases` are names; empty means any. `reads` are the slots that its clauses read, ascending.
    """

    LEAST: ClassVar[int] = 16

    name: str
    parameters: tuple[Parameter, ...]
    motion: Motion
    timing_class: int
    deadline_us: int
    validity_us: int
    phases: tuple[str, ...]
    duration_us: int
    grace_us: int
    require: tuple[Clause, ...]
    assume: tuple[Clause, ...]
    maintain: tuple[Clause, ...]
    fallback: tuple[Link, ...]
    energy: int
    record: tuple[str, ...]
    reads: tuple[int, ...]
    emits: tuple[Emission, ...] = ()
