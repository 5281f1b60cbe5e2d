"""Describe the tokens that the parser accepts at its position."""

import re
from collections.abc import Iterable

from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.recovery import open_block, owner, shifts
from rtshcua.ground.language.table import END

WORDS = {
    "<NAME>": "a name",
    "<NUMBER>": "a number",
    "<STRING>": "a string in quotes",
    "<TIME_OF_DAY>": "a time of day",
    "<UNIT>": "a unit",
    "<COMPARE>": "a comparison",
    "<DIVIDE>": "`/`",
    "<LOCAL_TIME>": "`local time`",
    "<_GROW>": "`grow`",
    "<_CIRCLE>": "`circle`",
    "<_POLYGON>": "`polygon`",
    "<_CORRIDOR>": "`corridor`",
    "<COMBINE>": "`union`, `difference`",
    "<FUNCTION>": "`abs`, `min`, `max`",
    "<_REPEAT>": "`repeat`",
    "<_RISING>": "`rising`",
    "<_FALLING>": "`falling`",
    "<_ONE_OF>": "`one of`",
    "<_ON_INADMISSIBLE>": "`on inadmissible`",
    "<_AT_CLAUSE>": "`at` a clause",
    "<REASON>": "a reason",
    "<LINK_NAME>": "a name",
    "<FAULT>": "a fault",
    END: "the end of the file",
}

_QUOTED = re.compile("`([^`]+)`")

VALUE = {"<NAME>", "<NUMBER>", "<TIME_OF_DAY>", "<LOCAL_TIME>", "<FUNCTION>", "-", "("}
CONDITION = {"not", "<_RISING>", "<_FALLING>"}  # tokens that only start a condition
NUMBER = {"-", "<NUMBER>"}
ARITHMETIC = {"+", "-", "*", "<DIVIDE>"}
CONNECTING = {"and", "or", "for", "within"}  # tokens that may follow a condition
SHAPE = {"<_CIRCLE>", "<_POLYGON>", "<_CORRIDOR>", "<COMBINE>"}


def accepted(automaton: Automaton) -> set[str]:
    """The keywords, marks and kinds of token that are accepted next."""
    row = automaton.table.rows[automaton.states[-1]]
    return {symbol for symbol in row if _is_token(symbol) and _after(automaton, symbol) is not None}


def beginnings(automaton: Automaton) -> set[str]:
    """The keywords that start a declaration."""
    return {word for word in automaton.table.words if shifts(automaton.table.rows[0], word)}


def parts(automaton: Automaton, symbols: Iterable[str]) -> set[str]:
    """Those of `symbols` that start a part of the innermost open block."""
    block = open_block(automaton)
    if block is None:
        return set()
    row = automaton.table.rows[automaton.states[block[0]]]
    return {symbol for symbol in symbols if symbol.isalpha() and shifts(row, symbol)}


def phrase(automaton: Automaton, word: str) -> str:
    """`word` with the keywords that must follow it: `stale after`, `lasts at most`."""
    sequence, state = [word], _after(automaton, word) if word.isalpha() else None
    while state is not None:
        tokens = {symbol: step for symbol, step in automaton.table.rows[state].items() if _is_token(symbol)}
        (only, state) = next(iter(tokens.items())) if len(tokens) == 1 else ("", None)
        if state is not None and state >= 0 and only.isalpha():
            sequence.append(only)
        else:
            state = None
    return " ".join(sequence)


def describe(automaton: Automaton, symbols: set[str]) -> str:
    """`symbols` as a list for a sentence: names of groups where possible, keywords and marks in backticks."""
    rest = set(symbols)
    alternatives: list[str] = []
    if beginnings(automaton) <= rest:
        rest -= beginnings(automaton)
        alternatives.append("a declaration")
    if rest >= VALUE:
        alternatives.append("a condition" if rest & CONDITION else "a value")
        rest -= VALUE | CONDITION
    if "<COMPARE>" in rest:
        alternatives.append("a comparison")
        rest -= ARITHMETIC | {"<COMPARE>", "in", "inside", "outside"}
    elif "+" in rest:
        alternatives.append("an operator")
        rest -= ARITHMETIC | (CONNECTING if "and" in rest else set())
    if rest >= NUMBER:
        alternatives.append("a number")
        rest -= NUMBER
    if rest >= SHAPE:
        alternatives.append("a shape")
        rest -= SHAPE
    items = parts(automaton, rest)
    whose = owner(automaton)
    if len(items) > 3 and whose is not None:
        rest -= items
        alternatives.append(f"another part of the {whose[0]}")
    if alternatives:
        rest.discard(END)
    alternatives += sorted(WORDS[symbol] for symbol in rest if symbol in WORDS)
    alternatives += sorted(f"`{phrase(automaton, symbol)}`" for symbol in rest if symbol not in WORDS)
    return " or ".join([", ".join(alternatives[:-1]), alternatives[-1]] if len(alternatives) > 1 else alternatives)


def words(symbols: Iterable[str]) -> set[str]:
    """The keywords among `symbols`, also those that are kinds of token."""
    return {
        word for symbol in symbols for word in (_QUOTED.findall(WORDS.get(symbol, "")) or [symbol]) if _is_word(word)
    }


def _is_word(text: str) -> bool:
    return text.replace(" ", "").isalpha()


def _is_token(symbol: str) -> bool:
    return not symbol.startswith("<") or symbol.isupper()


def _after(automaton: Automaton, symbol: str) -> int | None:
    """The state of the parser after `symbol`, None if it does not fit. The parser itself stays unchanged."""
    rows, rules = automaton.table.rows, automaton.table.rules
    popped = 0
    pushed: list[int] = []  # states above the remaining ones, so that the stack is not copied
    while True:
        state = pushed[-1] if pushed else automaton.states[len(automaton.states) - 1 - popped]
        if symbol == END and state == automaton.table.end:
            return state
        step = rows[state].get(symbol)
        if step is None or step >= 0:
            return step
        rule = rules[~step]
        kept = max(0, len(pushed) - rule.length)
        popped += rule.length - (len(pushed) - kept)
        del pushed[kept:]
        state = pushed[-1] if pushed else automaton.states[len(automaton.states) - 1 - popped]
        pushed.append(rows[state][rule.origin])
