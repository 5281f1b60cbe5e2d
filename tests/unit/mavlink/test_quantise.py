"""Telemetry to integers: the unit table by hand, and rounding against exact fractions."""

import math
from decimal import ROUND_HALF_UP, Decimal, localcontext
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.mavlink import dialect
from rtshcua.mavlink.quantise import UNITS, hypot_mm, quantise
from rtshcua.model.quantity import Dimension
from virtual.rows import rows


@rows(
    ("raw", "unit", "dimension", "expected"),
    [
        (1234, "mm", "length", 1234),
        (57, "cm", "length", 570),
        (1.5, "m", "length", 1500),
        (-3, "dm", "length", -300),
        (250, "cm/s", "speed", 2500),
        (7.25, "m/s", "speed", 7250),
        (473977400, "degE7", "angle", 473977400),
        (9000, "cdeg", "angle", 900_000_000),
        (math.pi, "rad", "angle", 1_800_000_000),
        (-math.pi / 2, "rad", "angle", -900_000_000),
        (93, "%", "ratio", 9300),
        (1000, "d%", "ratio", 10_000),
        (12, "ms", "duration", 12_000),
        (1499, "ns", "duration", 1),
        (1500, "ns", "duration", 2),
        (10, "", "count", 10),
        (41, "m/s*5", "speed", 8200),
    ],
)
def test_units(raw: int | float, unit: str, dimension: str, expected: int) -> None:
    assert quantise(raw, *UNITS[Dimension(dimension)][unit]) == expected


def test_every_unit_is_spelled_as_in_the_dialect() -> None:
    spelled = {field.unit for message in dialect.load().messages.values() for field in message.fields.values()}
    assert {unit for units in UNITS.values() for unit in units} <= spelled


@pytest.mark.parametrize("raw", [math.nan, math.inf, -math.inf])
def test_nan_and_infinity_are_unknown(raw: float) -> None:
    assert quantise(raw, 1, 1) is None


def test_sentinels_are_unknown() -> None:
    assert quantise(-1, 100, 1, {-1}) is None
    assert quantise(65535, 1, 1, frozenset({65535})) is None
    assert quantise(-1.0, 1, 1, {-1}) is None
    assert quantise(0, 100, 1, {-1}) == 0


@rows(("raw", "expected"), [(0.5, 1), (-0.5, -1), (1.5, 2), (2.5, 3), (0.49, 0), (-0.0, 0)])
def test_halves_go_away_from_zero(raw: float, expected: int) -> None:
    result = quantise(raw, 1, 1)
    assert result == expected
    assert type(result) is int


@given(
    st.one_of(st.integers(-(2**63), 2**64), st.floats(allow_nan=False, allow_infinity=False)),
    st.integers(1, 10**15),
    st.integers(1, 10**9),
)
def test_agrees_with_exact_fractions(raw: int | float, numerator: int, denominator: int) -> None:
    exact = Fraction(raw) * Fraction(numerator, denominator)
    result = quantise(raw, numerator, denominator)
    assert type(result) is int
    assert abs(result - exact) <= Fraction(1, 2)
    if abs(result - exact) == Fraction(1, 2):
        assert abs(result) > abs(exact)


@given(st.integers(-(10**12), 10**12), st.integers(1, 10**6), st.integers(1, 10**6))
def test_agrees_with_decimal(raw: int, numerator: int, denominator: int) -> None:
    with localcontext(prec=60):
        expected = int((Decimal(raw * numerator) / denominator).to_integral_value(ROUND_HALF_UP))
    assert quantise(raw, numerator, denominator) == expected


@given(st.integers(-(2**40), 2**40), st.integers(-(2**40), 2**40))
def test_hypot(a: int, b: int) -> None:
    length = hypot_mm(a, b)
    assert length * length <= a * a + b * b < (length + 1) ** 2
