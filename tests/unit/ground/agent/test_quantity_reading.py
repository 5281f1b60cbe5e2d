"""Values in another notation are read as their author meant them, or not at all."""

import re
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.span import Span
from rtshcua.ground.agent.quantity_reading import read_place, read_quantity
from rtshcua.ground.agent.rejections import PermittedRange, nearest_quantity
from rtshcua.ground.agent.value_patterns import COORDINATES, quantities, written
from rtshcua.ground.checker.agent_values import parse_value
from rtshcua.model.ir.expression import Coordinates, Quantity
from rtshcua.model.quantity import Dimension
from virtual.rows import rows

#: a text, its dimension, the same value as the language writes it or None, and a part of the reason
TEXTS = (
    ("25 m", Dimension.ALTITUDE, "25 m", ""),
    ("25m", Dimension.ALTITUDE, "25 m", ""),
    ("25 meters", Dimension.ALTITUDE, "25 m", "no unit `meters`"),
    ("25 (m)", Dimension.ALTITUDE, "25 m", ""),
    ("25 m.", Dimension.ALTITUDE, "25 m", ""),
    ('"25 m"', Dimension.ALTITUDE, "25 m", "same value"),
    ("'25 m'", Dimension.ALTITUDE, "25 m", "same value"),
    ("82 ft", Dimension.ALTITUDE, "24.994 m", "82 ft is 24.9936 m"),
    ("82'", Dimension.ALTITUDE, "24.994 m", "24.9936 m"),
    ("2500 centimetres", Dimension.LENGTH, "25 m", "25 m"),
    ("1 mile", Dimension.LENGTH, "1609.344 m", "1609.344 m"),
    ("1 NM", Dimension.LENGTH, "1852 m", "1852 m"),
    ("1 nautical mile", Dimension.LENGTH, "1852 m", "1852 m"),
    ("1 nm", Dimension.LENGTH, None, "unknown unit `nm`"),
    ("25\u00a0m", Dimension.LENGTH, "25 m", "same value"),
    ("25\u2009m", Dimension.LENGTH, "25 m", "same value"),
    ("25\u200bm", Dimension.LENGTH, "25 m", "same value"),
    ("25 m\u202e", Dimension.LENGTH, None, "`m<U+202E>`"),
    ("+25 m", Dimension.LENGTH, "25 m", "same value"),
    ("\u221225 m", Dimension.LENGTH, "-25 m", "same value"),
    ("-0 m", Dimension.LENGTH, "0 m", ""),
    ("25,5 m", Dimension.LENGTH, "25.5 m", "same value"),
    ("0,125 m", Dimension.LENGTH, "0.125 m", "same value"),
    ("1234,567 m", Dimension.LENGTH, "1234.567 m", "same value"),
    ("1,000 m", Dimension.LENGTH, None, "ambiguous"),
    ("1.000,5 m", Dimension.LENGTH, None, "expected a number"),
    ("1 000 m", Dimension.LENGTH, None, "expected one value"),
    ("2.5e1 m", Dimension.LENGTH, "25 m", "same value"),
    ("\uff12\uff15\uff4d", Dimension.LENGTH, "25 m", "same value"),
    ("20-30 m", Dimension.LENGTH, None, "expected one value"),
    ("20 \u2013 30 m", Dimension.LENGTH, None, "expected one value"),
    ("20 to 30 m", Dimension.LENGTH, None, "expected one value"),
    ("5 ft 6 in", Dimension.LENGTH, None, "expected one value"),
    ("about 25 m", Dimension.LENGTH, None, "expected a number"),
    ("null", Dimension.LENGTH, None, "expected a number"),
    ("25", Dimension.ALTITUDE, None, "if it is in metres, write `25 m`"),
    ("1e400", Dimension.ALTITUDE, None, "expected"),
    ("9" * 300 + " m", Dimension.ALTITUDE, None, "expected"),
    ("25 m above home", Dimension.ALTITUDE, "25 m", "same value"),
    ("25 m AGL", Dimension.ALTITUDE, None, "above ground; a height of 25 m above home is written `25 m`"),
    ("82 ft MSL", Dimension.ALTITUDE, None, "above sea; a height of 24.9936 m above home"),
    ("25 m/s", Dimension.ALTITUDE, None, "a unit of speed; expected altitude"),
    ("18 km/h", Dimension.SPEED, "5 m/s", ""),
    ("18 kph", Dimension.SPEED, "5 m/s", "5 m/s"),
    ("5 metres per second", Dimension.SPEED, "5 m/s", "5 m/s"),
    ("300 metres per minute", Dimension.SPEED, "5 m/s", "5 m/s"),
    ("10 knots", Dimension.SPEED, "5.144 m/s", "about 5.144444 m/s"),
    ("10 mph", Dimension.SPEED, "4.47 m/s", "is 4.4704 m/s"),
    ("10 ft/s", Dimension.SPEED, "3.048 m/s", "3.048 m/s"),
    ("600 fpm", Dimension.SPEED, "3.048 m/s", "3.048 m/s"),
    ("5 s/m", Dimension.SPEED, None, "unknown unit"),
    ("2 minutes", Dimension.DURATION, "120 s", "120 s"),
    ("1 hour", Dimension.DURATION, "3600 s", "3600 s"),
    ("500 msec", Dimension.DURATION, "0.5 s", "0.5 s"),
    ("5 \u00b5s", Dimension.DURATION, "0.000005 s", "0.000005 s"),
    ("1:30", Dimension.DURATION, None, "expected one value"),
    ("5 m", Dimension.DURATION, None, "a unit of length"),
    ("90\u00b0", Dimension.ANGLE, "90 deg", "90 deg"),
    ("90 degrees", Dimension.ANGLE, "90 deg", "90 deg"),
    ("1 rad", Dimension.ANGLE, "57.2957795 deg", "about 57.29578 deg"),
    ("50%", Dimension.RATIO, "50 %", ""),
    ("50 percent", Dimension.RATIO, "50 %", "50 %"),
    ("50 per cent", Dimension.RATIO, "50 %", "50 %"),
    ("50 \uff05", Dimension.RATIO, "50 %", "same value"),
    ("0.5", Dimension.RATIO, None, "if it is in per cent, write `0.5 %`"),
    ("14,8 Volts", Dimension.VOLTAGE, "14.8 V", "14.8 V"),
    ("14.8 MV", Dimension.VOLTAGE, None, "unknown unit"),
    ("3", Dimension.COUNT, "3", ""),
    ("3.0", Dimension.COUNT, "3", ""),
    ("3 times", Dimension.COUNT, None, "unknown unit"),
    ("three", Dimension.COUNT, None, "such as `20`"),
)  # fmt: skip


