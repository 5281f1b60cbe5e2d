"""Numbers become whole canonical units exactly; `fractions.Fraction` is the oracle."""

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.exact_values import LIMIT, Trouble, exact
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import Comparison, Quantity
from rtshcua.model.quantity import UNITS, Datum, Dimension, display
from virtual.rows import rows

DIGITS = st.text("0123456789", min_size=1, max_size=24)


@given(whole=DIGITS, fraction=st.none() | DIGITS, unit=st.sampled_from(sorted(UNITS)), negative=st.booleans())
def test_exact_values_agree_with_fractions(whole: str, fraction: str | None, unit: str, negative: bool) -> None:
    written = whole if fraction is None else f"{whole}.{fraction}"
    value = Fraction(written) * UNITS[unit].numerator / UNITS[unit].denominator
    found = exact(written, unit, negative)
    assert found.dimension is UNITS[unit].dimension
    if value > LIMIT:
        assert found.trouble is Trouble.OUT_OF_BOUNDS or value < LIMIT + 1
    elif value.denominator == 1:
        assert (found.value, found.trouble) == (-value if negative else value, None)
    else:
        assert found.trouble is Trouble.NOT_EXACT
        assert abs(abs(found.value) - value) <= Fraction(1, 2)


@given(value=st.integers(0, LIMIT), dimension=st.sampled_from([d for d in Dimension if d is not Dimension.ALTITUDE]))
def test_displayed_value_is_read_back(value: int, dimension: Dimension) -> None:
    number, _, unit = display(value, dimension).partition(" ")
    assert exact(number, unit or None) == (value, dimension, None)


@rows(
    ("number", "unit", "expected"),
    [
        ("0", "m", 0),
        ("1_000", "m", 1_000_000),
        ("0.5", "m", 500),
        ("007", "m", 7_000),
        ("36", "km/h", 10_000),
        ("1.5", "min", 90_000_000),
        ("35.55", "%", 3_555),
        ("90", "deg", 900_000_000),
        ("2.500", None, None),
        ("2.000", None, 2),
        ("0.0001", "m", None),
        ("10", "km/h", None),
        ("0.001", "%", None),
        ("9223372036854775807", None, LIMIT),
        ("9223372036854775808", None, None),
        ("9" * 100_000, "m", None),
        ("0." + "0" * 100_000 + "1", "m", None),
        ("0" * 100_000 + "1", "m", 1_000),
    ],
)
def test_written_numbers_have_their_exact_values(number: str, unit: str | None, expected: int | None) -> None:
    found = exact(number, unit)
    assert (found.value if found.trouble is None else None) == expected


def quantity(text: str) -> Quantity:
    parsed = parse(Source("x", f"skill s() {{ require x > {text} }}"))
    assert parsed.diagnostics == ()
    condition = parsed.unit.skills[0].require[0].condition
    assert isinstance(condition, Comparison)
    assert isinstance(condition.right, Quantity)
    return condition.right


@rows(
    ("text", "value", "dimension", "datum"),
    [
        ("20 m", 20_000, Dimension.LENGTH, None),
        ("20m", 20_000, Dimension.LENGTH, None),
        ("-3 m", -3_000, Dimension.LENGTH, None),
        ("20 m above home", 20_000, Dimension.ALTITUDE, Datum.HOME),
        ("-2.5 m above sea", -2_500, Dimension.ALTITUDE, Datum.SEA),
        ("35 %", 3_500, Dimension.RATIO, None),
        ("35%", 3_500, Dimension.RATIO, None),
        ("500 ms", 500_000, Dimension.DURATION, None),
        ("12 m/s", 12_000, Dimension.SPEED, None),
        ("3", 3, Dimension.COUNT, None),
    ],
)
def test_literals(text: str, value: int, dimension: Dimension, datum: Datum | None) -> None:
    found = quantity(text)
    assert (found.value, found.dimension, found.datum) == (value, dimension, datum)


@given(st.integers(0, 10**9), st.sampled_from(["mm", "cm", "m", "ms", "s", "min", "%", "m/s"]))
def test_literal_has_its_written_value(number: int, unit: str) -> None:
    assert quantity(f"{number:_} {unit}").value == number * UNITS[unit].numerator


def test_value_is_displayed_in_a_common_unit() -> None:
    """Not 150 cm/s for 1.5 m/s, 2 cm for 20 mm, or 37500 ms for 37.5 s."""
    shown = {
        (20_000, Dimension.LENGTH): "20 m",
        (20, Dimension.LENGTH): "20 mm",
        (500, Dimension.LENGTH): "0.5 m",
        (1_500, Dimension.SPEED): "1.5 m/s",
        (14_800, Dimension.VOLTAGE): "14.8 V",
        (22_223_836, Dimension.DURATION): "22.223836 s",
        (500_000, Dimension.DURATION): "500 ms",
        (90_000_000, Dimension.DURATION): "90 s",
        (120_000_000, Dimension.DURATION): "2 min",
        (0, Dimension.DURATION): "0 s",
    }
    assert {key: display(*key) for key in shown} == shown
