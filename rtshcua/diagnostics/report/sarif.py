"""Findings as SARIF 2.1.0 (OASIS standard, errata 01), for code scanning and editors.

Numbers in comments and docstrings are sections of the standard. Columns and offsets count characters (`columnKind`
`unicodeCodePoints`), lines end at a line feed, and ends are exclusive.
"""

import hashlib
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, Protocol
from urllib.parse import quote

from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.span import Source, Span

#: the base of relative file names
ROOT: Final = "SRCROOT"


def physical(span: Span, sources: Mapping[str, Source]) -> dict[str, Any]:
    """A physicalLocation (3.29)."""
    return {"artifactLocation": artifact(span.file), "region": region(span, sources.get(span.file))}


def region(span: Span, source: Source | None) -> dict[str, int]:
    """A region (3.30), by lines and columns and by offsets."""
    offsets = {"charOffset": span.start, "charLength": span.end - span.start}
    if source is None:
        return offsets
    start, end = source.position(span.start), source.position(span.end)
    return {
        "startLine": start.line,
        "startColumn": start.column,
        "endLine": end.line,
        "endColumn": end.column,
    } | offsets


def artifact(file: str) -> dict[str, str]:
    """An artifactLocation (3.4). A relative name stays relative: it is the same on every machine."""
    return {"uri": uri(file)} if file.startswith("/") else {"uri": uri(file), "uriBaseId": ROOT}


def uri(file: str) -> str:
    """The name as a URI reference (RFC 3986). Bytes that are not UTF-8 keep their value; a colon is escaped."""
    path = quote(file, safe="/", errors="surrogateescape")
    return f"file://{path}" if file.startswith("/") else path


#: name and version of the fingerprint (3.27.17); a change of its computation needs a new version
FINGERPRINT: Final = "findingInLine/v1"


def fingerprints(found: Iterable[Diagnostic], sources: Mapping[str, Source]) -> list[str]:
    """The fingerprint of each finding, in order: a digest of its code and the words of its line, and its number among
    equal ones in the same file.
    """
    seen: dict[tuple[str, str], int] = {}
    marks = []
    for diagnostic in found:
        file, words = "", diagnostic.pointer or ""
        if diagnostic.span is not None:
            file = diagnostic.span.file
            source = sources.get(file)
            if source is not None:
                line = source.line(source.position(diagnostic.span.start).line)
                words = f"{' '.join(line.split())}\n{' '.join(source.slice(diagnostic.span).split())}"
        digest = hashlib.sha256(f"{diagnostic.code.id}\n{words}".encode(errors="surrogatepass")).hexdigest()[:32]
        seen[file, digest] = seen.get((file, digest), 0) + 1
        marks.append(f"{digest}:{seen[file, digest]}")
    return marks


VERSION: Final = "2.1.0"
SCHEMA: Final = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
#: exit codes of a run that finished its work, with or without findings
_DONE = (ExitCode.OK, ExitCode.DIAGNOSTICS)


class CodePage(Protocol):
    """The page of a code in Markdown: `text` is the whole page, `what` the section on its meaning."""

    @property
    def text(self) -> str: ...
    @property
    def what(self) -> str: ...


class Ignored(NamedTuple):
    """A finding that the author ignores, the reason, and the place of the `ignore`; None if a configuration has it."""

    diagnostic: Diagnostic
    reason: str
    at: Span | None = None


def sarif(
    found: Iterable[Diagnostic],
    sources: Mapping[str, Source],
    *,
    version: str,
    code: ExitCode,
    ignored: Iterable[Ignored] = (),
    pages: Mapping[str, CodePage] | None = None,
    base: str | None = None,
) -> dict[str, Any]:
    """Return one run as a value for `json.dumps`.

    `version` is the version of rtshcua and `code` the exit code; `pages` has the page of each code by its id; `base` is
    the absolute folder that the names of sources are relative to. A finding without a place, as of an unreadable file,
    becomes a notification of the run (3.20.21).
    """
    each = [(diagnostic, None) for diagnostic in found] + [(one.diagnostic, one) for one in ignored]
    rules = list(dict.fromkeys(diagnostic.code for diagnostic, _ in each))
    index = {rule: number for number, rule in enumerate(rules)}
    placed = [pair for pair in each if _has_place(pair[0])]
    marks = fingerprints([diagnostic for diagnostic, _ in placed], sources)
    root: dict[str, Any] = {"description": {"text": "the folder in which the command ran"}}
    if base is not None:
        root = {"uri": uri(f"{base.rstrip('/')}/")} | root
    invocation: dict[str, Any] = {
        "executionSuccessful": code in _DONE,
        "exitCode": int(code),
        "exitCodeDescription": f"{code.slug}: {code.meaning}",
    }
    notified = [_notification(diagnostic, index) for diagnostic, _ in each if not _has_place(diagnostic)]
    if notified:
        invocation["toolExecutionNotifications"] = notified
    run = {
        "tool": {
            "driver": {
                "name": "rtshcua",
                "version": version,
                "semanticVersion": version,
                "rules": [_rule(rule, None if pages is None else pages.get(rule.id)) for rule in rules],
            }
        },
        "invocations": [invocation],
        "originalUriBaseIds": {ROOT: root},
        "columnKind": "unicodeCodePoints",
        "newlineSequences": ["\n"],
        "language": "en-GB",
        "results": [
            _result(diagnostic, reason, sources, index[diagnostic.code], mark)
            for (diagnostic, reason), mark in zip(placed, marks, strict=True)
        ],
    }
    return {"$schema": SCHEMA, "version": VERSION, "runs": [run]}


