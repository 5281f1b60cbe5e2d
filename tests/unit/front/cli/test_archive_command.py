"""`rtshcua archive`: output and exit codes."""

import csv
import errno
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import duckdb
import pytest

from reference import generated_logs
from reference.archived import write_fleet
from rtshcua.adapters.store.logs import begins_as_log
from rtshcua.app.log_archive import code_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.render import archive_tables

ROOT = ("--root", generated_logs.ROOT_KEY.hex())


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of a small fleet, each in a folder of its own, as `rtshcua run` leaves them."""
    folder = tmp_path_factory.mktemp("runs")
    write_fleet(folder)
    for log in sorted(folder.glob("*.jsonl")):
        run = folder / log.stem
        run.mkdir()
        log.rename(run / "log.jsonl")
    return folder


@pytest.fixture(scope="session")
def filled(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of all runs."""
    folder = tmp_path_factory.mktemp("filled")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("RTSHCUA_DATA_DIR", str(folder))
        assert archive("add", runs, *ROOT) == ExitCode.INCOMPLETE
    return folder / "archive"


@pytest.fixture
def archived(filled: Path, tmp_path: Path) -> None:
    """The archive of all runs, in this test's folder."""
    shutil.copytree(filled, tmp_path / "archive")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def archive(*words: object) -> int:
    return app.main(["archive", *map(str, words)])


