"""What can be made to go wrong, and how a command line writes it: `wind,at=20s,speed=12m/s,from=270deg`.

`at_us` is the simulation's time, from its start; `for_us` None means for good.
"""

import re
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from decimal import Decimal
from enum import StrEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.modes import Mode


@dataclass(frozen=True, slots=True)
class Fault:
    """What goes wrong at a time."""

    at_us: int


class LinkFault(Fault):
    """Of the link, in one direction or both; or what the radio tells of it."""

    __slots__ = ()


class ReceiverFault(Fault):
    """Of the receiver of positions."""

    __slots__ = ()


class AutopilotFault(Fault):
    """Of the autopilot itself."""

    __slots__ = ()


class PilotFault(Fault):
    """Somebody takes over, past the link."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class BatteryLevel(Fault):
    """The battery is found to hold no more than this, in 1/10000."""

    level: int


@dataclass(frozen=True, slots=True)
class GpsLoss(ReceiverFault):
    """The receiver loses its fix."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsJump(ReceiverFault):
    """The receiver is off by this much more from now on."""

    north_mm: int
    east_mm: int


@dataclass(frozen=True, slots=True)
class GpsGlitch(ReceiverFault):
    """The receiver alone is off by this; the estimator does not believe it, and gives up after a while."""

    north_mm: int
    east_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class BatteryVoltage(Fault):
    """This voltage is measured from now on, whatever the battery holds."""

    voltage_mv: int


@dataclass(frozen=True, slots=True)
class WindStep(Fault):
    """The mean wind changes to this speed, from this direction; gusts end unless given."""

    speed_mm_s: int
    from_deg: int = 0
    gust_mm_s: int = 0


class Way(StrEnum):
    """A direction of the link."""

    BOTH = "both"
    UP = "up"
    """To the vehicle."""
    DOWN = "down"
    """From the vehicle."""


@dataclass(frozen=True, slots=True)
class LinkDelay(LinkFault):
    """Every datagram takes this much longer."""

    delay_us: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkJitter(LinkFault):
    """Every datagram takes up to this much longer, each another time; none overtakes another."""

    jitter_us: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkReorder(LinkFault):
    """This part of the datagrams, in 1/10000, is overtaken by those that are sent in the 60 ms after."""

    part: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkLoss(LinkFault):
    """This part of the datagrams, in 1/10000, is lost; RADIO_STATUS tells."""

    loss: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkSilence(LinkFault):
    """Nothing gets through: it is lost, or `held` back until the silence is over and comes in one burst."""

    for_us: int | None = None
    way: Way = Way.BOTH
    held: bool = False


@dataclass(frozen=True, slots=True)
class Stall(AutopilotFault):
    """The autopilot's loop halts: its time and its flight stand still, as recorded (arducopter-dropout).

    What was sent meanwhile waits and is answered in one burst. With a `shuffle` other than 0, what it says in the first
    200 ms after comes at once at their end, in an order that is drawn from that seed.
    """

    for_us: int
    shuffle: int = 0


