"""Comments that ignore findings, and what is wrong with them (E1309 to E1311).

    // rtshcua: ignore E1304 because the authority's letter says 30 m
    // rtshcua: ignore-file naming, E1301 because the register gives the names

The first is about findings that begin on its line or, where its lines hold only comments, on the next line that holds
something else. The second is about the whole file, and must stand before its first declaration. Codes go by their id or
slug. A comment without a reason, or without a code that can be ignored, ignores nothing. Comments are read from the
text alone, since a text with errors has comments too; the formatter reads the same ones.
"""

import re
from bisect import bisect_left
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import REGISTRY, Code, Severity, can_be_ignored, code_named
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.project.strict_tables import is_reason

#: what a comment may ask for: about a line, or about the whole file
LINE, FILE = "ignore", "ignore-file"
#: what a comment holds that asks for anything
MARKER = "rtshcua:"

_COMMENT_TOKEN = re.compile(
    r'(?P<text>"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+){0,999}"?)|(?P<comment>//[^\n]*+|/\*.*?(?:\*/|\Z))|(?P<other>[^\s"/]++|/)',
    re.DOTALL,
)
#: what a comment asks of the tools, by what stands between its marks
_REQUEST = re.compile(r"\s*rtshcua:\s*(?P<word>[^\s,]*)(?P<rest>.*)", re.DOTALL)


class SourceComment(NamedTuple):
    """A comment with its marks, what stands between them, and whether a declaration stands before it.

    `alone` is whether nothing but comments stands on its lines; `about` is the line (from 1) that it speaks of: the one
    that it begins on, or, where it is alone, the next that has something else than comments.
    """

    span: Span
    inside: str
    offset: int  # of `inside` in the text
    alone: bool
    about: int
    begun: bool


def ignores_line(comment: str) -> bool:
    """Whether a comment, with its marks, ignores findings by the line."""
    if MARKER not in comment:
        return False
    request = _REQUEST.match(_inside(comment))
    return request is not None and request["word"] == LINE


def comments(source: Source, holding: str = "") -> Iterator[SourceComment]:
    """The comments of a text that hold another, in order: there may be millions, and few that ask for anything."""
    found: list[tuple[int, int, bool]] = []
    taken: list[int] = []  # lines that have something else
    begun = False
    for match in _COMMENT_TOKEN.finditer(source.text):
        if match["comment"] is not None:
            if holding in match["comment"]:
                found.append((*match.span(), begun))
            continue
        begun = True
        line = source.position(match.start()).line  # what is no comment stays on one line
        if not taken or taken[-1] != line:
            taken.append(line)
    for start, end, later in found:
        first, last = source.position(start).line, source.position(end).line
        after = bisect_left(taken, first)
        alone = after == len(taken) or taken[after] > last
        about = first if not alone else taken[after] if after < len(taken) else last + 1
        inside = _inside(source.text[start:end]).rstrip("\r")
        yield SourceComment(Span(source.file, start, end), inside, start + 2, alone, about, later)


def _inside(written: str) -> str:
    """What stands between the marks of a comment; a block at the end of a text may lack the second."""
    closed = written.startswith("/*") and written.endswith("*/") and len(written) >= 4
    return written[2:-2] if closed else written[2:]


_REASON = re.compile(r"(?:^|(?<=[\s,]))because(?!\S)")
_NAME = re.compile(r"[^\s,]+")
#: codes that one comment names; there are not that many
MOST_NAMES = 100
#: faults for which the nearest code is looked for: that takes long, and a file may have a hundred thousand
MOST_GUESSES = 1_000
_HELP = "write it as `// rtshcua: ignore E1304 because the authority's letter says 30 m`"


class Ignore(NamedTuple):
    """One code that a comment ignores: on one line (from 1), or in the whole file (None). `span` is the name of the
    code, `fix` what takes it out again.
    """

    code: Code
    line: int | None
    reason: str
    span: Span
    fix: Fix


class Ignores(NamedTuple):
    """What the comments of a file ignore, and what is wrong with them."""

    given: tuple[Ignore, ...]
    faults: tuple[Diagnostic, ...]


def ignores(source: Source) -> Ignores:
    """The ignores of a text."""
    if MARKER not in source.text:
        return Ignores((), ())
    faults: list[Diagnostic] = []
    given: list[Ignore] = []
    for comment in comments(source, MARKER):
        request = _REQUEST.match(comment.inside)
        if request is not None:
            given += _parse_ignore(source, comment, request, faults)
    return Ignores(tuple(given), tuple(faults))


