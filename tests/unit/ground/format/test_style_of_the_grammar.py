"""The style has exactly the declarations and items of the grammar."""

import re
from random import Random

import pytest
from lark.grammar import Rule

from fuzz.mutation.sentences import grammar, sentence
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from rtshcua.ground.format.style import CALLS, COLUMNS, ITEMS, OPERANDS
from rtshcua.ground.format.token_reader import SPACED
from rtshcua.ground.language.table import table

#: what stands in braces, or may come again, and is part of a list
LISTS = {"enumerators", "names", "source"}
#: rules whose items stand in no braces
BARE = ("file", "signal", "zone")


def rules() -> dict[str, list[Rule]]:
    found: dict[str, list[Rule]] = {}
    for rule in grammar().rules:
        found.setdefault(rule.origin.name, []).append(rule)
    return found


def actions(name: str, known: dict[str, list[Rule]], seen: frozenset[str] = frozenset()) -> set[str]:
    """The actions that a symbol of the grammar may end in; what only passes its part on is looked through."""
    found: set[str] = set()
    for rule in known.get(name, []):
        if name.startswith("_") or (rule.options.expand1 and len(rule.expansion) == 1):
            for each in rule.expansion:
                if each.name not in seen:
                    found |= actions(each.name, known, seen | {name})
        else:
            found.add(rule.alias or name)
    return found


def items() -> set[str]:
    """The actions of all that stands in braces, and of declarations and the items of signals and zones."""
    known = rules()
    found: set[str] = set()
    for rule in grammar().rules:
        names = [symbol.name for symbol in rule.expansion]
        inner = names[names.index("LEFT_BRACE") + 1 : names.index("RIGHT_BRACE")] if "LEFT_BRACE" in names else []
        if rule.origin.name in BARE:
            inner += [name for name in names if name.startswith("__")]
        for name in inner:
            found |= actions(name, known)
    return found - LISTS


def test_every_item_of_the_grammar_has_a_style() -> None:
    assert {"deadline", "permit", "step", "zone", "stale", "given", "row", "climb_to"} <= items()
    assert items() - set(ITEMS) == set(), "enter them in rtshcua/ground/format/style.py"
    assert set(ITEMS) - items() <= {"expectation"}, "these are in the grammar no more"


def test_style_words_are_keywords() -> None:
    known = table()
    kinds = {kind for row in known.rows for kind in row}
    written = {word for style in ITEMS.values() for word in (*style.breaks, *style.cuts)}
    for word in (*written, *CALLS, *OPERANDS, *SPACED):
        assert word in kinds, word
    assert set(COLUMNS) <= {rule.action for rule in known.rules}


def test_tokens_with_blanks_are_known() -> None:
    """Only these may be written with blanks in more than one way."""
    words = {word for pattern in grammar().terminals for word in re.findall("[a-z]{2,}", pattern.pattern.to_regexp())}
    spaced = [f"{word} \t {other}" for word in words for other in ("time", "of", "inadmissible", "x", '"x"', "(", "")]
    found = set()
    for terminal in grammar().terminals:
        whole = re.compile(terminal.pattern.to_regexp())
        matches = [match[0] for match in map(whole.match, spaced) if match]
        if any(" \t " in match for match in matches):
            found.add(f"<{terminal.name}>")
    assert found - {"<SPACE>"} == SPACED


@pytest.mark.slow
@pytest.mark.parametrize(
    "start", ["declaration", "skill_item", "policy_item", "mission_item", "test_item", "scenario_item", "zone"]
)
def test_item_begins_a_line(start: str) -> None:
    """Two of a kind that stand on one line are laid out on two."""
    blocks = {
        "declaration": "{} {}", "zone": "{} {}", "skill_item": "skill s() {{ \n{} {} }}",
        "policy_item": "policy p version 1 {{ \n{} {} }}", "mission_item": "mission m under p@1 on v {{ \n{} {} }}",
        "test_item": 'test "t" {{ \n{} {} }}', "scenario_item": 'scenario "s" {{ \n{} {} }}',
    }  # fmt: skip
    tried = 0
    for seed in range(60):
        one, other = sentence(Random(seed), start), sentence(Random(seed + 1000), start)
        made = formatted(Source("x", blocks[start].format(one, other)))
        if made.text is not None and "//" not in one + other:
            tried += 1
            first = other.split()[0]
            assert re.search(rf"^ *{re.escape(first)}", made.text.split("\n", 1)[1], re.MULTILINE), made.text
    assert tried > 10
