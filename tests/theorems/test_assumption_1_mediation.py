"""Assumption 1: mediated dispatch. What moves the vehicle passes the executor and its gate, under a permit.

Statement. The gate is the only way out for frames. A frame that passes it, and that is not housekeeping, is part of
the command of a permit that the boundary issued and the executor dispatched last, while that command runs; its first
frame passes within the permit's time, and the points of its path in their order. Before the first command a geofence
may be set; no permit ever covers forced arming, another sender, or another receiver.

Attacker: the adapter and the runtime, taken over. They hand the gate arbitrary frames, damaged ones and those of other
commands, report anything about the vehicle, and use every permit at any time, altered, repeated, late, or as a
standing permit. They hold no key.

Enforced by: `rtshcua/onboard/enforcement/executor.py`, `rtshcua/onboard/enforcement/frames.py`,
`rtshcua/onboard/enforcement/allow_list.py`, `rtshcua/mavlink/signing.py`, `boundary/enforcement/executor.c`,
`boundary/enforcement/frames.c`.

Not covered: an autopilot that does not enforce MAVLink signing obeys anyone who reaches its link
(`docs/flying/link.md`, `tests/attacks/test_runtime_taken_over.py`). A false report about the height of home of at most
10 m between two takeoffs is believed (`tests/attacks/test_frames_beyond.py`).

Frames are judged by the auditor's reading of MAVLink (`rtshcua/ground/audit/frame_meaning.py`), which is independent of
the gate's, against the motion of the request that was allowed.
"""

from math import isfinite, nan
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from boundary.test_gate import HOME_AMSL, OURS, SYSTEM, drawn_command, drawn_frame, drawn_report, long, pack
from reference import worlds
from reference.flat_case import HEIGHT, MIN, POSITION_X, POSITION_Y, S
from reference.world import START, FakeVehicle, answer_to, loaded, renewed, request_for
from rtshcua.adapters.vehicle.messages import set_mode, stop_here
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.audit.frame_meaning import (
    FrameNature,
    HomeHeights,
    MotionTarget,
    is_part_of,
    nature,
    parameter_write,
    read_frame,
    switches_fence_on,
    target_of_link,
    target_of_step,
)
from rtshcua.mavlink.layouts import COMMAND_INT, LAYOUTS, PARAM_VALUE, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.mavlink.modes import PX4, CopterMode, Px4Mode
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import State
from rtshcua.onboard.enforcement import allow_list
from rtshcua.onboard.enforcement import executor as executors
from rtshcua.onboard.enforcement import frames as gates
from rtshcua.onboard.enforcement.allow_list import Frame
from rtshcua.onboard.ports import Command
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP

TEMPLATE = loaded()
ACTS = ("fly",) * 4 + ("along",) * 4 + ("use", "stand in", "end", "wait") + ("report",) * 4 + ("send",) * 20
#: mm: the reports of `drawn_report` about the height of home, above its usual one
HOME = HomeHeights(HOME_AMSL, HOME_AMSL + 10_001)
FORCED = long(400, 1, 21196)


