"""Explain a syntax error: what was found, what is accepted, and the nearest correction.

`recognise` knows notations of other languages.
"""

import re
from typing import Any, NamedTuple

from rtshcua.diagnostics.codes import SYNTAX, UNCLOSED
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.excerpt import SHOWN, short
from rtshcua.diagnostics.span import Source, Span
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

#: Words of other languages, and the keywords with the same meaning.
WORDS = {
    "allow": "permit", "grant": "permit", "accept": "permit", "deny": "forbid", "prohibit": "forbid", "block": "forbid",
    "reject": "forbid", "disallow": "forbid", "if": "when", "where": "when", "is": "==", "equals": "==",
    "assert": "expect", "then": "expect", "should": "expect", "set": "given", "let": "given", "do": "when",
    "cases": "table", "permit": "allow", "forbid": "deny", "setup": "nominal",
}  # fmt: skip

#: Names of altitude datums on charts.
DATUMS = {"agl": "above home", "ahl": "above home", "amsl": "above sea", "msl": "above sea", "asl": "above sea"}

#: the help for a missing string after these keywords
TEXTS = {
    "test": 'a test has a quoted name, as in `test "low battery" { ... }`',
    "scenario": 'a scenario has a quoted name, as in `scenario "gust at the bridge" { ... }`',
    "at": 'write a moment as in `at "2026-06-01T08:00:00Z"`',
}
_IS = re.compile(r"\bis\s+\Z")
_KEYWORD = re.compile(r"\b(import|test|scenario|at)\s+\Z")

_EXPONENT = re.compile(r"(?<![A-Za-z0-9_.])[0-9][0-9_.]*[eE][0-9]*\s*\Z")
_SIGNED = re.compile(r"-\s*([0-9][0-9_.]*)\s*([NSEW])\b")
_LETTER_FIRST = re.compile(r"[NSEW][0-9]*")
_COORDINATES = "write latitude and longitude as in `47.3977 N, 8.5456 E`"
_OPPOSITE = {"N": "S", "S": "N", "E": "W", "W": "E"}
_NAMELESS = re.compile(r"\bproposed\s+by\s+(agent|operator)\s+(for\s+)\Z")
_BARE = re.compile(r"([0-9][0-9_.]*)\s+(?:by|focal|pixels)\s+\Z")
_FILE = re.compile(r"<([^<>\"\n]*)>|([^\s\"<>]+)")
_LAST = re.compile(r"[A-Za-z0-9_.]+\Z|\S\Z")
LOOK_BACK = 80  # characters before a failure that are searched for the keyword of an unfinished part


class Advice(NamedTuple):
    """A help, a fix if there is one, and the span and message of the finding if they are not those of the token."""

    help: str
    fix: Fix | None = None
    at: tuple[Span, str] | None = None


class Stop(NamedTuple):
    """Where the parser stopped: the token that does not fit, the text before it, and the symbols that would fit."""

    source: Source
    span: Span
    found: str
    before: str
    symbols: set[str]


def recognise(stop: Stop, values: list[Any]) -> Advice | None:
    """Return the advice for a notation of other languages; `values` is the stack of the parser."""
    return (
        _string(stop)
        or _equality(stop)
        or _other_word(stop)
        or _missing_role(stop, values)
        or _proposer(stop)
        or _length(stop)
        or _number(stop)
    )


def _string(stop: Stop) -> Advice | None:
    keyword = _KEYWORD.search(stop.before) if stop.symbols == {"<STRING>"} else None
    if keyword is None:
        return None
    return _import(stop) if keyword[1] == "import" else Advice(TEXTS[keyword[1]])


def _import(stop: Stop) -> Advice:
    help = 'write the file name in quotes, as in `import "lib:skills/goto.rts"`'
    named = _FILE.match(stop.source.text, stop.span.start)
    if named is None or "\\" in named[0]:
        return Advice(help)
    quoted = f'"{named[1] or named[2] or ""}"'
    return Advice(help, Fix(stop.span._replace(end=named.end()), quoted, f"write `{quoted}`"))


