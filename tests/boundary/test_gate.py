"""The gate and the signing of frames in C match those in Python: the same frames pass, the others are refused for the
same reason, with the same octets, and the same incoming frames are accepted.
"""

import ctypes
from math import inf, nan, radians
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.signing import EPOCH_US, MINUTE, MOST_AHEAD, SignedLink, SigningState
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.model.flat.zone import SHIFT, Projection, unproject
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command
from rtshcua.wire import cbor

SYSTEM, OURS, HOME_AMSL = 3, 191, 488_000
AUTOPILOTS = (3, 12)
HOMES = (  # Zurich; across longitude 180, in the south; near the pole
    Projection(473_977_000, 85_456_000, int(7.53 * (1 << SHIFT)), int(11.12 * (1 << SHIFT))),
    Projection(-171_000_000, 1_799_999_900, int(10.6 * (1 << SHIFT)), int(11.06 * (1 << SHIFT))),
    Projection(890_000_000, -1_000_000, int(0.19 * (1 << SHIFT)), int(11.17 * (1 << SHIFT))),
)
HEADINGS = (0, 1, 4_500, 17_999, 18_000, 18_001, 35_999)
SAMPLE, SOAK = 40, 40_000


class InC:
    """The gate in C."""

    def __init__(self, boundary: ctypes.CDLL) -> None:
        self._lib = boundary
        boundary.rt_test_gate_seal.restype = boundary.rt_test_gate_sign_ahead.restype = ctypes.c_char_p
        boundary.rt_test_gate_begin()

    def open(self, command: Command, projection: Projection, not_after_us: int) -> None:
        octets, *levels = (
            b"".join(map(cbor.encode, each)) for each in (command.path, command.heights, command.headings)
        )
        self.kept = octets, levels
        self._lib.rt_test_gate_levels(
            levels[0], len(levels[0]), len(command.heights), levels[1], len(levels[1]), len(command.headings)
        )
        self._lib.rt_test_gate_open(
            ctypes.c_int64(command.kind), ctypes.c_int64(command.altitude), ctypes.c_int64(command.speed), octets,
            len(octets), len(command.path),
            (ctypes.c_int64 * 4)(projection.latitude, projection.longitude, projection.east, projection.north),
            ctypes.c_int64(not_after_us),
        )  # fmt: skip

    def close(self) -> None:
        self._lib.rt_test_gate_close()

    def observe(self, frame: bytes, now_us: int) -> None:
        self._lib.rt_test_gate_observe(frame, len(frame), ctypes.c_int64(now_us))

    def sign_ahead(self, frame: bytes, now_us: int) -> str | None:
        """Sign ahead for the command that it was last opened for; return the refusal."""
        slug = self._lib.rt_test_gate_sign_ahead(frame, len(frame), ctypes.c_int64(now_us))
        return slug and slug.decode()

    def seal(self, frame: bytes, now_us: int) -> bytes | str:
        out, size = ctypes.create_string_buffer(512), ctypes.c_uint32()
        slug = self._lib.rt_test_gate_seal(frame, len(frame), ctypes.c_int64(now_us), out, ctypes.byref(size))
        return out.raw[: size.value] if slug is None else slug.decode()


def pack(message: Any, component: int = OURS, system: int = SYSTEM) -> bytes:
    return Codec(system, component).pack(message)


def long(number: int, *parameters: float, component: int = 1) -> Any:
    padded = [*parameters, *[0.0] * (7 - len(parameters))]
    return m.MAVLink_command_long_message(SYSTEM, component, number, 0, *padded)


def drawn_command(random: Random, home: Projection) -> Command:
    near = [random.randrange(-60_000, 60_000) for _ in range(2 * random.randrange(1, 6))]
    kind = random.choice(list(MotionKind))
    path = tuple(near) if kind in (MotionKind.FLY, MotionKind.COVER) else ()
    geo = tuple(part for x, y in zip(path[::2], path[1::2], strict=True) for part in unproject(home, x, y))
    altitude, speed = random.choice((20_000, 35_250)), random.choice((0, 4_000, 3_333))
    heights = tuple(random.choice((altitude, 5_000, 12_340)) for _ in path[::2]) if random.random() < 0.5 else ()
    headings = tuple(random.choice((ALONG, *HEADINGS)) for _ in path[::2]) if random.random() < 0.5 else ()
    return Command(7, "skill", kind, path, geo, altitude, speed, heights=heights, headings=headings)


