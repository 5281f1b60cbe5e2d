import struct

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import MAX_MONITORS, MAX_SLOTS, MAX_VALUE
from rtshcua.model.flat.situation import Now, State
from rtshcua.wire import artefact, cbor, names, request
from rtshcua.wire.request import MAX_AGE_US, MAX_SIZE, STEP, Request
from virtual.rows import rows

TIME = st.integers(0, MAX_VALUE)


def plain(slots: int = 3, monitors: int = 2) -> Request:
    state = State(tuple([None, 7, -7] * slots)[:slots], tuple(range(slots)), ((1, 2, 4) * monitors)[:monitors])
    return Request(STEP, 2, -1, bytes(range(32)), Now(10, 20, 30), state, 5, 1, 400)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    slots = draw(st.integers(0, MAX_SLOTS))
    values = draw(st.lists(st.none() | st.integers(-MAX_VALUE, MAX_VALUE), min_size=slots, max_size=slots))
    ages = draw(st.lists(st.integers(0, MAX_AGE_US), min_size=slots, max_size=slots))
    said = draw(st.lists(st.sampled_from([1, 2, 4]), max_size=MAX_MONITORS))
    return Request(
        draw(st.integers(0, 2)),
        draw(st.integers(-1, 1 << 14)),
        draw(st.integers(-1, 8)),
        draw(st.binary(min_size=32, max_size=32)),
        Now(draw(TIME), draw(TIME), draw(TIME)),
        State(tuple(values), tuple(ages), tuple(said)),
        draw(TIME),
        draw(st.integers(0, 63)),
        draw(TIME),
    )


@given(requests())
def test_request_roundtrip_fits_limit(asked: Request) -> None:
    data = request.encode(asked)
    assert len(data) <= MAX_SIZE
    assert request.decode(data, len(asked.state.values), len(asked.state.monitors)) == asked


def test_the_largest_request_fits() -> None:
    state = State((MAX_VALUE,) * MAX_SLOTS, (MAX_AGE_US,) * MAX_SLOTS, (4,) * MAX_MONITORS)
    now = Now(MAX_VALUE, MAX_VALUE, MAX_VALUE)
    largest = Request(2, (1 << 15) - 1, (1 << 15) - 1, bytes(32), now, state, MAX_VALUE, (1 << 15) - 1, MAX_VALUE)
    assert largest.ref == (2, (1 << 15) - 1, (1 << 15) - 1)
    assert len(request.encode(largest)) == 21 + 79 + 12 * MAX_SLOTS + MAX_MONITORS <= MAX_SIZE


@given(requests(), st.data())
def test_a_changed_byte_is_refused_or_is_another_request(asked: Request, data: st.DataObject) -> None:
    good = request.encode(asked)
    at = data.draw(st.integers(0, len(good) - 1))
    bad = bytearray(good)
    bad[at] ^= data.draw(st.integers(1, 255))
    read = request.decode(bytes(bad), len(asked.state.values), len(asked.state.monitors))
    if isinstance(read, Request):
        assert request.encode(read) == bytes(bad), "one request, one encoding"


@given(st.binary(max_size=1500))
def test_any_bytes_are_an_answer_and_never_an_exception(data: bytes) -> None:
    assert isinstance(request.decode(data, 4, 2), Refusal)


GOOD = request.encode(plain())
HEAD = GOOD[: -(79 + 12 * 3 + 2)]  # the fields before `kind`


def changed(at: int, octets: bytes) -> bytes:
    """The good request with other octets at an offset of its body."""
    start = len(HEAD) + at
    return GOOD[:start] + octets + GOOD[start + len(octets) :]


BIG = (MAX_VALUE + 1).to_bytes(8)


@rows(
    ("data", "text"),
    [
        (b"", "not a request of version 2 for a state of 3 slots and 2 monitors"),
        (bytes(MAX_SIZE + 1), "not a request"),
        (GOOD + b"\0", "not a request"),
        (GOOD[:-1], "not a request"),
        (cbor.encode(("rtshcua/request", 1, bytes(117))), "not a request"),
        (cbor.encode(("rtshcua/permit!", 2, bytes(117))), "not a request"),
        (artefact.wrap(names.REQUEST, 7), "not a request"),
        (changed(0, b"\3"), "the kind, step or link is out of range"),
        (changed(1, b"\xff\xfe"), "the kind, step or link is out of range"),
        (changed(3, b"\x80\0"), "the kind, step or link is out of range"),
        (changed(37, BIG), "a time is out of range"),
        (changed(45, BIG), "a time is out of range"),
        (changed(53, BIG), "a time is out of range"),
        (changed(61, BIG), "a time is out of range"),
        (changed(69, BIG), "a time is out of range"),
        (changed(79, BIG), "a state value is out of range"),
        (changed(95, (-MAX_VALUE - 1).to_bytes(8, signed=True)), "a state value is out of range"),
        (changed(115, b"\0"), "the value of a monitor is not a truth"),
        (changed(115, b"\3"), "the value of a monitor is not a truth"),
        (changed(116, b"\x80"), "the value of a monitor is not a truth"),
    ],
)
def test_each_rule_is_named(data: bytes, text: str) -> None:
    read = request.decode(data, 3, 2)
    assert isinstance(read, Refusal)
    assert text in read.text


def test_the_body_is_one_artefact() -> None:
    body = artefact.unwrap(names.REQUEST, GOOD)
    assert isinstance(body, bytes)
    assert HEAD + body == GOOD


def test_a_state_of_another_policy_is_refused() -> None:
    data = request.encode(plain(3))
    assert isinstance(request.decode(data, 3, 2), Request)
    assert isinstance(request.decode(data, 4, 2), Refusal)
    assert isinstance(request.decode(data, 3, 3), Refusal)


def test_monitor_state_fits_request() -> None:
    too_old = msgspec.structs.replace(plain(1), state=State((1,), (MAX_AGE_US + 1,)))
    with pytest.raises(struct.error):
        request.encode(too_old)
