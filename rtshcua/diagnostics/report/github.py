"""Findings as workflow commands of GitHub Actions, which shows them as annotations of the source lines.

GitHub shows at most ten errors, ten warnings and ten notices per step; the log has all of them.
"""

from collections.abc import Iterable, Mapping

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.span import Source, Span

_COMMANDS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}


def github(found: Iterable[Diagnostic], sources: Mapping[str, Source], folder: str = "") -> str:
    """Return one line per finding, each ended by a newline.

    `folder` is the absolute folder that the names of sources are relative to: the runner needs it if it is not the root
    of the repository.
    """
    return "".join(f"{_command(diagnostic, sources, folder)}\n" for diagnostic in found)


def _command(diagnostic: Diagnostic, sources: Mapping[str, Source], folder: str) -> str:
    code, span = diagnostic.code, diagnostic.span
    properties = {"title": code.id}
    lines = [f"{code.id} {code.slug}: {visible(diagnostic.message)}"]
    if span is not None:
        properties = _placed(span, sources.get(span.file), folder) | properties
        lines[0] = f"{_place(span, sources)}: {lines[0]}"
    lines += [f"at: {visible(diagnostic.pointer)}"] if diagnostic.pointer is not None else []
    lines += [f"{_place(label.span, sources)}: {visible(label.text)}".rstrip(": ") for label in diagnostic.labels]
    lines += [f"help: {visible(diagnostic.help)}"] if diagnostic.help is not None else []
    written = ",".join(f"{name}={_property(visible(value))}" for name, value in properties.items())
    return f"::{_COMMANDS[diagnostic.severity]} {written}::{_data(chr(10).join(lines))}"


def _placed(span: Span, source: Source | None, folder: str) -> dict[str, str]:
    """The runner accepts columns only for a place within one line."""
    file = span.file if span.file.startswith("/") or not folder else f"{folder.rstrip('/')}/{span.file}"
    if source is None:
        return {"file": file}
    start, end = source.position(span.start), source.position(span.end)
    lines = {"file": file, "line": str(start.line), "endLine": str(end.line)}
    return lines | ({"col": str(start.column), "endColumn": str(end.column)} if start.line == end.line else {})


def _place(span: Span, sources: Mapping[str, Source]) -> str:
    source = sources.get(span.file)
    if source is None:
        return visible(span.file)
    at = source.position(span.start)
    return f"{visible(span.file)}:{at.line}:{at.column}"


def _data(text: str) -> str:
    """Escape a message, as GitHub's toolkit does."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """Escape the value of a property, as GitHub's toolkit does."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")
