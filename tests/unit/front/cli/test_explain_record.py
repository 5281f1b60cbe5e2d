"""`rtshcua verify-log --explain N`: one record explained, after an audit of its log."""

import json
import re
from pathlib import Path

import pytest

from reference.forgery import ROOT_KEY, edit, flight, signed
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

LINES = flight()
RECORDS = [json.loads(line) for line in LINES]
DECISION = next(record for record in RECORDS if record["type"] == "decision")
SENT = next(record for record in RECORDS if record.get("event") == "dispatched")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join(LINES))
    return path


def explain(log: Path, number: int, *words: str) -> int:
    return app.main(["verify-log", str(log), "--root", ROOT_KEY.hex(), "--explain", str(number), *words])


def words(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join(capsys.readouterr().out.split())


def test_a_decision(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert explain(log, DECISION["seq"]) == ExitCode.OK
    told = words(capsys)
    assert f"Record {DECISION['seq']}: allow step 1" in told
    assert f"asked to begin a step, for invocation {DECISION['invocation']}" in told
    assert "decided allow: admitted, at step 8 of the rules" in told
    assert f"sent by record {SENT['seq']}" in told
    assert re.search(r"battery = 99 %, 5\d\d(\.\d)? ms old", told)
    assert "position = 47.39" in told
    assert "gps.fix = fix_3d" in told
    assert "durability 3 (synced first): on the disk before the permitted command was sent" in told
    seal = next(record["seq"] for record in RECORDS if record["type"] == "seal")
    key = RECORDS[0]["next_key"]
    assert f"signed by record {seal}, which seals epoch 0, with epoch key {key}, which record 0 names" in told
    assert "verified yes" in told
    assert "anchored no" in told


def test_dispatch_record_names_its_permit(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert explain(log, SENT["seq"]) == ExitCode.OK
    told = words(capsys)
    assert f"permitted by record {DECISION['seq']}" in told
    assert "durability 1 (written): survives the end of the process" in told


@pytest.mark.slow
def test_every_record_can_be_explained(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for record in RECORDS:
        assert explain(log, record["seq"], "--json", "--no-derive") == ExitCode.OK
        told = json.loads(capsys.readouterr().out)
        assert told["record"] == {name: value for name, value in record.items() if name not in ("bundle", "root")}
        assert told["anchored"] is False
        signer = next(each["seq"] for each in RECORDS if each["seq"] >= max(record["seq"], 1) and "checkpoint" in each)
        assert told["sealed_by"] == (None if record["type"] == "genesis" and signer == 0 else signer)
        assert (told["verdict"], told["exit_code"]) == ("verified", 0)
        assert explain(log, record["seq"]) == ExitCode.OK
        assert capsys.readouterr().out.startswith(f"Record {record['seq']}: ")


def test_unsigned_record_is_explained_as_unsigned(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log.write_bytes(b"".join(LINES[:4]))
    assert explain(log, 3) == ExitCode.INCOMPLETE
    told = words(capsys)
    assert "signed by nobody: the log ends before its epoch was sealed" in told
    assert "as far as it goes: the log is incomplete" in told
    assert "sent never" in told


def test_a_log_that_fails(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    number = DECISION["seq"]
    forged = signed([*LINES[:number], edit(LINES[number], outcome="deny"), *LINES[number + 1 :]])
    log.write_bytes(b"".join(forged))
    assert explain(log, number) == ExitCode.DECISION
    assert f"verified NO, the log fails at record {number}, decision/outcome" in words(capsys)


def test_there_must_be_such_a_record(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert explain(log, 999) == ExitCode.INPUT
    assert "has no record 999" in capsys.readouterr().err
    log.write_bytes(b"".join([*LINES[:3], b"{}\n"]))
    assert explain(log, 7) == ExitCode.EVIDENCE
    assert "fails before record 7, at record 3: record/malformed, not a record" in capsys.readouterr().err
    assert app.main(["verify-log", str(log), str(log), "--root", ROOT_KEY.hex(), "--explain", "1"]) == ExitCode.USAGE
    log.write_bytes(b"hello\n")
    assert explain(log, 0) == ExitCode.INPUT
