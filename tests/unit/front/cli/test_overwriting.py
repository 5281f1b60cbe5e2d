"""No output overwrites a source that the same run reads, under any name."""

from pathlib import Path

import pytest

from reference.tested import POLICY, TESTS
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

#: commands, each with a placeholder for its output file
COMMANDS = [
    ("test", "tests.rts", "--junit"),
    ("test", "policy.rts", "--generate", "--force", "-o"),
    ("test", "tests.rts", "--policy", "yard", "--generate", "--force", "-o"),
    ("lint", "tests.rts", "--isolated", "--no-cache", "--format", "sarif", "-o"),
    ("docs", "tests.rts", "-o"),
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("policy.rts").write_text(POLICY, encoding="utf-8")
    Path("tests.rts").write_text(TESTS, encoding="utf-8")
    Path("link.rts").symlink_to("policy.rts")
    Path("hard.xml").hardlink_to("policy.rts")
    return tmp_path


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("target", ["policy.rts", "./policy.rts", "link.rts", "hard.xml"])
def test_a_source_that_is_read_or_imported_is_not_written_over(
    here: Path, words: tuple[str, ...], target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert app.main([*words, target]) == ExitCode.USAGE
    said = capsys.readouterr()
    assert f"`{Path(target)}` is one of the sources" in said.err
    assert Path("policy.rts").read_text(encoding="utf-8") == POLICY


def test_source_read_from_the_cache_is_not_overwritten(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        app.main(["lint", "tests.rts"])
    assert app.main(["lint", "tests.rts", "--format", "junit", "-o", "policy.rts"]) == ExitCode.USAGE
    assert Path("policy.rts").read_text(encoding="utf-8") == POLICY
    assert "one of the sources" in capsys.readouterr().err


def test_an_earlier_report_is(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("report.xml").write_text("before", encoding="utf-8")
    app.main(["test", "tests.rts", "--junit", "report.xml"])
    assert "<testsuite" in Path("report.xml").read_text(encoding="utf-8")