@rows("text, dimension, same, why", TEXTS)
def test_text_is_read_as_meant_or_not_at_all(text: str, dimension: Dimension, same: str | None, why: str) -> None:
    found = read_quantity(text, dimension)
    assert (None if found.value is None else written(round(found.value), dimension)) == same
    assert why in found.why
    assert found.why == found.why.strip()
    assert bool(found.why) or found.value is not None


@pytest.mark.parametrize(
    ("value", "near", "why"),
    [
        ("25 meters", "20 m", "the value is 25 m, out of range"),
        ("25 m", "20 m", ""),
        ("1 ft", "3 m", "the value is 0.3048 m, out of range"),
        ("20.0004 metres", "20 m", "the value is 20.0004 m, out of range"),
        ("12,00049 m", "12 m", "same value, rounded"),
        ("30 ft", "9.144 m", "30 ft is 9.144 m"),
        ("31 ft", "9.449 m", "31 ft is 9.4488 m, rounded"),
        ({"value": 12.5, "unit": "meters"}, "12.5 m", "`meters`"),
        ({"value": 12.5}, None, ""),
        ([12.5], None, ""),
        (True, None, ""),
        (None, None, ""),
        (12, None, "no unit; if it is in metres, write `12 m`"),
    ],
)
def test_nearest_value_is_nearest_to_what_was_meant(value: Any, near: str | None, why: str) -> None:
    found = nearest_quantity(value, PermittedRange(3_000, 20_000, Dimension.ALTITUDE))
    assert found[0] == near
    assert why in found[1]


#: the size of units in the canonical unit, by hand
SIZES: dict[Dimension, dict[str, int | Fraction]] = {
    Dimension.LENGTH: {"m": 1_000, "meters": 1_000, "KM": 1_000_000, "cm": 10, "feet": Fraction("304.8"),
                       "yd": Fraction("914.4"), "miles": 1_609_344},
    Dimension.SPEED: {"m/s": 1_000, "m / sec": 1_000, "km/h": Fraction(2_500, 9), "kt": Fraction(4_630, 9),
                      "mph": Fraction("447.04"), "feet per second": Fraction("304.8")},
    Dimension.DURATION: {"s": 10**6, "secs": 10**6, "minutes": 6 * 10**7, "ms": 1_000, "Hours": 36 * 10**8},
    Dimension.RATIO: {"%": 100, "percent": 100},
    Dimension.ANGLE: {"deg": 10**7, "\u00b0": 10**7},
    Dimension.VOLTAGE: {"V": 1_000, "volts": 1_000, "mV": 1},
}  # fmt: skip


