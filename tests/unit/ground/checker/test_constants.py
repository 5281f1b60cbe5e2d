"""Constants are exact fractions; stored constants are whole, or refused."""

from fractions import Fraction
from pathlib import Path
from random import Random

from reference.naive_expression import SI, Names, World, known, number
from reference.random_expressions import ALTITUDE, STEP, Maker
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import Symbols
from rtshcua.ground.checker.values import typed
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.ir.expression import Value
from rtshcua.model.quantity import Dimension
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]

SOURCE = """
import "lib:policies/site.rts"
import "lib:skills/signals.rts"
import "lib:skills/emergency_land.rts"

skill probe(up: altitude in RANGE = DEFAULT, wait: duration in 1 s .. 1 min = 3 s) {
  motion   hold
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  fallback emergency_land
  energy   at most 5 %
}

policy rules version 1 {
  permit probe by role operator
  permit emergency_land by any
  contingency emergency_land
}

mission m under rules@1 on quad {
  proposed by operator x for role operator
  phase a { probe(ARGUMENT) }
}
"""


class Literals(Maker):
    """Draws numbers in which every name is a literal."""

    def name(self, dimension: Dimension, observed: bool) -> Value:
        return self.literal(dimension)


def test_constant_equals_its_written_fraction() -> None:
    maker = Literals(Random(3))
    nothing = World(0, {}, {}, None, 0)
    whole = 0
    for _ in range(3_000):
        dimension = maker.random.choice(list(STEP))
        node = maker.number(dimension, 4, observed=False)
        report = Report({})
        found = typed(Scope(Symbols(), report), node)
        assert report.found == []
        assert found is not None
        expected = known(number(node, nothing, Names({}, {}, {})))
        assert found.constant == expected * SI[dimension], node
        assert found.type.dimension is (Dimension.LENGTH if dimension is ALTITUDE else dimension)
        whole += found.constant == Fraction(int(found.constant))
    assert 500 < whole < 2_800


def compiled(argument: str, *, range: str = "1 m .. 100 m", default: str = "20 m") -> Compiled:
    text = SOURCE.replace("RANGE", range).replace("DEFAULT", default).replace("ARGUMENT", argument)
    program = load(["x.rts"], lambda path: text.encode() if path == "x.rts" else Path(path).read_bytes(), str(CHECKOUT))
    return compile_program(program, dialect.load(), mission=None, issued_at_us=0)


STORED = [
    ("up = 3 * 5 m", "E0302", None),
    ("up = 10 m / 4", "E0302", None),
    ("up = max(5 m, 3 m) + 2 m/s * 5 s", "E0302", None),
    ("wait = 40 m / 4 m/s", "E0302", None),
    ("up = 10 m / 3", "E0302", "an altitude above home must be whole mm; the nearest are `3.333 m` and `3.334 m`"),
    ("wait = 10 s / 3", "E0302", "a duration must be whole us; the nearest are `3.333333 s` and `3.333334 s`"),
    ("up = height * 2", "E0318", "write a constant, such as a number with its unit"),
    ("up = 300 m / 2", "E0605", "the nearest accepted value is `100 m`"),
    ("wait = 40 m / 4 s", "E0310", "write a duration, such as `10 s`"),
    ("up = 3 m / 0", "E0322", None),
]


@rows(("argument", "code", "help"), STORED)
def test_argument_is_a_whole_canonical_number(argument: str, code: str, help: str | None) -> None:
    found = [(each.code.id, each.help) for each in compiled(argument).diagnostics if each.code.id < "E0606"]
    assert found == ([(code, help)] if help is not None or code == "E0322" else [])


def test_range_ends_and_default_are_whole() -> None:
    assert not [
        each for each in compiled("", range="1 m .. 2 * 50 m", default="3 * 5 m").diagnostics if "E03" in each.code.id
    ]
    for range, default in (("1 m / 3 .. 100 m", "20 m"), ("1 m .. 100 m", "20 m / 3")):
        found = {each.code.id for each in compiled("", range=range, default=default).diagnostics}
        assert found == {"E0302"}
