"""Patterns of quantities accept exactly the decimals of a range, in every dimension, below zero and with fractions."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.span import Source
from rtshcua.ground.agent.narrowed_schema import narrowed
from rtshcua.ground.agent.value_patterns import quantities, unit_of, written
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import UNITS, Dimension
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
LINEAR = sorted(Dimension, key=lambda one: one.value)
#: the number of canonical units in the unit of a dimension, by hand
SCALES = {
    Dimension.LENGTH: 1000, Dimension.ALTITUDE: 1000, Dimension.SPEED: 1000, Dimension.DURATION: 10**6,
    Dimension.ANGLE: 10**7, Dimension.RATIO: 100, Dimension.VOLTAGE: 1000,
    Dimension.COUNT: 1,
}  # fmt: skip


def fits(pattern: str, text: str) -> bool:
    return re.search(pattern, text, re.ASCII) is not None


def texts(value: int, scale: int) -> Iterator[str]:
    """Every spelling of a canonical value: without leading zeros, with any number of trailing zeros."""
    sign, (whole, rest) = "-" if value < 0 else "", divmod(abs(value), scale)
    digits = str(rest).zfill(len(str(scale)) - 1) if scale > 1 else ""
    for count in range(len(digits) + 1):
        if not digits[count:].strip("0"):
            yield f"{sign}{whole}{'.' if count else ''}{digits[:count]}"


def test_pattern_agrees_with_values_on_a_grid() -> None:
    """Exhaustive in per cent: limits from -1.3 % to 1.3 %, the numbers near them, in every spelling."""
    step = 7
    for low in range(-130, 131, step):
        for high in range(low, 131, step):
            pattern = re.compile(quantities(low, high, Dimension.RATIO), re.ASCII)
            for value in (*range(low - 3, low + 4), *range(high - 3, high + 4), *range(-210, 211, 10), -1, 1):
                for text in texts(value, 100):
                    assert bool(pattern.search(f"{text} %")) == (low <= value <= high), (low, high, text)


@given(dimension=st.sampled_from(LINEAR), data=st.data())
def test_pattern_accepts_exactly_the_decimals_of_its_range(dimension: Dimension, data: st.DataObject) -> None:
    scale = SCALES[dimension]
    near = st.integers(-3 * scale, 3 * scale) | st.integers(-400, 400).map(lambda number: number * max(scale // 4, 1))
    low, high = sorted((data.draw(near), data.draw(near)))
    pattern, unit = quantities(low, high, dimension), unit_of(dimension)
    value = data.draw(near | st.sampled_from([low - 1, low, low + 1, high - 1, high, high + 1]))
    for text in texts(value, scale):
        assert fits(pattern, f"{text} {unit}".rstrip()) == (low <= value <= high)
        for wrong in (f"0{text}", f"+{text}", f"{text}.", f"-{text}" if value <= 0 else f"--{text}", f" {text}"):
            assert not fits(pattern, f"{wrong} {unit}".rstrip())
        assert not fits(pattern, f"{text}{'0' * len(str(scale))}1 {unit}".rstrip())
    for end in (low, high):
        assert fits(pattern, written(end, dimension))
    assert not fits(pattern, f"-0 {unit}".rstrip())
    assert not fits(pattern, f"-0.0 {unit}".rstrip())


@given(dimension=st.sampled_from(LINEAR), value=st.integers(-(10**9), 10**9))
def test_written_quantity_parses_to_the_same_value(dimension: Dimension, value: int) -> None:
    parsed = parse(Source("x.rts", f"mission m under p@1 on v {{ phase a {{ s(x = {written(value, dimension)}) }} }}"))
    step = parsed.unit.missions[0].phases[0].items[0]
    assert isinstance(step, Step)
    read = step.arguments[0].value
    assert isinstance(read, Quantity)
    assert read.value == value


def test_scales_agree_with_the_units() -> None:
    for dimension, scale in SCALES.items():
        if dimension is not Dimension.COUNT:
            assert UNITS[unit_of(dimension)][1:] == (scale, 1)


#: a skill with parameters of every dimension, and a permit that limits an altitude
POLICY = """
import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
skill spin(turn: angle in -90 deg .. 12.5 deg = 0 deg, d: duration in 1500 us .. 2 min = 1 s, n: count in -2 .. 5 = 2,
           off: length in -5 m .. 30.25 m = 0 m) {
  motion hold
  class tactical deadline 2 s valid for 10 min
  lasts at most 40 s grace 1 s
  require battery > 30 %
  fallback return_home, emergency_land
  energy at most 4 %
}
policy q version 1 {
  permit spin by role operator through agent
  permit takeoff by role operator through agent when PERMITTED
  permit hover, return_home, emergency_land by any
  contingency return_home, emergency_land
}
"""


def arguments(permitted: str = "altitude <= 20 m") -> dict[str, dict[str, Any]]:
    """The schemas of the arguments by name."""

    def read(path: str) -> bytes:
        return POLICY.replace("PERMITTED", permitted).encode() if path == "p.rts" else Path(path).read_bytes()

    program = load(["p.rts"], read, str(CHECKOUT))
    (lowered,) = examine_program(program, dialect.load()).policies
    steps = narrowed(lowered, program.units, None)["$defs"]
    return {
        name: each
        for step in steps.values()
        for name, each in step["properties"].get("arguments", {"properties": {}})["properties"].items()
    }


def test_every_example_fits_its_pattern() -> None:
    found = arguments()
    assert {"turn", "d", "n", "off", "altitude"} <= set(found)
    for name, each in found.items():
        for example in each.get("examples", ()):
            assert fits(each["pattern"], example), (name, example)
    assert found["off"]["examples"] == ["30.25 m"]
    assert found["d"]["examples"] == ["120 s"]
    assert found["n"]["examples"] == ["5"]


@rows(
    ("permitted", "least", "most"),
    [
        ("altitude > 10.5 m and altitude < 30.25 m", 10_501, 30_249),
        ("altitude >= 10.5 m and altitude <= 30.25 m", 10_500, 30_250),
        ("10.5 m < altitude and 30.25 m > altitude", 10_501, 30_249),
        ("12 m <= altitude and 13 m >= altitude", 12_000, 13_000),
        ("altitude in 6 m .. 9.125 m", 6_000, 9_125),
        ("altitude == 12.5 m", 12_500, 12_500),
        ("12.5 m == altitude and altitude != 40 m", 12_500, 12_500),
        ("altitude < 7 m or altitude > 9 m", 3_000, 60_000),  # `or` is not analysed: the range may be too wide
    ],
)
def test_pattern_has_the_limits_of_the_permit_to_the_millimetre(permitted: str, least: int, most: int) -> None:
    altitude = arguments(permitted)["altitude"]
    for value in (least, most):
        assert fits(altitude["pattern"], written(value, Dimension.ALTITUDE))
    for value in (least - 1, most + 1):
        assert not fits(altitude["pattern"], written(value, Dimension.ALTITUDE))
    ends = [written(end, Dimension.ALTITUDE) for end in (least, most)]
    assert altitude["description"].startswith(f"From {ends[0]} to {ends[1]} above home")