def _equality(stop: Stop) -> Advice | None:
    """`is` and `=` as comparisons."""
    if stop.symbols == {"known"} and (found := _IS.search(stop.before)):
        start = stop.span.start - len(found[0])
        fix = Fix(Span(stop.span.file, start, start + len("is")), "==", "write `==`")
        return Advice("did you mean `==`? `is` is only used in `is known`", fix)
    if stop.found == "=" and stop.before[-1:] == "=" and "<NUMBER>" in stop.symbols:
        return Advice("assign a value with a single `=`", Fix(stop.span, "", "write a single `=`"))
    return None


def _other_word(stop: Stop) -> Advice | None:
    """A word of another language, or a fault without parentheses."""
    span, found, symbols = stop.span, stop.found, stop.symbols
    if "<FAULT>" in symbols and found.replace("_", "-") in KINDS:
        fix = Fix(span._replace(start=span.end), "()", "write `()`")
        return Advice(f"a fault needs parentheses, as in `{found}(...)`", fix)
    datum = DATUMS.get(found.casefold()) if "above" in symbols else None
    meant = "=" if found == ":" and "=" in symbols else WORDS.get(found)
    if datum or meant in words(symbols) | symbols or (meant == "==" and "<COMPARE>" in symbols):
        return Advice(f"did you mean `{datum or meant}`?", Fix(span, str(datum or meant), f"write `{datum or meant}`"))
    return None


def _missing_role(stop: Stop, values: list[Any]) -> Advice | None:
    """`permit goto when ...`, without `by`."""
    if stop.found != "when" or stop.symbols != {"by"}:
        return None
    fix = Fix(stop.span._replace(end=stop.span.start), "by any ", "write `by any`") if "forbid" in values else None
    return Advice("add the role: `by role operator when ...` for one role, `by any when ...` for all", fix)


def _proposer(stop: Stop) -> Advice | None:
    """`proposed by operator for role operator`: `for` was read as the name."""
    nameless = _NAMELESS.search(stop.before) if stop.found == "role" else None
    if nameless is None:
        return None
    start = stop.span.start - len(nameless[2])
    at = Span(stop.span.file, start, start + len("for")), f"expected the name of the proposer after `{nameless[1]}`"
    return Advice(f"write who proposes, as in `proposed by {nameless[1]} ada for role operator`", at=at)


def _length(stop: Stop) -> Advice | None:
    """A length of a camera without its unit: the next word was read as the unit."""
    bare = _BARE.search(stop.before) if stop.symbols & {"by", "focal", "pixels"} else None
    if bare is None:
        return None
    start = stop.span.start - len(bare[0])
    at = Span(stop.span.file, start, start + len(bare[1])), f"`{bare[1]}` has no unit"
    return Advice(f"write `{bare[1]} mm`", at=at)


def _number(stop: Stop) -> Advice | None:
    """A coordinate with a sign or with its letter first, an exponent or a decimal comma."""
    source, span, found = stop.source, stop.span, stop.found
    if found == "-":
        return _signed(source, span)
    power = _EXPONENT.search(stop.before)
    if power is not None and (found[:1].isalnum() or found in ("%", "+")):
        number = power[0].rstrip()
        start = span.start - len(power[0])
        at = Span(span.file, start, start + len(number)), f"`{number}` is not a number: exponents are not supported"
        return Advice("write all digits, which `_` may group, as in `20_000 m`", at=at)
    if "<NUMBER>" in stop.symbols and _LETTER_FIRST.fullmatch(found):
        return Advice(_COORDINATES)
    if found == "," and re.match(r"\d", source.text[span.end :][:1]) and stop.before[-1:].isdigit():
        return Advice("use a decimal point, as in `20.5 m`", Fix(span, ".", "write a point"))
    return None


def _signed(source: Source, span: Span) -> Advice | None:
    """A latitude or a longitude with a sign."""
    signed = _SIGNED.match(source.text, span.start)
    if signed is None:
        return None
    plain = f"{signed[1]} {_OPPOSITE[signed[2]]}"
    help = f"coordinates have no sign: write `{plain}` or `{signed[1]} {signed[2]}`"
    return Advice(help, Fix(span._replace(end=signed.end()), plain, f"write `{plain}`"))