class Adapter:
    """The outbound side of the vehicle, taken over, and a notary who knows what may leave. `broken` lists the
    violations of the assumption.
    """

    def __init__(self, of: Random) -> None:
        self.of, self.loaded, self.now = of, renewed(TEMPLATE), START
        self.autopilot = of.choice((3, 12))
        self.step = 0  # the next step of an honest runtime
        self.issued: dict[bytes, tuple[int, int, MotionTarget]] = {}  # by permit: kind, step and motion
        self.used: set[bytes] = set()
        self.current: MotionTarget | None = None  # the motion that may leave now,
        self.until_us = 0  # the time of its first frame at most,
        self.first = True  # and whether that is still to come
        self.leg = -1  # the last point of its path that left
        self.begun = False  # a command was dispatched
        self.types: float | None = None  # the reported FENCE_TYPE
        self.left = 0  # the frames of commands that left
        self.motions: list[Command] = []
        self.broken: list[str] = []
        self.hear(pack(mavlink.MAVLink_heartbeat_message(2, self.autopilot, 0, 0, 0, 3), 1))
        self.hear(drawn_report(of, self.some_motion(), self.autopilot))

    def go(self, acts: int) -> list[str]:
        for _ in range(acts):
            match self.of.choice(ACTS):
                case "fly":
                    self.fly()
                case "along":
                    self.along()
                case "use" if self.issued:
                    self.use(self.of.choice([*self.issued]), altered=self.of.random() < 0.3)
                case "stand in" if self.issued:
                    self.stand_in(self.of.choice([*self.issued]))
                case "end":
                    getattr(self.loaded.executor, self.of.choice(("ended", "landed", "release")))()
                    self.current = None
                case "wait":
                    us = self.of.choice([50_000, S, 11 * S, MIN])
                    self.now = replace(self.now, monotonic_us=self.now.monotonic_us + us, utc_us=self.now.utc_us + us)
                case "report":
                    self.hear(drawn_report(self.of, self.some_motion(), self.autopilot))
                case "send":
                    self.send()
        return self.broken

    def hear(self, octets: bytes) -> None:
        self.loaded.executor.frames.observe(octets, self.now.monotonic_us)
        frame = read_frame(octets)
        if frame is not None and (frame.system, frame.component, frame.message) == (SYSTEM, 1, PARAM_VALUE):
            _, value = parameter_write(frame, self.autopilot)
            self.types = value if isfinite(value) else 0.0

    def some_motion(self) -> Command:
        """A command whose frames are tried: the last one, an earlier one, or one that nobody permitted."""
        if self.motions and self.of.random() < 0.8:
            return self.of.choice((self.motions[-1], self.motions[-1], *self.motions))
        return drawn_command(self.of, self.loaded.bundle.policy.projection)

    # ------------------------------------------------------------------------------------------------ actions

    def fly(self) -> None:
        """The requests of an honest runtime, so that something is permitted at all."""
        of, policy, steps = self.of, self.loaded.bundle.policy, self.loaded.bundle.mission.invocations
        kind = of.choice((STEP, STEP, STEP, FALLBACK_LINK, CONTINGENCY_LINK))
        step = min(self.step - (kind != STEP), len(steps) - 1)
        if step < 0:
            return
        link = -1 if kind == STEP else of.randrange(3)
        asked = request_for(
            self.loaded, kind, -1 if kind == CONTINGENCY_LINK else step, link, now=self.now,
            released_us=self.now.monotonic_us, state=state_at(step),
        )  # fmt: skip
        answer = answer_to(self.loaded, asked)
        if not isinstance(answer, Decision) or not answer.permit:
            return
        chain = policy.contingency if kind == CONTINGENCY_LINK else steps[step].contract.fallback
        target = target_of_step(steps[step], policy) if kind == STEP else target_of_link(chain[link], policy)
        self.issued[answer.permit] = kind, step, target
        self.step += kind == STEP
        if of.random() < 0.9:
            self.loaded.executor.ended()
            self.current = None
            self.use(answer.permit, until_us=answer.valid_until_us)
            for _ in range(of.choice((0, 0, 6, 12))):
                self.along()

    def use(self, permit: bytes, *, altered: bool = False, until_us: int = 1 << 60) -> None:
        octets = damaged(self.of, permit) if altered else permit
        found = self.loaded.executor.dispatch(octets, self.now.monotonic_us)
        if not isinstance(found, Command):
            return
        self.hold(octets in self.issued, "a permit that nobody issued")
        self.hold(octets not in self.used, "a permit that was used before")
        self.used.add(octets)
        self.runs(found, self.issued[permit][2], min(found.not_after_us, until_us))

    def stand_in(self, permit: bytes) -> None:
        """Use a step's permit for a link behind it."""
        kind, link = self.of.choice((FALLBACK_LINK, CONTINGENCY_LINK)), self.of.randrange(3)
        found = self.loaded.executor.stand_in(permit, kind, link, self.now.monotonic_us)
        if isinstance(found, Command):
            its, step, _ = self.issued[permit]
            self.hold(its == STEP and permit in self.used, "a link stood in for a step that was not sent")
            policy = self.loaded.bundle.policy
            contract = self.loaded.bundle.mission.invocations[step].contract
            chain = contract.fallback if kind == FALLBACK_LINK else policy.contingency
            self.runs(found, target_of_link(chain[link], policy), 1 << 60)

    def runs(self, command: Command, target: MotionTarget, until_us: int) -> None:
        self.current, self.until_us, self.first, self.leg, self.begun = target, until_us, True, -1, True
        self.motions.append(command)

    def send(self) -> None:
        """Draw a frame for the gate."""
        motion = self.some_motion()
        chance = self.of.random()
        frame = pack(FORCED) if chance < 0.03 else drawn_frame(self.of, motion)
        if chance > 0.6:
            frame = pack(self.of.choice(fitting(self.of, motion, self.autopilot)), self.of.choice((OURS,) * 9 + (1,)))
        self.offer(frame, motion)

    def along(self) -> None:
        """Report the last point of the path that left as reached, and send the vehicle to the next one, or another."""
        if not self.current or not self.motions[-1].geo:
            return
        motion = self.motions[-1]
        path = [*zip(motion.geo[::2], motion.geo[1::2], strict=True)]
        if self.leg >= 0:
            x, y = path[self.leg]
            self.hear(pack(mavlink.MAVLink_global_position_int_message(0, x, y, HOME_AMSL, 0, 0, 0, 0, 0), 1))
        following = path[min(self.leg + 1, len(path) - 1)]
        point = following if self.of.random() < 0.6 else self.of.choice(path)
        for message in fitting(self.of, motion, self.autopilot, point):
            self.offer(pack(message), motion)

    def offer(self, frame: bytes, motion: Command) -> None:
        """Hand the gate a frame, and judge it if it passes."""
        found = self.loaded.executor.frames.seal(frame, self.now.monotonic_us)
        if not isinstance(found, Refusal):
            self.hold(found == frame, "another frame than the one that was judged")
            self.witness(found, motion)

    # ------------------------------------------------------------------------------------------- properties

    def witness(self, octets: bytes, motion: Command) -> None:
        """A frame leaves."""
        frame = read_frame(octets)
        if frame is None:
            self.hold(False, "octets that are no frame")
            return
        self.hold((frame.system, frame.component) == (SYSTEM, OURS), "a frame in the name of another sender")
        match nature(frame):
            case FrameNature.FENCE:
                self.hold(not self.begun, "a fence after the first command")
            case FrameNature.SETTING:
                name, value = parameter_write(frame, self.autopilot)
                unknown = self.autopilot == PX4 and name in ("FENCE_ENABLE", "FENCE_TYPE")  # PX4 has neither
                listed = unknown or switches_fence_on(name, value, self.types)
                self.hold(listed and not self.begun, "a parameter that nobody listed")
            case FrameNature.COMMAND:
                self.left += 1
                current = self.current
                if current is None:
                    self.hold(False, "a frame that moves the vehicle without a permit")
                    return
                self.hold(is_part_of(frame, current, self.autopilot, HOME), "a frame outside of the permitted command")
                late = self.first and self.now.monotonic_us > self.until_us
                self.hold(not late, "the first frame after the permit's time")
                self.first = False
                point = point_of(frame.message, frame.fields)
                path = [*zip(motion.geo[::2], motion.geo[1::2], strict=True)]
                if point in path and motion is self.motions[-1]:
                    turns = [leg for leg, each in enumerate(path) if each == point and leg in (self.leg, self.leg + 1)]
                    self.hold(bool(turns), "a point of the path before its turn")
                    self.leg = turns[0] if turns else self.leg

    def hold(self, truth: bool, what: str) -> None:
        if not truth:
            self.broken.append(what)


