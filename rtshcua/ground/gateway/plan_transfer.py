"""A client's missions: the transfer of items in both directions, and the steps that the items mean.

The dialogue is that of the vehicle's autopilot: PX4 requests items with MISSION_REQUEST_INT, repeats after 250 ms and
gives up after 5 s; ArduPilot requests with MISSION_REQUEST, repeats after 1 s and gives up after 8 s, and its slot 0 is
home. A mission is stored only after it was translated and checked as a whole. Fences and rally points are refused.
https://mavlink.io/en/services/mission.html
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import Any, Final, NamedTuple

from rtshcua.ground.gateway.accepted import ITEM
from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.interface import ProposedStep
from rtshcua.ground.gateway.translation import Translation, Untranslated, has_place
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED
from rtshcua.mavlink.modes import ARDUPILOT
from rtshcua.model.flat.contract import MotionKind

# MAV_MISSION_RESULT
MISSION_ACCEPTED: Final = 0
MISSION_UNSUPPORTED: Final = 3
MISSION_NO_SPACE: Final = 4
MISSION_INVALID: Final = 5
MISSION_INVALID_PARAM1: Final = 6
MISSION_INVALID_SEQUENCE: Final = 13
MISSION_DENIED: Final = 14
MISSION_CANCELLED: Final = 15

MISSION: Final = 0  # MAV_MISSION_TYPE
ALL_TYPES: Final = 255
WAYPOINT: Final = 16
LOITER_TIME: Final = 19
#: the most items of an upload
MOST_ITEMS: Final = 256


class _Pace(NamedTuple):
    """How an autopilot requests items: message, interval of repetitions and patience, us."""

    request: int
    again_us: int
    patience_us: int


_ARDUPILOT: Final = _Pace(layouts.MISSION_REQUEST, 1_000_000, 8_000_000)
_PX4: Final = _Pace(layouts.MISSION_REQUEST_INT, 250_000, 5_000_000)


class UploadedPlan(NamedTuple):
    """A client's mission: its items as uploaded, its steps, and for each step the number of its item."""

    items: tuple[Received, ...]
    steps: tuple[ProposedStep, ...]
    item_of: tuple[int, ...]


class RefusedPlan(NamedTuple):
    """Why a mission cannot be translated: MAV_MISSION_RESULT and the reason. `for_now`: it may be translated later."""

    result: int
    text: str
    for_now: bool = False


@dataclass(slots=True)
class _Upload:
    sender: tuple[int, int]
    count: int
    heard_us: int
    asked_us: int
    items: list[Received] = field(default_factory=list)


