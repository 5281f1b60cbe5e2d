"""Coverage does not depend on line breaks and comments."""

import random
import re
from functools import lru_cache
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.testing.clause_coverage import Coverage, CoverageTally
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[4]
PARSE = lru_cache(maxsize=None)(parse)
DIALECT = dialect.load()

TEXT = """import "lib:policies/bridge_inspection.rts"
import "lib:policies/site.rts"
template low(top: altitude in 5 m .. 60 m) {
  permit hover by role operator through agent when height <= top
}
role trainee
policy own version 2 {
  use low(20 m)
  delegate hover by role operator to role trainee through agent when wind.speed < 5 m/s
  permit return_home, emergency_land by any
  forbid hover by any when battery < 20 %
  degrade any when wind.speed > 8 m/s to return_home
  airspace inside city outside school
  contingency return_home, emergency_land
}
nominal day {
  under own on surveyor by role operator through agent at "2026-06-01T10:00:00Z" phase flight
  given battery = 80 %, gps.fix = fix_3d, position = 47.39774 N, 8.54559 E, height = 10 m
  given wind.speed = 1 m/s, velocity.north = 0 m/s, velocity.east = 0 m/s, velocity.down = 0 m/s
}
test "hovering" from day {
  when hover(10 s)
  table battery, wind.speed {
    80 %, 1 m/s expect allow
    10 %, 1 m/s expect deny because authority/forbidden
    80 %, 9 m/s expect fallback return_home
    unknown, 1 m/s expect defer
  }
}
test "a trainee" from day { when hover(10 s) by role trainee through agent expect allow }
"""
#: tokens that a line break must not split: strings, numbers with fractions, words with dots
TOKENS = re.compile(r'"[^"]*"|[0-9][0-9:]*(?:\.[0-9]+)?|[A-Za-z_][A-Za-z0-9_/]*(?:\.[A-Za-z_]+)*|\.\.|[<>=!]=|\S')
BREAKS = (" ", "\n", "  ", "\n\n", " // a word\n", " /* some\n words */ ", "\t")


def coverage(text: str) -> Coverage:
    def read(path: str) -> bytes:
        return text.encode() if path == "own.rts" else (CHECKOUT / path).read_bytes()

    program = load(["own.rts"], read, str(CHECKOUT), None, PARSE)
    made = suite(program, DIALECT)
    assert [each.message for each in made.diagnostics] == []
    tally = CoverageTally()
    for policy in made.policies:
        tally.policy(policy, program.units, program.sources)
    for case in made.cases:
        tally.case(run_case(case))
    (covered,) = tally.all()
    assert len(covered.spans) == len(covered.coverage.lines)
    return covered.coverage


AS_WRITTEN = coverage(TEXT)


def test_coverage_of_the_sample_is_as_expected() -> None:
    rules = {line.item.text: line for line in AS_WRITTEN.lines if line.item.role in ("permit", "forbid", "degrade")}
    assert list(rules) == [
        "use low(20 m): permit hover by role operator through agent when height <= top",
        "permit return_home, emergency_land by any",
        "forbid hover by any when battery < 20 %",
        "degrade any when wind.speed > 8 m/s to return_home",
        "delegate hover by role operator to role trainee through agent when wind.speed < 5 m/s: "
        "use low(20 m): permit hover by role operator through agent when height <= top",
    ]
    assert [text for text, line in rules.items() if "decided" in line.missing] == [list(rules)[1]]
    assert AS_WRITTEN.decisions == 5


@settings(max_examples=settings().max_examples // 2)
@given(st.randoms(use_true_random=False))
def test_formatting_and_comments_do_not_change_coverage(chance: random.Random) -> None:
    text = "".join(token + chance.choice(BREAKS) for token in TOKENS.findall(TEXT))
    found = coverage(text)
    assert (found.covered, found.total, found.decisions) == (AS_WRITTEN.covered, AS_WRITTEN.total, AS_WRITTEN.decisions)
    for ours, theirs in zip(found.lines, AS_WRITTEN.lines, strict=True):
        assert ours.counts == theirs.counts
        assert (ours.item.role, ours.item.skill, ours.item.goals) == (
            theirs.item.role,
            theirs.item.skill,
            theirs.item.goals,
        )
