"""The end of a flight on a failing disk: only stored files are listed, and missing ones are reported."""

import errno
import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.faulty_disk import FaultyDisk, until
from reference.flat_case import MISSION
from reference.seeds import epoch_seeds
from rtshcua.adapters.store import runs, telemetry
from rtshcua.adapters.store.evidence_file import EvidenceWriter
from rtshcua.adapters.store.runs import RunFolder
from rtshcua.app.fly.closing import close_log, keep_summary
from rtshcua.app.fly.story import Summary
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.log_writer import Recorder
from rtshcua.front.cli.render.live.lines import ending
from rtshcua.model.durability import SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Ending
from rtshcua.wire.keys import Duty
from virtual import case

FRAME = bytes.fromhex("fd09000000010100000000000000020351040312d4")
NOW = Now(7_000_000, 1_750_000_000_000_000, 1_000)
SUMMARY = Summary(
    mission=MISSION.name, policy="p@1", vehicle="quad-07", flavour="px4", mode="software", ending="completed",
    exit_code=0, steps=1, steps_done=1, outcomes={}, flight_us=1, records=3, whole=True, folder="f", log="l", next="n",
)  # fmt: skip


class Ended:
    """A flight of one record more than its genesis, about to be closed."""

    def __init__(self, folder: Path) -> None:
        self.run = RunFolder(folder, name="short", bundle=b"bundle", utc_us=NOW.utc_us)
        key = case.KEYS[Duty.LOG]
        self.recorder = Recorder(lambda text: key.sign(text, duty=Duty.LOG), key.public, epoch_seeds())
        self.disk = FaultyDisk()
        log = self.run.log(self.disk)
        genesis = self.recorder.genesis(
            NOW, bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software"
        )
        log.append(genesis, SYNCED_FIRST)
        self.sink = EvidenceWriter(log, close_s=0.5)
        self.frames = self.run.telemetry()
        self.frames.write(NOW.utc_us, FRAME)
        self.notes: list[str] = []
        self.heard: list[bytes] = []

    def close(self, ending: Ending | None = Ending.COMPLETED) -> tuple[str, ...]:
        return close_log(
            self.recorder, self.sink, self.frames, lambda: NOW, ending, self.notes.append, self.heard.append
        )

    def records(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (self.run.path / "log.jsonl").read_text().splitlines()]


@pytest.fixture
def ended(tmp_path: Path) -> Ended:
    return Ended(tmp_path)


def test_complete_flight_lists_nothing_missing(ended: Ended) -> None:
    assert ended.close() == ()
    assert ended.notes == []
    assert [record["type"] for record in ended.records()] == ["genesis", "close"]
    assert ended.records()[-1]["tlog"] is not None
    assert json.loads(ended.heard[0]) == ended.records()[-1]


def test_a_frame_log_with_a_gap_is_not_vouched_for(ended: Ended, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telemetry, "free_bytes", lambda folder: 0)
    ended.frames.write(NOW.utc_us, FRAME)
    (missing,) = ended.close()
    assert missing.endswith("missing: the last free space on the disk is reserved for the log (telemetry.tlog)")
    assert ended.notes == [f"the frame log is incomplete: {missing.removesuffix(' (telemetry.tlog)')}"]
    _, effect, close = ended.records()
    assert (effect["event"], effect["detail"]) == ("frames-lost", missing.removesuffix(" (telemetry.tlog)"))
    assert (close["type"], close["tlog"]) == ("close", None)


def test_frames_that_came_too_fast_are_missing_too(ended: Ended) -> None:
    ended.frames.lost = 3
    assert ended.close() == ("3 frames missing: the disk did not keep up (telemetry.tlog)",)


def test_a_frame_log_that_is_gone(ended: Ended) -> None:
    (ended.run.path / "telemetry.tlog").unlink()
    (missing,) = ended.close()
    assert missing == "it cannot be read any more: no such file or directory (telemetry.tlog)"
    assert ended.records()[-1]["tlog"] is None


def test_the_records_that_the_disk_refused_are_counted(ended: Ended) -> None:
    ended.disk.room = 0
    for _ in range(4):
        ended.sink.append(ended.recorder.effect(NOW, "arrived"), WRITTEN)
    assert ended.close() == ("5 of 6 records (log.jsonl)",)
    assert len(ended.records()) == 1


def test_records_of_the_last_attempt_are_not_missing(ended: Ended) -> None:
    ended.sink.append(line := ended.recorder.effect(NOW, "arrived"), WRITTEN)
    until(lambda: ended.sink.kept == 1)
    ended.disk.room = len(line)
    assert ended.close() == ("1 of 3 records (log.jsonl)",)
    assert len(ended.records()) == 2


def test_hanging_disk_is_reported_after_a_limit(ended: Ended) -> None:
    ended.disk.open["sync"].clear()
    assert ended.close() == ("1 of 2 records: the disk has not answered for 0.5 s (log.jsonl)",)
    ended.disk.heal()


def test_a_fault_leaves_the_log_unsigned(ended: Ended) -> None:
    assert ended.close(None) == ()
    assert [record["type"] for record in ended.records()] == ["genesis"]


def test_a_summary_that_could_not_be_written(ended: Ended, monkeypatch: pytest.MonkeyPatch) -> None:
    assert keep_summary(ended.run, SUMMARY) == SUMMARY

    def refuse(path: Path, data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(runs, "replace", refuse)
    kept = keep_summary(ended.run, SUMMARY)
    assert (kept.whole, kept.exit_code) == (False, ExitCode.FULL)
    assert kept.missing == ("the summary: no space left on device (summary.json)",)
    assert ending(kept)
    ended.close()


def test_missing_records_are_shown() -> None:
    lines = list(ending(replace(SUMMARY, whole=False, missing=("5 of 6 records (log.jsonl)", "the summary"))))
    assert "  log      l (3 records, evidence NOT whole)" in lines
    assert "  missing  5 of 6 records (log.jsonl)" in lines
    assert "  missing  the summary" in lines
