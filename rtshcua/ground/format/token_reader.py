"""Reads the tokens and items of a text by the parser's table, without building anything.

The table and its lexers are those of the parser, so both agree on what a token is; reading twice costs less than
parsing once.
"""

from functools import cache
from typing import NamedTuple

from rtshcua.ground.format.style import ITEMS
from rtshcua.ground.language.table import END, table

#: the kinds of tokens that may have blanks inside, as `one of`: one is enough
SPACED = frozenset({"<LOCAL_TIME>", "<_ONE_OF>", "<_ON_INADMISSIBLE>", "<_AT_CLAUSE>"})


class ItemRange(NamedTuple):
    """An item, as `deadline 2 s`: the action of its rule, and the number of the token after its last."""

    action: str
    end: int


class TokenizedText(NamedTuple):
    """The tokens of a text, by their number: offsets, what is written, and the symbol that the parser took each for.

    `items` has those of the rules in `style.ITEMS`, by their first token; of two that begin there the larger. `rules`
    is the parse tree in postfix, without the tokens: each rule after its parts. A comma that a list may end in does
    not show in it.
    """

    text: str
    starts: list[int]
    ends: list[int]
    words: list[str]
    symbols: list[str]
    items: dict[int, ItemRange]
    rules: list[int]

    @property
    def depth(self) -> int:
        """How deep brackets stand within each other at most."""
        depth = deepest = 0
        for symbol in self.symbols:
            if symbol in ("(", "{"):
                depth += 1
                deepest = max(deepest, depth)
            elif symbol in (")", "}"):
                depth -= 1
        return deepest


class _Reduction(NamedTuple):
    """What a reduction does here: `tag` stands for the rule, `item` is its action where it is an item."""

    origin: str
    length: int
    tag: int | None
    item: str | None


@cache
def _reductions() -> tuple[_Reduction, ...]:
    """For each rule of the table its step.

    Rules with one action that keep the same parts differ in an optional comma alone, and share their tag. What only
    passes its one part on needs none.
    """
    tags: dict[tuple[str, str, tuple[int | None, ...]], int] = {}
    made = []
    for rule in table().rules:
        tag = tags.setdefault((rule.origin, rule.action, rule.kept), len(tags))
        passes = rule.length == 1 and not rule.action and not rule.repeats
        made.append(
            _Reduction(rule.origin, rule.length, None if passes else tag, rule.action if rule.action in ITEMS else None)
        )
    return tuple(made)


def read(text: str) -> TokenizedText | None:
    """The text's tokens; None where the parser does not take it."""
    known = table()
    rows, lexers, last, steps = known.rows, known.lexers, known.end, _reductions()
    starts, ends, words, symbols = list[int](), list[int](), list[str](), list[str]()
    items: dict[int, ItemRange] = {}
    rules: list[int] = []
    states, firsts = [0], [0]  # `firsts` has the first token of what each state stands for
    start = end = group = 1 if text.startswith("\ufeff") else 0
    while True:
        match, kinds = lexers[states[-1]]
        token = match(text, end)
        if token is None and (begin := known.skipped(text, end)) < len(text):
            token = match(text, begin)
            if token is None:
                return None
        if token:
            group = token.lastindex or 0
            word, kind = token[group], kinds[group]
        else:
            word = kind = END
        while True:
            row = rows[states[-1]]
            symbol = word if word in row else kind
            step = row.get(symbol)
            if step is None:
                return None
            if step >= 0 and token:
                states.append(step)
                firsts.append(len(words))
                start, end = token.span(group)
                starts.append(start)
                ends.append(end)
                words.append(word)
                symbols.append(symbol)
                break
            origin, length, tag, item = steps[~step]
            if length:
                del states[-length:], firsts[len(firsts) + 1 - length :]
            else:
                firsts.append(len(words))
            if tag is not None:
                rules.append(tag)
                if item is not None:
                    items[firsts[-1]] = ItemRange(item, len(words))
            state = rows[states[-1]][origin]
            states.append(state)
            if word is END and state == last:
                return TokenizedText(text, starts, ends, _with_single_spaces(words, symbols), symbols, items, rules)


def _with_single_spaces(words: list[str], symbols: list[str]) -> list[str]:
    """The words, with single spaces in those that have any."""
    for number in [number for number, symbol in enumerate(symbols) if symbol in SPACED]:
        words[number] = " ".join(words[number].split())
    return words