def last_word(automaton: Automaton) -> Span:
    """The last token that the parser shifted."""
    text, end = automaton.source.text, automaton.end
    found = _LAST.search(text[max(0, end - LOOK_BACK) : end])
    return Span(automaton.source.file, end - len(found[0]) if found else end, end)


#: Characters of other languages, and their replacements.
FOREIGN = {
    "≤": "<=", "≥": ">=", "≠": "!=", "–": "-", "−": "-", "×": "*", "÷": "/", "“": '"', "”": '"', "'": '"', "‘": '"',
    "’": '"', "#": "//", "&": "and", "&&": "and", "|": "or", "||": "or", "!": "not", "…": "..",
}  # fmt: skip

LISTED = 20  # the most words in a help


def explain(automaton: Automaton, failure: Failure) -> Diagnostic:
    """Return the finding for the token that stopped the parser; its stacks must be as `Automaton.run` left them."""
    if not failure.kind:
        return _foreign(automaton, failure)
    source = automaton.source
    span = Span(source.file, failure.start, failure.end)
    symbols = accepted(automaton)
    found = source.slice(span)
    if "}" in symbols and (failure.kind == END or _begins_declaration(automaton, failure, found)):
        return _unclosed_block(automaton, span, found)
    shown = f"`{short(found)}`" if found else "the end of the file"
    message = f"found {shown}, expected {describe(automaton, symbols)}"
    stop = Stop(source, span, found, source.text[max(0, failure.start - LOOK_BACK) : failure.start], symbols)
    advice = recognise(stop, automaton.values)
    at = _in(automaton, symbols)
    if advice is None and at is not None:
        return _not_in_range(automaton, span, at)
    advice = advice or _correction(automaton, stop)
    if advice is not None:
        place, message = advice.at or (span, message)
        return Diagnostic(SYNTAX, message, place, advice.help, fixes=(advice.fix,) if advice.fix else ())
    help = _help(automaton, failure, symbols)
    if "\n" in source.text[automaton.end : failure.start] and not _may_end(automaton, symbols):
        return _broken_off(automaton, span, shown, symbols, help)
    return Diagnostic(SYNTAX, message, span, help)


def _correction(automaton: Automaton, stop: Stop) -> Advice | None:
    """The nearest correction of a misplaced or misspelt word."""
    span, found, symbols = stop.span, stop.found, stop.symbols
    if found == "not" and symbols & CONDITION:
        return Advice("put it in parentheses, as in `(not a > b)`")
    if NAME in symbols and automaton.table.words.get(found) is False:
        return Advice("choose another name", at=(span, f"`{found}` is a reserved word and cannot be a name"))
    if found == "{" and symbols == {"("}:
        begun = pending(automaton)
        what = "template" if begun is not None and begun[0] == "template" else "skill"
        fix = Fix(span._replace(end=span.start), "() ", "write `()`")
        return Advice(f"a {what} without parameters needs `()`", fix)
    meant = _meant(found, symbols)
    return None if meant is None else Advice(f"did you mean `{meant}`?", Fix(span, meant, f"write `{meant}`"))


def _may_end(automaton: Automaton, symbols: set[str]) -> bool:
    """Whether the current part may end here, so that the error is on the next line."""
    return "}" in symbols or beginnings(automaton) <= symbols or bool(parts(automaton, symbols))


def _broken_off(automaton: Automaton, span: Span, shown: str, symbols: set[str], help: str | None) -> Diagnostic:
    """An unfinished line: the finding is at its end, not on the next line."""
    last = last_word(automaton)
    text = short(automaton.source.slice(last))
    labels = (Label(span, f"found {shown}"),) if span.start < span.end else ()
    message = f"expected {describe(automaton, symbols)} after `{text}`"
    fixes: tuple[Fix, ...] = ()
    if symbols == {"("}:
        help = "write `()` where there are no arguments"
        fixes = (Fix(Span(last.file, last.end, last.end), "()", "write `()`"),)
    return Diagnostic(SYNTAX, message, last, help, labels, fixes)