class PlanTransfer:
    """The transfers of one connection. `plans` are the stored missions by the client's configured name: the address is
    the identity, so all connections to it, and later ones, have the same mission.
    """

    def __init__(
        self, link: ClientLink, translation: Translation, autopilot: int, plans: dict[str, UploadedPlan]
    ) -> None:
        self._link = link
        self._plans = plans
        #: under the policy in force
        self.translation = translation
        self._autopilot = autopilot
        self._pace = _ARDUPILOT if autopilot == ARDUPILOT else _PX4
        self._upload: _Upload | None = None
        self._checking: tuple[tuple[int, int], UploadedPlan] | None = None

    @property
    def plan(self) -> UploadedPlan | None:
        """The stored mission, if there is one."""
        return self._plans.get(self._link.name)

    @property
    def plan_is_idle(self) -> bool:
        """Whether no upload is under way, so that an item is one of its own."""
        return self._upload is None

    def answer_guided(self, to: tuple[int, int], result: int) -> None:
        """Answer an item that was to be flown to at once, by the MAV_RESULT of its step."""
        refused = MISSION_UNSUPPORTED if result == UNSUPPORTED else MISSION_DENIED
        self._answer(to, MISSION_ACCEPTED if result == ACCEPTED else refused)

    # ---------------------------------------------------------------- upload

    def count(self, message: Received, now_us: int) -> None:
        """MISSION_COUNT: an upload begins, or the mission is cleared."""
        count = message.fields["count"]
        if count == 0:
            self.clear(message, now_us)
            return
        if self._refuses_type(message, now_us):
            return
        self._upload = self._checking = None
        if count > MOST_ITEMS:
            self._link.text(f"a mission of {count} items is too long: at most {MOST_ITEMS}", now_us)
            self._link.record("refused", now_us, message="MISSION_COUNT", count=count)
            self._answer(message.sender, MISSION_NO_SPACE)
        else:
            self._upload = _Upload(message.sender, count, now_us, now_us)
            self._ask(self._upload, now_us)

    @staticmethod
    def clears(message: Received) -> bool:
        """Whether a MISSION_COUNT or MISSION_CLEAR_ALL clears the mission, perhaps among others."""
        return message.fields["mission_type"] in (MISSION, ALL_TYPES) and not message.fields.get("count", 0)

    def item(self, message: Received, shadows: Mapping[str, float], now_us: int) -> UploadedPlan | None:
        """MISSION_ITEM or MISSION_ITEM_INT of an upload. Return the mission to be checked, once it is complete."""
        upload = self._upload
        if upload is None or message.sender != upload.sender:
            if self._checking is None:
                self._answer(message.sender, MISSION_INVALID_SEQUENCE, message.whole("mission_type"))
            return None
        if message.fields["mission_type"] != MISSION or message.fields["seq"] != len(upload.items):
            return None  # a repetition; the next request names the expected item
        upload.items.append(message)
        upload.heard_us = now_us
        if len(upload.items) < upload.count:
            self._ask(upload, now_us)
            return None
        self._upload = None
        made = read_plan(upload.items, self.translation, shadows, now_us, self._autopilot)
        if isinstance(made, RefusedPlan):
            self.refuse(upload.sender, made, now_us)
            return None
        self._checking = upload.sender, made
        return made

    def checked(self, refusal: str | None, now_us: int) -> None:
        """The mission was checked as a whole: store it, or refuse it with the reason."""
        if self._checking is None:
            return
        sender, plan = self._checking
        self._checking = None
        if refusal is not None:
            self.refuse(sender, RefusedPlan(MISSION_DENIED, refusal), now_us)
            return
        self._plans[self._link.name] = plan
        self._link.record("accepted", now_us, message="MISSION_COUNT", count=len(plan.items))
        self._answer(sender, MISSION_ACCEPTED)

    def refuse(self, to: tuple[int, int], why: RefusedPlan, now_us: int) -> None:
        """Answer an upload, and say why it is refused."""
        self._link.text(f"mission refused: {why.text}", now_us)
        self._link.record("refused", now_us, message="MISSION_COUNT", reason=why.text)
        self._answer(to, why.result)

    def acknowledged(self, message: Received) -> None:
        """MISSION_ACK: the client ended a download, or gives up an upload."""
        if message.fields["type"] != MISSION_ACCEPTED and self._upload is not None:
            self._upload = None

    def tick(self, now_us: int) -> None:
        """Repeat a request that was not answered; give up after the autopilot's patience."""
        upload = self._upload
        if upload is None:
            return
        if now_us - upload.heard_us > self._pace.patience_us:
            self._upload = None
            self._answer(upload.sender, MISSION_CANCELLED)
        elif now_us - upload.asked_us > self._pace.again_us:
            self._ask(upload, now_us)

    # ---------------------------------------------------------------- download, clearing, others

    def request_list(self, message: Received) -> None:
        """MISSION_REQUEST_LIST: the number of stored items; of fences and rally points there are none."""
        kind = message.fields["mission_type"]
        items = self.plan.items if self.plan is not None and kind == MISSION else ()
        self._link.send(layouts.MISSION_COUNT, count=len(items), mission_type=kind, **_target(message.sender))

    def request(self, message: Received) -> None:
        """MISSION_REQUEST or MISSION_REQUEST_INT: one stored item, in the requested form."""
        kind, at = message.fields["mission_type"], message.fields["seq"]
        items = self.plan.items if self.plan is not None and kind == MISSION else ()
        if at >= len(items):
            self._answer(message.sender, MISSION_INVALID_SEQUENCE, kind)
            return
        whole = message.message == layouts.MISSION_REQUEST_INT
        number = layouts.MISSION_ITEM_INT if whole else layouts.MISSION_ITEM
        fields = _in_form(items[at], whole=whole) | _target(message.sender) | {"seq": at, "current": 0}
        self._link.send(number, **fields)

    def clear(self, message: Received, now_us: int) -> None:
        """MISSION_CLEAR_ALL: forget this client's mission. It has no fence and no rally points to clear, and those of
        the vehicle stay as they are.
        """
        kind = message.fields["mission_type"]
        if self.clears(message):
            self._upload = self._checking = None
            self._plans.pop(self._link.name, None)
        elif kind not in (enums.MAV_MISSION_TYPE_FENCE, enums.MAV_MISSION_TYPE_RALLY):
            self._refuses_type(message, now_us)
            return
        self._link.record("absorbed", now_us, message=message.message, plan=kind)
        self._answer(message.sender, MISSION_ACCEPTED, kind)

    def unsupported(self, message: Received, now_us: int) -> None:
        """A part of the protocol that is not offered: partial uploads."""
        self._link.text("partial uploads are refused: upload the whole mission", now_us, "partial")
        self._link.record("refused", now_us, message=message.message)
        self._answer(message.sender, MISSION_UNSUPPORTED, message.whole("mission_type"))

    def _refuses_type(self, message: Received, now_us: int) -> bool:
        kind = message.fields["mission_type"]
        if kind == MISSION:
            return False
        what = {enums.MAV_MISSION_TYPE_FENCE: "fence", enums.MAV_MISSION_TYPE_RALLY: "rally points"}.get(kind, "plan")
        self._link.text(f"{what}: changes are refused", now_us, what)
        self._link.record("refused", now_us, message=message.message, plan=what)
        self._answer(message.sender, MISSION_DENIED, kind)
        return True

    def _ask(self, upload: _Upload, now_us: int) -> None:
        upload.asked_us = now_us
        self._link.send(self._pace.request, seq=len(upload.items), **_target(upload.sender))

    def _answer(self, to: tuple[int, int], result: int, kind: int = MISSION) -> None:
        self._link.send(layouts.MISSION_ACK, type=result, mission_type=kind & 0xFF, **_target(to))


