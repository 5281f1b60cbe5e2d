"""Make `table.json` from `grammar/rtshcua.lark` with Lark: `python -m rtshcua.ground.language.generate`.

Lark needs 0.2 s for the LALR table; reading the file takes a few milliseconds at each start. A test keeps the committed
table current. States are numbered in the order in which they are reached, so that the same grammar always gives the
same bytes.
"""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark
from lark.grammar import Rule, Terminal
from lark.lexer import PatternStr, TerminalDef
from lark.parsers.lalr_analysis import Shift

from rtshcua.ground.language.table import PATH

START = "file"
GRAMMAR = Path(__file__).parents[3] / "grammar" / "rtshcua.lark"

Row = dict[str, tuple[Any, Any]]


@cache
def lark(grammar: str) -> Lark:
    """Lark's own parser of the grammar: the source of the table, and the oracle of the tests and the benchmark."""
    return Lark(grammar, start=START, parser="lalr", lexer="contextual", propagate_positions=True)


def generate(grammar: str) -> str:
    """Return the table as JSON text, ending in a newline; `table.ParserTable` describes it."""
    made = lark(grammar)
    fixed, ignored, patterns = _terminals(made)
    names = re.compile(next(t.pattern.to_regexp() for t in patterns if t.name == "NAME"))
    keys = fixed | {t.name: f"<{t.name}>" for t in patterns} | {"$END": "<END>"}
    rules = sorted(made.rules, key=lambda rule: (rule.origin.name, [symbol.name for symbol in rule.expansion]))
    places = {rule: number for number, rule in enumerate(rules)}
    automaton = made.parser.parser._parse_table
    order = _reached(automaton.states, automaton.start_states[START])
    table = {
        "end": order[automaton.end_states[START]],
        "ignored": [t.pattern.to_regexp() for t in sorted(ignored, key=lambda t: t.name)],
        "patterns": [[keys[t.name], t.pattern.to_regexp()] for t in sorted(patterns, key=_first)],
        "marks": sorted((text for text in fixed.values() if not text.isalpha()), key=lambda text: (-len(text), text)),
        "words": {text: bool(names.fullmatch(text)) for text in sorted(fixed.values()) if text.isalpha()},
        "rules": [_rule(rule) for rule in rules],
        "states": [_row(automaton.states[state], keys, order, places) for state in order],
    }
    return "{\n" + ",\n".join(f"{json.dumps(key)}: {_lines(value)}" for key, value in table.items()) + "\n}\n"


def _terminals(made: Lark) -> tuple[dict[str, str], list[TerminalDef], list[TerminalDef]]:
    """The keywords and marks by name, the ignored terminals, and all others."""
    fixed = {t.name: t.pattern.value for t in made.terminals if isinstance(t.pattern, PatternStr)}
    ignored = [t for t in made.terminals if t.name in made.ignore_tokens]
    return fixed, ignored, [t for t in made.terminals if t.name not in fixed and t not in ignored]


def _first(terminal: TerminalDef) -> tuple[int, str]:
    return -terminal.priority, terminal.name


def _reached(states: dict[int, Row], start: int) -> dict[int, int]:
    """Map Lark's number of each state to its number in a breadth-first walk from `start`, in alphabetical order."""
    order = {start: 0}
    queue = [start]
    for state in queue:
        for _, (action, to) in sorted(states[state].items(), key=lambda entry: entry[0]):
            if action is Shift and to not in order:
                order[to] = len(order)
                queue.append(to)
    return order


def _row(row: Row, keys: dict[str, str], order: dict[int, int], rules: dict[Rule, int]) -> dict[str, int]:
    """The row of a state: for each symbol the next state (0 or more), or the rule `~n` to reduce by (negative)."""
    return {
        keys.get(symbol, f"<{symbol}>"): order[to] if action is Shift else ~rules[to]
        for symbol, (action, to) in sorted(row.items())
    }


def _rule(rule: Rule) -> list[Any]:
    """[origin, name of the action or "", length, kept]: `kept` lists positions, None for an absent `[...]`.

    Lark makes the rules `__x_star_0` for repetitions. Their value is a list whose items are passed to the parent, which
    the complement of the position marks. A `?rule` with one kept child has no action.
    """
    absent = iter("".join(str(int(empty)) for empty in rule.options.empty_indices or ()).split("0"))
    kept: list[int | None] = [None] * len(next(absent, ""))
    for at, symbol in enumerate(rule.expansion):
        if not (isinstance(symbol, Terminal) and symbol.filter_out):
            kept.append(~at if not symbol.is_term and symbol.name.startswith("_") else at)
        kept += [None] * len(next(absent, ""))
    passes = rule.options.expand1 and not rule.alias and len(kept) == 1
    helper = rule.origin.name.startswith("_")
    action = "" if passes or helper else rule.alias or rule.origin.name
    return [f"<{rule.origin.name}>", action, len(rule.expansion), kept]


def _lines(value: Any) -> str:
    """JSON with one line for each entry, so that a change of the grammar gives a readable diff."""
    if isinstance(value, dict):
        return "{\n" + ",\n".join(f" {json.dumps(key)}: {json.dumps(item)}" for key, item in value.items()) + "\n}"
    if isinstance(value, list):
        return "[\n" + ",\n".join(f" {json.dumps(item)}" for item in value) + "\n]"
    return json.dumps(value)


if __name__ == "__main__":
    PATH.write_text(generate(GRAMMAR.read_text(encoding="utf-8")), encoding="utf-8")
