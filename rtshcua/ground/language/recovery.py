"""Error recovery: continue at the next part of the same block, at its end, or at the next declaration.

Parsing continues at a keyword at the start of a line that fits in the block or in the file, or at the closing brace of
the block. That token is shifted, so every recovery makes progress and parsing terminates for any text.
"""

import re

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.automaton import Automaton, Failure
from rtshcua.ground.language.table import Row
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.tests import Quoted

_SCAN = re.compile(
    r"""(?P<line>\n[ \t\r\f]*+) | //[^\n]*+ | /\*(?s:.)*?(?:\*/|\Z) | "[^"\\\n]*+(?:\\.[^"\\\n]*+){0,999}"?
      | (?P<word>[A-Za-z_][A-Za-z0-9_.]*+) | (?P<open>\{) | (?P<close>\})
      | [^\n/"A-Za-z_{}]++ | (?s:.)""",
    re.VERBOSE,
)
_NOT_BEGUN = re.compile(r"\s*[:=,(){]")  # follows a parameter or an argument, never the keyword of a declaration


def at_line_start(source: Source, offset: int) -> bool:
    """Whether only blanks precede `offset` on its line."""
    text = source.text
    while offset and text[offset - 1] in " \t\r\f":
        offset -= 1
    return not offset or text[offset - 1] == "\n"


def shifts(row: Row, word: str) -> bool:
    """Whether a state shifts `word` directly, without a reduction."""
    return row.get(word, -1) >= 0


def file_level(automaton: Automaton) -> int:
    """The number of states of the file itself: the first, and the list of declarations if there is one."""
    rows, states = automaton.table.rows, automaton.states
    return 2 if len(states) > 1 and shifts(rows[states[1]], "import") else 1


def pending(automaton: Automaton) -> tuple[str, Name | Quoted | None] | None:
    """The keyword of the incomplete declaration, and its name if it was read."""
    begun = automaton.values[file_level(automaton) - 1 :]
    if not begun:
        return None
    name = begun[1] if len(begun) > 1 and isinstance(begun[1], Name | Quoted) else None
    return str(begun[0]), name


def open_braces(automaton: Automaton) -> list[int]:
    """The indices of the open braces in the values, the innermost last."""
    found: list[int] = []
    for at, value in enumerate(automaton.values):
        if value == "{":
            found.append(at)
        elif value == "}":
            found.pop()
    return found


def owner(automaton: Automaton) -> tuple[str, Name | Quoted | None] | None:
    """The owner of the innermost open block, and its name: a phase, a step, or else the pending declaration."""
    values, braces = automaton.values, open_braces(automaton)
    inner = values[braces[0] + 1 : braces[-1]] if len(braces) > 1 else []
    while inner:
        if isinstance(inner[-1], Name):
            return ("phase" if "phase" in inner[-2:-1] else "step"), inner[-1]
        if inner[-1] in ("repeat", "table"):
            return inner[-1], None
        if inner[-1] == "in":
            break
        inner.pop()
    return pending(automaton)


def open_block(automaton: Automaton) -> tuple[int, int] | None:
    """The innermost open block: the index of the state that reads its next part, and the number of deeper braces."""
    rows, states = automaton.table.rows, automaton.states
    for depth, brace in enumerate(reversed(open_braces(automaton))):
        for at in (brace + 2, brace + 1):  # after the parts, or after the brace
            if at < len(states) and shifts(rows[states[at]], "}"):
                return at, depth
    return None


def misread(automaton: Automaton, failure: Failure) -> Failure:
    """Correct a failure after an unclosed block, where the keyword of the next declaration was read as a step's name.

    Then that keyword is the failure, and the stacks are unwound to before it.
    """
    word, at = (automaton.values[-1], automaton.starts[-1]) if automaton.values else ("", 0)
    begins = isinstance(word, str) and shifts(automaton.table.rows[0], word)
    named = automaton.source.text[failure.start : failure.start + 1]
    if begins and (named.isalpha() or named in ("_", '"')) and at_line_start(automaton.source, at):
        before = automaton.table.rows[automaton.states[-2]]
        if "}" in before and not shifts(before, word):
            _unwind(automaton, len(automaton.states) - 1, at)
            return Failure(at, at + len(word), word)
    return failure


def resume(automaton: Automaton, failed: int) -> int | None:
    """Unwind the stacks and return the offset to continue from; None if nothing after `failed` fits."""
    rows, states = automaton.table.rows, automaton.states
    text, base = automaton.source.text, file_level(automaton)
    block, depth = open_block(automaton) or (None, 0)
    fresh = at_line_start(automaton.source, failed)
    for token in _SCAN.finditer(text, failed):
        kind, start = token.lastgroup, token.start()
        if kind == "word" and fresh:
            word = token[0]
            if shifts(rows[states[base - 1]], word) and not _NOT_BEGUN.match(text, token.end()):
                return _unwind(automaton, base, start)
            if block is not None and depth == 0 and shifts(rows[states[block]], word):
                return _unwind(automaton, block + 1, start)
        elif kind == "open":
            depth += 1
        elif kind == "close":
            if depth == 0 and block is not None:
                return _unwind(automaton, block + 1, start)
            depth = max(0, depth - 1)
        fresh = kind == "line"
    return None


def _unwind(automaton: Automaton, keep: int, offset: int) -> int:
    """Keep `keep` states with their values and offsets, and return `offset`."""
    del automaton.states[keep:], automaton.values[keep - 1 :], automaton.starts[keep - 1 :]
    return offset
