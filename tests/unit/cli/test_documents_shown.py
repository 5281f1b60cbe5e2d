"""`show`, `why` and `verify-log` on a log with documents: the steps are those in force, and no signature is printed."""

import json
from pathlib import Path

import pytest

from reference.documents import approval, hand, low, recall, replacement
from reference.flat_case import S
from reference.world import ROOT_KEY, TICK, Run
from rtshcua.cli.app import main
from rtshcua.diagnostics.exits import ExitCode


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Approved, then replaced, then recalled on the way home."""
    run = Run(low()).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    assert hand(run, replacement(run.loaded)) == "accepted"
    run.until_flies("return_home")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    for _ in range(S // TICK):
        run.clock.advance(TICK)
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join([*run.lines, close]))
    return path


def test_a_timeline_names_the_steps_that_are_in_force(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(log)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "letters, signed" in out
    assert max(map(len, out.splitlines())) < 200
    assert "step 2 `step 3`" in out, "the last step, which is the third one now"


def test_a_decision_is_told_from_the_mission_in_force(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(log), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["outcome"] == "allow"
    damaged = log.read_bytes().replace(b'"event":"replacement"', b'"event":"replacemant"')
    log.write_bytes(damaged)
    assert main(["why", str(log), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["reason"] == "integrity/binding-mismatch"


def test_a_replacement_that_is_none(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = log.read_bytes().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if b'"event":"replacement"' in line)
    for nonsense in ("", "!!", "aGVsbG8="):
        record = json.loads(lines[at]) | {"detail": nonsense}
        lines[at] = json.dumps(record, separators=(",", ":"), sort_keys=True).encode() + b"\n"
        log.write_bytes(b"".join(lines))
        assert main(["show", str(log)]) == ExitCode.OK
        assert main(["why", str(log)]) == ExitCode.INPUT
        assert "a replacement in the log" in capsys.readouterr().err


def test_the_audit_says_what_was_signed(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify-log", str(log), "--root", ROOT_KEY.public.hex(), "--json"]) == ExitCode.OK
    proven = {claim["slug"]: claim["text"] for claim in json.loads(capsys.readouterr().out)["proven"]}
    assert proven["documents"].startswith("1 approval, 1 recall, 1 replacement, ")
