"""The steps of a plan: each item means what it means to the gateway when a ground station uploads it.

Items are written as MAVLink mission items and read by `ground/gateway/plan_transfer`, so one table, the `accepts`
lines of the skills, says which skill an item stands for. Before that, items that are several things at once are taken
apart: a waypoint with a wait is a flight and a wait. An unset parameter (`null`) is the default on PX4, and 0 on
ArduPilot.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from math import nan
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.ground.exchange.losses import Loss, NotKept
from rtshcua.ground.exchange.qgc_reading import QgcItem, QgcPlan, command_name, degrees_e7
from rtshcua.ground.gateway.accepted import AcceptedCommand
from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.interface import GatewaySettings, ProposedStep
from rtshcua.ground.gateway.plan_transfer import LOITER_TIME, WAYPOINT, PlanSteps
from rtshcua.ground.gateway.translation import SEA_FRAMES, Translation, degrees
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now, State

# MAV_CMD that occur in plans alone
_NAV_DELAY, _VTOL_TAKEOFF, _VTOL_LAND = 93, 84, 85
_TAKEOFF, _LAND = enums.MAV_CMD_NAV_TAKEOFF, enums.MAV_CMD_NAV_LAND
CHANGE_SPEED: Final = enums.MAV_CMD_DO_CHANGE_SPEED
_HORIZONTAL: Final = (0, 1)  # SPEED_TYPE: through the air, over ground
#: altitude modes of the planner: above terrain as it computed it, and a terrain frame; the frames that agree with a
#: mode
_CALCULATED, _TERRAIN_MODE = 3, 4
_SEA, _HOME = (0, 5), (3, 6)
_FRAMES_OF: Final = {1: _HOME, 2: _SEA, _CALCULATED: _SEA}
_TERRAIN: Final = (10, 11)
_TERRAIN_HELP: Final = (
    "plan it above home or above sea: no skill follows terrain, and a fixed height would not be the same"
)

#: commands that do not move the vehicle, by the loss that they are
IGNORED: Final[Mapping[int, str]] = MappingProxyType(
    {
        **dict.fromkeys((203, 206, 214, 260, 530, 531, 532, 2000, 2001, 2003, 2500, 2501), "camera"),
        **dict.fromkeys((204, 205, 1000, 1001), "gimbal"),
        **dict.fromkeys((80, 195, 196, 197, 201), "region-of-interest"),
        **dict.fromkeys((181, 182, 183, 184, 211, 216, 218, 600, 601, 42_600), "payload"),
        **dict.fromkeys((112, 113, 114), "condition"),
        **dict.fromkeys((188, 189, 190), "marker"),
        **dict.fromkeys((115, 213), "yaw"),
        207: "fence-switch",
        3000: "vtol",
    }
)
_JUMP: Final = 177
#: the most items of a plan whose jumps are written out
_MOST_ITEMS: Final = 256
#: commands that are not repeated
_ONCE: Final = (_TAKEOFF, _LAND, _VTOL_TAKEOFF, _VTOL_LAND, enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)
#: commands that no mission of this language has, and the reason
_REFUSED: Final[Mapping[int, str]] = MappingProxyType(
    {
        17: "it waits without an end; no step does",
        18: "no skill flies circles",
        31: "no skill climbs in circles",
        82: "no skill flies curves between places",
        _JUMP: "no step jumps to another; write the repeated steps in `repeat N { ... }`",
        179: "home cannot be moved in flight: heights and the return count from it",
    }
)


class PlannedVehicle(VehicleSeen):
    """A vehicle that nobody has seen: it knows the height of its home above sea, or not, and nothing else."""

    def __init__(self, above_sea: int | None) -> None:
        super().__init__(1)
        self._above_sea = above_sea

    @property
    def home_amsl(self) -> int | None:
        """The height of home above sea, mm."""
        return self._above_sea


class StepTable(NamedTuple):
    """What items mean under a policy: the policy, the defaults of its skills and their `accepts` lines. `home` is in
    1e-7 degree, latitude first, `above_sea` its height in mm, None if it is not declared.
    """

    policy: PreparedPolicy
    defaults: Mapping[str, Mapping[str, tuple[int, ...]]]
    accepted: tuple[AcceptedCommand, ...]
    home: tuple[int, int]
    above_sea: int | None


class ImportedStep(NamedTuple):
    """A step, and the place of its item in the file."""

    step: ProposedStep
    place: str


class ImportedSteps(NamedTuple):
    """The steps of a plan with its losses, and what is not kept."""

    steps: tuple[ImportedStep, ...]
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]


def plan_steps(
    plan: QgcPlan,
    table: StepTable,
    without: Iterable[str] = (),
    after: Mapping[str, ProposedStep] = MappingProxyType({}),
) -> ImportedSteps:
    """Translate the items of a plan, without those at the places `without`. The steps `after` come after the flights at
    their places, and end elsewhere.
    """
    return _Translating(plan, table, after).steps(frozenset(without))


def without_jumps(plan: QgcPlan) -> QgcPlan:
    """A plan with its jumps written out: the items from the target to the jump are flown again as often as it says, as
    both autopilots do. A jump without an end, forward, over another jump, or over a take-off, a landing or a return
    stays.
    """
    items: list[QgcItem] = []
    free = 0  # the items before it are repeated already
    for item in plan.items:
        again = _repeated(items[free:], item) if item.command == _JUMP else []
        if again and len(items) + len(again) <= _MOST_ITEMS:
            items += again
        else:
            items.append(item)
        if item.command == _JUMP:
            free = len(items)
    return plan._replace(items=tuple(items))


def _repeated(before: Sequence[QgcItem], jump: QgcItem) -> list[QgcItem]:
    """The items that a jump repeats, as often as it does; none if they are not written out."""
    target, count = jump.params[0], jump.params[1]
    begin = next((at for at, each in enumerate(before) if each.jump_id and each.jump_id == target), None)
    if begin is None or count is None or count != count.to_integral_value() or not 0 < count <= _MOST_ITEMS:
        return []
    body = list(before[begin:])
    return [] if any(each.command in _ONCE for each in body) else body * int(count)


def item_losses(plan: QgcPlan) -> Iterator[Loss]:
    """The losses of a plan that do not depend on a policy: of its items and of its vehicle."""
    for item in plan.items:
        yield from _losses(item, reads_yaw=not plan.is_ardupilot)
    if plan.vehicle_type not in enums.MULTIROTORS:
        yield Loss("vehicle-type", "/mission/vehicleType", f"MAV_TYPE {plan.vehicle_type}")
    if plan.speed and not any(item.command == CHANGE_SPEED for item in plan.items):
        yield Loss("planned-speed", "/mission/hoverSpeed", f"{plan.speed:f} m/s")


def _losses(item: QgcItem, *, reads_yaw: bool) -> Iterator[Loss]:
    name = IGNORED.get(item.command)
    if name is not None:
        yield Loss(name, item.place, command_name(item.command))
        return
    if item.command in (_VTOL_TAKEOFF, _VTOL_LAND):
        yield Loss("vtol", item.place, command_name(item.command))
    if item.command == CHANGE_SPEED and item.params[0] not in (None, *_HORIZONTAL):
        yield Loss("vertical-speed", item.place, f"{item.params[1]} m/s")
    if item.command in _REFUSED or not _flies(item.command):
        return
    if item.params[3] is not None and reads_yaw:
        yield Loss("yaw", item.place, f"{item.params[3]:f} deg")
    yield from _losses_of_options(item)


def _losses_of_options(item: QgcItem) -> Iterator[Loss]:
    """The losses of an item that flies, by its other parameters."""
    if item.command == WAYPOINT and (item.params[1] or item.params[2]):
        yield Loss("acceptance-radius", item.place, f"{item.params[1] or item.params[2]} m")
    if item.command in (_LAND, _VTOL_LAND) and (item.params[0] or item.params[1]):
        yield Loss("landing-options", item.place, "an abort height or a precision landing")
    if item.mode == _CALCULATED:
        shown = "a height" if item.height is None else f"{item.height:f} m"
        yield Loss("height-above-terrain", item.place, f"{shown} above terrain")


def flying_items(plan: QgcPlan) -> tuple[QgcItem, ...]:
    """The items that have a place and a height."""
    return tuple(each for each in plan.items if _flies(each.command))


def _flies(command: int) -> bool:
    return command in (WAYPOINT, LOITER_TIME, _TAKEOFF, _LAND, _VTOL_TAKEOFF, _VTOL_LAND)


class _Translating:
    """The translation of one plan."""

    def __init__(self, plan: QgcPlan, table: StepTable, after: Mapping[str, ProposedStep]) -> None:
        self._plan, self._table, self._after = plan, table, after
        self._autopilot = ARDUPILOT if plan.is_ardupilot else PX4
        settings = GatewaySettings(1, self._autopilot, table.policy, table.defaults, table.accepted, _no_state)
        self._translation = Translation(settings, PlannedVehicle(table.above_sea))
        self._made = PlanSteps(self._translation, {}, 0)
        self._places: list[str] = []
        self._losses = list(item_losses(plan))
        self._not_kept: list[NotKept] = []

    def steps(self, without: frozenset[str]) -> ImportedSteps:
        for item in self._plan.items:
            if item.place in without:
                continue
            why = self._refusal(item)
            if why is None:
                self._take(item)
            else:
                self._not_kept.append(NotKept(command_name(item.command), item.place, *why))
        self._take_off()
        found = tuple(self._without_still_flights())
        return ImportedSteps(found, tuple(self._losses), tuple(self._not_kept))

    def _refusal(self, item: QgcItem) -> tuple[str, str] | None:
        """Why an item is not kept, before anything is asked of the policy; and a help."""
        if not item.goes_on:
            return "the mission would stop there (`autoContinue` is false)", ""
        if item.command in _REFUSED:
            return _REFUSED[item.command], ""
        if item.command in (_LAND, _VTOL_LAND) or not _flies(item.command):  # its height has no meaning
            return None
        if item.params[6] is None and not self._plan.is_ardupilot:
            return "it has no height", "give it a height in the planner"
        if item.frame in _TERRAIN or item.mode == _TERRAIN_MODE:
            return "its height is above terrain", _TERRAIN_HELP
        agreeing = _FRAMES_OF.get(item.mode)
        if agreeing is not None and item.frame not in agreeing:
            return f"its frame {item.frame} contradicts its altitude mode {item.mode}", "set its altitude mode again"
        return None

    def _take(self, item: QgcItem) -> None:
        if item.command in IGNORED or is_vertical(item):
            return
        before = len(self._made.steps)
        for message in self._messages(item):
            problem = self._made.add(len(self._places), message)
            if problem is not None:
                del self._made.steps[before:]
                self._not_kept.append(NotKept(command_name(item.command), item.place, problem.text))
                return
        self._places += [item.place] * (len(self._made.steps) - before)
        self._tell(item)

    def _tell(self, item: QgcItem) -> None:
        """The losses that depend on the policy's home."""
        if item.command in (_TAKEOFF, _VTOL_TAKEOFF) and self._plan.is_ardupilot and self._elsewhere(item):
            self._losses.append(Loss("takeoff-place", item.place, command_name(item.command)))
        if _flies(item.command) and item.command not in (_LAND, _VTOL_LAND) and item.frame in SEA_FRAMES:
            self._losses.append(Loss("height-datum", item.place, f"{item.params[6]} m above sea"))

    def _elsewhere(self, item: QgcItem) -> bool:
        return any(self._translation.is_elsewhere(each, 0) for each in self._messages(item))

    # ---------------------------------------------------------------- MAVLink

    def _messages(self, item: QgcItem) -> Iterator[Received]:
        """The mission items that an item stands for."""
        command = {_VTOL_TAKEOFF: _TAKEOFF, _VTOL_LAND: _LAND}.get(item.command, item.command)
        params = [*map(self._float, item.params[:4])]
        x, y = (self._degrees(each) for each in item.params[4:6])
        fields = {
            "command": command, "frame": item.frame, "x": x, "y": y, "z": self._float(item.params[6]),
            "param1": params[0], "param2": params[1], "param3": params[2], "param4": params[3],
        }  # fmt: skip
        whole = Received(0, 0, layouts.MISSION_ITEM_INT, fields)
        waits = params[0] if command in (WAYPOINT, _NAV_DELAY) else 0.0
        if command == WAYPOINT:
            yield whole._replace(fields=fields | {"param1": 0.0})
        if waits > 0:
            stays = {"command": LOITER_TIME, "x": 0, "y": 0, "z": 0.0, "param1": waits}
            yield whole._replace(fields=fields | stays)
        if command != WAYPOINT and not (command == _NAV_DELAY and waits >= 0):
            yield whole

    def _float(self, value: Decimal | None) -> float:
        return float(value) if value is not None else 0.0 if self._plan.is_ardupilot else nan

    def _degrees(self, value: Decimal | None) -> int:
        if value is None:
            return 0 if self._plan.is_ardupilot else enums.NO_PLACE
        return max(-enums.NO_PLACE, min(degrees_e7(value), enums.NO_PLACE))

    # ---------------------------------------------------------------- steps

    def _take_off(self) -> None:
        """A plan that begins with a flight begins with a climb to its height, as on PX4 and in the gateway."""
        first = self._made.steps[0] if self._made.steps else None
        contract = None if first is None else self._translation.contract(first.skill)
        if first is None or contract is None or contract.motion.kind == MotionKind.CLIMB:
            return
        if contract.motion.altitude < 0:
            return
        offered = self._translation.takeoffs_to(first.values[contract.motion.altitude])
        takeoff = next((each for each in offered if each is not None), None)
        if takeoff is not None:
            self._made.steps.insert(0, takeoff)
            self._places.insert(0, self._places[0])
            self._losses.append(Loss("added-takeoff", self._places[0], "the first item flies"))

    def _without_still_flights(self) -> Iterator[ImportedStep]:
        """The steps without flights to the place and the height where the vehicle is already."""
        at, height = self._home_text, 0
        for step, place in zip(self._made.steps, self._places, strict=True):
            contract = self._translation.contract(step.skill)
            assert contract is not None, step
            motion = contract.motion
            to = next((text for text in step.arguments.values() if "," in text), at)
            high = step.values[motion.altitude] if motion.altitude >= 0 else height
            surveyed = self._after.get(place) if motion.kind == MotionKind.FLY else None
            if motion.kind == MotionKind.FLY and (to, high) == (at, height) and surveyed is None:
                continue
            at, height = to, high
            if motion.kind == MotionKind.HOME:
                at, height = self._home_text, 0
            elif motion.kind == MotionKind.LAND:
                height = 0
            yield ImportedStep(step, place)
            if surveyed is not None:
                yield ImportedStep(surveyed, place)
                at = ""

    @property
    def _home_text(self) -> str:
        return _written(self._table.home)


def is_vertical(item: QgcItem) -> bool:
    """Whether a change of speed is one of climbs or descents."""
    return item.command == CHANGE_SPEED and item.params[0] not in (None, *_HORIZONTAL)


def _written(place: tuple[int, int]) -> str:
    return f"{degrees(place[0], 'NS')}, {degrees(place[1], 'EW')}"


def _no_state(now: Now) -> State:
    raise AssertionError("no decision is made while a plan is read")
