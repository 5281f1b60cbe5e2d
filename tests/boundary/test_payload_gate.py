"""The gate in C lets out the same commands to payload as the one in Python, as often, and both lists of what may be
emitted in each language agree: in the compiler, in the checks of a bundle, and in the gate.
"""

import ctypes
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import nan
from pathlib import Path
from random import Random
from struct import pack as pack_float
from struct import unpack
from typing import Any
from xml.etree import ElementTree

import pytest
from msgspec import to_builtins
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary.test_gate import AUTOPILOTS, HOME_AMSL, HOMES, OURS, SYSTEM, InC, drawn_command, pack
from reference import payload_case as case
from reference.payload_case import ARGUMENTS, SERVOS, SPEED
from rtshcua.decision.checks.contracts import tightens
from rtshcua.decision.checks.emission_numbers import may_be_emitted
from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.checks.emits import ADDRESSEES, EMITTABLE
from rtshcua.mavlink.dialect import load
from rtshcua.mavlink.parameters import NAN, nearest_bits, value_of
from rtshcua.model.flat.contract import (
    ZONE,
    Addressee,
    Emission,
    EmissionMoment,
    EmissionParameter,
    MotionKind,
    NumberOrigin,
    Parameter,
)
from rtshcua.model.flat.zone import Projection, unproject
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.payload_gate import COMMANDS, payload_of, with_control
from rtshcua.onboard.ports import Command, PayloadFrame
from rtshcua.wire import bundle, cbor
from virtual.rows import rows

SAMPLE, SOAK = 40, 20_000
CHANNELS = (9, 10, 1)
COMPONENTS = {Addressee.VEHICLE: (1, 1), Addressee.CAMERA: (100, 100, 101), Addressee.GIMBAL: (154, 154, 171)}


def emit_in_c(
    gate: InC, boundary: ctypes.CDLL, emits: tuple[Emission, ...], command: Command, home: Projection
) -> None:
    """Tell the gate in C what its next command sends to payload."""
    lists = (
        [to_builtins(each, builtin_types=(bytes,)) for each in emits], list(ARGUMENTS), list(command.path), list(SERVOS)
    )  # fmt: skip
    octets = [b"".join(map(cbor.encode, each)) for each in lists]
    gate.emitted = octets  # type: ignore[attr-defined]
    boundary.rt_test_gate_payload(
        (ctypes.c_char_p * 4)(*octets), (ctypes.c_uint32 * 4)(*map(len, octets)),
        (ctypes.c_uint32 * 4)(*map(len, lists)),
        (ctypes.c_int64 * 4)(home.latitude, home.longitude, home.east, home.north), ctypes.c_int64(SPEED),
    )  # fmt: skip


def drawn_emission(random: Random) -> Emission:
    """A command to payload as bundles may have it, or another command that none may have."""
    command = random.choice([*COMMANDS, *COMMANDS, 22, 400, 246])
    parameters = [_parameter(random) for _ in range(7)]
    if command == 195:
        parameters[4:] = [
            EmissionParameter(NumberOrigin.LATITUDE, 2, 0),
            EmissionParameter(NumberOrigin.LONGITUDE, 2, 0),
            EmissionParameter(NumberOrigin.HEIGHT, *random.choice(((4, 0), (-1, 30_500)))),
        ]
    if command == 183:
        parameters[0] = EmissionParameter(NumberOrigin.CONSTANT, -1, nearest_bits(random.choice(CHANNELS), 1))
    moment = random.choice(list(EmissionMoment))
    amount = {EmissionMoment.DISTANCE: 9_000, EmissionMoment.TIME: 800_000}.get(moment, 0)
    return Emission(command, random.choice(list(Addressee)), tuple(parameters), moment, amount, 0, 0, 3_000_000, 0, "")


def _parameter(random: Random) -> EmissionParameter:
    if random.random() < 0.3:
        return EmissionParameter(NumberOrigin.ARGUMENT, *random.choice(((0, 10_000_000), (1, 1_000_000), (4, 7))))
    return EmissionParameter(NumberOrigin.CONSTANT, -1, random.choice((0, 0, 0, NAN, nearest_bits(1, 1), 0xC2280000)))


