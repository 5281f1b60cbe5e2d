"""Values of parameters, on the wire and as text."""

import struct
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.mavlink.parameters import bits_of, decode, encode, fits, is_bytewise, shown, value_of
from virtual.rows import rows


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_32_bits_and_their_text_are_the_same_number(value: float) -> None:
    bits = bits_of(value)
    assert bits is not None
    assert value_of(bits) == value
    assert bits_of(float(shown(bits))) == bits


@rows(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (300.0, "300"),
        (-0.0, "0"),
        (16_777_217.0, "16777216"),
        (1 / 3, "0.33333334"),
        (9.99999974e-6, "1e-05"),
    ],
)
def test_a_value_is_shown_in_as_few_digits_as_tell_it(value: float, text: str) -> None:
    bits = bits_of(value)
    assert bits is not None
    assert shown(bits) == text


@pytest.mark.parametrize("value", [nan, inf, -inf, 1e39])
def test_value_outside_float_range_has_no_bits(value: float) -> None:
    assert bits_of(value) is None


@rows(("kind", "value"), [(1, 200), (2, -5), (3, 60_000), (4, -30_000), (5, 2**32 - 1), (6, -(2**31)), (9, 7)])
def test_integers_are_octets_for_px4_and_numbers_for_ardupilot(kind: int, value: int) -> None:
    raw = encode(value, kind, bytewise=True)
    assert raw is not None
    assert decode(raw, kind, bytewise=True) == value
    if kind != 9:
        assert int.from_bytes(struct.pack("<f", raw), "little") & 0xFF == value & 0xFF
    assert encode(value, kind, bytewise=False) == decode(value, kind, bytewise=False) == value


@rows(("kind", "value", "good"), [
    (1, 255, True), (1, 256, False), (1, -1, False), (2, -128, True), (2, 128, False), (4, 30_000, True),
    (4, 1e9, False), (0, 80.5, True), (6, 80.5, False), (6, -(2.0**31), True), (6, 2.0**31, False), (6, inf, False),
    (9, 80.5, True),
])  # fmt: skip
def test_value_that_does_not_fit_integer_is_not_encoded(kind: int, value: float, good: bool) -> None:
    assert fits(value, kind) == good
    assert (encode(value, kind, bytewise=True) is not None) == good
    assert encode(value, kind, bytewise=False) == value


def test_encoding_by_autopilot() -> None:
    assert is_bytewise(PX4)
    assert not is_bytewise(ARDUPILOT)