def _parse_ignore(
    source: Source, comment: SourceComment, what: "re.Match[str]", faults: list[Diagnostic]
) -> Iterator[Ignore]:
    word = what["word"]
    if word not in (LINE, FILE):
        near = nearest(word, (LINE, FILE))
        help = _HELP if near is None else f"did you mean `{near}`?"
        faults.append(
            Diagnostic(codes.UNKNOWN_IGNORE, f"`{word}` is nothing that a comment can ask for", comment.span, help)
        )
        return
    start = comment.offset + what.start("rest")
    found = _REASON.search(what["rest"])
    written = what["rest"] if found is None else what["rest"][: found.start()]
    reason = "" if found is None else " ".join(what["rest"][found.end() :].split())
    if len([*islice(_NAME.finditer(written), MOST_NAMES + 1)]) > MOST_NAMES:
        message = f"this names more than {MOST_NAMES} codes, so it ignores nothing"
        faults.append(Diagnostic(codes.UNKNOWN_IGNORE, message, comment.span, _HELP))
        return
    names = [(each[0], Span(source.file, start + each.start(), start + each.end())) for each in _NAME.finditer(written)]
    if not is_reason(reason):
        faults.append(_without_reason(comment))
        return
    if not names:
        faults.append(Diagnostic(codes.UNKNOWN_IGNORE, "this names no code to ignore", comment.span, _HELP))
    if word == FILE and comment.begun:
        message = f"`{FILE}` stands behind the first declaration, so it ignores nothing"
        faults.append(Diagnostic(codes.UNUSED_IGNORE, message, comment.span, "put it before the first declaration"))
        return
    for at, (name, span) in enumerate(names):
        code = code_named(name)
        if code is None or not can_be_ignored(code):
            faults.append(_unknown_ignore(name, code, span, guess=len(faults) < MOST_GUESSES))
        else:
            yield Ignore(
                code, None if word == FILE else comment.about, reason, span, _removal(source, comment, names, at)
            )


def _without_reason(comment: SourceComment) -> Diagnostic:
    message = "this does not say why, so it ignores nothing"
    return Diagnostic(codes.IGNORE_WITHOUT_REASON, message, comment.span, "end it with `because ...`")


def _unknown_ignore(name: str, code: Code | None, span: Span, *, guess: bool) -> Diagnostic:
    if code is not None:
        why = "is an error, and errors cannot be ignored"
        if code.severity is not Severity.ERROR:
            why = "is about ignores themselves, and cannot be ignored"
        return Diagnostic(codes.UNKNOWN_IGNORE, f"`{name}` {why}", span, "remove it, and correct what it is about")
    near = None
    if guess:
        can = [code for code in REGISTRY.values() if can_be_ignored(code)]
        near = nearest(name, [*(code.id for code in can), *(code.slug for code in can)])
    help = "codes are written as `E1304` or `repeated-number`" if near is None else f"did you mean `{near}`?"
    fixes = () if near is None else (Fix(span, near, f"write `{near}`"),)
    return Diagnostic(codes.UNKNOWN_IGNORE, f"there is no code `{name}`", span, help, fixes=fixes)


def _removal(source: Source, comment: SourceComment, names: list[tuple[str, Span]], at: int) -> Fix:
    """Take one code out of a comment; with the last one the comment goes, and its line if nothing else stands there."""
    text, span = source.text, names[at][1]
    if len(names) > 1:
        start, end = (span.start, names[at + 1][1].start) if at == 0 else (names[at - 1][1].end, span.end)
        return Fix(Span(source.file, start, end), "", f"take `{names[at][0]}` out", Applicability.SAFE)
    start, end = comment.span.start, comment.span.end
    while start and text[start - 1] in " \t":
        start -= 1
    behind = end
    while behind < len(text) and text[behind] in " \t\r":
        behind += 1
    if (not start or text[start - 1] == "\n") and (behind == len(text) or text[behind] == "\n"):
        end = min(behind + 1, len(text))
    return Fix(Span(source.file, start, end), "", "delete the comment", Applicability.SAFE)


def unused_ignore(ignore: Ignore) -> Diagnostic:
    """The finding on an ignore that ignores nothing."""
    where = "in this file" if ignore.line is None else "there"
    message = f"nothing of `{ignore.code.id}` ({ignore.code.slug}) is found {where}, so this ignores nothing"
    return Diagnostic(codes.UNUSED_IGNORE, message, ignore.span, ignore.fix.title, fixes=(ignore.fix,))
