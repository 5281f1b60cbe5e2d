"""`rtshcua recover`: output and exit codes."""

import json
from hashlib import sha256
from pathlib import Path
from random import Random

import pytest

from reference.crashed import LOG_KEY, unverified, writes
from reference.forgery import flight
from reference.marked import mark, note_of
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.recovery import alone
from rtshcua.adapters.store.vehicle_records import LastLog
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.records import is_signed
from rtshcua.front.cli import app
from rtshcua.wire.key_file import dump_signing_key
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case


@pytest.fixture
def lines() -> list[bytes]:
    log = writes(Random(6), seals=9)
    return [next(log)[0] for _ in range(30)]


@pytest.fixture
def run(tmp_path: Path, lines: list[bytes]) -> Path:
    """The folder of a run whose log ends in the middle of a line; and its log key in the key store."""
    store = KeyStore(data_folder())
    store.folder.mkdir(parents=True)
    store.key_path(Duty.LOG).write_bytes(dump_signing_key(LOG_KEY, passphrase=None))
    store.key_path(Duty.LOG).chmod(0o600)
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "log.jsonl").write_bytes(b"".join(lines) + b'{"_prev":"0')
    return folder


def recover(*words: object) -> int:
    return app.main(["recover", *map(str, words)])


def test_a_log_that_broke_off(run: Path, lines: list[bytes], capsys: pytest.CaptureFixture[str]) -> None:
    assert recover(run) == ExitCode.OK
    out = capsys.readouterr().out
    assert "log.jsonl: recovered, 30 records kept\n" in out
    assert "were not sealed" in out
    assert "11 bytes after them are in log.discarded: the log ends inside this record" in out
    assert unverified(run / "log.jsonl", lines, 30) == ""
    assert recover(run / "log.jsonl") == ExitCode.OK
    assert "closed, 32 records; nothing to recover" in capsys.readouterr().out


