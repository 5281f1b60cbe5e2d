"""The LALR table that Lark made of the grammar (see `generate`), as the automaton reads it."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

PATH = Path(__file__).with_name("table.json")

END = "<END>"
NAME = "<NAME>"
WORD = "[A-Za-z_][A-Za-z0-9_]*"
MAX_SKIPPED = 1000  # comments and runs of blanks that one match takes

Row = dict[str, int]


class Production(NamedTuple):
    """A production: pop `length` values and hand those at `kept` to `action`; the result is an `origin`.

    `kept` lists positions; None is an optional part that is absent, and the complement `~n` is a list that is handed on
    item by item. Without an action the one value that is kept passes unchanged; `repeats` says that it is a list that
    grows.
    """

    origin: str
    action: str
    length: int
    kept: tuple[int | None, ...]

    @property
    def repeats(self) -> bool:
        """Whether Lark made this rule for a repetition."""
        return self.origin.startswith("<__")


class Lexer(NamedTuple):
    """Reads one token where the parser stands: `match(text, offset)` skips what is ignored and reads what follows.

    The match's `lastindex` is the token's group and the index of its kind in `kinds`; empty for a word or a mark, which
    is its own kind. There is no match at the end of the text, nor where no token begins.
    """

    match: Callable[[str, int], re.Match[str] | None]
    kinds: tuple[str, ...]


class Lexers(dict[int, Lexer]):
    """The lexer of each state, compiled when the parser first stands there: most texts never reach most of them, and to
    compile them all took as long as to read a small policy.
    """

    def __init__(self, raw: dict[str, Any]) -> None:
        super().__init__()
        self._raw = raw
        self._kinds = tuple(kind for kind, _ in raw["patterns"])
        self._known: dict[tuple[str, ...], Lexer] = {}

    def __missing__(self, state: int) -> Lexer:
        row = self._raw["states"][state]
        found = self[state] = self.accepting(tuple(kind for kind in self._kinds if kind in row))
        return found

    @property
    def any(self) -> Lexer:
        """Reads every kind of token."""
        return self.accepting(self._kinds)

    def accepting(self, kinds: tuple[str, ...]) -> Lexer:
        """Reads words, marks, and tokens of these kinds; states that accept the same share it."""
        if kinds not in self._known:
            self._known[kinds] = _lexer(self._raw, kinds)
        return self._known[kinds]


@dataclass(frozen=True, slots=True)
class ParserTable:
    """One row a state: from a symbol to the next state (0 or more) or to the rule `~n` to reduce by (negative).

    A symbol is a word or mark as it is written (`deadline`, `{`), a kind of token (`<NAME>`), or a rule (`<skill>`).
    `words` says of each word of the language whether it may also be a name. `lexers` has one entry a state, `skip`
    matches what is ignored.
    """

    rows: tuple[Row, ...]
    rules: tuple[Production, ...]
    lexers: Lexers
    end: int
    words: dict[str, bool]
    skip: re.Pattern[str]

    def skipped(self, text: str, offset: int) -> int:
        """Where the comments and blanks end that begin at a place; a lexer skips at most `MAX_SKIPPED` of them."""
        while (found := self.skip.match(text, offset)) and found.end() > offset:
            offset = found.end()
        return offset


@cache
def table() -> ParserTable:
    """The committed table. Read once in a process, in a few milliseconds."""
    raw = json.loads(PATH.read_text(encoding="utf-8"))
    return ParserTable(
        rows=tuple(raw["states"]),
        rules=tuple(Production(origin, action, length, tuple(kept)) for origin, action, length, kept in raw["rules"]),
        lexers=Lexers(raw),
        end=raw["end"],
        words=raw["words"],
        skip=re.compile(_ignored(raw)),
    )


def _ignored(raw: dict[str, Any]) -> str:
    """Bounded, for each repetition of a group costs memory: `Automaton.run` goes on behind what one match skipped."""
    return f"(?>(?:{'|'.join(raw['ignored'])}){{0,{MAX_SKIPPED}}})"


def _lexer(raw: dict[str, Any], accepted: tuple[str, ...]) -> Lexer:
    patterns = dict(raw["patterns"])
    groups = [patterns[kind] for kind in accepted]
    groups.append("|".join([*map(re.escape, raw["marks"]), WORD]))
    pattern = _ignored(raw) + "(?:" + "|".join(f"({group})" for group in groups) + ")"
    return Lexer(re.compile(pattern).match, ("", *accepted, ""))
