"""The committed table is the one that Lark makes of the committed grammar."""

import logging
from pathlib import Path

import pytest
from lark import Lark, logger
from lark.lexer import PatternStr

from rtshcua.ground.language import generate
from rtshcua.ground.language.build.actions import ACTIONS
from rtshcua.ground.language.expected import WORDS
from rtshcua.ground.language.table import END, PATH, table


@pytest.fixture
def grammar(checkout: Path) -> str:
    return (checkout / "grammar" / "rtshcua.lark").read_text(encoding="utf-8")


def test_committed_table_is_current(grammar: str) -> None:
    assert PATH.read_text(encoding="utf-8") == generate.generate(grammar), "python -m rtshcua.ground.language.generate"


@pytest.mark.slow
def test_grammar_has_no_conflict(grammar: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, logger.name)
    Lark(grammar, start=generate.START, parser="lalr", debug=True)
    assert [record.message for record in caplog.records if "conflict" in record.message.lower()] == []


def test_every_terminal_is_named(grammar: str) -> None:
    names = [terminal.name for terminal in generate.lark(grammar).terminals]
    assert [name for name in names if name.startswith("__")] == []


def test_keywords_are_reserved_only_if_necessary(grammar: str) -> None:
    assert {word for word, free in table().words.items() if not free} == {
        "and", "or", "not", "in", "inside", "outside", "any",
    }  # fmt: skip
    fixed = {t.pattern.value for t in generate.lark(grammar).terminals if isinstance(t.pattern, PatternStr)}
    assert set(table().words) == {text for text in fixed if text.isalpha()}


def test_actions_match_the_rules_of_the_grammar() -> None:
    assert ACTIONS.keys() == {rule.action for rule in table().rules if rule.action}


def test_every_token_kind_has_a_description() -> None:
    assert set(WORDS) == {kind for kind in table().lexers.any.kinds if kind} | {END}
