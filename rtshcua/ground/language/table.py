"""The LALR table of the grammar, made by `generate`, in the form that the automaton uses."""

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
MAX_SKIPPED = 1000  # comments and runs of blanks per match

Row = dict[str, int]


class Production(NamedTuple):
    """A production: pop `length` values and pass those at `kept` to `action`; the result is an `origin`.

    `kept` lists positions; None is an absent optional part, and the complement `~n` is a list whose items are passed
    singly. Without an action the one kept value passes unchanged, or grows a list if the rule `repeats`.
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
    """Reads one token: `match(text, offset)` skips blanks and comments and matches the token after them.

    The match's `lastindex` is the token's group and the index of its kind in `kinds`. A keyword or a mark is its own
    kind: its entry is empty. There is no match at the end of the text, nor where no token starts.
    """

    match: Callable[[str, int], re.Match[str] | None]
    kinds: tuple[str, ...]


class Lexers(dict[int, Lexer]):
    """The lexer of each state, compiled on demand: most texts reach few states, and compiling all of them took as long
    as parsing a small policy.
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
        """The lexer for every kind of token."""
        return self.accepting(self._kinds)

    def accepting(self, kinds: tuple[str, ...]) -> Lexer:
        """The lexer for keywords, marks and these kinds of token, shared by states that accept the same kinds."""
        if kinds not in self._known:
            self._known[kinds] = _lexer(self._raw, kinds)
        return self._known[kinds]


@dataclass(frozen=True, slots=True)
class ParserTable:
    """One row per state: maps a symbol to the next state (0 or more) or to the rule `~n` to reduce by (negative).

    A symbol is a keyword or mark as written (`deadline`, `{`), a kind of token (`<NAME>`), or a rule (`<skill>`).
    `words` maps each keyword to whether it may also be a name. `lexers` has one entry per state; `skip` matches blanks
    and comments.
    """

    rows: tuple[Row, ...]
    rules: tuple[Production, ...]
    lexers: Lexers
    end: int
    words: dict[str, bool]
    skip: re.Pattern[str]

    def skipped(self, text: str, offset: int) -> int:
        """The end of the comments and blanks at `offset`; a lexer skips at most `MAX_SKIPPED` of them."""
        while (found := self.skip.match(text, offset)) and found.end() > offset:
            offset = found.end()
        return offset


@cache
def table() -> ParserTable:
    """The committed table, read once per process."""
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
    """The pattern of blanks and comments, bounded because each repetition of a group costs memory.

    `Automaton.run` skips the rest.
    """
    return f"(?>(?:{'|'.join(raw['ignored'])}){{0,{MAX_SKIPPED}}})"


def _lexer(raw: dict[str, Any], accepted: tuple[str, ...]) -> Lexer:
    patterns = dict(raw["patterns"])
    groups = [patterns[kind] for kind in accepted]
    groups.append("|".join([*map(re.escape, raw["marks"]), WORD]))
    pattern = _ignored(raw) + "(?:" + "|".join(f"({group})" for group in groups) + ")"
    return Lexer(re.compile(pattern).match, ("", *accepted, ""))
