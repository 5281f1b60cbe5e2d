"""Comments that ignore findings, and findings about these comments.

    // rtshcua: ignore E1304 because the authority's letter says 30 m
    // rtshcua: ignore-file naming, E1301 because the register gives the names

The first ignores findings that begin on its line. If its lines hold only comments, it ignores findings on the next line
that holds anything else. The second applies to the whole file and must precede the first declaration. A code is written
as its id or its slug. A comment without a reason, or without a code that can be ignored, has no effect. Comments are
read from the text, not from the syntax tree, so that sources with errors may have them too. The formatter reads the
same comments.
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

#: the directives of a comment, for one line and for the whole file
LINE, FILE = "ignore", "ignore-file"
#: the text that begins a directive
MARKER = "rtshcua:"

_COMMENT_TOKEN = re.compile(
    r'(?P<text>"[^"\\\n]*+(?:\\[^\n][^"\\\n]*+){0,999}"?)|(?P<comment>//[^\n]*+|/\*.*?(?:\*/|\Z))|(?P<other>[^\s"/]++|/)',
    re.DOTALL,
)
#: a directive, matched against the text between the comment's delimiters
_DIRECTIVE = re.compile(r"\s*rtshcua:\s*(?P<word>[^\s,]*)(?P<rest>.*)", re.DOTALL)


class SourceComment(NamedTuple):
    """A comment: its span with the delimiters, the text between them, and whether a declaration precedes it (`begun`).

    `alone` is whether its lines hold only comments. `about` is the line (from 1) that it applies to: its first line or,
    if it is alone, the next line that holds anything else.
    """

    span: Span
    inside: str
    offset: int  # of `inside` in the source
    alone: bool
    about: int
    begun: bool


def ignores_line(comment: str) -> bool:
    """Whether a comment, written with its delimiters, ignores findings on one line."""
    if MARKER not in comment:
        return False
    directive = _DIRECTIVE.match(_inside(comment))
    return directive is not None and directive["word"] == LINE


def comments(source: Source, holding: str = "") -> Iterator[SourceComment]:
    """Yield the comments that contain `holding`, in order. The filter saves time in sources with many comments."""
    found: list[tuple[int, int, bool]] = []
    taken: list[int] = []  # lines that hold more than comments
    begun = False
    for match in _COMMENT_TOKEN.finditer(source.text):
        if match["comment"] is not None:
            if holding in match["comment"]:
                found.append((*match.span(), begun))
            continue
        begun = True
        line = source.position(match.start()).line  # only a comment may span lines
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
    """The text between the delimiters of a comment. The closing one may be missing at the end of a source."""
    closed = written.startswith("/*") and written.endswith("*/") and len(written) >= 4
    return written[2:-2] if closed else written[2:]


_REASON = re.compile(r"(?:^|(?<=[\s,]))because(?!\S)")
_NAME = re.compile(r"[^\s,]+")
#: most codes that one comment may name, more than there are
MOST_NAMES = 100
#: most findings with a suggested code: the search is slow, and a file may have a hundred thousand unknown codes
MOST_GUESSES = 1_000
_HELP = "write it as `// rtshcua: ignore E1304 because the authority's letter says 30 m`"


class Ignore(NamedTuple):
    """A code that a comment ignores on one line (from 1), or in the whole file (None).

    `span` covers the name of the code; `fix` removes it.
    """

    code: Code
    line: int | None
    reason: str
    span: Span
    fix: Fix


class Ignores(NamedTuple):
    """The valid ignores of a file, and the findings about its comments."""

    valid: tuple[Ignore, ...]
    faults: tuple[Diagnostic, ...]


def ignores(source: Source) -> Ignores:
    """Read the comments of a source that ignore findings."""
    if MARKER not in source.text:
        return Ignores((), ())
    faults: list[Diagnostic] = []
    valid: list[Ignore] = []
    for comment in comments(source, MARKER):
        directive = _DIRECTIVE.match(comment.inside)
        if directive is not None:
            valid += _parse_ignore(source, comment, directive, faults)
    return Ignores(tuple(valid), tuple(faults))


def _parse_ignore(
    source: Source, comment: SourceComment, directive: "re.Match[str]", faults: list[Diagnostic]
) -> Iterator[Ignore]:
    word = directive["word"]
    if word not in (LINE, FILE):
        near = nearest(word, (LINE, FILE))
        help = _HELP if near is None else f"did you mean `{near}`?"
        faults.append(Diagnostic(codes.UNKNOWN_IGNORE, f"unknown directive `{word}`", comment.span, help))
        return
    start = comment.offset + directive.start("rest")
    found = _REASON.search(directive["rest"])
    written = directive["rest"] if found is None else directive["rest"][: found.start()]
    reason = "" if found is None else " ".join(directive["rest"][found.end() :].split())
    if len([*islice(_NAME.finditer(written), MOST_NAMES + 1)]) > MOST_NAMES:
        message = f"this names more than {MOST_NAMES} codes, so it has no effect"
        faults.append(Diagnostic(codes.UNKNOWN_IGNORE, message, comment.span, _HELP))
        return
    names = [(each[0], Span(source.file, start + each.start(), start + each.end())) for each in _NAME.finditer(written)]
    if not is_reason(reason):
        faults.append(_without_reason(comment))
        return
    if not names:
        faults.append(Diagnostic(codes.UNKNOWN_IGNORE, "this names no code to ignore", comment.span, _HELP))
    if word == FILE and comment.begun:
        message = f"`{FILE}` follows the first declaration, so it has no effect"
        faults.append(Diagnostic(codes.UNUSED_IGNORE, message, comment.span, "move it before the first declaration"))
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
    message = "this ignore gives no reason, so it has no effect"
    return Diagnostic(codes.IGNORE_WITHOUT_REASON, message, comment.span, "add the reason: `because ...`")


def _unknown_ignore(name: str, code: Code | None, span: Span, *, guess: bool) -> Diagnostic:
    if code is not None:
        why = "is an error, and errors cannot be ignored"
        if code.severity is not Severity.ERROR:
            why = "is a finding about ignores, and cannot be ignored"
        return Diagnostic(codes.UNKNOWN_IGNORE, f"`{name}` {why}", span, "remove it, and correct the finding")
    near = None
    if guess:
        can = [code for code in REGISTRY.values() if can_be_ignored(code)]
        near = nearest(name, [*(code.id for code in can), *(code.slug for code in can)])
    help = "write a code as `E1304` or `repeated-number`" if near is None else f"did you mean `{near}`?"
    fixes = () if near is None else (Fix(span, near, f"write `{near}`"),)
    return Diagnostic(codes.UNKNOWN_IGNORE, f"unknown code `{name}`", span, help, fixes=fixes)


def _removal(source: Source, comment: SourceComment, names: list[tuple[str, Span]], at: int) -> Fix:
    """A fix that removes one code from a comment. The last code takes the comment with it, and its line if empty."""
    text, span = source.text, names[at][1]
    if len(names) > 1:
        start, end = (span.start, names[at + 1][1].start) if at == 0 else (names[at - 1][1].end, span.end)
        return Fix(Span(source.file, start, end), "", f"remove `{names[at][0]}`", Applicability.SAFE)
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
    """The finding about an ignore that has no effect."""
    where = "in this file" if ignore.line is None else "on that line"
    message = f"there is no finding `{ignore.code.id}` ({ignore.code.slug}) {where}, so this ignore has no effect"
    return Diagnostic(codes.UNUSED_IGNORE, message, ignore.span, ignore.fix.title, fixes=(ignore.fix,))
