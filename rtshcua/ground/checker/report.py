"""The report of one compilation's findings."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256

from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label, has_errors
from rtshcua.diagnostics.span import Source, Span

#: the most uses that a finding on a template names
MAX_CONTEXTS = 3


class Report:
    """Collects the findings of one compilation, and gives access to the source texts."""

    def __init__(self, sources: Mapping[str, Source], data: Mapping[str, bytes] | None = None) -> None:
        self.sources = sources
        self._data = data or {}
        self.found: list[Diagnostic] = []
        self._digests: dict[str, bytes] = {}
        self._context: tuple[Label, ...] = ()
        self._among = 0
        self._plain: dict[Diagnostic, tuple[Diagnostic, int]] = {}
        self._amounts: dict[Diagnostic, int] = {}

    def add(
        self,
        code: Code,
        span: Span | None,
        message: str,
        *,
        help: str | None = None,
        labels: Iterable[tuple[Span, str]] = (),
        fix: tuple[Span, str, str] | None = None,
        amount: int = 0,
    ) -> None:
        """Report one finding; `labels` are spans with texts, `fix` is a span, its replacement and a title.

        `amount` is the size of the excess: if a mission fails with several values of its parameters, the finding with
        the largest amount is reported.
        """
        found = Diagnostic(
            code,
            message,
            span,
            help,
            tuple(Label(place, words) for place, words in labels),
            () if fix is None else (Fix(*fix),),
        )
        if self._context:
            plain, found = found, replace(found, labels=(*found.labels, *self._context))
            self._plain[found] = plain, self._among
            self._amounts[plain] = max(amount, self._amounts.get(plain, 0))
        self.found.append(found)

    def add_twice(self, code: Code, span: Span, what: str, how: str, first: Span) -> None:
        """Report that `what` is given, named or declared (`how`) twice; `first` is the first place."""
        self.add(code, span, f"{what} is {how} twice", labels=[(first, f"first {how} here")])

    @contextmanager
    def within(self, labels: Iterable[tuple[Span, str]], among: int = 0) -> Iterator[None]:
        """Add labels to findings in this context, such as the use of a template or the values of parameters.

        A finding in all of `among` contexts does not depend on them and gets no labels.
        """
        before = self._context, self._among
        self._context = (*self._context, *(Label(place, words) for place, words in labels))
        self._among = among or self._among
        try:
            yield
        finally:
            self._context, self._among = before

    def merged(self) -> tuple[Diagnostic, ...]:
        """Return each finding once.

        Findings that differ only in the labels of `within` are merged, with the labels of up to `MAX_CONTEXTS`
        contexts. If a mission is checked with several values, the worst finding of each code and place is kept.
        """
        groups: dict[Diagnostic, tuple[dict[Diagnostic, None], int]] = {}
        for found in self.found:
            plain, among = self._plain.get(found, (found, 0))
            groups.setdefault(plain, ({}, among))[0][found] = None
        merged = {
            plain: plain if len(group) == among > 1 else _joined(list(group))
            for plain, (group, among) in groups.items()
        }
        alike: dict[tuple[Code, Span | None], list[Diagnostic]] = {}
        for plain, (_, among) in groups.items():
            if among > 1:
                alike.setdefault((plain.code, plain.span), []).append(plain)
        for some in alike.values():
            worst = max(some, key=lambda each: self._amounts[each])
            for each in some:
                if each is not worst:
                    del merged[each]
            if len(some) > 1:
                others = "it also fails for other values of the mission's parameters"
                merged[worst] = replace(merged[worst], help="; ".join(filter(None, (worst.help, others))))
        return tuple(merged.values())

    def text(self, span: Span) -> str:
        """The source text under a span with its white space folded, for messages."""
        return " ".join(self.raw(span).split())

    def raw(self, span: Span) -> str:
        """The source text under a span, unchanged."""
        source = self.sources.get(span.file)
        return "" if source is None else source.slice(span)

    def digest(self, file: str) -> bytes:
        """The SHA-256 of a source's text in UTF-8, or of the bytes of a zone file."""
        digest = self._digests.get(file)
        if digest is None:
            source = self.sources.get(file)
            content = self._data[file] if source is None else source.text.encode("utf-8", "surrogatepass")
            digest = self._digests[file] = sha256(content).digest()
        return digest

    def failed(self) -> bool:
        """Whether any finding so far is an error."""
        return has_errors(self.found)


def _joined(group: list[Diagnostic]) -> Diagnostic:
    """Merge findings that differ only in their labels."""
    first = group[0]
    words = {label.text for label in first.labels}
    alike = [each for each in group if {label.text for label in each.labels} <= words][:MAX_CONTEXTS]
    return replace(first, labels=tuple(dict.fromkeys(label for each in alike for label in each.labels)))