# ---------------------------------------------------------------- what the items mean


def read_plan(
    items: Sequence[Received], translation: Translation, shadows: Mapping[str, float], now_us: int, autopilot: int
) -> UploadedPlan | RefusedPlan:
    """The steps of a mission's items. DO_CHANGE_SPEED is no step: it sets the speed of the flights after it.

    An item that stays or lands at a place becomes a flight to the place, and then the step. A take-off at a place is
    followed by a flight to it on PX4.
    """
    made = PlanSteps(translation, shadows, now_us)
    for number, item in enumerate(items):
        if autopilot == ARDUPILOT and number == 0:
            continue
        problem = made.add(number, item)
        if problem is not None:
            return problem._replace(text=f"item {number}: {problem.text}")
    if not made.steps:
        return RefusedPlan(MISSION_INVALID, "the mission has no item that flies")
    return UploadedPlan(tuple(items), tuple(made.steps), tuple(made.item_of))


class PlanSteps:
    """Collects the steps of items, in order. After a refusal, what `add` appended of that item is to be dropped."""

    def __init__(self, translation: Translation, shadows: Mapping[str, float], now_us: int) -> None:
        self._translation = translation
        self._shadows = shadows
        self._now_us = now_us
        self._speed: float | None = None
        self._height: int | None = None  # of the last step that has one, mm above home
        self.steps: list[ProposedStep] = []
        self.item_of: list[int] = []

    def add(self, number: int, item: Received) -> RefusedPlan | None:
        """Add the steps of an item; return why it is refused."""
        command = item.fields["command"]
        if command == enums.MAV_CMD_DO_CHANGE_SPEED:
            return self._change_speed(item)
        if command == WAYPOINT:
            hold = item.number("param1")
            if not isnan(hold) and hold != 0:
                return RefusedPlan(MISSION_INVALID_PARAM1, "waits at a waypoint are refused: use NAV_LOITER_TIME")
            return self._append(number, item)
        if command == enums.MAV_CMD_NAV_TAKEOFF and self._translation.flies_after_takeoff(item, self._now_us):
            there = item._replace(fields=item.fields | {"command": WAYPOINT, "param1": 0.0})
            return self._append(number, item) or self._append(number, there)
        return self._append_at_its_place(number, item)

    def _append_at_its_place(self, number: int, item: Received) -> RefusedPlan | None:
        """Append an item; before one that holds or lands at a place that its skill does not take, the flight there."""
        command = item.fields["command"]
        if has_place(item) and self._translation.row(ITEM, command, item) is None:
            there = item._replace(fields=item.fields | {"x": 0, "y": 0})
            row = self._translation.row(ITEM, command, there)
            contract = None if row is None else self._translation.contract(row.skill)
            if contract is not None and contract.motion.kind in (MotionKind.HOLD, MotionKind.LAND):
                lands = contract.motion.kind == MotionKind.LAND
                if lands and self._height is None:
                    return RefusedPlan(MISSION_INVALID, "no item before it says at which height it is reached")
                return self._append(number, self._flight_to(item, lands=lands)) or self._append(number, there)
        return self._append(number, item)

    def _flight_to(self, item: Received, *, lands: bool) -> Received:
        """A waypoint at an item's place; one that lands has no height of its own, so it is reached at the last one."""
        fields = item.fields | {"command": WAYPOINT, "param1": 0.0}
        if lands and self._height is not None:
            fields |= {"frame": enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, "z": self._height / 1_000}
        return item._replace(fields=fields)

    def _change_speed(self, item: Received) -> RefusedPlan | None:
        kind, speed = item.number("param1"), item.number("param2")
        if kind not in (0, 1) or isnan(speed):
            return RefusedPlan(MISSION_INVALID_PARAM1, "only the horizontal speed can be changed")
        self._speed = speed if speed >= 0 else (None if speed == -2 else self._speed)
        return None

    def _append(self, number: int, item: Received) -> RefusedPlan | None:
        command = item.fields["command"]
        row = self._translation.row(ITEM, command, item)
        if row is None:
            return RefusedPlan(MISSION_UNSUPPORTED, f"command {command} has no mapping")
        step = self._translation.step(row, item, self._shadows, self._now_us)
        if not isinstance(step, Untranslated) and self._speed is not None:
            step = self._translation.with_speed(step, self._speed)
        if isinstance(step, Untranslated):
            return RefusedPlan(MISSION_INVALID, step.text, for_now=step.result == TEMPORARILY_REJECTED)
        contract = self._translation.contract(step.skill)
        if contract is not None and contract.motion.altitude >= 0:
            self._height = step.values[contract.motion.altitude]
        self.steps.append(step)
        self.item_of.append(number)
        return None


def _in_form(item: Received, *, whole: bool) -> dict[str, Any]:
    """The fields of an item, with its place in the requested form."""
    fields = dict(item.fields)
    if whole and item.message == layouts.MISSION_ITEM:
        for name in ("x", "y"):
            scaled = item.number(name) * 1e7
            fields[name] = enums.NO_PLACE if isnan(scaled) or abs(scaled) >= enums.NO_PLACE else round(scaled)
    elif not whole and item.message == layouts.MISSION_ITEM_INT:
        places = {name: item.fields[name] for name in ("x", "y")}
        fields |= {name: float("nan") if at == enums.NO_PLACE else at / 1e7 for name, at in places.items()}
    return fields


def _target(to: tuple[int, int]) -> dict[str, int]:
    return {"target_system": to[0], "target_component": to[1]}
