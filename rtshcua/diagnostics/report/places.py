"""Where something stands, as SARIF says it (3.4, 3.29, 3.30): files by address, regions by lines and by offsets."""

from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import quote

from rtshcua.diagnostics.span import Source, Span

#: what relative names of files are relative to
ROOT: Final = "SRCROOT"


def physical(span: Span, sources: Mapping[str, Source]) -> dict[str, Any]:
    """A physicalLocation (3.29)."""
    return {"artifactLocation": artifact(span.file), "region": region(span, sources.get(span.file))}


def region(span: Span, source: Source | None) -> dict[str, int]:
    """A region (3.30) in both ways that the standard has."""
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
    """An artifactLocation (3.4): a name that is relative stays so, for it is the same on every machine."""
    return {"uri": uri(file)} if file.startswith("/") else {"uri": uri(file), "uriBaseId": ROOT}


def uri(file: str) -> str:
    """RFC 3986; octets of a name that are no UTF-8 keep their value, and a colon is no scheme's."""
    path = quote(file, safe="/", errors="surrogateescape")
    return f"file://{path}" if file.startswith("/") else path
