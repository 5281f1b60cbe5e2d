"""Words of the language are names wherever the grammar asks for a name."""

import pytest

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.table import table

SOFT = sorted(word for word, free in table().words.items() if free)
RESERVED = sorted(word for word, free in table().words.items() if not free)

EVERYWHERE = """
import "x"
enum § = § { § = 1, b = 2 }
signal § : § = §.§, §.§ or B.§ unknown at §, 3 stale after 5 s
signal a.§ : § = A.§ stale after 5 s
zone § = circle(1 N, 2 E, 3 m) floor 1 m
vehicle § {
  identity "x" home 1 N, 2 E within 50 m speed at most 12 m/s climb at most 3 m/s
  position error 3 m energy 100 % = 18 min hover reserve 15 %
}
skill §(§: §, b: one of §, c, § = §, d: speed in § .. § = §, e: one of §) {
  motion fly to § at § speed §
  class §
  valid for 1 s during §, §
  require § > § + § and not § == § or § in § .. § and § in {§, §} or § inside § or § outside grow(§, 3 m)
  fallback §(§, § = §) for 2 s, §
  record §, §
}
policy § version 1 {
  permit §, § by role §, § through §, § when § > §
  forbid any by any through §
  confirm § by role § within 3 s
  degrade § to §
  airspace inside §, § outside §, §
  contingency §, §
}
mission § under §@1 on § {
  proposed by § § for role §
  phase § { §() §(§, § = §) on inadmissible skip §() on inadmissible hold }
}
"""


@pytest.mark.parametrize("word", SOFT)
def test_soft(word: str) -> None:
    assert parse(Source("x", EVERYWHERE.replace("§", word))).diagnostics == ()


@pytest.mark.parametrize("word", RESERVED)
def test_reserved(word: str) -> None:
    (found,) = parse(Source("x", f"signal {word} : ratio = A.b stale after 5 s")).diagnostics
    assert found.code is SYNTAX
    assert found.message == f"`{word}` is a reserved word, so it is no name"


def test_two_words_that_stand_before_a_name_of_their_own() -> None:
    text = "mission m under p@1 on v { phase a { on() on() on inadmissible skip on() grow(grow) } }"
    parsed = parse(Source("x", text))
    assert parsed.diagnostics == ()
    assert [step.skill.text for step in parsed.unit.missions[0].phases[0].steps] == ["on", "on", "on", "grow"]
