"""Translate a client's command, message, mission item or mode into a step: a skill with arguments in canonical units.

The table of accepted commands (`accepted.py`) says which skill and which fields. Values are quantised here, once.
Heights become heights above home here, in one place. What cannot be read exactly is refused, and never guessed.
"""

from collections import defaultdict
from collections.abc import Mapping
from math import isfinite, isnan
from typing import Final, NamedTuple, TypeAlias

from rtshcua.ground.agent.value_patterns import written
from rtshcua.ground.checker.checks.accepts import scale_of
from rtshcua.ground.gateway.accepted import COMMAND, ITEM, MESSAGE, UNITS_OF_PARAMETERS, AcceptedCommand, ArgumentSource
from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.interface import GatewaySettings, ProposedStep
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import DENIED, TEMPORARILY_REJECTED
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.mavlink.quantise import quantise
from rtshcua.model.flat.contract import PLACE, QUANTITY, Contract, MotionKind, Parameter
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.zone import HALF_TURN, MAX_COORDINATE, meridian, project
from rtshcua.model.quantity import Dimension

_AUTOPILOTS: Final = {PX4: "px4", ARDUPILOT: "ardupilot"}
#: frames whose heights are above mean sea level, and above home
SEA_FRAMES: Final = frozenset({enums.MAV_FRAME_GLOBAL, enums.MAV_FRAME_GLOBAL_INT})
HOME_FRAMES: Final = frozenset({enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})
#: the messages whose place is in 1e-7 degree
_WHOLE: Final = frozenset({layouts.COMMAND_INT, layouts.MISSION_ITEM_INT, layouts.SET_POSITION_TARGET_GLOBAL_INT})
#: the names of a table's fields in messages with x, y and z
_PLACED: Final = {"param5": "x", "param6": "y", "param7": "z"}
_WITH_XYZ: Final = frozenset({layouts.COMMAND_INT, layouts.MISSION_ITEM_INT, layouts.MISSION_ITEM})
_POLE: Final = 900_000_000
#: a place of take-off that is further away than this is another place, in 1e-7 degree (some 5 m)
_NEAR: Final = 500
#: NAV_WAYPOINT, NAV_LOITER_UNLIM, NAV_LAND, NAV_TAKEOFF, DO_REPOSITION: `param4` is the yaw, or NaN
_WITH_YAW: Final = frozenset({16, 17, 21, 22, 192})
#: POSITION_TARGET_TYPEMASK_YAW_IGNORE and _YAW_RATE_IGNORE
_YAW_IGNORED: Final = 1 << 10 | 1 << 11
#: what an argument is that the message does not give, without a look at the vehicle's parameters
_WITHOUT_VALUE: Final = frozenset({"default", "here", ""})
#: an argument: its cells in canonical units, and its text in the language
Argument: TypeAlias = tuple[tuple[int, ...], str]


class Untranslated(NamedTuple):
    """Why a command cannot be a step: the MAV_RESULT, and the reason for the client's screen.

    `wanted` is a parameter of the autopilot whose value is missing.
    """

    result: int
    text: str
    wanted: str = ""


def shadowed_parameters(rows: tuple[AcceptedCommand, ...]) -> frozenset[str]:
    """The autopilot's parameters that only give defaults of commands: a client's value stays in the gateway."""
    otherwise = {source.otherwise for row in rows for source in row.arguments}
    return frozenset(each.partition(" above ")[0] for each in otherwise - _WITHOUT_VALUE)


