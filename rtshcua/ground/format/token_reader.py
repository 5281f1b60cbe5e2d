"""Read the tokens and items of a text with the parser's table, without building the IR.

The table and its lexers are those of the parser, so both agree on tokens; reading twice is faster than parsing once.
"""

from functools import cache
from typing import NamedTuple

from rtshcua.ground.format.style import ITEMS
from rtshcua.ground.language.table import END, table

#: the kinds of tokens with blanks inside, such as `one of`, which are written with one blank
SPACED = frozenset({"<LOCAL_TIME>", "<_ONE_OF>", "<_ON_INADMISSIBLE>", "<_AT_CLAUSE>"})


class ItemRange(NamedTuple):
    """An item, such as `deadline 2 s`: the action of its rule, and the number of the token after its last."""

    action: str
    end: int


class TokenizedText(NamedTuple):
    """The tokens of a text by number: their offsets, texts and symbols.

    `items` has the items of the rules in `style.ITEMS` by their first token; of two with the same first token, the
    larger. `rules` is the parse tree in postfix order without tokens: each rule follows its parts. An optional comma at
    the end of a list is not part of it.
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
        """The maximal nesting depth of brackets."""
        depth = deepest = 0
        for symbol in self.symbols:
            if symbol in ("(", "{"):
                depth += 1
                deepest = max(deepest, depth)
            elif symbol in (")", "}"):
                depth -= 1
        return deepest


class _Reduction(NamedTuple):
    """A reduction: `tag` identifies the rule, `item` is its action if it is an item."""

    origin: str
    length: int
    tag: int | None
    item: str | None


@cache
def _reductions() -> tuple[_Reduction, ...]:
    """Return the reduction of each rule of the table.

    Rules with the same action and the same kept parts differ only in an optional comma, and share a tag. A rule that
    only passes its part on has no tag.
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
    """Return the tokens of a text; None if it has a syntax error."""
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
    """The tokens, with single blanks inside tokens of several words."""
    for number in [number for number, symbol in enumerate(symbols) if symbol in SPACED]:
        words[number] = " ".join(words[number].split())
    return words
