"""Whatever clients send: every proposal is a step of the table, and every frame for the vehicle is housekeeping."""

import json
import struct
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import (
    NORTH,
    ROWS,
    SYSTEM,
    GatewayWorld,
    command_long,
    item,
    reposition,
    setpoint,
)
from rtshcua.ground.gateway.client_frames import LAYOUTS_OF_CLIENTS, made
from rtshcua.ground.gateway.interface import (
    Action,
    ClientDown,
    ClientNote,
    FromClient,
    FromVehicle,
    ProposalAnswered,
    ProposalChecked,
    Propose,
    RequestFrame,
    ToClient,
)
from rtshcua.ground.gateway.translation import Translation
from rtshcua.mavlink import layouts
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.onboard.enforcement.allow_list import is_housekeeping, read_frame

SKILLS = {row.skill for row in ROWS}
COMMANDS = sorted(
    {row.number for row in ROWS if row.number < 1 << 16} | {176, 300, 400, 511, 512, 224, 32_100, 178, 246, 410}
)
#: floats that formats, rounding and units may fail at
FLOATS = st.one_of(
    st.sampled_from(
        [float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1.0, -1.0, 3.4e38, -3.4e38, 1e-45, 21196.0, 4.0, 10.0,
         20.0, 508.0, 47.3983, 8.54559, 2147483648.0, 16777217.0, 1.8e9]
    ),
    st.floats(width=32),
)  # fmt: skip
_LIMITS = {"b": (-1 << 7, (1 << 7) - 1), "B": (0, 255), "h": (-1 << 15, (1 << 15) - 1), "H": (0, 0xFFFF)}
_LIMITS |= {
    "i": (-1 << 31, (1 << 31) - 1),
    "I": (0, (1 << 32) - 1),
    "q": (-1 << 63, (1 << 63) - 1),
    "Q": (0, (1 << 64) - 1),
}
_SMALL = st.integers(0, 8)


def checked(world: GatewayWorld, actions: list[Action]) -> None:
    """Nothing but steps of the table and housekeeping, in the forms that were promised."""
    for each in actions:
        match each:
            case Propose(_, _, role, steps):
                assert role == "operator"
                for step in steps:
                    contract = next(one for one in world.policy.policy.contracts if one.name == step.skill)
                    assert step.skill in SKILLS
                    assert len(step.values) == sum(2 if one.kind == 3 else 1 for one in contract.parameters)
                    assert all(type(value) is int and abs(value) <= MAX_VALUE for value in step.values)
                    assert set(step.arguments) <= {one.name for one in contract.parameters}
            case RequestFrame(_, _, frame):
                read = read_frame(frame)
                if read is not None:
                    assert is_housekeeping(read)
                else:
                    assert int.from_bytes(frame[7:10], "little") == layouts.LOG_REQUEST_LIST
                assert frame[5:7] == bytes([SYSTEM, 191])
            case ToClient(_, frame):
                assert frame[5:7] == bytes([SYSTEM, 1])
            case ClientNote(said):
                assert len(each.text) <= 200
                for name, value in json.loads(each.text).items():
                    whole = said[name]
                    if value != whole:  # cut at a space, with white space folded
                        assert value.endswith("...")
                        assert " ".join(str(whole).split()).startswith(value.removesuffix("...").rstrip())


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    """A frame of a message that the gateway reads, with any values, mostly plausible ones."""
    number = draw(st.sampled_from(sorted(LAYOUTS_OF_CLIENTS)))
    layout = LAYOUTS_OF_CLIENTS[number]
    codes = "".join(_expanded(layout.fields.format))
    values: dict[str, Any] = {}
    for name, code in zip(layout.names, codes, strict=True):
        if code == "s":
            values[name] = draw(st.one_of(st.binary(max_size=60), st.just(b"MIS_TAKEOFF_ALT")))
        elif code == "f":
            values[name] = draw(FLOATS)
        elif name == "command":
            values[name] = draw(st.one_of(st.sampled_from(COMMANDS), st.integers(*_LIMITS[code])))
        elif name == "target_system":
            values[name] = draw(st.sampled_from([0, SYSTEM, SYSTEM, 9]))
        elif name == "target_component":
            values[name] = draw(st.sampled_from([0, 1, 1, 100]))
        elif name in ("x", "lat_int"):
            values[name] = draw(st.sampled_from([473_983_000, (1 << 31) - 1, -1 << 31, 0])) if code == "i" else 3
        else:
            values[name] = draw(st.one_of(_SMALL, st.integers(*_LIMITS[code])))
    return made(number, values, (draw(st.integers(1, 255)), 190), 0)


def _expanded(format: str) -> list[str]:
    """One code for each field."""
    found: list[str] = []
    count = ""
    for character in format.lstrip("<"):
        if character.isdigit():
            count += character
        else:
            found += [] if character == "x" else [character] * (1 if character == "s" else int(count or 1))
            count = ""
    return found


def _upload(heights: list[int]) -> list[Any]:
    items = [item(0, 22, z=heights[0]), *(item(at, 16, x=N, y=E, z=z) for at, z in enumerate(heights, start=1))]
    return [mavlink.MAVLink_mission_count_message(SYSTEM, 1, len(items), 0), *items, command_long(300)]


