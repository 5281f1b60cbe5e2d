"""The verifier of a page, in a browser, beside the verifiers in Python: the same verdict, slug and record."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser

from reference.browser import OpenPage, opened
from reference.verifiers import ROOT_KEY, careful, independent
from reference.verify_page import page
from rtshcua.ground.flight.embedding import embed

Judged = tuple[str, str, int | None]


@dataclass
class Script:
    """The functions of the script, in one page."""

    page: OpenPage

    def call(self, body: str, given: object) -> Any:
        """The value of the body of an asynchronous function of `given`."""
        return self.page.page.evaluate(
            "async given => { const octets = text => Uint8Array.from(atob(text), each => each.charCodeAt(0));"
            f"{body} }}",
            given,
        )

    def judge(self, logs: Sequence[tuple[bytes, bytes]]) -> list[Judged]:
        """Verdict, slug and record of each log under its key."""
        body = """const all = [];
        for (const [log, key] of given) {
          const { verdict, failure, shortfall } = await tested.verifyLog(octets(log), octets(key));
          const why = failure ?? shortfall;
          all.push([verdict, why?.slug ?? "", why?.record ?? null]);
        }
        return all;"""
        found = self.call(body, [[b64encode(part).decode() for part in each] for each in logs])
        return [(verdict, slug, record) for verdict, slug, record in found]

    def result(self, log: bytes) -> dict[str, Any]:
        """The whole result of one log."""
        body = "return tested.verifyLog(octets(given[0]), octets(given[1]));"
        found: dict[str, Any] = self.call(body, [b64encode(part).decode() for part in (log, ROOT_KEY)])
        return found

    def redacted(self, data: bytes, key: bytes = b"") -> dict[str, Any]:
        """The result of a redacted log."""
        body = "return tested.verifyRedacted(octets(given[0]), given[1] ? octets(given[1]) : null);"
        found: dict[str, Any] = self.call(body, [b64encode(data).decode(), b64encode(key).decode()])
        return found


@contextmanager
def script_of(browser: Browser, folder: Path) -> Iterator[Script]:
    """The script in a page of its own."""
    file = folder / "page.html"
    file.write_text(page(embed(b""), hook=True), encoding="utf-8")
    with opened(browser, file) as found:
        assert found.errors == []
        yield Script(found)


def by_python(data: bytes, pinned: bytes = ROOT_KEY) -> Judged:
    """As the careful verifier has it."""
    report = careful(data, pinned).report
    why = report.failure or report.shortfall
    return report.verdict.value, why.slug if why else "", why.record if why else None


def alike(ours: Judged, theirs: Judged) -> bool:
    """Whether two verdicts agree. Why a line is no record is told differently: JSON is read by other programs."""
    forms = ("record/malformed", "record/not-canonical", "genesis/format")
    same = ours[1] == theirs[1] or {ours[1], theirs[1]} <= set(forms)
    return ours[0] == theirs[0] and ours[2] == theirs[2] and same


def compare(script: Script, logs: Sequence[tuple[str, bytes, bytes]], *, loosely: bool = False) -> dict[str, Judged]:
    """The verdicts of the page, which must be those of the careful verifier, and of the independent one; `loosely`: not
    of the latter, which leaves some of the form of trust roots and bundles to the former.
    """
    found = script.judge([(data, pinned) for _, data, pinned in logs])
    wrong = []
    for (name, data, pinned), ours in zip(logs, found, strict=True):
        theirs = by_python(data, pinned)
        closed = {"verified": "closed", "incomplete": "incomplete"}.get(ours[0], "failed")
        word = closed if loosely else independent(data, pinned)
        if not alike(ours, theirs) or closed != (word if word in ("closed", "incomplete") else "failed"):
            wrong.append((name, ours, theirs, word))
    assert not wrong, "\n".join(map(str, wrong))
    return {name: ours for (name, _, _), ours in zip(logs, found, strict=True)}
