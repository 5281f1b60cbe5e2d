"""Output for a person fits 80 columns, on a terminal or in a pipe; longer words stand alone."""

import re
from collections.abc import Callable

import pytest

from rtshcua.diagnostics.codes import NO_SUCH_FILE, REGISTRY
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.span import Source, Span
from rtshcua.evidence.finding import Claim
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands.explain import _reflowed
from rtshcua.front.cli.faults import fail, say
from rtshcua.front.cli.render.claims import listed, write
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.log_slugs import every, find
from rtshcua.front.cli.render.pages import read_page
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.verdict import HELPS, MEANINGS
from rtshcua.front.cli.stdout import out

DIGEST = "0123456789abcdef" * 4
PATH = "/srv/flights/" + "of-a-long-day/" * 8 + "log.jsonl"
LONG = f"the log `{PATH}` names key {DIGEST[:32]} and digest {DIGEST}, and then says a good deal more of what it is"


@pytest.fixture(autouse=True)
def pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS")


def too_wide(text: str) -> list[str]:
    """The lines of more than 80 columns, except those of one word."""
    return [line for line in text.splitlines() if len(line) > 80 and " " in re.sub(r"^[ `]+|[`,.]+$", "", line)]


def _page() -> None:
    page = TextPage()
    page.head(LONG)
    page.row("digest", LONG)
    page.rows("rules", [LONG, "short"])
    page.text(LONG)
    out(*str(page).splitlines())


def _findings() -> None:
    source = Source("a.rts", f"policy p {{}} // {'word ' * 14}\n{'word ' * 40}\n")
    labels = (Label(Span("a.rts", 76, 80), "declared here"), Label(Span("a.rts", 200, 204), LONG[-40:]))
    found = Diagnostic(NO_SUCH_FILE, LONG, Span("a.rts", 0, 6), LONG, labels)
    Findings(json=False).report([found], {"a.rts": source})


SAID: dict[str, Callable[[], object]] = {
    "a line": lambda: out(LONG, f"  name      value  {LONG}", f"allow  step 3 `goto(a, b)`  {LONG}"),
    "an error": lambda: fail(ExitCode.INPUT, LONG, LONG),
    "a note": lambda: say(f"note: {LONG}"),
    "claims": lambda: write(listed("shown", "green", "+", [Claim("a", LONG)])),
    "a page": _page,
    "findings": _findings,
    "meanings": lambda: write([("", f"  {text}") for text in (*MEANINGS.values(), *HELPS.values())]),
    "the overview": lambda: main(["--help"]),
    "a wrong option": lambda: main(["run", "--" + "nothing-of-the-kind" * 4]),
    "no such file": lambda: main(["check", f"{PATH}/none.rts"]),
    "all codes": lambda: main(["explain"]),
}


@pytest.mark.parametrize("what", SAID)
def test_messages_fit_80_columns(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    SAID[what]()
    said = capsys.readouterr()
    assert said.out + said.err
    assert too_wide(said.out + said.err) == []
    if what in ("a line", "an error", "claims", "a page", "findings"):
        assert DIGEST in said.out + said.err, "whole"
        assert PATH in said.out + said.err


def test_every_page_of_a_code_fits_80_columns_but_for_its_examples() -> None:
    for code in REGISTRY.values():
        text = _reflowed(read_page(code).text)
        prose = re.sub(r"```.*?```|^[|#>].*?$", "", text, flags=re.DOTALL | re.MULTILINE)
        assert too_wide(prose) == [], code.id
        assert text.split() == read_page(code).text.split()


def test_meanings_of_log_findings_fit_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    for slug in every():
        assert find(slug) is not None
        main(["explain", slug])
    assert too_wide(capsys.readouterr().out) == []


def test_the_environment_may_ask_for_more(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for columns, lines in (("1000", 1), ("", 6), ("junk", 6), ("99999999999", 6), ("0", 9)):
        monkeypatch.setenv("COLUMNS", columns)
        out("word " * 80)
        assert len(capsys.readouterr().out.splitlines()) >= lines
        assert (lines == 1) == (columns == "1000")


def test_help_fits_80_columns(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["verify-log", "--help"]) == ExitCode.OK
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80
