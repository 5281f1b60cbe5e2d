"""Near-valid sources and random sentences are compiled or get a diagnostic."""

import time
from collections.abc import Callable
from functools import cache
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz import corpus
from fuzz.mutation.sentences import mutated, sentence
from fuzz.targets import check, condition, parse

#: the limit in CPU seconds for each source
LIMIT = 10
SLOW = settings(suppress_health_check=list(HealthCheck))
CHANCES = st.integers(0, (1 << 64) - 1)


@cache
def texts() -> tuple[bytes, ...]:
    """The valid sources and their invalid twins, without the largest."""
    return tuple(text for text in corpus.sources() if len(text) < check.MAX_LENGTH)


def within_limit(one: Callable[[bytes], None], text: bytes) -> None:
    begun = time.process_time()
    one(text)
    assert time.process_time() - begun < LIMIT, text


def near(seed: int) -> bytes:
    of = Random(seed)
    return mutated(of.choice(texts()), of)


def near_condition(seed: int) -> bytes:
    of = Random(seed)
    return mutated(of.choice(corpus.conditions()), of)


@given(CHANCES)
@SLOW
def test_near_valid_sources(seed: int) -> None:
    within_limit(check.one, near(seed))


@given(CHANCES)
@SLOW
def test_near_valid_conditions(seed: int) -> None:
    within_limit(condition.one, near_condition(seed))


@given(CHANCES)
@SLOW
def test_sentences_of_the_grammar(seed: int) -> None:
    text = sentence(Random(seed)).encode()
    within_limit(parse.one, text)
    within_limit(check.one, text)


@pytest.mark.soak
@pytest.mark.parametrize("part", range(10))
def test_20_000_near_valid_sources(part: int) -> None:
    for number in range(2_000):
        within_limit(check.one, near(1_000_000 * part + number))


@pytest.mark.soak
@pytest.mark.parametrize("part", range(10))
def test_50_000_near_valid_conditions(part: int) -> None:
    for number in range(5_000):
        within_limit(condition.one, near_condition(1_000_000 * part + number))


@pytest.mark.soak
def test_20_000_sentences_of_the_grammar() -> None:
    for number in range(20_000):
        within_limit(check.one, sentence(Random(number)).encode())
