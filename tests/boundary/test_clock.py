"""The boundary's own clock, in Python and in C: both accept the same sources, challenges and frames."""

import ctypes
from collections import Counter
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary import both_boundaries
from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from reference.documents import approval
from reference.own_clock import ARDUPILOT_US, CHALLENGE_US, VEHICLE_US, OwnClock
from reference.world import ROOT, SESSION_KEY, START, VEHICLE, request_for, sealed
from rtshcua.codec.frames import Codec
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire.clock import APART_US, ClockSource, bears_out
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.receipt import decode as read_receipt

S = 1_000_000
#: where a response has its status: behind its name, its version, and the head of its body
_STATUS_AT = len(b"\x83\x70rtshcua/response\x02\x58\x35")
CODECS = [Codec(1, 1), Codec(2, 1), Codec(1, 154)]


def words(now: Now) -> Any:
    return (ctypes.c_int64 * 3)(now.monotonic_us, now.utc_us, now.utc_error_us)


def some_now(random: Random, about_us: int) -> Now:
    error_us = random.choice((0, 1, 1_000, S, UTC_UNKNOWN_US - 1, UTC_UNKNOWN_US, UTC_UNKNOWN_US + 1, MAX_VALUE))
    return Now(random.randrange(100 * S), random.choice((0, about_us, UTC_UNKNOWN_US, UTC_UNKNOWN_US + 1)), error_us)


def some_frame(random: Random, number: int) -> bytes:
    utc_us = random.choice((0, 10**15 - 1, 10**15, *[START.utc_us] * 4, MAX_VALUE, MAX_VALUE + 1, (1 << 64) - 1))
    clock_ns = random.choice((0, -1, 1, *[5 * S * 1_000] * 3))
    wanted = random.choice((number, number, number + 1, 0, -1))
    frame = random.choice(CODECS[:1] * 4 + CODECS).pack(
        random.choice(
            (
                m.MAVLink_timesync_message(clock_ns, wanted),
                m.MAVLink_system_time_message(utc_us, random.choice((0, 5))),
            )
        )
    )
    if random.random() < 0.2 and frame[7] == m.MAVLINK_MSG_ID_TIMESYNC:  # as present autopilots send it
        frame = frame[:1] + b"\x12" + frame[2:10] + frame[10:-2].ljust(16, b"\0") + b"\x01\xbf" + frame[-2:]
    if random.random() < 0.1:
        at = random.randrange(len(frame))
        frame = frame[:at] + random.randbytes(random.choice((0, 1))) + frame[at + 1 :]
    return frame


def test_both_check_the_same_time_of_day(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_clock_asks.restype = boundary.rt_test_bears_out.restype = ctypes.c_bool
    random, taken = Random(31), Counter[ClockSource]()
    told = (ctypes.c_int64 * 5)()
    for _ in range(1_200):
        now_us, stated = random.randrange(100 * S), random.choice((-1, 0, 1_000))
        machine = Now(now_us, START.utc_us + random.randrange(S), random.choice((UTC_UNKNOWN_US,) * 5 + (0, 900)))
        here = OwnClock(machine, None if stated < 0 else stated)
        boundary.rt_test_clock_begin(words(machine), ctypes.c_int64(stated))
        for _ in range(18):
            now_us += random.choice(
                (0, 1, 1_000, S, *[CHALLENGE_US, CHALLENGE_US + 1, 1_000 * S] * (random.random() < 0.1))
            )
            at = ctypes.c_int64(now_us)
            assert here.asks(now_us) == boundary.rt_test_clock_asks(at)
            match random.randrange(12):
                case 0:
                    number = random.randrange(1, 1 << 56)
                    here.challenge(number, now_us)
                    boundary.rt_test_clock_challenge(ctypes.c_int64(number), at)
                case 2:
                    looked = Now(now_us, START.utc_us, random.choice((UTC_UNKNOWN_US,) * 20 + (5,)))
                    here.look(looked)
                    boundary.rt_test_clock_look(words(looked))
                case 3 if random.random() < 0.1:
                    here.settle(now_us)
                    boundary.rt_test_clock_settle(at)
                case _:
                    frame, link = some_frame(random, here.number), random.choice((0, 0, 0, 1))
                    vehicle_us = random.choice((ARDUPILOT_US, VEHICLE_US))
                    here.hear(frame, link, vehicle_us, now_us)
                    boundary.rt_test_clock_hear(frame, len(frame), link, ctypes.c_int64(vehicle_us), at)
            boundary.rt_test_clock_now(at, told)
            assert (here.source, *vars_of(here.now(now_us)), here.number) == tuple(told)
        taken[here.source] += 1
    assert min(taken[source] for source in list(ClockSource)[:4]) > 20, taken


def vars_of(now: Now) -> tuple[int, int, int]:
    return now.monotonic_us, now.utc_us, now.utc_error_us


def test_both_accept_the_same_claimed_times(boundary: ctypes.CDLL) -> None:
    boundary.rt_test_bears_out.restype = ctypes.c_bool
    random, found = Random(32), Counter[bool]()
    for _ in range(3_000):
        own = some_now(random, START.utc_us)
        off_us = random.choice((0, 1, APART_US, APART_US + 1, APART_US + 1_000, 5 * S, MAX_VALUE // 3))
        named = some_now(random, max(0, own.utc_us + random.choice((-1, 1)) * off_us))
        answer = bears_out(own, named)
        assert answer == boundary.rt_test_bears_out(words(own), words(named)), (own, named)
        found[answer] += 1
    assert min(found[True], found[False]) > 300


@pytest.mark.parametrize("stated", [-1, 1_000])
def test_both_use_only_their_own_clock(boundary: ctypes.CDLL, stated: int) -> None:
    """The same clock for both, with claimed times that differ in every direction."""
    random = Random(33)
    moment, unknown = START.monotonic_us, replace(START, utc_error_us=UTC_UNKNOWN_US)
    own = OwnClock(unknown, None if stated < 0 else stated)
    caller = both_boundaries.begin(
        boundary, SIGNED_ROOT, PIN, VEHICLE, SESSION_KEY, unknown, stated_us=stated, own_us=lambda: moment
    )
    caller.time(settle=True)
    own.settle(moment)
    there = load(sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.PROCESS, session_key=SESSION_KEY,
                 flight=bytes(16), peer_is_own_simulator=False, caller=caller)  # fmt: skip
    assert isinstance(there, Loaded)
    here = load(sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
                flight=there.in_force.flight, peer_is_own_simulator=False)  # fmt: skip
    assert isinstance(here, Loaded)
    assert isinstance(here.boundary, SoftwareBoundary)
    statuses = Counter[int]()
    for number in range(300):
        moment += random.choice((0, 1_000, 50_000))
        off_us = random.choice((0, 0, 0, 1, APART_US, APART_US + 2_000, 5 * 3_600 * S)) * random.choice((1, -1))
        error_us = random.choice((1_000, 2_000, 6 * 3_600 * S, UTC_UNKNOWN_US))
        named = Now(moment, START.utc_us + moment - START.monotonic_us + off_us, error_us)
        if number % 5:
            asked = request_for(there, now=named)
            one, other = here.boundary.enforce(asked, own.now(moment)), there.boundary.enforce(asked)
            assert one == other, named
            statuses[one[_STATUS_AT]] += 1
        else:
            document = approval(there)
            one = here.boundary.present(document, named, 0, own.now(moment))
            told, found = read_receipt(one), read_receipt(there.boundary.present(document, named, 0))
            assert isinstance(told, Receipt)
            assert isinstance(found, Receipt)
            assert replace(told, text=found.text) == found
    assert len(statuses) > 1, statuses
