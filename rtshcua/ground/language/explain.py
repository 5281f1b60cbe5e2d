"""Says what does not fit, what would, and where there is one, the change that would make it fit.

`habit` knows what people write who know other notations.
"""

import re
from typing import NamedTuple

from rtshcua.diagnostics.codes import SYNTAX, UNCLOSED
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.excerpt import SHOWN, short
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
from rtshcua.ground.language.recovery import at_line_start, open_braces, owner, pending
from rtshcua.ground.language.table import END, NAME
from rtshcua.model.faults import KINDS

#: Words of other policies and programs, and those that mean the same here.
WORDS = {
    "allow": "permit", "grant": "permit", "accept": "permit", "deny": "forbid", "prohibit": "forbid", "block": "forbid",
    "reject": "forbid", "disallow": "forbid", "if": "when", "where": "when", "is": "==", "equals": "==",
    "assert": "expect", "then": "expect", "should": "expect", "set": "given", "let": "given", "do": "when",
    "cases": "table", "permit": "allow", "forbid": "deny", "setup": "nominal",
}  # fmt: skip

#: What charts call the datum of an altitude.
DATUMS = {"agl": "above home", "ahl": "above home", "amsl": "above sea", "msl": "above sea", "asl": "above sea"}

#: what the texts are that stand behind these words
TEXTS = {
    "test": 'a test is called by a text, as in `test "low battery" { ... }`',
    "scenario": 'a scenario is called by a text, as in `scenario "gust at the bridge" { ... }`',
    "at": 'a moment is written as in `at "2026-06-01T08:00:00Z"`',
}
_IS = re.compile(r"\bis\s+\Z")
_TOLD = re.compile(r"\b(test|scenario|at)\s+\Z")

_EXPONENT = re.compile(r"(?<![A-Za-z0-9_.])[0-9][0-9_.]*[eE][0-9]*\s*\Z")
_SIGNED = re.compile(r"-\s*([0-9][0-9_.]*)\s*([NSEW])\b")
_OPPOSITE = {"N": "S", "S": "N", "E": "W", "W": "E"}
_FILE = re.compile(r"<([^<>\"\n]*)>|([^\s\"<>]+)")
_LAST = re.compile(r"[A-Za-z0-9_.]+\Z|\S\Z")
LOOK_BACK = 80  # characters before a failure that may tell what was begun


class Habit(NamedTuple):
    """What to say, the change that would make it fit, if there is one, and what is at fault, if not what was found."""

    help: str
    fix: Fix | None = None
    at: tuple[Span, str] | None = None  # and the message for it


def habit(automaton: Automaton, failure: Failure, symbols: set[str]) -> Habit | None:
    """The notation that the author probably had in mind."""
    source = automaton.source
    span = Span(source.file, failure.start, failure.end)
    found = source.slice(span)
    before = source.text[max(0, failure.start - LOOK_BACK) : failure.start]
    if symbols == {"<STRING>"} and re.search(r"\bimport\s+\Z", before):
        return _import(automaton, failure)
    if symbols == {"<STRING>"} and (told := _TOLD.search(before)):
        return Habit(TEXTS[told[1]])
    if symbols == {"known"} and (told := _IS.search(before)):
        word = Span(source.file, failure.start - len(told[0]), failure.start - len(told[0]) + len("is"))
        return Habit("did you mean `==`? `is` stands before `known` alone", Fix(word, "==", "write `==`"))
    if found == "=" and before[-1:] == "=" and "<NUMBER>" in symbols:
        return Habit("a value is given with one `=`", Fix(span, "", "write one `=`"))
    if "<FAULT>" in symbols and found.replace("_", "-") in KINDS:
        end = Span(source.file, failure.end, failure.end)
        return Habit(f"a fault is written with brackets, as in `{found}(...)`", Fix(end, "()", "write `()`"))
    meant = "=" if found == ":" and "=" in symbols else WORDS.get(found)
    if meant is not None and (
        meant in words(symbols) or meant in symbols or (meant == "==" and "<COMPARE>" in symbols)
    ):
        return Habit(f"did you mean `{meant}`?", Fix(span, meant, f"write `{meant}`"))
    datum = DATUMS.get(found.casefold())
    if datum is not None and "above" in symbols:
        return Habit(f"write `{datum}`", Fix(span, datum, f"write `{datum}`"))
    if found == "when" and symbols == {"by"}:
        return _by_whom(automaton, span)
    if found == "-":
        return _signed(automaton, failure)
    power = _EXPONENT.search(before)
    if power is not None and (found[:1].isalnum() or found in ("-", "%", "+")):
        number = power[0].rstrip()
        start = failure.start - len(power[0])
        at = Span(source.file, start, start + len(number)), f"`{number}` is not a number: there are no exponents"
        return Habit("write all digits, which `_` may group, as in `20_000 m`", at=at)
    if found == "," and re.match(r"\d", source.text[failure.end :][:1]) and before[-1:].isdigit():
        return Habit("decimals stand behind a point, as in `20.5 m`", Fix(span, ".", "write a point"))
    return None


def last_word(automaton: Automaton) -> Span:
    """The last word or mark that the parser took."""
    text, end = automaton.source.text, automaton.end
    found = _LAST.search(text[max(0, end - LOOK_BACK) : end])
    return Span(automaton.source.file, end - len(found[0]) if found else end, end)


def _import(automaton: Automaton, failure: Failure) -> Habit:
    help = 'a file is named in quotes, as in `import "lib:skills/goto.rts"`'
    named = _FILE.match(automaton.source.text, failure.start)
    if named is None or "\\" in named[0]:
        return Habit(help)
    quoted = f'"{named[1] or named[2] or ""}"'
    return Habit(help, Fix(Span(automaton.source.file, failure.start, named.end()), quoted, f"write `{quoted}`"))


def _by_whom(automaton: Automaton, span: Span) -> Habit:
    if "forbid" in automaton.values:
        insert = Fix(Span(span.file, span.start, span.start), "by any ", "write `by any`")
        return Habit("say to whom: `by any when ...` is for every role, `by role operator when ...` for one", insert)
    return Habit("say to whom: `by role operator when ...`, or `by any when ...` for every role")


def _signed(automaton: Automaton, failure: Failure) -> Habit | None:
    """A latitude or a longitude with a sign."""
    signed = _SIGNED.match(automaton.source.text, failure.start)
    if signed is None:
        return None
    plain = f"{signed[1]} {_OPPOSITE[signed[2]]}"
    span = Span(automaton.source.file, failure.start, signed.end())
    return Habit(
        f"a place has no sign: write `{plain}`, or `{signed[1]} {signed[2]}`", Fix(span, plain, f"write `{plain}`")
    )


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
