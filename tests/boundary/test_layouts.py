"""Requests, answers, permits, preparations and receipts: both implementations read and write the same octets."""

import ctypes
from random import Random
from typing import Any

import pytest

from boundary.layout import structs
from boundary.mutants import damaged
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.limits import MAX_MONITORS, MAX_SLOTS, MAX_VALUE
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import WIRE_REASONS, Outcome
from rtshcua.wire import permit, preparation, receipt, request, response
from rtshcua.wire.permit import Permit
from rtshcua.wire.preparation import ParameterWrite, Preparation
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.request import Request
from rtshcua.wire.response import NO_TARGET, Status

KEY = bytes(range(32))
STRUCTS = structs()
TIMES = (0, 1, 500, MAX_VALUE - 1, MAX_VALUE)
NUMBERS = (0, 1, -1, 1 << 32, -(1 << 40), MAX_VALUE, -MAX_VALUE)


class CRequest(ctypes.Structure):
    """`rt_request` of wire/request.h."""

    _fields_ = [
        ("kind", ctypes.c_int64), ("step", ctypes.c_int64), ("link", ctypes.c_int64), ("binding", ctypes.c_uint8 * 32),
        ("now", STRUCTS["rt_now"]), ("released_us", ctypes.c_int64), ("remaining_us", ctypes.c_int64),
        ("phase", ctypes.c_int64), ("state", STRUCTS["rt_state"]),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def c(boundary: ctypes.CDLL) -> ctypes.CDLL:
    boundary.rt_test_request.restype = ctypes.c_bool
    return boundary


def some_request(random: Random, slots: int, monitors: int) -> bytes:
    now = Now(random.choice(TIMES), random.choice(TIMES), random.choice(TIMES))
    values = tuple(random.choice((None, *NUMBERS)) for _ in range(slots))
    ages = tuple(random.choice((0, 1, (1 << 32) - 1)) for _ in range(slots))
    state = State(values, ages, tuple(random.choice((1, 2, 4)) for _ in range(monitors)))
    times = random.choice(TIMES), random.randrange(1 << 16), random.choice(TIMES)
    kind, step, link = random.choice((0, 1, 2)), random.choice((-1, 0, 32767)), random.choice((-1, 0, 7))
    return request.encode(Request(kind, step, link, random.randbytes(32), now, state, *times))


def test_requests_are_read_alike(c: ctypes.CDLL) -> None:
    random, accepted = Random(11), 0
    for number in range(1_500):
        slots, monitors = random.choice(((0, 0), (3, 0), (9, 2), (14, 7), (MAX_SLOTS, MAX_MONITORS)))
        data = some_request(random, slots, monitors)
        if number % 3 == 1:
            data = damaged(data, random)
        elif number % 3 == 2:  # of the right size, with anything in it
            at = random.randrange(19, len(data))
            data = (
                data[:at]
                + random.choice((b"\xff", b"\x80", b"\x03", b"\0", b"\x20\0\0\0\0\0\0\0", b"\x80\0\0\0\0\0\0\0"))[
                    : len(data) - at
                ]
                + data[at + 1 :]
            )
            data = data[: len(some_request(random, slots, monitors))]
        here, there = request.decode(data, slots, monitors), CRequest()
        assert c.rt_test_request(data, len(data), ctypes.c_int64(slots), monitors, ctypes.byref(there)) is isinstance(
            here, Request
        ), data.hex()
        if isinstance(here, Refusal):
            continue
        accepted += 1
        assert (there.kind, there.step, there.link, bytes(there.binding)) == (
            here.kind,
            here.step,
            here.link,
            here.binding,
        )
        assert (there.now.monotonic_us, there.now.utc_us, there.now.utc_error_us) == (
            here.now.monotonic_us,
            here.now.utc_us,
            here.now.utc_error_us,
        )
        assert (there.released_us, there.remaining_us, there.phase) == (here.released_us, here.remaining_us, here.phase)
        read = there.state
        assert tuple(read.values[i] if read.known[i] else None for i in range(slots)) == here.state.values
        assert (tuple(read.ages[:slots]), tuple(read.monitors[:monitors])) == (here.state.ages, here.state.monitors)
    assert 600 < accepted < 1_400


def test_answers_are_written_alike(c: ctypes.CDLL) -> None:
    random = Random(12)
    for number, reason in enumerate(WIRE_REASONS):
        for outcome in Outcome:
            clause, target = random.choice((-1, 0, 16_384)), random.choice((NO_TARGET, -16_384, -1, 0, 7))
            sealed = random.choice((b"", random.randbytes(permit.SIZE)))
            until, consumed, step = random.choice(NUMBERS), random.randrange(2), random.randrange(9)
            decision = STRUCTS["rt_decision"](outcome, number, step, clause, target, until)
            out = ctypes.create_string_buffer(192)
            size = c.rt_test_answer(ctypes.byref(decision), ctypes.c_int64(consumed), sealed or None, out)
            made = Decision(outcome, reason, step, None, None, None, until, consumed, sealed)
            assert out.raw[:size] == response.encode(made, clause, target, bytes(32))
    for status in list(Status)[1:]:
        out = ctypes.create_string_buffer(192)
        size = c.rt_test_refusal(int(status), out)
        assert out.raw[:size] == response.encode_refusal(status)


def test_permits_are_opened_and_sealed_alike(c: ctypes.CDLL) -> None:
    random, out = Random(13), ctypes.create_string_buffer(1024)
    for _ in range(200):
        number = random.choice((-(1 << 63), (1 << 63) - 1, *NUMBERS))
        made = Permit(random.choice((0, 1, 2)), random.choice((-1, 0, 32767)), random.choice((-32768, -1, 7)),
                      random.randrange(1 << 64), random.randrange(256), random.randrange(256), number)  # fmt: skip
        sealed = permit.seal(made, KEY)
        size = c.rt_test_permit(sealed, len(sealed), KEY, out)
        assert out.raw[:size] == sealed
        forged = damaged(sealed, random)
        assert (c.rt_test_permit(forged, len(forged), KEY, out) > 0) is (permit.open_permit(forged, KEY) is not None)


def test_preparations_are_opened_and_sealed_alike(c: ctypes.CDLL) -> None:
    random, out = Random(14), ctypes.create_string_buffer(2048)
    for _ in range(200):
        writes = tuple(
            ParameterWrite(
                random.choice(("", "A", "FENCE_ENABLE", "SIXTEEN_OCTETS_X")),
                random.randrange(1 << 32),
                random.randrange(1 << 32),
            )
            for _ in range(random.choice((0, 1, 3, preparation.MOST)))
        )
        made = Preparation(random.randrange(1 << 64), random.random() < 0.5, random.choice(NUMBERS), writes)
        sealed = preparation.seal(made, KEY)
        size = c.rt_test_preparation(sealed, len(sealed), KEY, out)
        assert out.raw[:size] == sealed
        body = bytearray(damaged(sealed[:-32], random))
        for at in range(19, min(len(body), 35)):
            body[at] = random.choice((body[at], body[at], 0, 0x80, 0x41))
        resealed = bytes(body) + preparation.digest(KEY, b"rtshcua/preparation\0" + bytes(body), "sha256")
        found, size = (
            preparation.open_preparation(resealed, KEY),
            c.rt_test_preparation(resealed, len(resealed), KEY, out),
        )
        assert out.raw[:size] == (b"" if found is None else preparation.seal(found, KEY))
        assert c.rt_test_preparation(resealed[:-1], len(resealed) - 1, KEY, out) == 0


def test_receipts_are_written_alike(c: ctypes.CDLL) -> None:
    random = Random(15)
    for _ in range(100):
        numbers: Any = [random.choice(NUMBERS) for _ in range(5)]
        slug, text = random.choice(("accepted", "", "malformed")), random.choice(("", "h\u00fcpf", "x" * 300))
        out = ctypes.create_string_buffer(1024)
        size = c.rt_test_receipt(
            (ctypes.c_int64 * 5)(*numbers), slug.encode(), len(slug.encode()), text.encode(), len(text.encode()), out
        )
        assert out.raw[:size] == receipt.encode(Receipt(numbers[0], slug, text, *numbers[1:]))