def state_at(step: int) -> State:
    """A nominal state, on the ground or at the place of the inspection."""
    values = FakeVehicle().values | ({HEIGHT: 20_000, POSITION_X: 110_000, POSITION_Y: -20_000} if step else {})
    return State(tuple(values[slot] for slot in range(len(values))), (0,) * len(values))


def fitting(of: Random, command: Command, autopilot: int, point: tuple[int, int] | None = None) -> list[Any]:
    """Messages that fly a command; to a point of its path, or to any of them."""
    px4, up, speed = autopilot == PX4, command.altitude / 1_000, command.speed / 1_000
    points = [*zip(command.geo[::2], command.geo[1::2], strict=True)]
    match command.kind:
        case MotionKind.CLIMB:
            to = long(22, nan, 0, 0, nan, nan, nan, HOME_AMSL / 1_000 + up) if px4 else long(22, 0, 0, 0, 0, 0, 0, up)
            return [long(400, 1), to, set_mode(SYSTEM, Px4Mode.HOLD if px4 else CopterMode.GUIDED)]
        case MotionKind.HOLD:
            return [stop_here(SYSTEM) if px4 else set_mode(SYSTEM, CopterMode.BRAKE)]
        case MotionKind.HOME:
            return [set_mode(SYSTEM, Px4Mode.RETURN if px4 else CopterMode.RTL)]
        case MotionKind.LAND:
            return [set_mode(SYSTEM, Px4Mode.LAND if px4 else CopterMode.LAND)]
    x, y = point or of.choice(points[:2] + points)
    if px4:
        return [mavlink.MAVLink_command_int_message(
            SYSTEM, 1, 0, 192, 0, 0, speed or -1, 1, 0, nan, x, y, HOME_AMSL / 1_000 + up
        )]  # fmt: skip
    return [
        set_mode(SYSTEM, CopterMode.GUIDED),
        mavlink.MAVLink_set_position_target_global_int_message(0, SYSTEM, 1, 6, 0x0DF8, x, y, up, *(0.0,) * 8),
    ]


