"""Run folders: named by time and bundle, never shared, readable for other tools."""

import errno
import hashlib
import json
from pathlib import Path

import pytest

from reference.faulty_disk import FaultyDisk, until
from rtshcua.adapters.store import runs, telemetry
from rtshcua.adapters.store.runs import RunFolder
from rtshcua.mavlink import tlog
from rtshcua.model.durability import SYNCED_FIRST

UTC_US = 1_750_000_000_999_999  # 2025-06-15T15:06:40Z
FRAME = bytes.fromhex("fd09000000010100000000000000020351040312d4")


def test_folder_holds_the_bundle_and_makes_room(tmp_path: Path) -> None:
    run = RunFolder(tmp_path / "runs", name="short", bundle=b"bundle", utc_us=UTC_US)
    assert run.path == tmp_path / "runs" / "20250615T150640Z-short"
    assert (run.path / "mission.bundle").read_bytes() == b"bundle"
    log = run.log()
    log.append(b"{}\n", SYNCED_FIRST)
    log.close()
    run.write_summary({"ending": "completed", "records": 1})
    run.write_summary({"ending": "aborted", "records": 1})
    assert json.loads((run.path / "summary.json").read_text())["ending"] == "aborted"
    run.telemetry().finish()
    assert sorted(file.name for file in run.path.iterdir()) == [
        "log.jsonl", "mission.bundle", "summary.json", "telemetry.tlog",
    ]  # fmt: skip


def test_no_empty_folder_is_left_where_the_bundle_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(runs, "write_new", full)
    with pytest.raises(OSError, match="No space left"):
        RunFolder(tmp_path / "runs", name="short", bundle=b"bundle", utc_us=UTC_US)
    assert list((tmp_path / "runs").iterdir()) == []


def test_two_runs_in_one_second_do_not_meet(tmp_path: Path) -> None:
    names = [RunFolder(tmp_path, name="short", bundle=b"", utc_us=UTC_US).path.name for _ in range(3)]
    assert names == ["20250615T150640Z-short", "20250615T150640Z-short-2", "20250615T150640Z-short-3"]


@pytest.mark.parametrize(("name", "part"), [("../../etc", ".._.._etc"), ("", "run"), ("é b" * 50, "__b" * 26 + "__")])
def test_a_name_stays_inside_the_folder(name: str, part: str, tmp_path: Path) -> None:
    run = RunFolder(tmp_path, name=name, bundle=b"", utc_us=UTC_US)
    assert run.path.parent == tmp_path
    assert run.path.name == f"20250615T150640Z-{part}"


def test_telemetry_is_a_tlog_and_its_digest_that_of_the_file(tmp_path: Path) -> None:
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog")
    file.write(UTC_US, FRAME)
    file.write(UTC_US + 1, FRAME)
    digest = file.finish()
    data = (tmp_path / "telemetry.tlog").read_bytes()
    assert digest == hashlib.sha256(data).digest()
    assert [(entry.at_us, entry.frame) for entry in tlog.read(data)] == [(UTC_US, FRAME), (UTC_US + 1, FRAME)]


@pytest.mark.parametrize("size", [10, 1 << 20])
def test_a_full_disk_ends_the_telemetry_and_not_the_flight(size: int, tmp_path: Path) -> None:
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog", FaultyDisk(room=0))
    for _ in range(3):
        file.write(UTC_US, bytes(size))
    assert file.finish() == hashlib.sha256(b"").digest()
    assert file.error is not None
    assert file.error.errno == errno.ENOSPC
    assert file.lost == 3


@pytest.mark.parametrize("size", [1, 10 * (8 + len(FRAME)) + 5, 1 << 17])
def test_full_disk_leaves_whole_frames_and_count_of_lost(size: int, tmp_path: Path) -> None:
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog", FaultyDisk(room=size))
    for number in range(6_000):
        file.write(UTC_US + number, FRAME)
    digest = file.finish()
    data = (tmp_path / "telemetry.tlog").read_bytes()
    kept = size // (8 + len(FRAME))
    assert [entry.at_us for entry in tlog.read(data)] == [UTC_US + number for number in range(kept)]
    assert (file.lost, digest) == (6_000 - kept, hashlib.sha256(data).digest())


def test_frames_that_were_not_synced_are_not_vouched_for(tmp_path: Path) -> None:
    disk = FaultyDisk()
    disk.failing["sync"] = errno.EIO
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog", disk)
    file.write(UTC_US, FRAME)
    file.finish()
    assert file.error is not None
    assert (file.error.errno, file.lost) == (errno.EIO, 0)


def test_a_disk_that_hangs_is_not_waited_for_for_ever(tmp_path: Path) -> None:
    disk = FaultyDisk()
    disk.open["write"].clear()
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog", disk)
    file.write(UTC_US, FRAME)
    with pytest.raises(OSError, match=r"has not answered for 0\.01 s"):
        file.finish(0.01)
    disk.heal()
    until(lambda: not file._thread.is_alive())
    file.finish()


def test_the_last_room_on_the_disk_is_left_to_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog")
    monkeypatch.setattr(telemetry, "free_bytes", lambda folder: telemetry.LEFT_TO_THE_LOG - 1)
    file.write(UTC_US, FRAME)
    assert file.finish() == hashlib.sha256(b"").digest()
    assert file.error is not None
    assert (file.error.errno, file.lost) == (errno.ENOSPC, 1)


def test_unknown_free_space_does_not_stop_the_telemetry_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(folder: Path) -> int:
        raise OSError(errno.ENOSYS, "Function not implemented")

    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog")
    monkeypatch.setattr(telemetry, "free_bytes", refuse)
    file.write(UTC_US, FRAME)
    file.finish()
    assert (file.error, file.lost) == (None, 0)


def test_stalled_disk_blocks_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telemetry, "MOST_WAITING", 3)
    disk = FaultyDisk()
    disk.open["write"].clear()
    file = telemetry.TelemetryFile(tmp_path / "telemetry.tlog", disk)
    file.write(UTC_US, FRAME)
    until(lambda: not file._waiting)
    for number in range(1, 6):
        file.write(UTC_US + number, FRAME)
    assert file.lost == 2
    disk.heal()
    file.finish()
    data = (tmp_path / "telemetry.tlog").read_bytes()
    assert [entry.at_us for entry in tlog.read(data)] == [UTC_US + number for number in range(4)]
    assert file.error is None
