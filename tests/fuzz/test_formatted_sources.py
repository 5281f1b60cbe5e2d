"""Sources with comments and blanks wherever they may stand, laid out: nothing is lost, and nothing changes twice."""

from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz import corpus
from fuzz.mutation.blanks import joined, sprinkled
from fuzz.mutation.sentences import sentence
from fuzz.targets.format import WIDTHS, check, mutated, pieces

SLOW = settings(suppress_health_check=list(HealthCheck))
#: for what takes more than 0.1 s for one example; the campaign below tries many
DEAR = settings(SLOW, max_examples=settings().max_examples // 3)
CHANCES = st.integers(0, (1 << 64) - 1)


def one(seed: int) -> bool:
    """One source of any kind; whether it was laid out."""
    of = Random(seed)
    return check(mutated(of.choice(corpus.sources()), of).decode(), of.choice(WIDTHS)) is not None


@pytest.mark.slow
@given(CHANCES)
@DEAR
def test_sprinkled_sources(seed: int) -> None:
    one(seed)


@given(CHANCES)
@SLOW
def test_sentences_of_the_grammar_on_lines_at_random(seed: int) -> None:
    of = Random(seed)
    check(sprinkled(joined(sentence(of), of), of), of.choice(WIDTHS))


def test_most_of_them_are_laid_out() -> None:
    """Otherwise the campaign would test nothing."""
    assert sum(one(seed) for seed in range(40)) > 20


def test_oracle_detects_required_changes() -> None:
    text = "skill s(a: b, /* c */ d: e) { // f\n}"
    same = "skill s(\n  a: b, /* c */\n  d: e,\n) {  // f\n}\n"
    assert pieces(text) == pieces(same)
    for changed in (
        same.replace("/* c */", ""), same.replace(", /* c */", " /* c */,"), same.replace("// f", "// g"),
        same.replace("  // f", "\n// f"), same.replace("a: b", "a: bb"),
    ):  # fmt: skip
        assert pieces(text) != pieces(changed)


@pytest.mark.soak
@pytest.mark.parametrize("part", range(10))
def test_50_000_sprinkled_sources(part: int) -> None:
    for number in range(5_000):
        one(1_000_000 * part + number)
