"""`verify-log` on too few witnesses, malformed notes, and unread files."""

import json
from base64 import b64decode, b64encode
from pathlib import Path

import pytest

from reference.forgery import LOG_KEY, edit, flight, signed
from reference.marked import mark, note_of
from rtshcua.adapters.store.recovery import examine
from rtshcua.app import verify_log
from rtshcua.app.fly.simulated_flight import SIMULATED, pace_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.recovery import ending
from rtshcua.evidence.report import LogReport
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Witnessed
from rtshcua.front.cli import app
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty
from virtual import case

ROOT = case.KEYS[Duty.ROOT]
HOWS = [[], ["--audit"], ["--fast"]]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join(flight()))
    return path


def verify(*words: object) -> int:
    return app.main(["verify-log", "--root", ROOT.public.hex(), *map(str, words)])


def spoilt(note: str) -> str:
    head, _, blob = note.rstrip("\n").rpartition(" ")
    octets = bytearray(b64decode(blob))
    octets[40] ^= 1
    return f"{head} {b64encode(bytes(octets)).decode()}\n"


@pytest.mark.parametrize("how", HOWS)
def test_a_damaged_note_says_nothing(how: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An anchor file is unsigned, so its content must not make a valid log fail."""
    note = mark(note_of(flight(), len(flight()) - 1))
    log.with_suffix(".anchors").write_text(spoilt(note) + "\n" + spoilt(note) + "\n")
    assert verify(log, *how) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "closed and signed; unanchored" in out
    assert "- 2 notes of witnesses, damaged or forged and ignored: witness `rtshcua/witness/" in out
    log.with_suffix(".anchors").write_text(spoilt(note) + "\n" + note + "\n")
    assert verify(log, *how) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "closed and signed; anchored to its end" in out
    assert "- 1 note of witnesses, damaged or forged" in out


@pytest.mark.parametrize("how", HOWS)
def test_a_file_of_anchors_that_holds_none(how: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log.with_suffix(".anchors").write_bytes(b"\xff\0garbage")
    (log.parent / "empty.anchors").touch()
    assert verify(log, *how) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "- the notes of witnesses in `log.anchors`: these files contain no readable notes" in out


def test_missing_path_is_reported(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(log, "--require-anchor") == ExitCode.INCOMPLETE
    out = capsys.readouterr().out
    assert "The log is complete, but witnesses did not see all of it" in out
    assert "The program stopped" not in out


@pytest.mark.parametrize("fast", [True, False])
def test_telemetry_that_nobody_read(fast: bool, log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (log.parent / "telemetry.tlog").write_bytes(b"")
    assert verify(log, *(["--fast"] if fast else [])) in (ExitCode.OK, ExitCode.EVIDENCE)
    assert ("`telemetry.tlog` was not read: without `--fast`" in capsys.readouterr().out) == fast


def test_fast_omits_missing_telemetry(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(log, "--fast") == ExitCode.OK
    assert "telemetry.tlog" not in capsys.readouterr().out


def test_a_log_that_must_be_anchored_and_too_few_cosigned() -> None:
    report = LogReport(
        10,
        {},
        None,
        None,
        None,
        None,
        0,
        b"",
        (),
        (),
        10,
        1,
        0,
        AnchoredExtent(0, 10, 2, (Witnessed(bytes(32), "w", 9, 1),)),
    )
    missing = verify_log._required(report).shortfall
    assert missing is not None
    assert missing.found == "0 records, the rest cosigned by 1 of 2 required witnesses"


def test_flight_speed_is_reported() -> None:
    assert pace_of(1, own=False) is None
    assert pace_of(1, own=True) == "a simulated vehicle, as fast as life"
    assert pace_of(10, own=True) == "a simulated vehicle, 10 times as fast as life"
    assert pace_of(0.5, own=False) == "a simulated vehicle, 0.5 times as fast as life"


def test_missing_log_does_not_stop_the_others(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lost = log.parent / "lost.jsonl"
    assert verify(lost, log) == verify(log, lost) == verify(lost, log, lost) == ExitCode.INPUT
    said = capsys.readouterr()
    assert said.out.count("VERIFIED") == 3
    assert said.err.count("no such file or directory") == 4
    cut = log.parent / "cut.jsonl"
    cut.write_bytes(b"".join(flight()[:-1]))
    assert verify(cut, lost, log) == ExitCode.INCOMPLETE, "the first that is not 0"


def test_write_failure_ends_the_command(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rtshcua.front.cli.commands.verify_log.as_text", full)
    assert verify(log, log) == ExitCode.FULL


def test_trailing_zeros_are_explained_as_a_power_cut(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log.write_bytes(b"".join(flight()[:-1]) + bytes(5_000))
    assert verify(log) == ExitCode.INCOMPLETE
    assert "tail/torn" in capsys.readouterr().out
    assert app.main(["recover", "--dry-run", str(log)]) == ExitCode.INCOMPLETE
    assert "can be recovered" in capsys.readouterr().out
    log.write_bytes(b"".join(flight()[:-1]) + bytes(5_000) + b"x")
    assert verify(log) == ExitCode.EVIDENCE
    assert "record/malformed" in capsys.readouterr().out


def test_a_recovered_flight_lasted_until_its_last_record(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = flight()[:-3]
    log.write_bytes(b"".join(kept))
    now = Now(1, json.loads(kept[-1])["utc_us"] + 86_400_000_000, 1_000)
    tail = ending(
        examine(log, None), now, lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, lambda: bytes(32)
    )
    log.write_bytes(b"".join(kept) + tail)
    for how in HOWS:
        assert verify(log, "--json", *how) == ExitCode.OK
        found = json.loads(capsys.readouterr().out)
        assert found["flight"]["lasted_us"] == json.loads(kept[-1])["at_us"] - json.loads(kept[0])["at_us"]
    log.write_bytes(b"".join(flight()))
    assert verify(log, "--json") == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert found["flight"]["lasted_us"] == json.loads(flight()[-1])["at_us"] - json.loads(kept[0])["at_us"]


@pytest.mark.parametrize("number", [1, 2])  # behind the boundary's first statement, where there is one
@pytest.mark.parametrize("how", HOWS)
def test_a_simulated_flight_says_so(how: list[str], number: int, log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(log, *how) == ExitCode.OK
    assert "simulated vehicle" not in capsys.readouterr().out
    detail = pace_of(10, own=True)
    lines = list(flight())
    lines[number] = edit(lines[number], event=SIMULATED, detail=detail)
    log.write_bytes(b"".join(signed(lines)))
    assert verify(log, *how) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "- that anything flew: times are those of a simulated vehicle, 10 times as fast as life" in out
    assert verify(log, "--explain", 3) == ExitCode.OK
    assert "those of a simulated vehicle, 10 times as fast as life" in " ".join(capsys.readouterr().out.split())
    assert app.main(["show", str(log)]) == ExitCode.OK
    assert "· simulated" in capsys.readouterr().out