def test_a_dry_run_needs_no_key_and_changes_nothing(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    KeyStore(data_folder()).key_path(Duty.LOG).unlink()
    before = (run / "log.jsonl").read_bytes()
    assert recover("--dry-run", run) == ExitCode.INCOMPLETE
    assert "can be recovered, 30 records kept" in capsys.readouterr().out
    assert (run / "log.jsonl").read_bytes() == before
    assert len(list(run.iterdir())) == 1


def test_as_json(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert recover("--json", run) == ExitCode.OK
    said = json.loads(capsys.readouterr().out)
    assert (said["state"], said["recovered"], said["records"], said["exit_code"]) == ("torn", True, 30, 0)
    assert (said["discarded_bytes"], said["discarded"]) == (11, str(run / "log.discarded"))
    assert said["reason"]["slug"] == "tail/torn"


def test_tampered_log_is_left_unchanged(run: Path, lines: list[bytes], capsys: pytest.CaptureFixture[str]) -> None:
    data = b"".join(lines[:2] + lines[3:])
    (run / "log.jsonl").write_bytes(data)
    assert recover(run) == ExitCode.EVIDENCE
    err = capsys.readouterr().err
    assert "the damage was not caused by a crash, so the log is not signed: record 2, octet" in err
    assert "the log was not changed" in err
    assert (run / "log.jsonl").read_bytes() == data
    assert recover("--json", run) == ExitCode.EVIDENCE
    assert json.loads(capsys.readouterr().out)["reason"]["slug"] == "chain/sequence"


def test_the_log_of_another_key(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.key"
    other.write_bytes(
        dump_signing_key(SigningKey.from_seed(b"o" * 32, duty=Duty.LOG, development=True), passphrase=None)
    )
    other.chmod(0o600)
    assert recover("--log-key", other, run) == ExitCode.UNTRUSTED
    assert "its flight used a different log key" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", ExitCode.EVIDENCE),
        (b'{"_prev":"00', ExitCode.EVIDENCE),
        (b'{"_prev":"","format":"rtshcua/log","type":"genesis","version":1}\n', ExitCode.UNTRUSTED),
    ],
)
def test_log_without_first_record_is_refused(
    run: Path, data: bytes, code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    (run / "log.jsonl").write_bytes(data)
    assert recover(run) == code
    assert "the first record is missing" in capsys.readouterr().err


@pytest.mark.parametrize("data", [b"hello\n", b"\x8a\x00\x01", b'{"format":"rtshcua/log"}\r\n'])
@pytest.mark.parametrize("how", [[], ["--dry-run"]])
def test_other_file_is_refused(run: Path, data: bytes, how: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    (run / "log.jsonl").write_bytes(data)
    assert recover(run, *how) == ExitCode.INPUT
    assert "is not a log of this program" in capsys.readouterr().err
    assert (run / "log.jsonl").read_bytes() == data


def test_a_log_that_is_being_written(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with alone(run / "log.jsonl"):
        assert recover(run) == ExitCode.INPUT
    assert "is still being written" in capsys.readouterr().err


def test_first_nonzero_exit_code_is_returned(run: Path, tmp_path: Path) -> None:
    assert recover(run, tmp_path / "none.jsonl") == ExitCode.INPUT
    (tmp_path / "empty.jsonl").touch()
    assert recover(run, tmp_path / "empty.jsonl") == ExitCode.EVIDENCE


@pytest.mark.parametrize("kept", [0, 1, 12, 30, 31])
def test_a_log_that_was_closed_is_not_ended_anew_where_its_end_was_cut_off(
    run: Path, kept: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert recover(run) == ExitCode.OK
    log = run / "log.jsonl"
    whole = log.read_bytes().splitlines(keepends=True)
    known = LastLog(data_folder() / "state", "quad-07")
    known.end(log, None, sha256(b"\0" + whole[-1]).hexdigest())
    (known.path.parent / "vehicle-other").write_bytes(b"damaged")
    assert recover(run) == ExitCode.OK
    log.write_bytes(b"".join(whole[:kept]))
    capsys.readouterr()
    for words in ((run,), ("--dry-run", run)):
        assert recover(*words) == ExitCode.EVIDENCE
        assert "was closed before with another last record" in capsys.readouterr().err
    assert log.read_bytes() == b"".join(whole[:kept])
    assert recover("--json", run) == ExitCode.EVIDENCE
    said = json.loads(capsys.readouterr().out)
    assert (said["state"], said["recovered"], said["reason"]["slug"]) == ("tampered", False, "close/missing")
    if kept > 1:
        assert recover("--state-dir", run, run) == ExitCode.OK  # no last log is stored there


def flown(run: Path) -> tuple[tuple[bytes, ...], list[int]]:
    """The log of a flight whose log key is in the key store, and the numbers of its signed records."""
    KeyStore(data_folder()).key_path(Duty.LOG).write_bytes(dump_signing_key(case.KEYS[Duty.LOG], passphrase=None))
    whole = flight()
    return whole, [number for number, line in enumerate(whole) if is_signed(line)]


@pytest.mark.parametrize("words", [[], ["--dry-run"], ["--json"]])
@pytest.mark.parametrize("end", [b"", b'{"_prev":"0'])
def test_log_shorter_than_its_anchors_is_not_closed(
    words: list[str], end: bytes, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log that was cut after a signed record looks like a crash, but its witness saw a later record."""
    whole, signed = flown(run)
    cut = signed[-2] + 1
    (run / "log.jsonl").write_bytes(b"".join(whole[:cut]) + end)
    note = mark(note_of(whole, signed[-1]))
    (run / "log.anchors").write_text(note + "\n")
    before = sorted((path.name, path.read_bytes()) for path in run.iterdir())
    assert recover(run, *words) == ExitCode.ANCHOR
    said = capsys.readouterr()
    assert "saw a longer log: the end of this one was removed" in " ".join(said.err.split())
    assert sorted((path.name, path.read_bytes()) for path in run.iterdir()) == before, "nothing was written"


def test_anchors_of_kept_records_do_not_block_recovery(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, signed = flown(run)
    (run / "log.jsonl").write_bytes(b"".join(whole[: signed[-2] + 2]))
    (run / "log.anchors").write_text(mark(note_of(whole, signed[-2])) + "\n" + "garbage\n\n")
    assert recover(run) == ExitCode.OK, capsys.readouterr().err
    assert recover(run) == ExitCode.OK, "it is closed, and ahead of its witness"