class Translation:
    """Translates under the settings of one gateway, with what was seen of the vehicle."""

    def __init__(self, settings: GatewaySettings, seen: VehicleSeen) -> None:
        self._policy = settings.policy.policy
        self._autopilot = settings.autopilot
        self._defaults = settings.defaults
        self._seen = seen
        self._contracts = {contract.name: contract for contract in self._policy.contracts}
        #: the parameters that are speeds, by skill
        self._speeds = {
            (contract.name, each.name)
            for contract in self._policy.contracts
            for each in contract.parameters
            if each.dimension == Dimension.SPEED.value
        }
        self._rows = defaultdict[tuple[str, int], list[AcceptedCommand]](list)
        for row in settings.accepted:
            if row.autopilot in ("", _AUTOPILOTS.get(settings.autopilot)):
                self._rows[row.kind, row.number].append(row)

    def row(self, kind: str, number: int, message: Received) -> AcceptedCommand | None:
        """The row that a command, item, message or mode matches; None if it has no mapping."""
        return next((row for row in self._rows.get((kind, number), ()) if self._matches(row, message)), None)

    def _matches(self, row: AcceptedCommand, message: Received) -> bool:
        """Whether every fixed field has its value, and every argument without a substitute is given."""
        if not all(_has(message, *field) for field in row.fixed):
            return False
        return not any(
            _is_unset(source, message, of_speed=(row.skill, source.parameter) in self._speeds)
            for source in row.arguments
            if not source.otherwise
        )

    def knows(self, kind: str, number: int) -> bool:
        """Whether the table has any row for it, whatever its other fields say."""
        return (kind, number) in self._rows

    def drops_yaw(self, message: Received) -> bool:
        """Whether a message that has a mapping asks for a yaw that no argument of its skill is read from."""
        if not _asks_for_yaw(message, self._autopilot):
            return False
        kind, number = MESSAGE, message.message
        if "command" in message.fields:
            kind, number = (ITEM if "seq" in message.fields else COMMAND), message.fields["command"]
        row = self.row(kind, number, message)
        return row is not None and not any({"param4", "yaw"}.intersection(each.fields) for each in row.arguments)

    def contract(self, skill: str) -> Contract | None:
        """The policy's contract of a skill; None if no rule of the policy names it."""
        return self._contracts.get(skill)

    def step(
        self, row: AcceptedCommand, message: Received, shadows: Mapping[str, float], now_us: int
    ) -> ProposedStep | Untranslated:
        """The step for a message that matches a row. `shadows` are the client's values of shadowed parameters."""
        contract = self._contracts.get(row.skill)
        if contract is None:
            return Untranslated(DENIED, f"{row.skill}: no rule of {self._policy.name} names this skill")
        sources = {source.parameter: source for source in row.arguments}
        defaults = self._defaults.get(row.skill, {})
        cells: list[int] = []
        texts: dict[str, str] = {}
        for parameter in contract.parameters:
            source = sources.get(parameter.name)
            found = None if source is None else self._argument(parameter, source, message, shadows, now_us)
            if isinstance(found, Untranslated):
                return found._replace(text=f"{row.skill}: {found.text}")
            if found is not None:
                cells += found[0]
                texts[parameter.name] = found[1]
            elif parameter.name in defaults:
                cells += defaults[parameter.name]
            else:
                return Untranslated(DENIED, f"{row.skill}: {parameter.name} is missing")
        return ProposedStep(row.skill, texts, tuple(cells))

    def is_elsewhere(self, item: Received, now_us: int) -> bool:
        """Whether an item has a place that is not where the vehicle stands; where that is not known, not home."""
        if not has_place(item):
            return False
        here, plane = self._seen.here(now_us) if self._seen.on_ground else None, self._policy.projection
        at = (plane.latitude, plane.longitude) if here is None else (int(here.fields["lat"]), int(here.fields["lon"]))
        scale = 1 if item.message in _WHOLE else 10_000_000
        latitude, longitude = (quantise(item.number(name), scale, 1) for name in ("x", "y"))
        if latitude is None or longitude is None:
            return True
        return max(abs(latitude - at[0]), abs(meridian(longitude, at[1]) - at[1])) > _NEAR

    def flies_after_takeoff(self, item: Received, now_us: int) -> bool:
        """Whether the vehicle flies to the place of a take-off item after the climb: PX4 does (`mission.cpp`),
        ArduCopter ignores the place.
        """
        return self._autopilot == PX4 and self.is_elsewhere(item, now_us)

    def takeoffs_to(self, altitude: int | None = None) -> list[ProposedStep | None]:
        """The take-off to a height in mm above home, by default the least of its contract, by each skill of the table
        that climbs; None for a skill that needs other arguments besides.
        """
        found: list[ProposedStep | None] = []
        for skill in dict.fromkeys(each.skill for some in self._rows.values() for each in some):
            contract = self._contracts.get(skill)
            if contract is not None and contract.motion.kind == MotionKind.CLIMB:
                parameter = next(each for each in contract.parameters if each.cell == contract.motion.altitude)
                height = parameter.low if altitude is None else altitude
                step = ProposedStep(skill, {parameter.name: written(height, Dimension.ALTITUDE)}, (height,))
                found.append(step if len(contract.parameters) == 1 else None)
        return found

    def with_speed(self, step: ProposedStep, metres_per_second: float) -> ProposedStep | Untranslated:
        """A step that flies, with another speed over ground; other steps stay as they are."""
        contract = self._contracts[step.skill]
        if contract.motion.speed < 0:
            return step
        parameter = next(each for each in contract.parameters if each.cell == contract.motion.speed)
        speed = quantise(metres_per_second, 1_000, 1)
        if speed is None or speed > MAX_VALUE:
            return Untranslated(DENIED, f"{step.skill}: {parameter.name} is not a number in range")
        values = list(step.values)
        values[parameter.cell] = speed
        texts = {**step.arguments, parameter.name: written(speed, Dimension(parameter.dimension))}
        return ProposedStep(step.skill, texts, tuple(values))

    def _argument(
        self, parameter: Parameter, source: ArgumentSource, message: Received, shadows: Mapping[str, float], now_us: int
    ) -> Argument | Untranslated | None:
        """An argument of the step; None for the skill's default."""
        if parameter.kind == PLACE:
            there = self._geographic(source, message, now_us)
            return there if isinstance(there, Untranslated) else self._placed(parameter, *there)
        if parameter.kind != QUANTITY:
            return Untranslated(DENIED, f"{parameter.name} cannot be given by a MAVLink field")
        if _is_unset(source, message, of_speed=parameter.dimension == Dimension.SPEED.value):
            return self._without(parameter, source, shadows, now_us)
        value, above = quantise(_field(message, source.fields[0]), source.scale, 1), self._datum(source.datum, message)
        if value is None or abs(value) > MAX_VALUE:
            return Untranslated(DENIED, f"{parameter.name} is not a number in range")
        return above if isinstance(above, Untranslated) else _quantity(parameter, value - above)

    def _without(
        self, parameter: Parameter, source: ArgumentSource, shadows: Mapping[str, float], now_us: int
    ) -> Argument | Untranslated | None:
        """An argument that the message does not give."""
        if source.otherwise == "default":
            return None
        if source.otherwise == "here":
            return self._height_here(parameter, now_us)
        name, _, datum = source.otherwise.partition(" above ")
        known = shadows.get(name, self._seen.parameter(name))
        if known is None:
            return Untranslated(TEMPORARILY_REJECTED, f"{name} is not known yet: name the {parameter.name}", name)
        dimension = Dimension(parameter.dimension)
        scale = scale_of(UNITS_OF_PARAMETERS[dimension], dimension)
        value = None if scale is None else quantise(known, scale, 1)
        if value is None or abs(value) > MAX_VALUE:
            return Untranslated(DENIED, f"{name} is not a number in range")
        above = self._above(datum)
        return above if isinstance(above, Untranslated) else _quantity(parameter, value - above)

    def _geographic(self, source: ArgumentSource, message: Received, now_us: int) -> tuple[int, int] | Untranslated:
        """Latitude and longitude of an argument in 1e-7 degree."""
        if _is_unset(source, message):
            here = self._seen.here(now_us)
            if here is None:
                return Untranslated(TEMPORARILY_REJECTED, "the vehicle's position is unknown")
            return int(here.fields["lat"]), int(here.fields["lon"])
        if _frame(message) not in (*SEA_FRAMES, *HOME_FRAMES, None):
            return Untranslated(DENIED, "its frame has no latitude and longitude")
        scale = 1 if message.message in _WHOLE else source.scale
        latitude, longitude = (quantise(_field(message, name), scale, 1) for name in source.fields)
        if latitude is None or longitude is None or abs(latitude) > _POLE or abs(longitude) > HALF_TURN:
            return Untranslated(DENIED, "the position is not on the globe")
        return latitude, longitude

    def _placed(self, parameter: Parameter, latitude: int, longitude: int) -> Argument | Untranslated:
        x, y = project(self._policy.projection, latitude, longitude)
        if max(abs(x), abs(y)) > MAX_COORDINATE:
            return Untranslated(DENIED, f"{parameter.name} is further away than any zone can be")
        return (x, y), f"{degrees(latitude, 'NS')}, {degrees(longitude, 'EW')}"

    def _height_here(self, parameter: Parameter, now_us: int) -> Argument | Untranslated:
        here = self._seen.here(now_us)
        if here is None:
            return Untranslated(TEMPORARILY_REJECTED, "the vehicle's height is unknown")
        return _quantity(parameter, int(here.fields["relative_alt"]))

    def _datum(self, datum: str, message: Received) -> int | Untranslated:
        """The height of home above the datum of a height, mm; 0 for what has no datum. A frame of reference that
        contradicts the datum of the table is refused.
        """
        frame = _frame(message)
        if datum == "frame" and frame is None and self._autopilot != PX4:
            return Untranslated(DENIED, "COMMAND_LONG does not say above what: use COMMAND_INT")
        if datum and frame is not None:
            said = "home" if frame in HOME_FRAMES else "sea" if frame in SEA_FRAMES else ""
            if not said or datum not in (said, "frame"):
                return Untranslated(DENIED, f"heights in frame {frame} are not accepted here")
            datum = said
        return self._above("sea" if datum == "frame" else datum)

    def _above(self, datum: str) -> int | Untranslated:
        """The height of home above a datum, mm."""
        if datum != "sea":
            return 0
        home = self._seen.home_amsl
        return Untranslated(TEMPORARILY_REJECTED, "the height of home is unknown yet") if home is None else home


