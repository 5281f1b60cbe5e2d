"""Where checks put what they find."""

from collections.abc import Iterable, Mapping
from hashlib import sha256

from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label, has_errors
from rtshcua.diagnostics.span import Source, Span


class Report:
    """Collects the findings of one compilation, and lets a check quote the sources."""

    def __init__(self, sources: Mapping[str, Source]) -> None:
        self.sources = sources
        self.found: list[Diagnostic] = []
        self._digests: dict[str, bytes] = {}

    def add(
        self,
        code: Code,
        span: Span | None,
        message: str,
        *,
        help: str | None = None,
        labels: Iterable[tuple[Span, str]] = (),
        fix: tuple[Span, str, str] | None = None,
    ) -> None:
        """Report one finding; `labels` are places with their words, `fix` is a span, its replacement and a title."""
        self.found.append(
            Diagnostic(
                code,
                message,
                span,
                help,
                tuple(Label(place, words) for place, words in labels),
                () if fix is None else (Fix(*fix),),
            )
        )

    def text(self, span: Span) -> str:
        """The source text under a span, with its white space folded; for quoting in a message."""
        return " ".join(self.raw(span).split())

    def raw(self, span: Span) -> str:
        """The source text under a span as it stands."""
        source = self.sources.get(span.file)
        return "" if source is None else source.slice(span)

    def digest(self, file: str) -> bytes:
        """The SHA-256 of a file's text in UTF-8."""
        digest = self._digests.get(file)
        if digest is None:
            text = self.sources[file].text
            digest = self._digests[file] = sha256(text.encode("utf-8", "surrogatepass")).digest()
        return digest

    def failed(self) -> bool:
        """Whether anything found so far forbids going on."""
        return has_errors(self.found)