def as_json(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_add_reports_an_unclosed_log(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("add", runs, *ROOT) == ExitCode.INCOMPLETE
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith(f"incomplete  {runs / 'quad-08-2' / 'log.jsonl'}: close/missing, the log ends after")
    assert last == "6 logs, 6 of them verified now, under the key on the command line: 5 verified, 1 incomplete"
    assert archive("add", runs / "quad-07-0", *ROOT) == ExitCode.OK
    assert "1 log, 0 of them verified now" in capsys.readouterr().out


def test_missing_log_is_reported(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("add", runs / "quad-07-1", *ROOT) == ExitCode.OK
    assert "missing: the logs before 1 of these; run `rtshcua archive query missing`" in capsys.readouterr().out
    assert archive("query", "missing", "--json") == ExitCode.OK
    (row,) = as_json(capsys)
    assert row["vehicle"] == "quad-07"


def test_failed_log_is_reported_with_its_exit_code(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = (runs / "quad-07-0" / "log.jsonl").read_bytes()
    changed = tmp_path / "changed.jsonl"
    changed.write_bytes(data.replace(b'"outcome":"deny"', b'"outcome":"defer"', 1))
    assert archive("add", changed, *ROOT, "--json") == ExitCode.EVIDENCE
    said = as_json(capsys)
    (log,) = said["logs"]
    assert (said["exit_code"], said["counts"], log["status"], log["finding"]) == (
        9,
        {"failed": 1},
        "failed",
        "chain/broken",
    )
    assert archive("add", runs / "quad-07-0", "--root", "00" * 32, "--json") == ExitCode.UNTRUSTED
    assert as_json(capsys)["logs"][0]["finding"] == "trust/root-unknown-key"
    assert archive("list", "--status", "failed", "--csv") == ExitCode.OK
    assert len(list(csv.DictReader(io.StringIO(capsys.readouterr().out)))) == 2


def test_audit_derives(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("add", runs / "quad-07-0", *ROOT, "--audit", "--jobs", 1) == ExitCode.DECISION
    assert "decision/" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.usefixtures("archived")
def test_verified_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("verify", *ROOT, "--jobs", 1) == ExitCode.INCOMPLETE
    assert "6 logs, 6 of them verified now" in capsys.readouterr().out


@pytest.mark.usefixtures("archived")
def test_logs_of_another_root_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("verify", "--root", "00" * 32) == ExitCode.UNTRUSTED
    out = capsys.readouterr().out
    assert out.startswith("0 logs, 0 of them verified now")
    assert "6 logs in the archive were verified under other roots" in out
    assert archive("verify", "--root", "00" * 32, "--json") == as_json(capsys)["exit_code"] == ExitCode.UNTRUSTED
    assert archive("stats", "--json") == ExitCode.OK
    assert len(as_json(capsys)) == 2


@pytest.mark.usefixtures("archived")
def test_damaged_index_is_reported_and_rebuilt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "archive" / "index" / "logs.parquet").write_bytes(b"PAR1")
    assert archive("stats") == ExitCode.INPUT
    assert "help: rebuild it with `rtshcua archive verify --reindex`" in capsys.readouterr().err
    assert archive("verify", "--reindex", *ROOT, "--jobs", 1) == ExitCode.INCOMPLETE
    assert archive("stats") == ExitCode.OK


def test_full_disk_is_reported(runs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise duckdb.IOException("IO Error: Could not write file: No space left on device")

    monkeypatch.setattr("rtshcua.adapters.archive.adding.ingest", full)
    assert archive("add", runs / "quad-07-0", *ROOT) == ExitCode.FULL
    assert "the index could not be written" in capsys.readouterr().err

    def full_too(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("rtshcua.adapters.archive.adding.ingest", full_too)
    assert archive("add", runs / "quad-07-1", *ROOT) == ExitCode.FULL
    assert capsys.readouterr().err == "error: no space left on device: `archive`\n"


def test_questions_that_ship_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("query") == ExitCode.OK
    out = capsys.readouterr().out
    assert "which vehicle was refused what, when, why, under which policy version" in out
    assert archive("query", "refused-by-skill", "--show-sql") == ExitCode.OK
    assert capsys.readouterr().out.startswith("SELECT skill, COUNT(*)")


@pytest.mark.usefixtures("archived")
def test_refused_query_has_vehicle_step_time_and_version(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--vehicle", "quad-07", "--skill", "goto", "--policy", "bridge_inspection@8", "--since", "2025-06-15")
    assert archive("query", "refused", *words, "--json") == ExitCode.OK
    rows = as_json(capsys)
    assert rows
    assert {(row["vehicle"], row["skill"], row["policy_version"]) for row in rows} == {("quad-07", "goto", 8)}
    assert archive("query", "refused", *words, "--csv") == ExitCode.OK
    table = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["utc_us"] for row in table] == [str(row["utc_us"]) for row in rows]
    assert archive("query", "refused", *words, "--limit", 1) == ExitCode.OK
    head, line = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["utc_us", "vehicle", "mission"]
    assert line.startswith("2025-06-15 ")
    assert archive("query", "refused", "--until", "2025-06-15T00:00Z", "--json") == ExitCode.OK
    assert as_json(capsys) == []


@pytest.mark.usefixtures("archived")
def test_a_select_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        archive("query", "--sql", "SELECT COUNT(*) AS n FROM decided", "--vehicle", "quad-08", "--json") == ExitCode.OK
    )
    (row,) = as_json(capsys)
    assert 100 < row["n"] < 600
    assert archive("query", "--sql", "DROP TABLE logs") == ExitCode.INPUT
    assert "a single SELECT" in capsys.readouterr().err


@pytest.mark.usefixtures("archived")
def test_list_and_stats(capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("list", "--vehicle", "quad-08", "--json") == ExitCode.OK
    assert [row["policy_version"] for row in as_json(capsys)] == [7, 7, 8]
    assert archive("list") == ExitCode.OK
    assert len(capsys.readouterr().out.splitlines()) == 7
    assert archive("stats", "--json") == ExitCode.OK
    assert [(row["status"], row["logs"], row["vehicles"]) for row in as_json(capsys)] == [
        ("incomplete", 1, 1),
        ("verified", 5, 2),
    ]


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (("query", "refused"), ExitCode.INPUT, "`archive` is not an archive"),
        (("stats",), ExitCode.INPUT, "`archive` is not an archive"),
        (("verify", *ROOT), ExitCode.INPUT, "`archive` is not an archive"),
        (("add", "gone.jsonl", *ROOT), ExitCode.INPUT, "no such file"),
        (("add", ".", *ROOT), ExitCode.INPUT, "no `log.jsonl` found"),
        (("query", "refusd"), ExitCode.USAGE, "no such query: `refusd`"),
        (("query", "refused", "--sql", "SELECT 1"), ExitCode.USAGE, "cannot be combined"),
        (("query", "refused", "--since", "yesterday"), ExitCode.USAGE, "neither a day nor a time"),
        (("query", "refused", "--policy", "x@y"), ExitCode.USAGE, "has no valid version"),
        (("query", "missing", "--skill", "goto"), ExitCode.USAGE, "filters on decisions do not apply"),
        (("add",), ExitCode.USAGE, "missing"),
        (("list", "--status", "nonsense"), ExitCode.USAGE, "accepted: verified, incomplete, failed"),
        (("query", "refused", "--outcome", "nonsense"), ExitCode.USAGE, "accepted: allow, deny, defer, fallback"),
        (("query", "refused", "--witness", "nonsense"), ExitCode.USAGE, "accepted: witnessed, unwitnessed"),
        (("stats",), ExitCode.INPUT, "help: create one with `rtshcua archive add LOG...`"),
    ],
)
def test_invalid_options_are_refused(
    words: tuple[str, ...], code: ExitCode, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert archive(*words) == code
    assert text in capsys.readouterr().err


@pytest.mark.slow
def test_unreachable_cluster_is_reported(runs: Path) -> None:
    """Run in a separate process, because a cluster client leaves a thread behind."""
    words = ["archive", "add", str(runs / "quad-07-0"), *ROOT, "--cluster", "nonsense"]
    run = subprocess.run(
        [sys.executable, "-m", "rtshcua", *words], capture_output=True, text=True, check=False, timeout=120
    )
    assert (run.returncode, run.stderr) == (ExitCode.LINK, "error: no cluster answered: `nonsense`\n")


def test_file_that_is_not_a_log_is_not_added(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.txt").write_text("{}")
    assert archive("add", "notes.txt", *ROOT) == ExitCode.INPUT
    assert "`notes.txt` is not a log of this program" in capsys.readouterr().err
    assert not (tmp_path / "archive").exists()


def test_archive_add_requires_a_root(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert archive("add", runs) == ExitCode.UNTRUSTED
    assert "name the trust root" in capsys.readouterr().err
    assert not (tmp_path / "archive").exists()


@pytest.mark.parametrize("words", [("stats",), ("query", "refused"), ("add",)])
def test_missing_archive_extra_is_named(
    words: tuple[str, ...], runs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [*sys.modules]:
        if name.startswith("rtshcua.adapters.archive"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "duckdb", None)
    assert archive(*words, *((runs, *ROOT) if words == ("add",) else ())) == ExitCode.INPUT
    err = capsys.readouterr().err
    assert "the package `duckdb` is required and not installed" in err
    assert "pip install '.[archive]'" in err


@pytest.mark.parametrize(
    ("status", "finding", "code"),
    [
        ("verified", None, ExitCode.OK),
        ("incomplete", "close/missing", ExitCode.INCOMPLETE),
        ("failed", "chain/broken", ExitCode.EVIDENCE),
        ("failed", "trust/root-unknown-key", ExitCode.UNTRUSTED),
        ("failed", "genesis/format", ExitCode.UNTRUSTED),
        ("failed", "genesis/missing", ExitCode.EVIDENCE),
        ("failed", "decision/outcome", ExitCode.DECISION),
        ("failed", "document/unknown-key", ExitCode.DECISION),
        ("failed", "dispatch/unpermitted", ExitCode.DECISION),
        ("failed", "anchor/root", ExitCode.ANCHOR),
        ("failed", "archive/changed", ExitCode.EVIDENCE),
    ],
)
def test_exit_codes_are_those_of_verify_log(status: str, finding: str | None, code: ExitCode) -> None:
    assert code_of(status, finding) is code


def test_text_of_the_world_moves_no_cursor(capsys: pytest.CaptureFixture[str]) -> None:
    archive_tables.tell(("detail",), [("\033[2Jgone\n",)], archive_tables.Shape.TABLE)
    assert capsys.readouterr().out == "detail\n<U+001B>[2Jgone<U+000A>\n"


@pytest.mark.slow
@pytest.mark.parametrize("again", [(), ("--reindex",)])
@pytest.mark.usefixtures("archived")
def test_a_log_that_is_gone_fails_and_the_others_are_verified(
    again: tuple[str, ...], runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = tmp_path / "archive" / "logs"
    data = (runs / "quad-07-0" / "log.jsonl").read_bytes()
    (log,) = (path for path in gone.glob("*/*/log.jsonl") if path.read_bytes() == data)
    log.unlink()
    assert archive("verify", *again, *ROOT, "--jobs", 1, "--json") == ExitCode.EVIDENCE
    said = as_json(capsys)
    assert said["counts"] == {"failed": 1, "verified": 4, "incomplete": 1}
    (failed,) = (each for each in said["logs"] if each["status"] == "failed")
    assert (failed["log"], failed["finding"]) == (log.parent.name, "archive/missing")
    assert archive("add", runs / "quad-07-0", *ROOT) == ExitCode.OK
    assert log.read_bytes() == data
    capsys.readouterr()
    assert archive("stats", "--json") == ExitCode.OK
    assert {row["status"]: row["logs"] for row in as_json(capsys)} == {"verified": 5, "incomplete": 1}


def test_other_files_do_not_block_the_logs_of_a_folder(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, data in (("a", b""), ("b", b"junk\n"), ("z", (runs / "quad-07-0" / "log.jsonl").read_bytes())):
        (tmp_path / "flown" / name).mkdir(parents=True)
        (tmp_path / "flown" / name / "log.jsonl").write_bytes(data)
    os.mkfifo(tmp_path / "flown" / "log.jsonl")
    assert archive("add", "flown", *ROOT) == ExitCode.INPUT
    out = capsys.readouterr().out
    assert out.count("it is not a log of this program") == 2
    assert "flown/log.jsonl: not a regular file" in out
    assert out.splitlines()[-1] == "1 log, 1 of them verified now, under the key on the command line: 1 verified"
    assert archive("add", "flown", *ROOT, "--json") == ExitCode.INPUT
    assert [Path(each["path"]).parent.name for each in as_json(capsys)["skipped"]] == ["a", "b", "flown"]
    assert archive("add", "flown/a", "flown/b", *ROOT) == ExitCode.INPUT
    assert "cannot add `flown/a/log.jsonl`" in capsys.readouterr().err
    assert archive("add", "flown/z", "flown/b/log.jsonl", *ROOT) == ExitCode.INPUT
    assert "`flown/b/log.jsonl` is not a log of this program" in capsys.readouterr().err


@pytest.mark.slow
def test_two_stories_of_one_boot_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        generated_logs.write(
            tmp_path / name / "log.jsonl", "quad-07", 0, records=200, ending="completed" if name == "one" else "landed"
        )
    assert archive("add", "one", *ROOT) == ExitCode.OK
    capsys.readouterr()
    assert archive("add", "other", *ROOT) == ExitCode.EVIDENCE
    out = capsys.readouterr().out
    assert "one/log.jsonl` and `" in out.replace("other/log.jsonl` and `one/log.jsonl`", "one/log.jsonl` and `")
    assert "were signed differently at record" in out
    assert "conflict: 1 pair of logs" in out
    assert archive("verify", *ROOT, "--jobs", 1, "--json") == ExitCode.EVIDENCE
    assert len(as_json(capsys)["conflicts"]) == 1


def test_a_link_in_a_folder_is_not_taken_in(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A received folder must not make us copy another file of ours; a log named on the command line may be a link."""
    for name in ("a", "b"):
        Path("flown", name).mkdir(parents=True)
    Path("flown/a/log.jsonl").symlink_to(runs / "quad-07-0" / "log.jsonl")
    Path("flown/b/log.jsonl").write_bytes((runs / "quad-07-1" / "log.jsonl").read_bytes())
    assert archive("add", "flown", *ROOT) == ExitCode.INPUT
    assert "flown/a/log.jsonl: symbolic links are not followed here" in capsys.readouterr().out
    assert archive("add", "flown/a/log.jsonl", *ROOT) == ExitCode.OK


def test_log_replaced_by_a_link_is_not_added(
    runs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("flown/a").mkdir(parents=True)
    log = Path("flown/a/log.jsonl")
    log.write_bytes((runs / "quad-07-1" / "log.jsonl").read_bytes())

    def looked_at_and_replaced(path: Path, root: Path | None = None) -> bool:
        begins = begins_as_log(path, root)
        path.unlink()
        path.symlink_to(runs / "quad-07-0" / "log.jsonl")
        return begins

    monkeypatch.setattr("rtshcua.app.log_archive.begins_as_log", looked_at_and_replaced)
    assert archive("add", "flown", *ROOT) == ExitCode.INPUT
    assert "symbolic links are not followed here: `flown/a/log.jsonl`" in capsys.readouterr().err
    assert not list(Path("archive/logs").rglob("*.jsonl"))


def test_wide_table_is_printed_row_by_row(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [["a" * 30, "b" * 30, 1], ["c", "d", 2]]
    monkeypatch.setenv("COLUMNS", "80")
    archive_tables.tell(["one", "another", "third"], rows, archive_tables.Shape.TABLE)
    assert capsys.readouterr().out.splitlines()[0].split() == ["one", "another", "third"]
    monkeypatch.setenv("COLUMNS", "60")
    archive_tables.tell(["first", "another", "third"], rows, archive_tables.Shape.TABLE)
    lines = ["first    " + "a" * 30, "another  " + "b" * 30, "third    1", "", "first    c", "another  d", "third    2"]
    assert capsys.readouterr().out.splitlines() == lines
