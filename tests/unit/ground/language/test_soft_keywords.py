"""Keywords are names wherever the grammar expects a name."""

import pytest

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.table import table
from virtual.rows import rows

SOFT = sorted(word for word, free in table().words.items() if free)
RESERVED = sorted(word for word, free in table().words.items() if not free)

EVERYWHERE = """
import "x"
enum § = § { § = 1, b = 2 }
signal § : § = §.§, §.§ or B.§ unknown at §, 3 stale after 5 s
signal a.§ : § = A.§ stale after 5 s
zone § = circle(1 N, 2 E, 3 m) floor 1 m
zone § = union(§, difference(§, circle(1 N, 2 E, 3 m), §))
zone § from "x" feature "y" active 08:00 .. 09:00
vehicle § {
  identity "x" home 1 N, 2 E within 50 m speed at most 12 m/s climb at most 3 m/s
  position error 3 m energy 100 % = 18 min hover reserve 15 %
}
skill §(§: §, b: one of §, c, § = §, d: speed in § .. § = §, e: one of §) {
  motion fly to § at § speed §
  class §
  valid for 1 s during §, §
  require § > § + § and not § == § or § in § .. § and § in {§, §} or § inside § or § outside grow(§, §)
  assume rising § > § for the last 3 s within the last 3 s or not falling § inside § within 3 s of § == §
    and max(§, § / §) < abs(§ - §) * §
  fallback §(§, § = §) for 2 s, §
  record §, §
}
template §(§: §, §: role = §) {
  permit § by role § through § when § > §
}
policy § version 1 {
  use §(§, § = §)
  delegate § by role § to role § through § when § > §
  permit §, § by role §, § through §, § when § > §
  forbid any by any through §
  confirm § by role § within 3 s
  degrade § to §
  airspace inside §, § outside §, §
  contingency §, §
}
mission §(§: zone = §, §: § in § .. § = §) under §@1 on § {
  proposed by § § for role §
  lasts at most 2 min energy at most 3 % steps at most 4
  phase § { repeat 3 { §() } §() { deadline 2 s valid for 3 s during § require § > § record § } §() repeat 1 { } }
  phase § { §() §(§, § = §) on inadmissible skip §() on inadmissible hold }
}
nominal § {
  under § on § by role § through §
  phase § of §, § given § = §, §.§ = § measured 3 s ago, (§ > § for the last 3 s) = §
  approved by role § given § = § refused by role another 2 s ago
}
test "x" from § {
  when §(§, § = §) by role § through §
  table §, §.§ { §, § expect fallback hover because § §, § expect allow because x § measured 1 s ago, § expect deny }
}
"""


#: what is a word only with what follows it
LED = ["abs", "circle", "corridor", "difference", "falling", "grow", "max", "min", "polygon", "rising", "union"]


@pytest.mark.slow
@rows("word", [*SOFT, *LED, "repeat", "one", "local"])
def test_soft_keyword_is_a_name_elsewhere(word: str) -> None:
    assert parse(Source("x", EVERYWHERE.replace("§", word))).diagnostics == ()


@rows("word", RESERVED)
def test_reserved_word_is_refused_as_a_name(word: str) -> None:
    (found,) = parse(Source("x", f"signal {word} : ratio = A.b stale after 5 s")).diagnostics
    assert found.code is SYNTAX
    assert found.message == f"`{word}` is a reserved word and cannot be a name"


@rows("word", [*LED, "repeat", "on"])
def test_keyword_may_be_the_name_of_a_step(word: str) -> None:
    text = f"mission m under p@1 on v {{ phase a {{ {word}() {word} () on inadmissible skip {word}({word}) }} }}"
    parsed = parse(Source("x", text))
    assert parsed.diagnostics == ()
    assert [step.skill.text for step in parsed.unit.missions[0].phases[0].steps] == [word] * 3


@rows("word", ["rising", "falling"])
@rows(
    "text",
    [
        "§ < 3",
        "§<3",
        "§ in {a}",
        "§ in 1 .. 2",
        "§ inside z",
        "§\toutside z",
        "§ - 3 > a",
        "§ * 2 > a",
        "(§) > a",
        "a > §",
    ],
)
def test_signal_may_be_named_rising_or_falling(word: str, text: str) -> None:
    parsed = parse(Source("x", f"skill s() {{ require {text.replace('§', word)} }}"))
    assert parsed.diagnostics == ()
    assert parsed.unit.skills[0].require[0].condition.kind != "edge"