def drawn_frames(random: Random, payload: tuple[PayloadFrame, ...]) -> list[bytes]:
    """A frame of one of these commands, or what ends one, often sent again, sometimes with another number, component or
    repetition.
    """
    of = random.choice(payload)
    if random.random() < 0.3:
        stop = replace(of, command=2_001, numbers=(of.numbers[0], NAN, NAN, NAN, 0, 0, NAN), height=None)
        of = stop if of.command == 2_000 else case.ending(of) or of
    numbers = [value_of(each) for each in of.numbers]
    if of.height is not None and random.random() < 0.7:
        numbers[6] += HOME_AMSL / 1_000 + random.choice((0, 1.9, 2.1, -2.1))
    if random.random() < 0.15:
        numbers[random.randrange(7)] = random.choice((0.0, -0.0, nan, 1.0, 7.5))
    number = of.command if random.random() < 0.95 else random.choice((22, 400, 246, 209, 179, 2001))
    component = (
        random.choice((1, *COMPONENTS[Addressee(of.addressee)])) if random.random() < 0.95 else random.randrange(256)
    )
    again = random.choice((1, 1, 2, 6))
    confirmations = random.choice(([0] * again, range(again), [random.choice((0, 1, 2, 255)) for _ in range(again)]))
    return [
        pack(m.MAVLink_command_long_message(SYSTEM, component, number, each, *numbers), OURS) for each in confirmations
    ]