def _has_place(diagnostic: Diagnostic) -> bool:
    return diagnostic.span is not None or diagnostic.pointer is not None


def _rule(code: Code, page: CodePage | None) -> dict[str, Any]:
    """A reportingDescriptor (3.49). Its texts take no arguments, so braces are not escaped."""
    sentence = f"{code.meaning[:1].upper()}{code.meaning[1:]}."
    rule: dict[str, Any] = {
        "id": code.id,
        "name": "".join(word.capitalize() for word in code.slug.split("-")),
        "shortDescription": {"text": sentence},
        "fullDescription": {"text": sentence if page is None else page.what},
        "defaultConfiguration": {"level": code.severity.value},
    }
    if page is not None:
        rule["help"] = {"text": page.text, "markdown": page.text}
    return rule


def _result(
    diagnostic: Diagnostic, ignored: Ignored | None, sources: Mapping[str, Source], rule: int, mark: str
) -> dict[str, Any]:
    """A result (3.27). `suppressions` is there in all of a run, or a reader could not tell what was not ignored."""
    result: dict[str, Any] = {
        "ruleId": diagnostic.code.id,
        "ruleIndex": rule,
        "level": diagnostic.severity.value,
        "message": _message_of(diagnostic),
        "locations": [_location(diagnostic, sources)],
        "partialFingerprints": {FINGERPRINT: mark},
        "suppressions": [] if ignored is None else [_suppression(ignored, sources)],
    }
    if diagnostic.labels:
        result["relatedLocations"] = [
            {"id": number, "physicalLocation": physical(label.span, sources), "message": _message(label.text)}
            for number, label in enumerate(diagnostic.labels, 1)
        ]
    if diagnostic.fixes:
        result["fixes"] = [_fix(fix, sources) for fix in diagnostic.fixes]
    return result


def _notification(diagnostic: Diagnostic, index: Mapping[Code, int]) -> dict[str, Any]:
    code = diagnostic.code
    return {
        "level": code.severity.value,
        "message": _message_of(diagnostic),
        "associatedRule": {"id": code.id, "index": index[code]},
    }


def _location(diagnostic: Diagnostic, sources: Mapping[str, Source]) -> dict[str, Any]:
    location: dict[str, Any] = {}
    if diagnostic.span is not None:
        location["physicalLocation"] = physical(diagnostic.span, sources)
    if diagnostic.pointer is not None:
        location["logicalLocations"] = [{"fullyQualifiedName": visible(diagnostic.pointer), "kind": "value"}]
    return location


def _fix(fix: Fix, sources: Mapping[str, Source]) -> dict[str, Any]:
    replacement: dict[str, Any] = {
        "deletedRegion": region(fix.span, sources.get(fix.span.file)),
        "insertedContent": {"text": fix.replacement},
    }
    return {
        "description": _message(fix.title),
        "artifactChanges": [{"artifactLocation": artifact(fix.span.file), "replacements": [replacement]}],
        "properties": {"applicability": fix.applicability.value},
    }


def _suppression(ignored: Ignored, sources: Mapping[str, Source]) -> dict[str, Any]:
    """A suppression (3.35)."""
    suppression: dict[str, Any] = {"kind": "external", "status": "accepted", "justification": visible(ignored.reason)}
    if ignored.at is not None:
        suppression |= {"kind": "inSource", "location": {"physicalLocation": physical(ignored.at, sources)}}
    return suppression


def _message_of(diagnostic: Diagnostic) -> dict[str, str]:
    """The message and, in a paragraph of its own, the help: few viewers show a help from elsewhere."""
    lines = [diagnostic.message] + ([] if diagnostic.help is None else [f"help: {diagnostic.help}"])
    return {"text": "\n".join(_message(line)["text"] for line in lines)}


def _message(text: str) -> dict[str, str]:
    """A message (3.11) of untrusted text: no placeholder (3.11.5), no link (3.11.6), no hidden characters."""
    return {"text": visible(text).replace("{", "{{").replace("}", "}}").replace("](", "] (")}