@dataclass(frozen=True, slots=True)
class Freeze(AutopilotFault):
    """The measurements stand still at their source: messages go on with old values and old time stamps."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageSilence(AutopilotFault):
    """One message of the autopilot, by its MAVLink name, does not come any more."""

    message: str
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class LinkQuality(LinkFault):
    """RADIO_STATUS tells of this quality, in 1/10000, though nothing is lost yet."""

    quality: int


@dataclass(frozen=True, slots=True)
class Obstacle(Fault):
    """The sensor sees something ahead at this distance, and goes on seeing it there wherever the vehicle goes."""

    distance_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Pillar(Fault):
    """A round thing stands in the world, from the ground up: what is seen of it depends on where the vehicle is.

    The place of its middle, and its height, are from home. Who flies into it crashes.
    """

    north_mm: int
    east_mm: int
    radius_mm: int
    height_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class PilotMode(PilotFault):
    """The pilot takes over with the mode switch."""

    mode: Mode = Mode.POSITION


@dataclass(frozen=True, slots=True)
class PilotPause(PilotFault):
    """The pilot stops it from a ground station, and the mode does not change.

    PX4: DO_REPOSITION without a place. ArduCopter: DO_PAUSE_CONTINUE, which has an effect in GUIDED only.
    """


@dataclass(frozen=True, slots=True)
class PilotGoto(PilotFault):
    """The pilot sends it elsewhere from a ground station, with DO_REPOSITION; the place and height are from home.

    PX4: the mode is Hold, as for a target of ours. ArduCopter: GUIDED, likewise.
    """

    north_mm: int
    east_mm: int
    up_mm: int


@dataclass(frozen=True, slots=True)
class PilotSticks(PilotFault):
    """The pilot moves the sticks of the remote control for a while, to steer it east.

    PX4 leaves every automatic mode for Position (COM_RC_OVERRIDE, bit 0, on by default; bit 1, for OFFBOARD, is off).
    ArduCopter does not mind in GUIDED, AUTO and BRAKE; while it lands it is moved aside at up to 1.25 m/s
    (LAND_REPOSITION, on by default; `land_run_horizontal_control`), and in LOITER and POSHOLD too.
    """

    for_us: int = 2_000_000


@dataclass(frozen=True, slots=True)
class Kill(PilotFault):
    """The motors stop, wherever it is: disarmed by force. In the air it falls."""


KINDS: Mapping[str, type[Fault]] = {
    "battery": BatteryLevel,
    "gps-loss": GpsLoss,
    "battery-voltage": BatteryVoltage,
    "gps-jump": GpsJump,
    "gps-glitch": GpsGlitch,
    "wind": WindStep,
    "link-delay": LinkDelay,
    "link-jitter": LinkJitter,
    "link-reorder": LinkReorder,
    "link-loss": LinkLoss,
    "link-silence": LinkSilence,
    "link-quality": LinkQuality,
    "obstacle": Obstacle,
    "pillar": Pillar,
    "pilot": PilotMode,
    "pilot-mode": PilotMode,
    "pilot-pause": PilotPause,
    "pilot-goto": PilotGoto,
    "pilot-sticks": PilotSticks,
    "kill": Kill,
    "stall": Stall,
    "freeze": Freeze,
    "mute": MessageSilence,
}

# How a field's name ends tells its unit; what may be written, and how many of the field's unit it is.
_UNITS: tuple[tuple[str, Mapping[str, int]], ...] = (
    ("_us", {"us": 1, "ms": 1000, "s": 1_000_000, "min": 60_000_000}),
    ("_mv", {"mV": 1, "V": 1000}),
    ("_mm_s", {"mm/s": 1, "m/s": 1000}),
    ("_mm", {"mm": 1, "m": 1000}),
    ("_deg", {"deg": 1}),
    ("", {"%": 100}),
)
_WORDS: Mapping[str, type[Mode | Way]] = {"mode": Mode, "way": Way}
_QUANTITY = re.compile(r"(-?\d+(?:\.\d+)?)(\D*)", re.ASCII)


def parse_fault(text: str) -> Fault:
    """The fault that a text describes. Raises ValueError, with a message for a person, if it describes none."""
    name, *pairs = text.split(",")
    kind = KINDS.get(name)
    if kind is None:
        raise ValueError(f"no such fault: `{name}`; there are {', '.join(KINDS)}")
    known = {_key(field): field for field in fields(kind)}
    values: dict[str, Any] = {}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if key not in known:
            raise ValueError(f"`{name}` has no `{key}`; it takes {', '.join(known)}")
        values[known[key].name] = _value(known[key], value)
    missing = [key for key, field in known.items() if field.default is MISSING and field.name not in values]
    if missing:
        raise ValueError(f"`{name}` needs {', '.join(missing)}")
    return kind(**values)


def message_number(name: str) -> int:
    """The number of a message. Raises ValueError if the dialect has none of this name."""
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}", None)
    if not isinstance(number, int):
        raise ValueError(f"no such message: `{name}`")
    return number


def _suffix(field: Field[Any]) -> tuple[str, Mapping[str, int]]:
    return next(unit for unit in _UNITS if field.name.endswith(unit[0]))


def _key(field: Field[Any]) -> str:
    return field.name.removesuffix(_suffix(field)[0])


def _value(field: Field[Any], text: str) -> int | str:
    if field.name in _WORDS:
        if text not in list(_WORDS[field.name]):
            raise ValueError(f"no such {field.name}: `{text}`; there are {', '.join(_WORDS[field.name])}")
        return _WORDS[field.name](text)
    if field.name == "held":
        if text not in ("yes", "no"):
            raise ValueError(f"`held` is yes or no, not `{text}`")
        return text == "yes"
    if field.name == "shuffle":
        if not text.isdecimal():
            raise ValueError(f"`shuffle` is the seed of an order, not `{text}`")
        return int(text)
    if field.name == "message":
        message_number(text)
        return text
    match = _QUANTITY.fullmatch(text)
    units = _suffix(field)[1]
    if match is None or match[2] not in units:
        raise ValueError(f"`{_key(field)}` is a number with its unit ({', '.join(units)}), not `{text}`")
    return round(Decimal(match[1]) * units[match[2]])