def drawn_frame(random: Random, of: Command) -> bytes:
    """A frame for the command, a similar one, housekeeping, or any other, sometimes damaged."""
    at = random.randrange(len(of.geo) // 2 + 2)
    x, y = [*zip(of.geo[::2], of.geo[1::2], strict=True), (2**31 - 1, 2**31 - 1), (1, 2)][at]
    of_point = at if at < len(of.geo) // 2 and random.random() < 0.8 else random.randrange(len(of.geo) // 2 or 1)
    height = (of.heights[of_point] if of.heights else of.altitude) / 1000
    height += random.choice((0, 0, 0.001, 0.003, 1.999, 2.002, -5.0))
    speed = of.speed / 1000 + random.choice((0, 0, 0.0015, 0.0025))
    odd = random.choice((0.0, -0.0, nan, inf, 1.0, -1.0, 1e-45, 3.4e38))
    sea = HOME_AMSL / 1000 + height
    heading = of.headings[of_point] if of.headings else ALONG
    turned = (heading + random.choice((0, 0, 0, 1, 9_000)) + 18_000) % TURN - 18_000
    yaw = nan if heading == ALONG else radians(turned / 100)
    message = random.choice(
        (
            long(176, 1, random.randrange(12), random.randrange(8)),
            long(176, 1, random.choice((4, 6, 9, 17)), odd),
            long(400, 1),
            long(400, random.choice((0, 1)), random.choice((0, 21196))),
            long(22, random.choice((0, nan)), 0, 0, nan, nan, nan, sea),
            long(22, 0, 0, 0, 0, 0, odd, height),
            long(178, 1, speed, -1),
            long(random.choice((401, 511, 512, 246, 185)), random.choice((0, odd))),
            long(
                random.choice((512, 512, 511)), random.choice((262, 263, 263, 264, 262.5)), random.choice((0, 3, odd)),
                random.choice((0, 0, odd)), component=random.choice((99, 100, 103, 105, 106, 0)),
            ),
            m.MAVLink_command_int_message(
                SYSTEM, 1, random.choice((0, 0, 0, 3)), 192, 0, 0, random.choice((speed, -1.0)), 1,
                random.choice((0, odd)), random.choice((yaw, yaw, yaw, nan, 0)), x, y, random.choice((sea, sea, nan)),
            ),
            m.MAVLink_set_position_target_global_int_message(
                0, SYSTEM, 1, 6, random.choice((0x0DF8, 0x0DF8, 0x09F8, 0x09F8, 0x0DF0)), x, y, height, 1, 0, 0, 0, 0,
                0, random.choice((0, yaw, yaw)), 0,
            ),
            m.MAVLink_heartbeat_message(random.choice((18, 6)), 8, random.choice((0, 128)), 0, 4, 3),
            m.MAVLink_param_set_message(
                SYSTEM, 1, random.choice((b"FENCE_ENABLE", b"FENCE_TYPE", b"RTL_ALT")),
                random.choice((1, 7, 15, 4, odd)), random.choice((2, 6, 9)),
            ),
            m.MAVLink_param_request_list_message(SYSTEM, random.choice((1, 0))),
            m.MAVLink_mission_count_message(SYSTEM, 1, 4, random.choice((0, 1))),
            m.MAVLink_mission_clear_all_message(SYSTEM, 1, random.choice((0, 1, 255))),
            m.MAVLink_mission_item_int_message(
                SYSTEM, 1, 0, 0, random.randrange(4_999, 5_006), random.choice((0, 2)), 1, 4, 0, 0, 0, 1, 1, 0,
                random.choice((0, 1)),
            ),
            m.MAVLink_statustext_message(6, b"text"), m.MAVLink_timesync_message(0, 5),
            m.MAVLink_log_request_list_message(SYSTEM, random.choice((1, 0)), 0, 0xFFFF),
            m.MAVLink_log_request_data_message(SYSTEM, 1, 1, 0, 90),
            m.MAVLink_manual_control_message(SYSTEM, 0, 0, 500, 0, 0),
        )
    )  # fmt: skip
    frame = pack(message, random.choice((OURS,) * 9 + (1,)), random.choice((SYSTEM,) * 19 + (255,)))
    if random.random() < 0.15:
        at = random.randrange(len(frame))
        frame = frame[:at] + bytes([random.randrange(256)]) + frame[at + 1 :]
    return frame if random.random() < 0.98 else frame[: random.randrange(len(frame))]


def drawn_report(random: Random, of: Command, autopilot: int) -> bytes:
    """A random report of the vehicle about itself."""
    x, y = random.choice([*zip(of.geo[::2], of.geo[1::2], strict=True), (0, 0)])
    off = random.choice((0, 200, 440, 460, 700))
    near = [height + random.choice((0, 3_000, 3_001)) for height in of.heights]
    above = random.choice((random.randrange(50_000), *near))
    home = HOME_AMSL + random.choice((0, 500, 9_999, 10_001))
    message = random.choice(
        (
            m.MAVLink_heartbeat_message(
                random.choice((2, 2, 2, 13, 6, 26, 255)),
                random.choice((autopilot, autopilot, 3, 8)),
                random.choice((0, 128)),
                0,
                4,
                3,
            ),
            m.MAVLink_global_position_int_message(0, x + off, y - off, home + above, above, 0, 0, 0, 0),
            m.MAVLink_global_position_int_message(0, x, y + off, home + above, above, 0, 0, 0, 0),
            m.MAVLink_extended_sys_state_message(0, random.randrange(5)),
            m.MAVLink_param_value_message(
                b"FENCE_TYPE", random.choice((3, 7.5, nan, 1e-44, -3.5, 3e10)), random.choice((2, 4, 6, 9)), 1, 0
            ),
        )
    )
    return pack(message, random.choice((1, 1, 1, 1, 2)), random.choice((SYSTEM,) * 9 + (4,)))


def compare_gates(boundary: ctypes.CDLL, seed: int) -> int:
    """One session of each; returns how many frames both passed."""
    random = Random(seed)
    here, there = FrameSession(), InC(boundary)
    autopilot, home, now_us, left = random.choice(AUTOPILOTS), random.choice(HOMES), 1_000_000, 0
    command = opened = drawn_command(random, home)
    here.open(replace(command, not_after_us=now_us))
    there.open(command, home, now_us)
    here.close()
    there.close()
    first = m.MAVLink_heartbeat_message(random.choice((2, 2, 2, 6, 47, 48, 63, 64)), autopilot, 0, 0, 0, 3)
    for report in (first, None)[: random.randrange(3)]:
        frame = pack(report, 1) if report is not None else drawn_report(random, command, autopilot)
        here.observe(frame, now_us)
        there.observe(frame, now_us)
    for _ in range(60):
        now_us += random.choice((0, 1_000, 400_000, 4_000_000))
        chance = random.random()
        if chance < 0.08:
            command = opened = drawn_command(random, home)
            here.open(replace(command, not_after_us=now_us + 500_000))
            there.open(command, home, now_us + 500_000)
        elif chance < 0.1:
            here.close()
            there.close()
        elif chance < 0.35:
            report_ = drawn_report(random, command, autopilot)
            here.observe(report_, now_us)
            there.observe(report_, now_us)
        else:
            frame = drawn_frame(random, command)
            one, other = here.seal(frame, now_us), there.seal(frame, now_us)
            assert other == (one.slug if isinstance(one, Refusal) else one), (seed, frame.hex())
            left += not isinstance(one, Refusal)
            ahead = here.sign_ahead(frame, opened, now_us)
            assert there.sign_ahead(frame, now_us) == (ahead.slug if isinstance(ahead, Refusal) else None), frame.hex()
    return left


def target_frame(autopilot: int, place: tuple[int, int], height: float, heading: float | None) -> bytes:
    """A target at a place, mm above home, with a heading in 1/100 degree or along the leg."""
    yaw = nan if heading is None else radians((heading + 18_000) % TURN / 100 - 180)
    if autopilot == AUTOPILOTS[1]:
        sea = (HOME_AMSL + height) / 1_000
        return pack(m.MAVLink_command_int_message(SYSTEM, 1, 0, 192, 0, 0, -1.0, 1, 0, yaw, *place, sea))
    mask, yaw = (0x0DF8, 0.0) if heading is None else (0x09F8, yaw)
    return pack(
        m.MAVLink_set_position_target_global_int_message(
            0, SYSTEM, 1, 6, mask, *place, height / 1_000, 0, 0, 0, 0, 0, 0, yaw, 0
        )
    )


def compare_levels(boundary: ctypes.CDLL, seed: int) -> int:
    """Walk along a path with heights and headings, with many wrong frames; returns how many frames both passed."""
    random = Random(seed)
    here, there, home = FrameSession(), InC(boundary), random.choice(HOMES)
    autopilot, now_us, left = random.choice(AUTOPILOTS), 1_000_000, 0
    count = random.randrange(1, 6)
    path = tuple(random.choice((0, 4_000, 60_000)) for _ in range(2 * count))
    geo = tuple(part for x, y in zip(path[::2], path[1::2], strict=True) for part in unproject(home, x, y))
    heights = tuple(random.choice((5_000, 7_500, 8_000, 20_000)) for _ in range(count))
    headings = tuple(random.choice((ALONG, *HEADINGS)) for _ in range(count)) if random.random() < 0.7 else ()
    command = Command(7, "skill", MotionKind.COVER, path, geo, 20_000, 0, heights=heights, headings=headings)
    here.open(replace(command, not_after_us=now_us))
    there.open(command, home, now_us)
    reports = [m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3)]
    for number in range(count):
        x, y = geo[2 * number : 2 * number + 2]
        for height in (heights[number] + random.choice((0, 2_999, 3_001, -9_000)), heights[number]):
            reports.append(m.MAVLink_global_position_int_message(0, x, y, HOME_AMSL + height, height, 0, 0, 0, 0))
            for report in reports:
                here.observe(pack(report, 1), now_us)
                there.observe(pack(report, 1), now_us)
            for _ in range(8):
                of = min(max(number + random.choice((-1, 0, 0, 1, 1)), 0), count - 1)
                wanted = None if command.heading_at(of) == ALONG else command.heading_at(of) + random.choice((0, 0, 1))
                level = heights[random.choice((of, of, of, number))] + random.choice((0, 0, 2, 3))
                frame = target_frame(autopilot, geo[2 * of : 2 * of + 2], level, wanted)
                one, other = here.seal(frame, now_us), there.seal(frame, now_us)
                assert other == (one.slug if isinstance(one, Refusal) else one), (seed, frame.hex())
                left += not isinstance(one, Refusal)
            reports.clear()
    return left


