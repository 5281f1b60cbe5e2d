"""Says what does not fit, what would, and where there is one, the change that would make it fit."""

import re

from rtshcua.diagnostics.codes import SYNTAX, UNCLOSED
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.automaton import Automaton, Failure
from rtshcua.ground.language.expected import (
    ARITHMETIC,
    CONDITION,
    SHAPE,
    accepted,
    beginnings,
    describe,
    parts,
    phrase,
    words,
)
from rtshcua.ground.language.habits import habit, last_word
from rtshcua.ground.language.recovery import at_line_start, open_braces, owner, pending
from rtshcua.ground.language.table import END, NAME
from rtshcua.ground.language.wording import SHOWN, short

#: Characters and words of other notations, and what stands for them here.
FOREIGN = {
    "≤": "<=", "≥": ">=", "≠": "!=", "–": "-", "−": "-", "×": "*", "÷": "/", "“": '"', "”": '"', "'": '"', "‘": '"',
    "’": '"', "#": "//", "&": "and", "&&": "and", "|": "or", "||": "or", "!": "not", "…": "..",
}  # fmt: skip

LISTED = 20  # words that a help lists


def explain(automaton: Automaton, failure: Failure) -> Diagnostic:
    """The finding for the token that stopped the parser. The stacks must be as `Automaton.run` left them."""
    if not failure.kind:
        return _foreign(automaton, failure)
    span = Span(automaton.source.file, failure.start, failure.end)
    symbols = accepted(automaton)
    found = automaton.source.slice(span)
    if "}" in symbols and (failure.kind == END or _begins_declaration(automaton, failure, found)):
        return _unclosed_block(automaton, span, found)
    shown = f"`{short(found)}`" if found else "the end of the file"
    message = f"found {shown}, expected {describe(automaton, symbols)}"
    known = habit(automaton, failure, symbols)
    if known is not None:
        place, message = (span, message) if known.at is None else known.at
        return Diagnostic(SYNTAX, message, place, known.help, fixes=() if known.fix is None else (known.fix,))
    if ".." in symbols and symbols & ARITHMETIC:
        at = _in(automaton)
        if at is not None:
            return _not_in_range(automaton, span, at)
    if found == "not" and symbols & CONDITION:
        return Diagnostic(SYNTAX, message, span, "put it in brackets, as in `(not a > b)`")
    if NAME in symbols and automaton.table.words.get(found) is False:
        return Diagnostic(SYNTAX, f"`{found}` is a reserved word, so it is no name", span, "choose another name")
    if found == "{" and symbols == {"("}:
        insert = Fix(Span(span.file, span.start, span.start), "() ", "write `()`")
        begun = pending(automaton)
        what = "template" if begun is not None and begun[0] == "template" else "skill"
        return Diagnostic(SYNTAX, message, span, f"a {what} that takes nothing is written with `()`", fixes=(insert,))
    meant = _meant(found, symbols)
    if meant is not None:
        fix = Fix(span, meant, f"write `{meant}`")
        return Diagnostic(SYNTAX, message, span, f"did you mean `{meant}`?", fixes=(fix,))
    help = _help(automaton, failure, symbols)
    if "\n" in automaton.source.text[automaton.end : failure.start] and not _may_end(automaton, symbols):
        return _broken_off(automaton, span, shown, symbols, help)
    return Diagnostic(SYNTAX, message, span, help)


def _may_end(automaton: Automaton, symbols: set[str]) -> bool:
    """Whether what was begun could be over, so that what follows on another line is itself at fault."""
    return "}" in symbols or beginnings(automaton) <= symbols or bool(parts(automaton, symbols))


def _broken_off(automaton: Automaton, span: Span, shown: str, symbols: set[str], help: str | None) -> Diagnostic:
    """A line ends before what it begins; the finding is there, not on the line that follows."""
    last = last_word(automaton)
    text = short(automaton.source.slice(last))
    labels = (Label(span, f"found {shown}"),) if span.start < span.end else ()
    message = f"expected {describe(automaton, symbols)} after `{text}`"
    fixes: tuple[Fix, ...] = ()
    if symbols == {"("}:
        help = "what takes nothing is written with `()`"
        fixes = (Fix(Span(last.file, last.end, last.end), "()", "write `()`"),)
    return Diagnostic(SYNTAX, message, last, help, labels, fixes)


def _in(automaton: Automaton) -> int | None:
    """Where the `in` stands after which a single value was read."""
    for value, start in zip(reversed(automaton.values[-3:]), reversed(automaton.starts[-3:]), strict=True):
        if value == "in":
            return start
    return None