def has_place(item: Received) -> bool:
    """Whether an item names a place: latitude and longitude 0, or NaN, mean none."""
    x, y = item.number("x"), item.number("y")
    return not (isnan(x) or isnan(y) or (x, y) in ((0, 0), (enums.NO_PLACE, enums.NO_PLACE)))


def _quantity(parameter: Parameter, value: int) -> Argument:
    return (value,), written(value, Dimension(parameter.dimension))


def _field(message: Received, name: str) -> float:
    """A field by the name of the table; NaN if the message has none."""
    if message.message in _WITH_XYZ:
        name = _PLACED.get(name, name)
    return message.number(name)


def _asks_for_yaw(message: Received, autopilot: int) -> bool:
    """Whether a message asks for a yaw or a yaw rate. ArduCopter heeds none in these commands and items, where clients
    leave it 0.
    """
    mask = message.fields.get("type_mask")
    if mask is not None:
        return bool(~mask & _YAW_IGNORED)
    yaw, command = message.number("param4"), message.fields.get("command")
    return command in _WITH_YAW and not isnan(yaw) and (autopilot == PX4 or yaw != 0)


def _frame(message: Received) -> int | None:
    """The frame of reference of a message; None if it has none."""
    frame = message.fields.get("frame", message.fields.get("coordinate_frame"))
    return None if frame is None else int(frame)


def _unset(message: Received, name: str) -> bool:
    """Whether a field is unset: NaN, or INT32_MAX of an integer."""
    value = _field(message, name)
    return isnan(value) or (value == enums.NO_PLACE and message.message in _WHOLE)


def _is_unset(source: ArgumentSource, message: Received, *, of_speed: bool = False) -> bool:
    """Whether the message does not give an argument: one of its fields is unset, or it has none."""
    if not source.fields or any(_unset(message, name) for name in source.fields):
        return True
    return of_speed and _field(message, source.fields[0]) <= 0


def _has(message: Received, name: str, wanted: int | None, mask: int) -> bool:
    """Whether a field has a fixed value; None means unset. A float that is no whole number has no value."""
    if wanted is None:
        return _unset(message, name)
    value = _field(message, name)
    return isfinite(value) and value == int(value) and int(value) & mask == wanted


def degrees(value: int, hemispheres: str) -> str:
    """Degrees as in sources: `47.3977000 N`, exactly."""
    whole, rest = divmod(abs(value), 10_000_000)
    return f"{whole}.{rest:07} {hemispheres[value < 0]}"