def test_paths_with_heights_and_headings_pass_alike(boundary: ctypes.CDLL) -> None:
    assert sum(compare_levels(boundary, seed) for seed in range(SAMPLE)) > 2 * SAMPLE


def compare_links(boundary: ctypes.CDLL, seed: int) -> int:
    """One signed link of each; returns how many frames both accepted."""
    random = Random(seed)
    key, other_key = random.randbytes(32), random.randbytes(32)
    utc_us, now_us = EPOCH_US + random.randrange(10**15), random.randrange(10**9)
    local = (utc_us - EPOCH_US) // 10
    streams = {
        (random.randrange(1, 4), random.randrange(1, 3), random.randrange(2)): local
        - random.choice((5, MINUTE + 5, -9))
        for _ in range(random.randrange(4))
    }
    stored = SigningState(local + random.choice((-5, 0, 900)), streams)
    here = SignedLink(key, stored, utc_us, now_us)
    words = [part for stream, last in streams.items() for part in (*stream, last)]
    boundary.rt_test_link_begin(
        key, ctypes.c_int64(stored.timestamp), (ctypes.c_int64 * max(1, len(words)))(*words), len(streams),
        ctypes.c_int64(utc_us), ctypes.c_int64(now_us), 0,
    )  # fmt: skip
    boundary.rt_test_link_signed_up_to.restype = ctypes.c_int64
    names = ("accepted", "unsigned", "forged", "strayed", "stale", "crowded")
    seen, believed = [], 0
    for _ in range(80):
        now_us += random.choice((0, 10, 100_000, 70_000_000))
        frame = pack(long(512, 148), random.randrange(1, 40), random.choice((SYSTEM, 1, 2)))
        if random.random() < 0.3:
            ahead = random.random() < 0.4
            signed = (here.sign_ahead if ahead else here.sign)(frame, now_us)
            buffer = ctypes.create_string_buffer(frame, 300)
            sign = boundary.rt_test_link_sign_ahead if ahead else boundary.rt_test_link_sign
            size = sign(buffer, len(frame), ctypes.c_int64(now_us))
            assert signed is not None
            assert buffer.raw[:size] == signed
            assert unsigned(signed) == frame
            seen.append(signed)
        else:
            ahead = (utc_us + now_us - EPOCH_US) // 10 + random.choice((0, -MINUTE - 9, 7, 200_000))
            of = random.choice((key, key, key, other_key))
            signed = SignedLink(of, SigningState(ahead, {}), EPOCH_US, 0, link=random.randrange(2)).sign(frame, 0)
            signed = random.choice((signed, signed, signed, frame, *seen[-3:]))
            seen.append(signed)
            if random.random() < 0.1:
                at = random.randrange(len(signed))
                signed = signed[:at] + bytes([random.randrange(256)]) + signed[at + 1 :]
            if signed[0] != 0xFD or len(signed) < 12 or len(signed) != 12 + signed[1] + 13 * (signed[2] & 1):
                continue  # the codec gives whole frames alone
            before = {name: getattr(here.counts, name) for name in names}
            accepted = here.accept(signed, now_us)
            why = next(at for at, name in enumerate(names) if getattr(here.counts, name) != before[name])
            assert boundary.rt_test_link_accept(signed, len(signed), ctypes.c_int64(now_us)) == why, seed
            believed += accepted
        assert boundary.rt_test_link_signed_up_to() == here.state.timestamp
    return believed


