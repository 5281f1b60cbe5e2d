"""`rtshcua report`: pages, a logbook, and every wrong input."""

import io
import json
import os
import re
import shutil
import sys
from errno import EACCES
from pathlib import Path
from urllib.parse import unquote

import pytest

from rtshcua.adapters.store.runs import logs_of
from rtshcua.app.logs import worst
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from virtual import flight_reports

ROOT = ["--root", flight_reports.PIN.key.hex()]
AT = ["--at", "2026-01-31T08:00:00Z"]


class Terminal(io.StringIO):
    """A standard output that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    flight_reports.completed(folder / "runs" / "a")
    flight_reports.turned(folder / "runs" / "b")
    return folder / "runs"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_page_is_written(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(runs / "a"), "-o", "page.html", *ROOT, *AT]) == ExitCode.OK
    assert "verified, completed: written to page.html" in capsys.readouterr().out
    page = Path("page.html").read_text(encoding="utf-8")
    assert "The mission was completed." in page
    assert "a decision, with the number of its record" in page


def test_page_goes_to_a_pipe_and_to_a_file_of_its_run_on_a_terminal(
    runs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["report", str(runs / "a" / "log.jsonl"), *ROOT, *AT]) == ExitCode.OK
    piped = capsys.readouterr().out
    assert piped.startswith("<!DOCTYPE html>")
    monkeypatch.setattr(sys, "stdout", Terminal())
    assert main(["report", str(runs / "a"), *ROOT, *AT]) == ExitCode.OK
    assert Path("a.html").read_text(encoding="utf-8") == piped


def test_folder_as_target_gets_a_page_with_the_name_of_the_run(runs: Path, here: Path) -> None:
    (here / "pages").mkdir()
    assert main(["report", str(runs / "a"), "-o", "pages", *ROOT]) == ExitCode.OK
    assert (here / "pages" / "a.html").is_file()


def test_several_flights_make_a_logbook(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(runs), "-o", "book", *ROOT, *AT]) == ExitCode.OK
    assert sorted(each.name for each in Path("book").iterdir()) == ["a.html", "b.html", "index.html"]
    index = Path("book/index.html").read_text(encoding="utf-8")
    assert index.count("<tr>") == 3  # the head, and one for each
    assert 'href="./a.html"' in index
    assert "1 of 2" in index  # missions completed
    capsys.readouterr()


def test_json_has_the_content_of_each_page(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(runs), "-o", "book", "--json", *ROOT]) == ExitCode.OK
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [each["page"] for each in found] == ["book/a.html", "book/b.html"]
    assert [each["ending"] for each in found] == ["completed", "aborted"]
    assert main(["report", str(runs / "a"), "--json", *ROOT]) == ExitCode.OK
    (line,) = capsys.readouterr().out.splitlines()
    assert json.loads(line)["page"] is None


def test_exit_code_is_that_of_the_verification(runs: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = (runs / "a" / "log.jsonl").read_bytes()
    Path("cut.jsonl").write_bytes(data[: data.rindex(b'{"_prev"')])
    assert main(["report", "cut.jsonl", "-o", "cut.html", *ROOT]) == ExitCode.INCOMPLETE
    Path("bad.jsonl").write_bytes(data.replace(b'"admitted"', b'"admitteD"', 1))
    assert main(["report", "bad.jsonl", "-o", "bad.html", *ROOT]) == ExitCode.EVIDENCE
    assert main(["report", str(runs / "a"), "-o", "a.html", "--root", "00" * 32]) == ExitCode.UNTRUSTED
    assert 'class="said failed"' in Path("bad.html").read_text(encoding="utf-8")
    assert main(["report", str(runs / "a"), "bad.jsonl", "-o", "book", *ROOT]) == ExitCode.EVIDENCE
    assert Path("book/bad.html").is_file()


def test_redacted_page(runs: Path) -> None:
    assert main(["report", str(runs / "a"), "-o", "r.html", "--redact", "position,names", *ROOT]) == ExitCode.OK
    text = Path("r.html").read_text(encoding="utf-8")
    assert "not a record" in text
    assert "quad-07" not in text


def test_redacted_pages_and_their_logbook_have_numbers_for_names(
    runs: Path, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["report", str(runs), "-o", "pages", "--redact", "position,names", *ROOT, *AT]) == ExitCode.OK
    assert sorted(each.name for each in (here / "pages").iterdir()) == ["flight-1.html", "flight-2.html", "index.html"]
    index = Path("pages/index.html").read_text(encoding="utf-8")
    assert 'href="./flight-1.html"' in index
    assert not any(gone in index for gone in ("quad-07", "inspect_bridge_a", "bridge"))
    assert "left out" in index
    monkeypatch.setattr(sys, "stdout", Terminal())
    assert main(["report", str(runs / "a"), "--redact", "names", *ROOT, *AT]) == ExitCode.OK
    assert Path("flight-1.html").is_file()


def test_logbook_with_something_left_is_not_written(
    runs: Path, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtshcua.app.flights.report_pages.logbook_page", lambda *_: "<p>over Bridge-A</p>")
    assert main(["report", str(runs), "-o", "pages", "--redact", "names", *ROOT]) == ExitCode.FAULT
    assert "bridge_a" in capsys.readouterr().err
    assert not Path("pages/index.html").exists()


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["missing"], ExitCode.INPUT, "missing"),
        (["empty"], ExitCode.INPUT, "log.jsonl"),
        (["text.txt"], ExitCode.INPUT, "not a log"),
        (["RUN", "--redact", "everything"], ExitCode.USAGE, "accepted: `position`, `names`"),
        (["RUN", "--tiles", "http://tiles.example/{z}/{x}/{y}.png"], ExitCode.USAGE, "accepted: an https address"),
        (["RUN", "--tiles", "https://tiles.example/{z}/{x}.png"], ExitCode.USAGE, "accepted: an https address"),
        (["RUN", "--tiles", "https://a.b/{z}/{x}/{y}; script-src *"], ExitCode.USAGE, "accepted: an https address"),
        (["RUN", "--at", "yesterday"], ExitCode.USAGE, "is not a UTC time"),
        (["RUN", "-o", "no/such/page.html"], ExitCode.INPUT, "there is no folder"),
        (["RUN", "-o", "RUN/log.jsonl"], ExitCode.USAGE, "is not overwritten"),
        (["RUN", "RUN2", "-o", "text.txt"], ExitCode.USAGE, "is a file"),
        (["RUN", "--root", "nothing.trust"], ExitCode.INPUT, "nothing.trust"),
    ],
)
def test_wrong_input(
    runs: Path, here: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: ExitCode, told: str
) -> None:
    Path("text.txt").write_text("no log\n")
    Path("empty").mkdir()
    named = [each.replace("RUN2", str(runs / "b")).replace("RUN", str(runs / "a")) for each in words]
    root = [] if "--root" in named else ROOT
    assert main(["report", *named, *root]) == code
    captured = capsys.readouterr()
    assert told in captured.err.replace("\n  ", " ")
    assert "Traceback" not in captured.err
    assert sorted(each.name for each in here.iterdir()) == ["empty", "text.txt"]


def test_log_is_not_overwritten(runs: Path) -> None:
    before = (runs / "a" / "log.jsonl").read_bytes()
    assert main(["report", str(runs / "a"), "-o", str(runs / "a" / "log.jsonl"), *ROOT]) != ExitCode.OK
    assert (runs / "a" / "log.jsonl").read_bytes() == before


@pytest.mark.parametrize("name", ["bundle.json", "page.html"])
def test_file_that_is_no_page_is_not_overwritten(name: str, runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path(name).write_text('{"of": "somebody"}', encoding="utf-8")
    assert main(["report", str(runs / "a"), "-o", name, *ROOT]) != ExitCode.OK
    assert "is not a page, and is not overwritten by one" in capsys.readouterr().err
    assert Path(name).read_text(encoding="utf-8") == '{"of": "somebody"}'


@pytest.mark.parametrize("name", ["a.html", "index.html"])
def test_logbook_overwrites_pages_alone(name: str, runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("book").mkdir()
    for _ in range(2):  # its own pages again
        assert main(["report", str(runs), "-o", "book", *ROOT]) == ExitCode.OK
    Path("book", name).write_text("notes", encoding="utf-8")
    assert main(["report", str(runs), "-o", "book", *ROOT]) != ExitCode.OK
    assert f"`book/{name}` is not a page" in capsys.readouterr().err
    assert Path("book", name).read_text(encoding="utf-8") == "notes"


def test_logbook_links_pages_of_any_name(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = [b"index", b"INDEX", b"50%#a?b", b"javascript:x", b"\xff", b"a b"]
    for name in odd:
        flight_reports.completed(here / "odd" / os.fsdecode(name))
    assert main(["report", "odd", "-o", "book", "--json", *ROOT]) == ExitCode.OK
    pages = [Path(json.loads(line)["page"]) for line in capsys.readouterr().out.splitlines()]
    linked = re.findall(r'<a href="([^"]+)"><time', Path("book/index.html").read_text(encoding="utf-8"))
    assert all(each.startswith("./") for each in linked)
    assert {Path("book", unquote(each)) for each in linked} == set(pages)
    assert len({each.name.casefold() for each in (*pages, Path("index.html"))}) == len(odd) + 1
    assert all(each.is_file() for each in pages)


def test_log_named_twice_is_one_flight(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(runs / "a"), str(runs / "a" / "log.jsonl"), "-o", "a.html", *ROOT]) == ExitCode.OK
    assert "written to a.html" in capsys.readouterr().out


def test_failed_flight_says_so_first_and_counts_in_no_total(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = (runs / "a" / "log.jsonl").read_bytes()
    Path("bad").mkdir()
    Path("bad/log.jsonl").write_bytes(data.replace(b'"event":"succeeded"', b'"event":"failed"', 1))
    assert main(["report", "bad", str(runs / "a"), "-o", "book", *ROOT]) != ExitCode.OK
    page = Path("book/bad.html").read_text(encoding="utf-8")
    assert page.index("nothing on this page is proven") < page.index("What was asked")
    assert "1 of 2" in Path("book/index.html").read_text(encoding="utf-8")
    assert "nothing on this page is proven" not in Path("book/a.html").read_text(encoding="utf-8")
    capsys.readouterr()


@pytest.mark.parametrize("limit", ["MOST_OCTETS", "_MOST_EMBEDDED"])
@pytest.mark.parametrize("redacted", [[], ["--redact", "names"]])
def test_log_that_is_too_large_is_not_embedded_in_part(
    redacted: list[str], limit: str, runs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"rtshcua.app.flights.flight_report.{limit}", 1_000)
    assert main(["report", str(runs / "a"), *redacted, *ROOT]) == ExitCode.OK
    page = capsys.readouterr().out
    assert "the log is too large to be embedded" in page
    assert "application/gzip+base64" not in page


def test_logbook_names_each_log_that_it_cannot_read(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    begun = (runs / "a" / "log.jsonl").read_bytes()[:2_000]
    for name in ("cut", "short"):
        Path(name).mkdir()
        Path(name, "log.jsonl").write_bytes(begun)
    assert main(["report", "cut", str(runs / "a"), "short", "-o", "book", *ROOT]) == ExitCode.EVIDENCE
    told = capsys.readouterr().err
    assert all(f"`{name}/log.jsonl`" in told for name in ("cut", "short"))
    assert "1 flight: open book/index.html" in told
    page = Path("book/index.html").read_text(encoding="utf-8")
    assert "2 more could not be read" in page
    assert page.count('<td><span class="said failed">not read</span></td>') == 2
    assert "cut: <code>cut/log.jsonl</code>: the log is cut inside its first record" in page


def test_unreadable_entries_do_not_stop_the_logbook(runs: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder, a dangling link and a text in place of a log are rows, and the exit code tells it."""
    shutil.copytree(runs / "a", here / "all" / "b-flight")
    (here / "all" / "a-folder" / "log.jsonl").mkdir(parents=True)
    for name in ("c-link", "d-text"):
        (here / "all" / name).mkdir()
    (here / "all" / "c-link" / "log.jsonl").symlink_to("nowhere")
    (here / "all" / "d-text" / "log.jsonl").write_text("no log\n")
    given = [str(here / "all" / name) for name in ("a-folder", "b-flight", "c-link", "d-text")]
    assert main(["report", *given, "-o", "book", *ROOT]) == ExitCode.INPUT
    page = Path("book/index.html").read_text(encoding="utf-8")
    assert "3 more could not be read" in page
    for name in ("a-folder", "c-link", "d-text"):
        assert f'<td colspan="7">{name}: ' in page
    assert 'href="./b-flight.html"' in page
    assert "1 flight: open book/index.html" in capsys.readouterr().err
    assert main(["report", *given, "-o", "picture", "--redact", "names", *ROOT]) == ExitCode.INPUT
    assert "d-text" not in Path("picture/index.html").read_text(encoding="utf-8")


