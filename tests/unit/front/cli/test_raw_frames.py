"""`rtshcua verify-log --audit` compares a log with the raw frames beside it."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.forgery import edit, signed
from reference.kept_frames import Entries, kept
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.ground.audit.frames import OURS
from rtshcua.mavlink import tlog
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight

ROOT = case.KEYS[Duty.ROOT]


@pytest.fixture(scope="module")
def flown() -> tuple[list[bytes], Entries]:
    flight = Flight(case.seal(case.mission(case.short_steps())), case.simulated("px4"))
    entries = kept(flight)
    return flight.fly().lines, entries


def folder(at: Path, lines: list[bytes], data: bytes) -> Path:
    """A run whose log has the digest of this telemetry."""
    of = edit(lines[-1], tlog=hashlib.sha256(data).hexdigest())
    (at / "log.jsonl").write_bytes(b"".join(signed([*lines[:-1], of])))
    (at / "telemetry.tlog").write_bytes(data)
    return at


def encoded(entries: Entries) -> bytes:
    return b"".join(tlog.encode(at_us, frame) for at_us, frame in entries)


def verify(run: Path, capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    code = app.main(["verify-log", "--json", "--root", ROOT.public.hex(), *words, str(run)])
    return code, json.loads(capsys.readouterr().out)


def slugs(claims: list[dict[str, str]]) -> set[str]:
    return {claim["slug"] for claim in claims}


def test_frames_that_agree(
    flown: tuple[list[bytes], Entries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = folder(tmp_path, flown[0], encoded(flown[1]))
    code, said = verify(run, capsys, "--audit")
    assert code == ExitCode.OK
    assert {"telemetry", "frames"} <= slugs(said["proven"])
    code, said = verify(run, capsys)
    assert code == ExitCode.OK
    assert "telemetry" in slugs(said["proven"])
    assert "frames" not in slugs(said["proven"])


def test_a_frame_that_the_log_does_not_have(
    flown: tuple[list[bytes], Entries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines, entries = flown
    land = mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 6, 0, 0, 0, 0)
    added = [*entries, (entries[-1][0] + 1, Codec(1, OURS).pack(land))]
    code, said = verify(folder(tmp_path, lines, encoded(added)), capsys, "--audit")
    assert code == ExitCode.DECISION
    assert said["failure"]["slug"] == "frames/unrecorded"
    assert f"frame {len(entries)}" in said["failure"]["found"]


def test_invalid_frame_is_not_covered(
    flown: tuple[list[bytes], Entries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = encoded(flown[1])
    code, said = verify(folder(tmp_path, flown[0], data + b"cut off"), capsys, "--audit")
    assert code == ExitCode.OK
    assert "frames" not in slugs(said["proven"])
    assert f"from byte {len(data)} on" in next(
        claim["text"] for claim in said["unproven"] if claim["slug"] == "telemetry"
    )


def test_frames_that_were_changed_after_the_flight_prove_nothing(
    flown: tuple[list[bytes], Entries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = folder(tmp_path, flown[0], encoded(flown[1]))
    (run / "telemetry.tlog").write_bytes(encoded(flown[1][:-1]))
    code, said = verify(run, capsys, "--audit")
    assert code == ExitCode.EVIDENCE
    assert said["failure"]["slug"] == "telemetry/changed"


@pytest.mark.slow
def test_commands_that_were_sent_and_are_not_there_are_not_spoken_for(
    flown: tuple[list[bytes], Entries], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the boundary's signed count of passed frames, the missing ones are detected."""
    lines, entries = flown
    without = [(at_us, frame) for at_us, frame in entries if frame[6] != OURS]
    code, said = verify(folder(tmp_path, lines, encoded(without)), capsys, "--audit")
    assert (code, said["failure"]["slug"]) == (ExitCode.BOUNDARY, "boundary/frames")
    flight = Flight(case.seal(case.mission(case.low_steps())), case.simulated("px4"), attested=False)
    lines = flight.fly().lines
    code, said = verify(folder(tmp_path, lines, encoded(without[:9])), capsys, "--audit")
    assert code == ExitCode.OK
    assert "frames" not in slugs(said["proven"])
    assert "none of them is in the telemetry" in next(c["text"] for c in said["unproven"] if c["slug"] == "telemetry")