@pytest.mark.slow
def test_both_refuse_a_flood_of_frames_to_sign_ahead_at_the_same_frame(boundary: ctypes.CDLL) -> None:
    here = SignedLink(bytes(32), SigningState(0, {}), EPOCH_US, 0)
    boundary.rt_test_link_begin(
        bytes(32), ctypes.c_int64(0), (ctypes.c_int64 * 1)(), 0, ctypes.c_int64(EPOCH_US), ctypes.c_int64(0), 0
    )
    frame = pack(long(512, 148))
    answers = []
    for now_us in [0] * (MOST_AHEAD + 2) + [500] * 60:
        signed = here.sign_ahead(frame, now_us)
        buffer = ctypes.create_string_buffer(frame, 300)
        size = boundary.rt_test_link_sign_ahead(buffer, len(frame), ctypes.c_int64(now_us))
        assert (buffer.raw[:size] or None) == signed
        answers.append(signed is None)
    assert answers == [False] * MOST_AHEAD + [True] * 2 + [False] * 50 + [True] * 10


@pytest.mark.claim("A1", drawn="from seeds")
@pytest.mark.parametrize("compare", [compare_gates, compare_links])
def test_both_gates_let_out_and_believe_the_same(compare: Any, boundary: ctypes.CDLL) -> None:
    passed = [compare(boundary, seed) for seed in range(SAMPLE)]
    assert sum(map(bool, passed)) > SAMPLE / 2, "else it compares little"


@pytest.fixture(params=range(0, SOAK, 1_000))
def seeds(request: pytest.FixtureRequest) -> range:
    return range(request.param, request.param + 1_000)


@pytest.mark.claim("A1", drawn="from seeds")
@pytest.mark.soak
@pytest.mark.parametrize("compare", [compare_gates, compare_links])
def test_both_gates_agree_for_long(compare: Any, seeds: range, boundary: ctypes.CDLL) -> None:
    for seed in seeds:
        compare(boundary, seed)