N, E = NORTH
#: messages that may well be accepted, of which many are
PLAUSIBLE = st.one_of(
    st.builds(lambda z: [command_long(22, 0, 0, 0, 0, 0, 0, z)], st.integers(488, 530)),
    st.builds(lambda x, z: [reposition(N + x, E, z)], st.integers(-9_000, 9_000), st.integers(490, 530)),
    st.builds(lambda x, z: [setpoint(N + x, E, z)], st.integers(-9_000, 9_000), st.integers(0, 45)),
    st.builds(lambda main, sub: [command_long(176, 1, main, sub)], st.integers(0, 9), st.integers(0, 7)),
    st.builds(lambda number: [command_long(number)], st.sampled_from([20, 21, 193, 300, 400])),
    st.builds(_upload, st.lists(st.integers(5, 45), min_size=1, max_size=4)),
)

EVENTS = st.one_of(
    st.tuples(st.just("frame"), frames()),
    st.tuples(st.just("plausible"), PLAUSIBLE),
    st.tuples(st.just("plausible"), PLAUSIBLE),
    st.tuples(st.just("octets"), st.binary(max_size=80)),
    st.tuples(st.just("wait"), st.integers(1, 6_000_000)),
    st.tuples(
        st.just("line"), st.sampled_from(["waiting", "mission", "close", "dispatched", "succeeded", "superseded"])
    ),
    st.tuples(st.just("answer"), st.integers(1, 9)),
    st.tuples(st.just("armed"), st.booleans()),
    st.tuples(st.just("cut"), frames()),
    st.tuples(st.just("down"), st.integers(1, 2)),
)


def happens(world: GatewayWorld, kind: str, what: Any) -> list[Action]:
    if kind == "frame":
        return world.take(FromClient(1 + world.now_us % 2, what))
    if kind == "plausible":
        return [action for message in what for action in world.send(message, client=1 + world.now_us % 2)]
    if kind == "octets":
        return world.take(FromClient(1, b"\xfd" + what)) + world.take(FromVehicle(b"\xfe" + what))
    if kind == "cut":
        return world.take(FromClient(1, what[: len(what) // 2])) + world.take(FromClient(1, what[:-2] + b"\0\0"))
    if kind == "wait":
        return world.wait(what, step_us=100_000)
    if kind == "answer":
        return world.take(ProposalChecked(what, None, what)) + world.take(ProposalAnswered(what, "accepted"))
    if kind == "armed":
        return world.report(armed=what, airborne=what)
    if kind == "down":
        return world.take(ClientDown(what))
    if what in ("waiting", "mission", "close"):
        return world.line(type=what)
    return world.line(type="effect", event=what, kind=0, step=world.now_us % 9)


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
@given(events=st.lists(EVENTS, min_size=10, max_size=60), flies=st.booleans())
@settings(
    deadline=None,
    max_examples=settings().max_examples * 2,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)
def test_no_sequence_of_frames_leaves_the_table(autopilot: int, events: list[tuple[str, Any]], flies: bool) -> None:
    world = GatewayWorld(autopilot)
    world.client(2, "other", rank=1)
    world.ready()
    if flies:
        world.fly()
    for kind, what in events:
        world.now_us += 1
        checked(world, happens(world, kind, what))


@given(frame=frames(), flies=st.booleans())
@settings(deadline=None)
def test_without_rows_nothing_is_proposed(frame: bytes, flies: bool) -> None:
    world = GatewayWorld()
    world.gateway._state.translation = Translation(
        world.gateway._state.settings._replace(accepted=()), world.gateway._state.seen
    )
    world.ready()
    if flies:
        world.fly()
    actions = world.take(FromClient(1, frame))
    assert not [each for each in actions if isinstance(each, Propose)]
    checked(world, actions)


@pytest.mark.slow
def test_no_damaged_frame_moves_anything() -> None:
    """Every octet of a reposition is changed to every value: a frame with a wrong checksum is dropped."""
    world = GatewayWorld()
    world.fly()
    sender = mavlink.MAVLink(None, 255, 190)
    frame = mavlink.MAVLink_command_long_message(1, 1, 192, 0, 5, 1, 0, 0, 47.3983, 8.54559, 508).pack(sender)
    proposed = 0
    for at in range(len(frame)):
        for value in range(256):
            mutated = frame[:at] + bytes([value]) + frame[at + 1 :]
            if mutated != frame:
                actions = world.take(FromClient(1, mutated))
                checked(world, actions)
                proposed += any(isinstance(each, Propose) for each in actions)
    assert proposed == 0


def test_extreme_values_of_every_command_are_refused_or_understood() -> None:
    extreme = (float("nan"), float("inf"), float("-inf"), 3.4e38, -3.4e38, struct.unpack("<f", b"\1\0\0\0")[0])
    for autopilot in (PX4, ARDUPILOT):
        world = GatewayWorld(autopilot)
        world.fly()
        for command in (
            *range(16, 24),
            34,
            92,
            115,
            *range(176, 260),
            300,
            400,
            410,
            *range(510, 530),
            2000,
            32_100,
            65_535,
        ):
            for value in extreme:
                world.now_us += 10_000_000
                message = mavlink.MAVLink_command_long_message(1, 1, command, 0, *[value] * 7)
                checked(world, world.send(message))
                whole = mavlink.MAVLink_command_int_message(
                    1, 1, 6, command, 0, 0, *[value] * 4, -(1 << 31), (1 << 31) - 1, value
                )
                checked(world, world.send(whole))