def _not_in_range(automaton: Automaton, span: Span, at: int) -> Diagnostic:
    """`position in city`, `gps.fix in fix_3d`."""
    word = Span(span.file, at, at + len("in"))
    inside = Fix(word, "inside", "write `inside`")
    return Diagnostic(
        SYNTAX,
        "`in` is followed by a range, or by names in `{ }`",
        word,
        "a place is `inside` a zone; a number is `in 5 m .. 20 m`, a name `in {fix_2d, fix_3d}`",
        labels=(Label(span, "before this, `..` is missing"),) if span.start < span.end else (),
        fixes=(inside,) if re.search(r"\bposition\s+\Z", automaton.source.text[:at][-40:]) else (),
    )


def _meant(found: str, symbols: set[str]) -> str | None:
    """The word or mark that the author probably meant."""
    if found in ("=", "==") and symbols & {"=", "<COMPARE>"}:
        return "==" if found == "=" else "="
    known = words(symbols) - {found}
    return nearest(found, known) if found[:1].isalpha() and len(found) <= SHOWN else None


def _help(automaton: Automaton, failure: Failure, symbols: set[str]) -> str | None:
    if failure.kind == "<COMPARE>" and "+" in symbols:
        return "comparisons are not chained: write `height in 5 m .. 10 m`, or join two by `and`"
    begin = beginnings(automaton)
    if begin <= symbols:
        return f"declarations begin with {_listed(begin)}"
    items = parts(automaton, symbols)
    whose = owner(automaton)
    if len(items) > 3 and whose is not None:
        return f"parts of a {whose[0]} begin with {_listed({phrase(automaton, item) for item in items})}"
    if "the" in symbols or symbols == {"last"}:
        return "a look back is written as in `for the last 3 s` or `within the last 3 s`"
    if symbols in ({"N", "S"}, {"E", "W"}):
        return "a place is its latitude and longitude, as in `47.3977 N, 8.5456 E`"
    if automaton.source.slice(Span(automaton.source.file, failure.start, failure.end)) in words(symbols):
        return "its parts go in `(` and `)`"
    if symbols >= SHAPE:
        return f"shapes are {_listed(words(SHAPE))}"
    return None


def _listed(words: set[str]) -> str:
    return ", ".join(f"`{word}`" for word in sorted(words)[:LISTED])


def _begins_declaration(automaton: Automaton, failure: Failure, word: str) -> bool:
    return word in beginnings(automaton) and at_line_start(automaton.source, failure.start)


def _unclosed_block(automaton: Automaton, span: Span, found: str) -> Diagnostic:
    at = open_braces(automaton)[-1]
    brace = Span(span.file, automaton.starts[at], automaton.starts[at] + 1)
    whose = owner(automaton)
    what = f"{whose[0]} `{short(whose[1].text)}`" if whose is not None and whose[1] is not None else "block"
    where = "the next declaration begins here" if found else "the file ends here"
    return Diagnostic(
        UNCLOSED,
        f"this `{{` of the {what} is not closed",
        brace,
        "add the missing `}`",
        labels=(Label(span, where),),
        fixes=(Fix(Span(span.file, span.start, span.start), "}\n", "add `}`"),),
    )


def _foreign(automaton: Automaton, failure: Failure) -> Diagnostic:
    """A character at which no token begins."""
    source, start = automaton.source, failure.start
    text, file = source.text, source.file
    char = text[start]
    if char == '"':
        line = re.compile(r"[^\r\n]*").match(text, start)
        end = line.end() if line else start + 1
        return Diagnostic(
            UNCLOSED, "this text is not closed on its line", Span(file, start, end),
            'a text goes from `"` to `"`; within it write `\\"` and `\\\\`',
        )  # fmt: skip
    if text.startswith("/*", start):
        return Diagnostic(UNCLOSED, "this comment is not closed", Span(file, start, start + 2), "close it by `*/`")
    twice = text[start : start + 2]
    written = twice if twice in FOREIGN else char
    span = Span(file, start, start + len(written))
    shown = f"`{written}`" if written.isprintable() and not written.isspace() else f"the character U+{ord(char):04X}"
    other = FOREIGN.get(written)
    if other is not None and (other != '"' or "<STRING>" in accepted(automaton)):
        fix = Fix(span, other, f"write `{other}`")
        return Diagnostic(SYNTAX, f"{shown} is not used here", span, f"write `{other}`", fixes=(fix,))
    if char == ";":
        fix = Fix(span, "", "leave it out")
        return Diagnostic(SYNTAX, "nothing ends with `;` here", span, "leave it out", fixes=(fix,))
    symbols = accepted(automaton)
    message = f"found {shown}, expected {describe(automaton, symbols)}"
    help = "names are of the letters `a` to `z`, digits and `_`" if char.isalpha() or NAME in symbols else None
    return Diagnostic(SYNTAX, message, span, help or _help(automaton, failure, symbols))