def damaged(of: Random, octets: bytes) -> bytes:
    at = of.randrange(8 * len(octets))
    return octets[: at // 8] + bytes([octets[at // 8] ^ 1 << at % 8]) + octets[at // 8 + 1 :]


def point_of(message: int, fields: tuple[object, ...]) -> tuple[object, ...] | None:
    """The point that a frame sends the vehicle to."""
    names = {COMMAND_INT: ("x", "y"), SET_POSITION_TARGET_GLOBAL_INT: ("lat_int", "lon_int")}.get(message)
    return names and tuple(fields[LAYOUTS[message].at(name)] for name in names)


@pytest.mark.claim("A1")
@settings(max_examples=settings().max_examples * 2)
@given(worlds.CHANCES)
def test_no_history_moves_vehicle_past_the_executor(of: Random) -> None:
    assert Adapter(of).go(150) == []


@pytest.mark.soak
@pytest.mark.claim("A1")
@settings(max_examples=20_000)
@given(worlds.CHANCES)
def test_no_longer_history_moves_vehicle_past_the_executor(of: Random) -> None:
    assert Adapter(of).go(500) == []


def test_histories_let_commands_out() -> None:
    """Otherwise there would be nothing to break."""
    adapters = [Adapter(Random(seed)) for seed in range(25)]
    for each in adapters:
        each.go(150)
    assert sum(each.left > 0 for each in adapters) > 15
    kinds = {command.kind for each in adapters for command in each.motions}
    assert len(kinds) >= 5, kinds


def breaks(what: str, most: int = 400) -> bool:
    """Whether some history violates the assumption in this way."""
    return any(what in Adapter(Random(seed)).go(150) for seed in range(most))


@pytest.mark.claim("A1", broken="a gate that stays open when its command ends")
def test_search_detects_gate_that_stays_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gates.FrameSession, "close", lambda _: None)
    assert breaks("a frame that moves the vehicle without a permit")


@pytest.mark.claim("A1", broken="a gate that lets every frame pass while a command runs")
def test_search_detects_gate_without_comparison(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(allow_list, "carries_out", lambda *_: True)
    assert breaks("a frame outside of the permitted command")


@pytest.mark.claim("A1", broken="a gate without its list of what no permit allows")
def test_search_detects_gate_without_what_is_never_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gates.FrameSession, "_refuse_always", lambda *_: None)
    assert breaks("a frame in the name of another sender")


@pytest.mark.claim("A1", broken="a gate that lets the points of a path pass in any order")
def test_search_detects_gate_without_order(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse = gates.FrameSession._refuse_motion

    def whenever(self: gates.FrameSession, frame: Frame, now_us: int) -> Refusal | None:
        found = refuse(self, frame, now_us)
        return None if found is gates.OUT_OF_ORDER else found

    monkeypatch.setattr(gates.FrameSession, "_refuse_motion", whenever)
    assert breaks("a point of the path before its turn")


@pytest.mark.claim("A1", broken="an executor that forgets which permits were used")
def test_search_detects_executor_without_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    dispatch = executors.Executor._dispatch

    def again(self: executors.Executor, permit: object, now_us: int) -> object:
        self._used.clear()
        self._step, self._running = -1, False
        return dispatch(self, permit, now_us)  # type: ignore[arg-type]

    monkeypatch.setattr(executors.Executor, "_dispatch", again)
    assert breaks("a permit that was used before")
