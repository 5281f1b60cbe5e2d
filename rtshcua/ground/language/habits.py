"""What people write who know other notations, where the parser stops: what it is called here, and the change."""

import re
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.automaton import Automaton, Failure
from rtshcua.ground.language.expected import words
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
