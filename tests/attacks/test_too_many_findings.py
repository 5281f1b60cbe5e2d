"""Threat: a source with thousands of mistakes fills terminals, logs of CI and disks with findings."""

import json
from pathlib import Path

import pytest

from rtshcua.diagnostics.codes import NAMING, UNUSED
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.render import MOST_PLACES, MOST_SHOWN, most_severe, render_one
from rtshcua.diagnostics.span import Source, Span
from rtshcua.front.cli import app

MANY = 1_000


@pytest.mark.parametrize("command", ["check", "lint"])
def test_findings_beyond_limit_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.rts").write_text("".join(f'import "absent{number}.rts"\n' for number in range(MANY)))
    assert app.main([command, "a.rts"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr().err
    assert said.count("error[E0108]") == MOST_SHOWN
    assert "1000 errors; run `rtshcua explain E0108` for details" in said
    assert f"the {MANY - MOST_SHOWN} least severe are not shown; use `--json` for all" in said
    assert len(said) < 100_000
    assert app.main([command, "a.rts", "--json"]) == ExitCode.DIAGNOSTICS
    assert len(json.loads(capsys.readouterr().out)["diagnostics"]) == MANY


def test_errors_are_shown_before_the_rest() -> None:
    from rtshcua.diagnostics.codes import NO_SUCH_FILE

    warnings = [Diagnostic(NAMING, str(number), None) for number in range(5)]
    error = Diagnostic(NO_SUCH_FILE, "last", None)
    assert most_severe([*warnings, error], 3) == (*warnings[:2], error)
    assert most_severe([*warnings, error], 6) == (*warnings, error)


def test_places_of_one_finding_are_limited() -> None:
    text = "x\n" * MANY
    labels = tuple(Label(Span("a", 2 * number, 2 * number + 1), "here") for number in range(1, MANY))
    told = render_one(Diagnostic(UNUSED, "x", Span("a", 0, 1), labels=labels), {"a": Source("a", text)})
    assert told.count("here") == MOST_PLACES - 1
    assert f"= and {MANY - MOST_PLACES} more places" in told
