"""What tells findings apart over the life of a file: one keeps its mark when lines above it come and go."""

import hashlib
from collections.abc import Iterable, Mapping
from typing import Final

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source

#: name and version of the mark (SARIF, 3.27.17); another way to compute it needs another version
FINGERPRINT: Final = "findingInLine/v1"


def fingerprints(found: Iterable[Diagnostic], sources: Mapping[str, Source]) -> list[str]:
    """The mark of each finding, in order: of its code, the words of its line, and its number among those of the same
    file that are alike.
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
