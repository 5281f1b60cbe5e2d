"""Threat: a folder of logs, or an archive, of another user contains links, pipes and names that lead out of it.

Nothing outside of it is read, written or deleted, and a copy is never more readable than its original.
"""

import os
import shutil
from pathlib import Path

import duckdb
import pytest

from reference import generated_logs
from reference.archived import write_fleet
from rtshcua.adapters.archive.folder import TABLES
from rtshcua.adapters.store.writing import append
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

ROOT = ("--root", generated_logs.ROOT_KEY.hex(), "--jobs", "1")


def archive(*words: object) -> int:
    return app.main(["archive", *map(str, words)])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("fleet")
    write_fleet(folder)
    return (folder / "quad-07-0.jsonl").read_bytes()


@pytest.fixture(scope="module")
def filled(log: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filled")
    (folder / "run").mkdir()
    (folder / "run/log.jsonl").write_bytes(log)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RTSHCUA_DATA_DIR", str(folder))
        assert archive("add", folder / "run", "--archive", folder / "archive", *ROOT) == ExitCode.OK
    return folder / "archive"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder of ours, with something in it."""
    place = tmp_path / "victim"
    (place / "below").mkdir(parents=True)
    (place / "below/notes.txt").write_text("mine")
    return place


def inside(folder: Path) -> list[tuple[str, bytes | None]]:
    return [(str(each), each.read_bytes() if each.is_file() else None) for each in sorted(folder.rglob("*"))]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tmp", ("add", "../new")), ("tmp", ("verify",)), ("logs", ("add", "../new")),
        ("logs", ("verify", "--reindex")),
        ("index", ("add", "../new")), ("index", ("query", "missing")), ("index/decisions", ("verify", "--reindex")),
        ("index/decisions", ("query", "missing")), ("index/logs.parquet", ("query", "missing")),
    ],
    ids=str,
)  # fmt: skip
def test_a_link_in_the_place_of_a_folder_is_not_followed(
    filled: Path, log: bytes, victim: Path, tmp_path: Path, name: str, words: tuple[str, ...]
) -> None:
    shutil.copytree(filled, "archive")
    (tmp_path / "new").mkdir()
    (tmp_path / "new/log.jsonl").write_bytes(log)
    place = Path("archive", name)
    if place.is_file():
        place.unlink()
    else:
        shutil.rmtree(place)
    place.symlink_to(victim)
    before = inside(victim)
    assert archive(*words, *(() if words[0] == "query" else ROOT)) == ExitCode.INPUT
    assert inside(victim) == before


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_a_link_among_the_logs_is_not_followed(
    filled: Path, log: bytes, tmp_path: Path, victim: Path, depth: int
) -> None:
    shutil.copytree(filled, "archive")
    (place,) = Path("archive/logs").glob("*/*/log.jsonl")
    for _ in range(3 - depth):
        place = place.parent
    shutil.rmtree(place) if place.is_dir() else place.unlink()
    place.symlink_to(victim if depth < 3 else victim / "below/notes.txt")
    before = inside(victim)
    (tmp_path / "log.jsonl").write_bytes(log)
    for words in (["verify"], ["add", "../log.jsonl"]):
        code = archive(*words, *ROOT)
        assert code != ExitCode.OK or not place.is_symlink()
        assert inside(victim) == before


@pytest.mark.parametrize("where", ["index/decisions/x.parquet", "tmp/x"])
def test_a_pipe_is_not_waited_for(filled: Path, where: str, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(filled, "archive")
    Path("archive", where).unlink(missing_ok=True)
    os.mkfifo(Path("archive", where))
    assert archive("query", "missing") == ExitCode.INPUT
    assert f"`{where}` in the archive" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("column", "value"), [("part", "../../../victim/x"), ("part", "*"), ("log", "/etc/passwd"), ("log", "x" * 64)]
)
def test_index_with_outside_paths_is_ignored(
    filled: Path, column: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(filled, "archive")
    catalogue = "archive/index/logs.parquet"
    with duckdb.connect() as engine:
        engine.execute(f"CREATE TABLE l AS SELECT * REPLACE ('{value}' AS {column}) FROM read_parquet('{catalogue}')")
        engine.execute(f"COPY l TO '{catalogue}' (FORMAT parquet)")
    assert archive("verify", *ROOT) == ExitCode.INPUT
    assert "refers to files outside of the archive" in capsys.readouterr().err
    if column == "part":
        assert archive("query", "missing") == ExitCode.INPUT
    assert archive("verify", "--reindex", *ROOT) == ExitCode.OK
    assert all(len(list(Path("archive/index", table).iterdir())) == 2 for table in TABLES)


def test_copy_has_permissions_of_its_log(log: bytes) -> None:
    Path("run").mkdir()
    for name, mode in (("log.jsonl", 0o600), ("log.anchors", 0o640)):
        Path("run", name).write_bytes(log if name == "log.jsonl" else b"a/b/c\n1\nAAAA\n\n\xe2\x80\x94 x AAAA\n\n")
        Path("run", name).chmod(mode)
    assert archive("add", "run", *ROOT) == ExitCode.OK
    (kept,) = Path("archive/logs").glob("*/*/log.jsonl")
    assert kept.stat().st_mode & 0o777 == 0o400
    for anchors in kept.parent.glob("*.anchors"):
        assert anchors.stat().st_mode & 0o037 == 0


def test_invalid_anchor_file_is_not_copied(log: bytes) -> None:
    Path("run").mkdir()
    Path("run/log.jsonl").write_bytes(log)
    Path("run/private.anchors").write_text("-----BEGIN PRIVATE KEY-----\n")
    assert archive("add", "run", *ROOT) == ExitCode.OK
    assert not list(Path("archive").rglob("*.anchors"))


def test_file_changed_before_copy_is_checked_again(
    log: bytes, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("run").mkdir()
    Path("run/log.jsonl").write_text("-----BEGIN PRIVATE KEY-----\n")
    monkeypatch.setattr("rtshcua.app.log_archive.begins_as_log", lambda *_: True)
    assert archive("add", "run", *ROOT) == ExitCode.INPUT
    assert "it is not a log of this program" in capsys.readouterr().err
    assert not list(Path("archive/logs").rglob("*.jsonl"))


def test_a_witness_does_not_append_to_a_file_of_another_name(tmp_path: Path, victim: Path) -> None:
    os.link(victim / "below/notes.txt", tmp_path / "log.anchors")
    with pytest.raises(OSError, match="hard link to another file"):
        append(tmp_path / "log.anchors", b"anchor", tmp_path)
    assert (victim / "below/notes.txt").read_text() == "mine"