@given(data=st.data())
def test_repair_is_the_nearest_accepted_value(data: st.DataObject) -> None:
    """The oracle: a table of sizes, and the neighbours of the answer."""
    dimension = data.draw(st.sampled_from(list(SIZES)))
    unit, size = data.draw(st.sampled_from(list(SIZES[dimension].items())))
    number = data.draw(st.decimals(-10_000, 10_000, places=4)) + 0
    low = data.draw(st.integers(-(10**5), 10**5))
    high = data.draw(st.integers(low, low + 10**5))
    sign = data.draw(st.sampled_from(["", "+"])) if number >= 0 else ""
    between = data.draw(st.sampled_from(["", " ", "\u00a0", "\u2009", "  "]))
    point = data.draw(st.sampled_from([".", ","]))
    text = f"{sign}{number:f}{between}{unit}".replace(".", point).replace("-", data.draw(st.sampled_from("-\u2212")))
    near, _ = nearest_quantity(text, PermittedRange(low, high, dimension))
    assert near is not None, text
    assert re.fullmatch(quantities(low, high, dimension), near), "the schema accepts it"
    value, found = parse_value(near, Span("", 0, len(near)), lambda at: at)
    assert isinstance(value, Quantity), found
    meant = Fraction(Decimal(number)) * size
    assert low <= value.value <= high
    neighbours = [each for each in (value.value - 1, value.value + 1) if low <= each <= high]
    assert all(abs(value.value - meant) <= abs(each - meant) for each in neighbours)


NAIVE = re.compile(r"\s*([+-]?)\s*(\d+(?:[.,]\d+)?|\.\d+)(?:e([+-]?\d+))?\s*m[\s.]*")


@given(st.text("0123456789.,+-e mk()", max_size=14))
def test_no_text_is_read_as_another_value(text: str) -> None:
    found = read_quantity(text, Dimension.LENGTH)
    if found.value is None or "k" in text or "(" in text or ")" in text or "mm" in text:
        return
    matched = NAIVE.fullmatch(text)
    assert matched is not None, text
    sign, number, exponent = matched.groups()
    meant = Fraction(number.replace(",", ".")) * Fraction(10) ** int(exponent or 0)
    assert found.value == (-meant if sign == "-" else meant) * 1_000


#: a place, the same as the language writes it or None, and a part of the reason
PLACES: tuple[tuple[Any, str | None, str], ...] = (
    ("47.39927 N, 8.54572 E", "47.39927 N, 8.54572 E", ""),
    ("47.39927N 8.54572E", "47.39927 N, 8.54572 E", "same value"),
    ("47.39927\u00b0N, 8.54572\u00b0E", "47.39927 N, 8.54572 E", ""),
    ("N47.39927 W8.5", "47.39927 N, 8.5 W", ""),
    ("8.5 e; 47.4 s", "47.4 S, 8.5 E", ""),
    ("(47.4 N, 8.5 E)", "47.4 N, 8.5 E", ""),
    ("47\u00b023'57.4\"N, 8\u00b032'44.6\"E", "47.3992778 N, 8.5457222 E", ""),
    ("47\u00b024\u2032N 8\u00b030\u2032E", "47.4 N, 8.5 E", ""),
    ("47.123456789 N, 8.5 E", "47.1234568 N, 8.5 E", "same value, rounded"),
    ({"lat": 47.4, "lon": -8.5}, "47.4 N, 8.5 W", ""),
    ({"Longitude": 8.5, "Latitude": -47.4}, "47.4 S, 8.5 E", ""),
    ({"lat": 47.4, "lon": 8.5, "alt": 20}, None, ""),
    ({"lat": 47.4, "latitude": 8.5}, None, ""),
    ("47.39927, 8.54572", None, "if it is the first one, write `47.39927 N, 8.54572 E`"),
    ([47.4, -8.5], None, "write `47.4 N, 8.5 W`"),
    ("47.4 N, 8.5 N", None, ""),
    ("-47.4 N, 8.5 E", None, ""),
    ("91 N, 8.5 E", None, ""),
    ("47.4 N", None, ""),
    ("over there", None, ""),
    (None, None, ""),
    (7, None, ""),
)


@rows("value, same, why", PLACES)
def test_place_is_read_as_meant_or_not_at_all(value: Any, same: str | None, why: str) -> None:
    found = read_place(value)
    assert found.text == same
    assert why in found.why


@given(st.integers(-899_999_999, 899_999_999), st.integers(-1_799_999_999, 1_799_999_999))
def test_coordinates_are_accepted_and_exact(latitude: int, longitude: int) -> None:
    texts = [f"{Decimal(each) / 10**7:f}" for each in (latitude, longitude)]
    found = read_place(dict(zip(("lat", "lon"), texts, strict=True))).text
    assert found is not None
    assert re.fullmatch(COORDINATES, found)
    value, _ = parse_value(found, Span("", 0, len(found)), lambda at: at)
    assert isinstance(value, Coordinates)
    assert (value.latitude, value.longitude) == (latitude, longitude)


@rows(
    "text, help",
    [
        ("5 mi", "`5 mi` is `8046.72 m`"),
        ("82 ft", "`82 ft` is about `24.994 m`"),
        ("10 kt", "`10 kt` is about `5.144 m/s`"),
        ("25 M", "did you mean `m`?"),
        ("5 mph", "`5 mph` is about `2.235 m/s`"),
    ],
)
def test_compiler_does_not_take_a_foreign_unit_for_another(text: str, help: str) -> None:
    """Regression: `5 mi` was answered with `min`."""
    _, (found,) = parse_value(text, Span("", 0, len(text)), lambda at: at)
    assert found.help == help