def test_paths_that_cannot_be_opened_are_rows_of_the_logbook(
    runs: Path, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A link to itself, a name that is too long, and a folder of runs of which one may not be searched."""
    shutil.copytree(runs / "a", here / "all" / "a-flight")
    for name in ("b-private", "c-notes"):
        (here / "all" / name).mkdir()
    Path("loop").symlink_to("loop")

    def denied(path: Path) -> list[Path]:
        if path.name in ("all", "b-private"):  # a superuser may search all folders
            raise PermissionError(EACCES, "Permission denied", str(path / "b-private"))
        return logs_of(path)

    monkeypatch.setattr("rtshcua.app.logs.logs_of", denied)
    assert main(["report", "all", "loop", "x" * 300, "-o", "book", *ROOT]) == ExitCode.INPUT
    page = Path("book/index.html").read_text(encoding="utf-8")
    assert "3 more could not be read" in page
    assert 'href="./a-flight.html"' in page
    for name in ("b-private", "loop", "x" * 300):
        assert f'<td colspan="7">{name}: ' in page
    capsys.readouterr()
    assert main(["report", "loop", *ROOT]) == ExitCode.INPUT
    assert "too many levels of symbolic links: `loop`" in capsys.readouterr().err


def test_exit_code_of_a_logbook_is_the_worst(runs: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (runs / "a" / "log.jsonl").read_bytes().splitlines(keepends=True)
    for name, kept in (("cut", lines[:-1]), ("changed", [*lines[:9], lines[9].replace(b":1", b":2", 1), *lines[10:]])):
        Path(name).mkdir()
        Path(name, "log.jsonl").write_bytes(b"".join(kept))
    assert main(["report", "cut", "changed", str(runs / "a"), "-o", "book", *ROOT]) == ExitCode.EVIDENCE
    assert main(["report", "cut", str(runs / "a"), "-o", "book", *ROOT]) == ExitCode.INCOMPLETE


@pytest.mark.parametrize(
    ("codes", "expected"),
    [
        ([], ExitCode.OK),
        ([ExitCode.OK, ExitCode.INCOMPLETE], ExitCode.INCOMPLETE),
        ([ExitCode.INCOMPLETE, ExitCode.INPUT], ExitCode.INPUT),
        ([ExitCode.INPUT, ExitCode.EVIDENCE, ExitCode.OK], ExitCode.EVIDENCE),
        ([ExitCode.EVIDENCE, ExitCode.DECISION], ExitCode.DECISION),
        ([ExitCode.DECISION, ExitCode.BOUNDARY, ExitCode.FULL], ExitCode.BOUNDARY),
        ([ExitCode.BOUNDARY, ExitCode.ANCHOR], ExitCode.ANCHOR),
    ],
)
def test_worst_code(codes: list[ExitCode], expected: ExitCode) -> None:
    assert worst(codes) is worst(codes[::-1]) is expected


def test_telemetry_that_was_removed_is_told_as_missing(
    runs: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(runs / "a", here / "a")
    Path("a/telemetry.tlog").unlink()
    assert main(["report", "a", "--json", *ROOT]) == ExitCode.OK
    told = json.loads(capsys.readouterr().out)
    assert "The telemetry that the log names is missing" in told["summary"][2]["answer"]
    assert {"what": "telemetry", "told": "the file that the log names is not beside it: no track, no signals"} in told[
        "gaps"
    ]


def test_several_flights_do_not_go_to_standard_output(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(runs), "-o", "-", *ROOT]) == ExitCode.USAGE
    assert "cannot be on standard output" in capsys.readouterr().err
    assert not Path("-").exists()