def compare(boundary: ctypes.CDLL, seed: int) -> int:
    """One session of each gate; returns how many frames both passed."""
    random = Random(seed)
    here, there = FrameSession(), InC(boundary)
    autopilot, home, now_us, left = random.choice(AUTOPILOTS), random.choice(HOMES), 1_000_000, 0
    payload: tuple[PayloadFrame, ...] = ()
    reports = [pack(m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3), 1)]
    reports += [
        pack(
            m.MAVLink_heartbeat_message(random.choice((30, 26, 18)), 8, 0, 0, 0, 3),
            each,
            random.choice((SYSTEM,) * 5 + (4, 0)),
        )
        for each in (100, 154, 171, 101, 99)
    ]
    reports.append(pack(m.MAVLink_global_position_int_message(0, 1, 2, HOME_AMSL + 5, 5, 0, 0, 0, 0), 1))
    for report in reports[: random.randrange(len(reports) + 3)]:
        here.observe(report, now_us)
        there.observe(report, now_us)
    for _ in range(70):
        now_us += random.choice((0, 1_000, 300_000, 900_000))
        chance = random.random()
        if chance < 0.06 or not payload:
            emits = tuple(drawn_emission(random) for _ in range(random.randrange(1, 9)))
            command = drawn_command(random, home)
            payload = payload_of(case.contract(emits), ARGUMENTS, len(command.path) // 2, case.policy(home, SPEED))
            here.open(replace(command, not_after_us=now_us + 5_000_000, payload=payload, servos=SERVOS))
            emit_in_c(there, boundary, emits, command, home)
            there.open(command, home, now_us + 5_000_000)
            payload = with_control(payload, SYSTEM)
        elif chance < 0.1:
            here.close()
            there.close()
        elif chance < 0.2:
            report = random.choice(reports)
            here.observe(report, now_us)
            there.observe(report, now_us)
        else:
            frames = drawn_frames(random, payload)
            for frame in frames:
                now_us += random.choice((0, 1_000, 200_000)) * (len(frames) > 1)
                one, other = here.seal(frame, now_us), there.seal(frame, now_us)
                assert other == (one.slug if isinstance(one, Refusal) else one), (seed, frame.hex())
                left += not isinstance(one, Refusal)
    return left


@pytest.mark.claim("A1", drawn="from seeds")
def test_both_gates_let_the_same_commands_to_payload_out(boundary: ctypes.CDLL) -> None:
    passed = [compare(boundary, seed) for seed in range(SAMPLE)]
    assert sum(map(bool, passed)) > SAMPLE / 2, "else it compares little"


@pytest.mark.claim("A1", drawn="from seeds")
@pytest.mark.soak
def test_both_gates_agree_on_payload_for_long(boundary: ctypes.CDLL) -> None:
    for seed in range(SAMPLE, SOAK):
        compare(boundary, seed)


def test_all_lists_refuse_the_same_commands(boundary: ctypes.CDLL) -> None:
    """Five lists were written apart: of the compiler; of the checks of a bundle and of the gate, in both languages."""
    boundary.rt_test_may_be_emitted.restype = boundary.rt_test_is_payload.restype = ctypes.c_bool
    numbers = load().enums["MAV_CMD"]
    compiled = {(numbers[name], ADDRESSEES[to]) for name, of in EMITTABLE.items() for to in of.to}
    every = [(number, to) for number in (*numbers.values(), 65_535) for to in Addressee]
    assert {each for each in every if may_be_emitted(*each)} == compiled
    in_c = {
        (number, to)
        for number, to in every
        if boundary.rt_test_may_be_emitted(ctypes.c_int64(number), ctypes.c_int64(to))
    }
    assert in_c == compiled
    assert {number for number, _ in compiled} == COMMANDS
    assert {number for number, _ in every if boundary.rt_test_is_payload(number)} == COMMANDS
    assert not any(may_be_emitted(2_000, to) for to in (-1, 3))


def test_no_list_has_what_moves_arms_or_changes_the_vehicle() -> None:
    never = (
        "NAV_WAYPOINT NAV_TAKEOFF NAV_LAND NAV_RETURN_TO_LAUNCH DO_SET_MODE DO_CHANGE_SPEED DO_REPOSITION DO_ORBIT "
        "DO_PAUSE_CONTINUE DO_CHANGE_ALTITUDE COMPONENT_ARM_DISARM DO_FLIGHTTERMINATION DO_MOTOR_TEST DO_SET_HOME "
        "DO_FENCE_ENABLE MISSION_START PREFLIGHT_REBOOT_SHUTDOWN PREFLIGHT_STORAGE PREFLIGHT_CALIBRATION DO_PARACHUTE "
        "DO_SET_PARAMETER DO_SET_MISSION_CURRENT DO_SET_ACTUATOR DO_SET_RELAY SET_MESSAGE_INTERVAL DO_SET_ROI_SYSID "
        "DO_REPEAT_SERVO DO_FOLLOW ACTUATOR_TEST"
    )
    known = load().enums["MAV_CMD"]
    names = [f"MAV_CMD_{name}" for name in never.split()]
    assert [name for name in names if name in EMITTABLE or known.get(name, 0) in COMMANDS] == []


def test_floats_are_the_nearest_in_both_languages(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_nearest_bits.restype = ctypes.c_uint32
    random = Random(7)
    cases = [
        (0, 5),
        (1, 1),
        (-1, 1),
        ((1 << 24) + 1, 1),
        ((1 << 24) + 3, 1),
        ((1 << 53) - 1, 1),
        (1, 1 << 30),
        (16_777_215, 2),
    ]
    cases += [
        (
            random.randrange(-(1 << random.randrange(1, 54)), 1 << random.randrange(1, 54)),
            random.randrange(1, (1 << 30) + 1),
        )
        for _ in range(2_000)
    ]
    cases += [
        ((2 * random.randrange(1 << 23, 1 << 24) + 1) << random.randrange(20), 1 << random.randrange(8))
        for _ in range(200)
    ]
    for numerator, denominator in cases:
        bits = nearest_bits(numerator, denominator)
        in_c = boundary.rt_test_nearest_bits(ctypes.c_int64(numerator), ctypes.c_int64(denominator))
        assert in_c == bits, (numerator, denominator)
        exact, found = Fraction(numerator, denominator), Fraction(*value_of(bits).as_integer_ratio())
        low, high = (
            (Fraction(*value_of(bits + step).as_integer_ratio()) for step in (-1, 1))
            if bits & 0x7FFFFFFF
            else (found, found)
        )
        distances = [abs(each - exact) for each in (low, found, high)]
        assert distances[1] == min(distances), (numerator, denominator)
        assert distances[1] not in (distances[0], distances[2]) or not bits & 1 or low == high, "ties to even"
    one = [unpack("<I", pack_float("<f", each))[0] for each in (0.5, -2.25, 1e10)]
    assert [nearest_bits(1, 2), nearest_bits(-9, 4), nearest_bits(10**10, 1)] == one
    values = [value_of(nearest_bits(n, 7)) for n in range(1, 2_000)]
    assert all(a <= b for a, b in pairwise(values))


def odd_emissions(random: Random) -> Iterator[tuple[Emission, MotionKind]]:
    """Emissions that a compiler makes, and the same with one number changed."""
    for command, to in GOOD:
        made = case.emission(command, to=to)
        if command == 195:
            places = (NumberOrigin.LATITUDE, NumberOrigin.LONGITUDE)
            of_place = [EmissionParameter(origin, 2, 0) for origin in places]
            made = replace(
                made, parameters=(*made.parameters[:4], *of_place, EmissionParameter(NumberOrigin.HEIGHT, 4, 0))
            )
        if command == 183:
            made = replace(made, parameters=(case.constant(nearest_bits(9, 1)), *made.parameters[1:]))
        yield made, MotionKind.FLY
        for _ in range(25):
            yield _changed(made, random), random.choice(list(MotionKind))


def _changed(made: Emission, random: Random) -> Emission:
    numbers = (
        -1,
        0,
        1,
        2,
        3,
        4,
        5,
        6,
        7,
        99_999,
        100_000,
        60_000_001,
        1_800_000_001,
        1 << 30,
        1 << 33,
        NAN,
        0x7F800000,
    )
    at = random.randrange(10)
    if at < 5:
        number, field = random.randrange(7), random.choice(("origin", "cell", "value"))
        changed = replace(made.parameters[number], **{field: random.choice(numbers)})
        return replace(made, parameters=(*made.parameters[:number], changed, *made.parameters[number + 1 :]))
    if at == 5:
        return replace(made, parameters=made.parameters[: random.randrange(7)])
    names = random.sample(("command", "addressee", "moment", "amount", "success", "bound", "within_us", "required"), 2)
    return replace(made, **{name: random.choice((*numbers, 2_000, 1_000)) for name in names})


GOOD = ((2_000, Addressee.CAMERA), (1_000, Addressee.GIMBAL), (195, Addressee.VEHICLE), (183, Addressee.VEHICLE))


def test_bundles_with_the_same_emissions_load_in_both_languages(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_prepare_policy.restype = ctypes.c_char_p
    random, accepted, refused = Random(3), 0, 0
    for emission, motion in odd_emissions(random):
        policy = case.policy(of=case.contract((emission,), motion))
        data = bundle.policy_payload(policy)
        here = prepare(policy)
        there = boundary.rt_test_prepare_policy(data, len(data))
        assert (there is None) is not isinstance(here, Refusal), (emission, here)
        accepted += there is None
        refused += there is not None
    assert accepted >= len(GOOD)
    assert refused > 20


_C, _A, _LAT, _LON, _H = NumberOrigin
BEGIN, END, TURN, WAYPOINT, DISTANCE, TIME = EmissionMoment


def _with(at: int, origin: NumberOrigin, cell: int, value: int, command: int = 2_000, **fields: Any) -> Emission:
    """A command with another parameter."""
    made = case.emission(command, to=Addressee.VEHICLE)
    parameter = EmissionParameter(origin, cell, value)
    return replace(made, parameters=(*made.parameters[: at - 1], parameter, *made.parameters[at:]), **fields)


def _of(command: int = 2_000, **fields: Any) -> Emission:
    return _with(2, _C, -1, 0, command, **fields)


def _placed(*last: EmissionParameter) -> Emission:
    made = _of(195)
    return replace(made, parameters=(*made.parameters[: 7 - len(last)], *last))


LAT, LON, HIGH = (EmissionParameter(*each) for each in ((_LAT, 2, 0), (_LON, 2, 0), (_H, -1, 9)))
ATTITUDE, IMAGE = {"success": 2, "bound": 1}, {"success": 1}


@rows(
    ("emission", "loads"),
    [
        (_with(1, _C, -1, 0), True), (_with(1, _C, 0, 0), False), (_with(1, _C, -1, 0x7F7FFFFF), True),
        (_with(1, _C, -1, NAN), True), (_with(1, _C, -1, NAN + 1), False), (_with(1, _C, -1, 0xFF800000), False),
        (_with(1, _C, -1, 1 << 32), False), (_with(1, _C, -1, -1), False),
        (_with(1, _A, 0, 1), True), (_with(1, _A, 0, 0), False), (_with(1, _A, 0, 1 << 30), True),
        (_with(1, _A, 0, (1 << 30) + 1), False), (_with(1, _A, 2, 1), False), (_with(1, _A, 3, 1), False),
        (_with(1, _A, 64, 1), False), (_with(1, _A, -1, 1), False),
        (_with(5, _LAT, 2, 0), False), (_with(7, _H, -1, 0), False), (_of(195), False),
        (_placed(LAT, LON, HIGH), True), (_placed(LON, LAT, HIGH), False), (_placed(LAT, LAT, HIGH), False),
        (_placed(LAT, LON, EmissionParameter(_H, 4, 0)), True), (_placed(LAT, LON, EmissionParameter(_H, 4, 1)), False),
        (_placed(LAT, LON, EmissionParameter(_H, 2, 0)), False), (_placed(LAT, LON, case.constant()), False),
        (_placed(LAT, LON, EmissionParameter(_H, -1, (1 << 30) + 1)), False),
        (_placed(EmissionParameter(_LAT, 2, 1), LON, HIGH), False),
        (_placed(EmissionParameter(_LAT, 4, 0), LON, HIGH), False),
        (replace(_of(), parameters=_of().parameters[:6]), False),
        (_with(1, _C, -1, nearest_bits(9, 1), 183), True), (_with(1, _C, -1, nearest_bits(8, 1), 183), False),
        (_with(1, _A, 1, 1, 183), False),
        (_of(moment=TURN), False), (_of(moment=WAYPOINT), True), (_of(moment=6), False), (_of(moment=END), True),
        (_of(moment=BEGIN, amount=1), False), (_of(moment=WAYPOINT, amount=1), False),
        (_of(moment=END, amount=1), False),
        (_of(moment=TIME, amount=100_000), True), (_of(moment=TIME, amount=99_999), False),
        (_of(moment=TIME, amount=(1 << 42) + 1), False), (_of(moment=DISTANCE, amount=1_200), True),
        (_of(moment=DISTANCE, amount=1_199), False), (_of(moment=DISTANCE, amount=(1 << 29) + 1), False),
        (_of(**IMAGE), True), (_of(**IMAGE, bound=1), False), (_of(**ATTITUDE), False), (_of(bound=1), False),
        (_of(1_000, **ATTITUDE), True), (_of(1_000, success=2), False), (_of(1_000, **IMAGE), False),
        (_of(205, **ATTITUDE), True), (_of(203, **IMAGE), True), (_of(success=3), True), (_of(success=4), False),
        (_of(206, success=3), True), (_of(2_003, success=3), True), (_of(203, success=3), True),
        (_of(530, success=3), False), (_of(206, success=1), False), (_of(success=3, bound=1), False),
        (_of(1_000, success=2, bound=1_800_000_001), False), (_of(within_us=0), False),
        (_of(within_us=60_000_001), False), (_of(required=2), False), (_of(addressee=3), False),
        (_of(addressee=Addressee.GIMBAL), False), (_of(400), False),
    ],
)  # fmt: skip
def test_each_number_of_an_emission_is_checked_in_both_languages(
    emission: Emission, loads: bool, boundary: ctypes.CDLL
) -> None:
    boundary.rt_test_prepare_policy.restype = ctypes.c_char_p
    policy = case.policy(of=case.contract((emission,)))
    data = bundle.policy_payload(policy)
    assert isinstance(prepare(policy), Refusal) is not loads
    assert (boundary.rt_test_prepare_policy(data, len(data)) is None) is loads


def test_turns_exist_where_an_area_is_covered(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_prepare_policy.restype = ctypes.c_char_p
    area = Parameter("area", ZONE, "zone", 5, 0, 2, ())
    for motion, loads in ((MotionKind.COVER, True), (MotionKind.HOLD, False)):
        made = case.contract((_of(moment=TURN),), motion)
        policy = case.policy(of=replace(made, parameters=(*made.parameters, area)))
        data = bundle.policy_payload(policy)
        assert isinstance(prepare(policy), Refusal) is not loads
        assert (boundary.rt_test_prepare_policy(data, len(data)) is None) is loads


class Pair:
    """A gate of each language for one flight, with a camera and a gimbal of their own or without."""

    def __init__(self, boundary: ctypes.CDLL, autopilot: int = 12, *, apart: bool = True) -> None:
        self.here, self.there, self.boundary = FrameSession(), InC(boundary), boundary
        self.now_us = 1_000_000
        self.observe(m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3), 1)
        if apart:
            self.observe(m.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3), 100)
            self.observe(m.MAVLink_heartbeat_message(26, 8, 0, 0, 0, 3), 154)

    def observe(self, message: Any, component: int) -> None:
        frame = pack(message, component)
        self.here.observe(frame, self.now_us)
        self.there.observe(frame, self.now_us)

    def open(self, *emits: Emission, points: int = 4) -> None:
        path = tuple(range(2 * points))
        geo = tuple(part for x, y in zip(path[::2], path[1::2], strict=True) for part in unproject(HOMES[0], x, y))
        command = Command(7, "look", MotionKind.COVER, path, geo, 20_000, 4_000)
        payload = payload_of(case.contract(emits), ARGUMENTS, points, case.policy(HOMES[0], SPEED))
        until_us = self.now_us + 1_000_000
        self.here.open(replace(command, not_after_us=until_us, payload=payload, servos=SERVOS))
        emit_in_c(self.there, self.boundary, emits, command, HOMES[0])
        self.there.open(command, HOMES[0], until_us)

    def close(self) -> None:
        self.here.close()
        self.there.close()

    def send(self, number: int, *numbers: float, to: int = 100, again: int = 0, after_us: int = 0) -> str:
        """The slug with which both refuse a command; empty if both let it pass."""
        self.now_us += after_us
        filled = [*numbers, *[0.0] * (7 - len(numbers))]
        frame = pack(m.MAVLink_command_long_message(SYSTEM, to, number, again, *filled), OURS)
        one, other = self.here.seal(frame, self.now_us), self.there.seal(frame, self.now_us)
        assert other == (one.slug if isinstance(one, Refusal) else one)
        return one.slug if isinstance(one, Refusal) else ""


START, STOP, VIDEO, POINT, CONTROL = 2_000, 2_001, 2_500, 1_000, 1_001
OF_START, OF_STOP = (0, 0, 1, 0, 0, 0, nan), (0, nan, nan, nan, 0, 0, nan)
NOT_COVERED, WRONG, OFTEN = "frame/not-covered", "frame/wrong-target", "frame/too-often"


def start(moment: EmissionMoment, amount: int = 0, *, pictures: int = 1) -> Emission:
    return case.emission(START, 0, 0, nearest_bits(pictures, 1), 0, 0, 0, NAN, moment=moment, amount=amount)


def test_a_declared_command_passes_once_with_three_repetitions(boundary: ctypes.CDLL) -> None:
    both = Pair(boundary)
    assert both.send(START, *OF_START) == NOT_COVERED
    both.open(start(BEGIN))
    assert both.send(START, *OF_START, again=1) == OFTEN
    assert both.send(START, *OF_START, to=1) == WRONG
    assert both.send(START, *OF_START, to=154) == WRONG
    assert both.send(START, *OF_START, to=101) == WRONG
    assert both.send(START, 0, 0, 2, 0, 0, 0, nan) == NOT_COVERED
    assert both.send(START, 0, 0, 1) == NOT_COVERED
    assert [both.send(START, *OF_START, again=again) for again in range(5)] == ["", "", "", "", OFTEN]
    assert both.send(START, *OF_START) == OFTEN
    assert both.send(STOP, *OF_STOP) == NOT_COVERED, "one picture needs no end"
    both.close()
    assert both.send(START, *OF_START) == NOT_COVERED


def test_repeated_commands_wait_for_their_interval(boundary: ctypes.CDLL) -> None:
    both = Pair(boundary)
    for every, interval_us in ((start(TIME, 800_000), 800_000), (start(DISTANCE, 9_000), 750_000)):
        both.open(every)
        assert both.send(START, *OF_START) == ""
        assert both.send(START, *OF_START, after_us=interval_us - 1) == OFTEN
        assert both.send(START, *OF_START, after_us=1) == ""
        assert both.send(START, *OF_START) == OFTEN
    for at, count in ((TURN, 2), (WAYPOINT, 4)):
        both.open(start(at), points=4)
        assert [both.send(START, *OF_START) for _ in range(count + 1)] == [*[""] * count, OFTEN]
    both.open(start(TURN), points=2)
    assert both.send(START, *OF_START) == OFTEN


def test_what_was_begun_may_be_ended_once_and_nothing_else(boundary: ctypes.CDLL) -> None:
    both = Pair(boundary)
    both.open(start(BEGIN, pictures=0))
    assert both.send(STOP, *OF_STOP) == NOT_COVERED
    assert both.send(START, 0, 0, 0, 0, 0, 0, nan) == ""
    both.close()
    assert both.send(STOP, *OF_STOP, to=1) == NOT_COVERED
    assert both.send(STOP, 1, nan, nan, nan, 0, 0, nan) == NOT_COVERED
    assert both.send(VIDEO + 1, 0, 0, nan, nan, 0, 0, nan) == NOT_COVERED
    assert [both.send(STOP, *OF_STOP, after_us=60_000_000) for _ in range(5)] == ["", "", "", "", NOT_COVERED]
    both.open(start(BEGIN, pictures=0), case.emission(STOP, 0, NAN, NAN, NAN, 0, 0, NAN, moment=END))
    assert both.send(START, 0, 0, 0, 0, 0, 0, nan) == both.send(STOP, *OF_STOP) == ""
    both.close()
    assert both.send(STOP, *OF_STOP) == NOT_COVERED, "the step has ended it"
    both.open(case.emission(206, nearest_bits(5, 1)))
    assert both.send(206, 5) == ""
    both.open()
    assert both.send(206) == ""


def test_control_of_a_gimbal_is_ours_while_we_point_it(boundary: ctypes.CDLL) -> None:
    both = Pair(boundary)
    taken, given = (SYSTEM, OURS, -1, -1), (-3, -3, -1, -1)
    both.open(start(BEGIN))
    assert both.send(CONTROL, *taken, to=154) == NOT_COVERED
    both.open(case.emission(POINT, nearest_bits(-90, 1), NAN, NAN, NAN, to=Addressee.GIMBAL))
    assert both.send(CONTROL, *given, to=154) == NOT_COVERED
    assert both.send(CONTROL, 255, 190, -1, -1, to=154) == NOT_COVERED
    assert both.send(CONTROL, *taken, to=1) == WRONG
    assert both.send(CONTROL, *taken, to=154) == ""
    assert both.send(POINT, -90, nan, nan, nan, to=154) == ""
    both.close()
    assert both.send(POINT, -90, nan, nan, nan, to=154, again=1) == NOT_COVERED
    assert both.send(CONTROL, *taken, to=154, again=1) == NOT_COVERED
    assert both.send(CONTROL, *given, to=154) == ""


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_without_components_of_their_own_the_autopilot_has_the_payload(boundary: ctypes.CDLL, autopilot: int) -> None:
    both = Pair(boundary, autopilot, apart=False)
    both.open(start(BEGIN), _of(211))
    assert both.send(START, *OF_START) == WRONG
    assert both.send(START, *OF_START, to=1) == ""
    assert both.send(211, to=1) == ""
    assert both.send(512, 259, to=100) == WRONG, "only of what was heard may messages be requested"
    both.observe(m.MAVLink_heartbeat_message(30, 8, 0, 0, 0, 3), 100)
    assert both.send(512, 259, to=100) == ""
    assert both.send(400, 1, to=100) == both.send(22, to=100) == WRONG


def test_a_height_is_sent_as_the_autopilot_expects_it(boundary: ctypes.CDLL) -> None:
    roi = _placed(LAT, LON, EmissionParameter(_H, -1, 30_000))
    place = [part / 1e7 for part in unproject(HOMES[0], *ARGUMENTS[2:4])]
    for autopilot, at, passes in (
        (3, 30.0, True),
        (3, 30.001, False),
        (12, 518.0, True),
        (12, 519.9, True),
        (12, 520.1, False),
    ):
        both = Pair(boundary, autopilot)
        both.open(roi)
        if autopilot == 12:
            assert both.send(195, 0, 0, 0, 0, *place, at, to=1) == NOT_COVERED, "the height of home is not known yet"
        both.observe(m.MAVLink_global_position_int_message(0, 1, 2, HOME_AMSL, 0, 0, 0, 0, 0), 1)
        assert (both.send(195, 0, 0, 0, 0, *place, at, to=1) == "") is passes
        assert both.send(195, 0, 0, 0, 0, place[0], place[1] + 1, at, to=1) == NOT_COVERED
        assert both.send(195, 0, 0, 0, 0, *place, nan, to=1) == NOT_COVERED


def test_a_step_that_needs_no_frame_has_its_payload_until_its_end(boundary: ctypes.CDLL) -> None:
    both = Pair(boundary)
    both.open(start(BEGIN))
    assert both.send(400, 1, to=1, after_us=1_000_001) == NOT_COVERED
    assert both.send(START, *OF_START) == ""


def test_free_servo_outputs_and_the_number_of_emissions_are_checked_in_both_languages(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_prepare_policy.restype = ctypes.c_char_p
    one = case.emission(2_000)
    for servos, count, loads in (
        ((9, 10), 8, True), ((9, 10), 9, False), ((9, 9), 1, False), ((0,), 1, False), ((33,), 1, False), ((), 1, True)
    ):  # fmt: skip
        policy = case.policy(of=case.contract((one,) * count))
        policy = replace(policy, vehicle=replace(policy.vehicle, servos=servos))
        data = bundle.policy_payload(policy)
        assert isinstance(prepare(policy), Refusal) is not loads, servos
        assert (boundary.rt_test_prepare_policy(data, len(data)) is None) is loads, servos


def test_a_mission_cannot_change_what_a_skill_emits() -> None:
    mine, other = case.contract((case.emission(2_000),)), case.contract(())
    assert list(tightens(mine, mine)) == []
    assert list(tightens(other, mine)) == list(tightens(mine, other)) == ["`emits` is looser than in the policy"]


def test_parameters_without_a_value_are_what_the_standard_says() -> None:
    """Reserved parameters whose default is NaN in the XML are NaN if they are unset; besides, those that a gimbal
    ignores.
    """
    for name, of in EMITTABLE.items():
        ignored = {"param1", "param2", "param3", "param4"} if name.endswith("PITCHYAW") else set()
        assert set(of.unset) == nan_by_default(name) | ignored, name


@cache
def _entries() -> dict[str, Any]:
    folder = Path(m.__file__).parent
    found = {}
    for file in ("common.xml", "ardupilotmega.xml"):
        for entry in ElementTree.parse(folder / file).iterfind("./enums/enum[@name='MAV_CMD']/entry"):
            found[entry.attrib["name"]] = entry
    return found


def nan_by_default(name: str) -> set[str]:
    return {
        f"param{each.attrib['index']}" for each in _entries()[name].iterfind("param") if each.get("default") == "NaN"
    }
