"""Threat: a foreign checkout makes our tools read or write files outside of it, by imports, settings and links.

Tools quote what they read in their findings, and strangers may read the log of CI.
"""

import os
import subprocess
from pathlib import Path

import pytest
from lsprotocol import types as lsp

from rtshcua import library
from rtshcua.adapters.store import writing
from rtshcua.adapters.store.checkout import checkout_of, expect_inside
from rtshcua.adapters.store.runs import logs_of
from rtshcua.adapters.store.witness import logs_in
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.lsp.session import EditorSession

SECRET = "TOKEN=hunter2 {"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout that is the working folder; other files of the user are beside it."""
    place = tmp_path / "checkout"
    (place / ".git").mkdir(parents=True)
    for name in ("mine.rts", "mine.geojson", ".env"):
        (tmp_path / name).write_text(SECRET)
        (place / name).write_text(SECRET)
    monkeypatch.chdir(place)
    return place


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = app.main(words)
    captured = capsys.readouterr()
    return code, captured.out + captured.err


@pytest.mark.parametrize("command", [["check"], ["lint", "--no-cache"], ["test"], ["docs", "--json"]], ids=" ".join)
@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('import "../mine.rts"\n', "E0108"),
        ('import "../absent.rts"\n', "E0108"),
        ('import ".env"\n', "E0109"),
        ('import "mine.geojson"\n', "E0109"),
        ('import "../../../../../../../proc/self/environ"\n', "E0109"),
        ('import "link.rts"\n', "E0108"),
        ('import "folder/mine.rts"\n', "E0108"),
        ('zone yard from "../mine.geojson"\n', "E0108"),
        ('zone yard from ".env"\n', "E0109"),
        ('zone yard from "link.geojson"\n', "E0108"),
    ],
)
def test_import_outside_checkout_is_refused(
    here: Path, command: list[str], text: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "a.rts").write_text(text)
    (here / "link.rts").symlink_to("../mine.rts")
    (here / "link.geojson").symlink_to("/proc/self/environ")
    (here / "folder").symlink_to("..")
    ended, text = said([*command, "a.rts"], capsys)
    assert ended != ExitCode.OK
    assert code in text
    assert "hunter2" not in text
    assert "did you mean" not in text
    if "../mine" in text or "../absent" in text:
        assert "it is outside of the project" in text


def test_import_allowed_by_user_is_resolved(
    here: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "a.rts").write_text('import "../mine.rts"\n')
    monkeypatch.setenv("RTSHCUA_IMPORTS", f"relative{os.pathsep}{tmp_path}")
    assert "error[E0101]" in said(["check", "a.rts"], capsys)[1]
    monkeypatch.delenv("RTSHCUA_IMPORTS")
    assert "error[E0101]" in said(["check", "a.rts", "../mine.rts"], capsys)[1]  # its folder was named
    assert "error[E0108]" in said(["check", "a.rts"], capsys)[1]


@pytest.mark.parametrize("command", [["check"], ["lint"], ["test"], ["fmt"], ["docs"]], ids=" ".join)
def test_symlink_out_of_folder_is_not_followed(
    here: Path, command: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "mine.rts").write_text("zone  hunter2 {}\n")
    for name in (".env", "mine.rts", "mine.geojson"):
        (here / name).unlink()
    (here / "link.rts").symlink_to("../mine.rts")
    for folder in (".", str(here)):
        code, text = said([*command, folder], capsys)
        assert (code, "hunter2" in text) == (ExitCode.INPUT, False), text
    assert (tmp_path / "mine.rts").read_text() == "zone  hunter2 {}\n"


@pytest.mark.parametrize("words", [["fmt"], ["lint", "--fix"], ["check"]], ids=" ".join)
def test_named_symlink_out_of_checkout_is_not_followed(
    here: Path, words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "mine.rts").write_text("zone  hunter2 {}\n")
    (here / "link.rts").symlink_to("../mine.rts")
    code, text = said([*words, "link.rts"], capsys)
    assert code != ExitCode.OK
    assert "hunter2" not in text
    assert (tmp_path / "mine.rts").read_text() == "zone  hunter2 {}\n"


@pytest.mark.parametrize("linked", ["out.xml", "reports"])
@pytest.mark.parametrize("marked", [True, False])
def test_a_report_is_not_written_out_of_the_checkout(
    here: Path, tmp_path: Path, linked: str, marked: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    if not marked:
        (here / ".git").rmdir()
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports/out.xml").write_text("mine")
    (here / "good.rts").write_text('import "lib:policies/site.rts"\n')
    (here / linked).symlink_to(tmp_path / "reports" / ("out.xml" if linked == "out.xml" else ""))
    target = linked if linked == "out.xml" else "reports/out.xml"
    for words in (["lint", "--format", "junit", "-o"], ["test", "--junit"]):
        code, text = said([*words, target, "good.rts"], capsys)
        assert "symbolic links lead out of" in text
        assert code == ExitCode.FULL
    assert (tmp_path / "reports/out.xml").read_text() == "mine"
    assert app.main(["lint", "--format", "junit", "-o", str(tmp_path / "typed.xml"), "good.rts"]) == ExitCode.OK
    assert (tmp_path / "typed.xml").exists()


def test_a_page_is_not_written_out_of_the_checkout(
    here: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "home").mkdir()
    (here / "pages").symlink_to(tmp_path / "home")
    (here / "good.rts").write_text('import "lib:policies/site.rts"\nimport "lib:policies/training_field.rts"\n')
    code, text = said(["docs", "good.rts", "-o", "pages/page.html"], capsys)
    assert (code, "symbolic links lead out of" in text) == (ExitCode.FULL, True), text
    assert list((tmp_path / "home").iterdir()) == []
    (here / "page.html").symlink_to(tmp_path / "mine.rts")
    assert said(["docs", "good.rts", "-o", "page.html"], capsys)[0] == ExitCode.OK
    assert not (here / "page.html").is_symlink()
    assert (tmp_path / "mine.rts").read_text() == SECRET


def test_a_report_is_not_written_to_a_device_nor_to_a_pipe(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "good.rts").write_text('import "lib:policies/site.rts"\n')
    (here / "device.xml").symlink_to("/dev/null")
    os.mkfifo(here / "pipe.xml")
    for target, why in (("device.xml", "symbolic links lead out of"), ("pipe.xml", "no process reads this pipe")):
        for words in (["lint", "--format", "junit", "-o"], ["test", "--junit"]):
            code, text = said([*words, target, "good.rts"], capsys)
            assert (code, why in text.lower()) == (ExitCode.FULL, True), text


@pytest.mark.parametrize("change", ["rewrite", "write_out", "replace_inside"])
def test_symlink_created_after_check_is_not_followed(
    here: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    (tmp_path / "home").mkdir()
    (here / "folder").mkdir()
    for place in (tmp_path / "home", here / "folder"):
        (place / "a.rts").write_text("before")

    def asked(path: Path) -> tuple[Path, Path | None]:
        found = expect_inside(path)
        (here / "folder").rename(here / "gone")
        (here / "folder").symlink_to(tmp_path / "home")
        return found

    monkeypatch.setattr(writing, "expect_inside", asked)
    words = (b"before", b"after") if change == "rewrite" else (b"after",)
    with pytest.raises(OSError, match=r"folder/a\.rts"):
        getattr(writing, change)(Path("folder/a.rts"), *words)
    assert (tmp_path / "home/a.rts").read_text() == "before"
    assert (here / "gone/a.rts").read_text() == "before"


@pytest.mark.parametrize("name", ["../mine.rts", "/etc/passwd", "link.rts"])
def test_settings_bring_no_source_from_outside(here: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "rtshcua.toml").write_text(f'lint.with = ["{name}"]\n')
    (here / "a.rts").write_text("\n")
    (here / "link.rts").symlink_to("../mine.rts")
    code, text = said(["lint", "a.rts"], capsys)
    assert (code, f"`{name}` in `with` lies outside the project" in text) == (ExitCode.INPUT, True), text


@pytest.mark.parametrize("workspace", [True, False])
def test_the_language_server_stays_in_the_workspace(here: Path, workspace: bool) -> None:
    told: list[lsp.PublishDiagnosticsParams] = []
    session = EditorSession(str(library.root()), told.append)
    if workspace:
        session.look_in([str(here)])
    (here / "good.rts").write_text("\n")
    (here / "a.rts").write_text('import "../mine.rts"\nimport "good.rts"\n')
    session._readable.ask(here / "a.rts") if not workspace else None
    program = session.desk.view("a.rts").program
    assert [unit.file for unit in program.units] == ["a.rts", "good.rts"]
    assert [each.code.id for each in program.diagnostics] == ["E0108"]
    session.end()


def test_checkout_folder_detection(here: Path, tmp_path: Path) -> None:
    (here / "sub/below").mkdir(parents=True)
    (here / "sub/rtshcua.toml").write_text("")
    assert checkout_of(here / "sub/below/a.rts") == str(here)
    (here / ".git").rmdir()
    assert checkout_of(here / "sub/below/a.rts") == str(here / "sub")
    assert checkout_of(here / "sub") == str(here / "sub")
    assert checkout_of(here / "a.rts") is None
    assert checkout_of("/") is None


@pytest.mark.slow
def test_deeply_nested_folders_are_read(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    # pytest would go into itself as often, and leave them
    request.addfinalizer(lambda: subprocess.run(["rm", "-rf", here / "d"], check=True))
    for name in (".env", "mine.rts", "mine.geojson"):
        (here / name).unlink()
    (here / "a").symlink_to("a")  # where the walk must not end
    for _ in range(1_100):
        os.mkdir("d")  # noqa: PTH102
        os.chdir("d")
    for name in ("a.rts", "log.jsonl"):
        Path(name).write_text("zone a = b\n")
    monkeypatch.chdir(here)
    for command in (["check"], ["fmt", "--check"], ["test"], ["lint", "--no-cache"]):
        code, text = said([*command, "."], capsys)
        assert (code, "E0101" in text) == (ExitCode.DIAGNOSTICS, True), text[-500:]
    code, text = said(["archive", "add", "."], capsys)
    assert (code, "log of this program" in text) == (ExitCode.INPUT, True), text[-500:]
    assert [each.name for each in (*logs_of(Path()), *logs_in(Path()))] == ["log.jsonl"] * 2