def _in(automaton: Automaton, symbols: set[str]) -> int | None:
    """The offset of an `in` that is followed by a single value instead of a range."""
    if ".." not in symbols or not symbols & ARITHMETIC:
        return None
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
        "expected a range or names in `{ }` after `in`",
        word,
        "write `inside` for a zone, `in 5 m .. 20 m` for a range, `in {fix_2d, fix_3d}` for names",
        labels=(Label(span, "`..` is missing before this"),) if span.start < span.end else (),
        fixes=(inside,) if re.search(r"\bposition\s+\Z", automaton.source.text[:at][-40:]) else (),
    )


def _meant(found: str, symbols: set[str]) -> str | None:
    """The keyword or mark that is most similar to `found`."""
    if found in ("=", "==") and symbols & {"=", "<COMPARE>"}:
        return "==" if found == "=" else "="
    known = words(symbols) - {found}
    return nearest(found, known) if found[:1].isalpha() and len(found) <= SHOWN else None


def _help(automaton: Automaton, failure: Failure, symbols: set[str]) -> str | None:
    if failure.kind == "<COMPARE>" and "+" in symbols:
        return "comparisons cannot be chained: write `height in 5 m .. 10 m`, or join two with `and`"
    begin = beginnings(automaton)
    if begin <= symbols:
        return f"a declaration begins with {_listed(begin)}"
    items = parts(automaton, symbols)
    whose = owner(automaton)
    if len(items) > 3 and whose is not None:
        return f"a part of a {whose[0]} begins with {_listed({phrase(automaton, item) for item in items})}"
    if "the" in symbols or symbols == {"last"}:
        return "write a time window as in `for the last 3 s` or `within the last 3 s`"
    if symbols in ({"N", "S"}, {"E", "W"}):
        return _COORDINATES
    if automaton.source.slice(Span(automaton.source.file, failure.start, failure.end)) in words(symbols):
        return "write its arguments in parentheses"
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
        f"the `{{` of the {what} is not closed",
        brace,
        "add the missing `}`",
        labels=(Label(span, where),),
        fixes=(Fix(Span(span.file, span.start, span.start), "}\n", "add `}`"),),
    )


def _foreign(automaton: Automaton, failure: Failure) -> Diagnostic:
    """A character that starts no token."""
    source, start = automaton.source, failure.start
    text, file = source.text, source.file
    char = text[start]
    if char == '"':
        line = re.compile(r"[^\r\n]*").match(text, start)
        end = line.end() if line else start + 1
        return Diagnostic(
            UNCLOSED, "the string is not closed on its line", Span(file, start, end),
            'close it with `"`; inside a string write `\\"` for a quote and `\\\\` for a backslash',
        )  # fmt: skip
    if text.startswith("/*", start):
        return Diagnostic(UNCLOSED, "the comment is not closed", Span(file, start, start + 2), "close it with `*/`")
    twice = text[start : start + 2]
    written = twice if twice in FOREIGN else char
    span = Span(file, start, start + len(written))
    shown = f"`{written}`" if written.isprintable() and not written.isspace() else f"the character U+{ord(char):04X}"
    other = FOREIGN.get(written)
    if other is not None and (other != '"' or "<STRING>" in accepted(automaton)):
        fix = Fix(span, other, f"write `{other}`")
        return Diagnostic(SYNTAX, f"{shown} is not part of the language", span, f"write `{other}`", fixes=(fix,))
    if char == ";":
        fix = Fix(span, "", "remove it")
        return Diagnostic(SYNTAX, "`;` is not part of the language", span, "remove it", fixes=(fix,))
    symbols = accepted(automaton)
    message = f"found {shown}, expected {describe(automaton, symbols)}"
    help = "names consist of the letters `a` to `z`, digits and `_`" if char.isalpha() or NAME in symbols else None
    return Diagnostic(SYNTAX, message, span, help or _help(automaton, failure, symbols))
