"""Recovery of interrupted logs on the disk, also when the recovery is interrupted."""

import json
import os
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from random import Random

import pytest

from reference.crashed import signer, unverified, writes
from reference.power import Died, PowerDisk
from rtshcua.adapters.store.evidence_file import EvidenceFile, Keeper
from rtshcua.adapters.store.recovery import InUse, alone, recover
from rtshcua.evidence.records import is_signed
from rtshcua.evidence.recovery import LogState


def torn(folder: Path, more: bytes = b'{"_prev":') -> tuple[Path, list[bytes]]:
    path = folder / "log.jsonl"
    log = writes(Random(7))
    lines = [next(log)[0] for _ in range(30)]
    path.write_bytes(b"".join(lines) + more)
    return path, lines


def test_recovery_keeps_discarded_octets_beside_log(tmp_path: Path) -> None:
    path, lines = torn(tmp_path)
    done = recover(path, signer(Random(1)))
    assert (done.done, done.found.state, done.discarded) == (True, LogState.TORN, tmp_path / "log.discarded")
    assert (tmp_path / "log.discarded").read_bytes() == b'{"_prev":'
    log = path.read_bytes().splitlines(keepends=True)
    assert log[:-2] == lines
    assert json.loads(log[-2])["discarded_digest"] == sha256(b'{"_prev":').hexdigest()
    assert done.last == sha256(b"\0" + log[-1]).hexdigest()
    assert unverified(path, lines, len(lines)) == ""
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["log.discarded", "log.jsonl"]
    again = recover(path, signer(Random(2)))
    assert (again.done, again.found.state, again.last) == (False, LogState.CLOSED, done.last)
    assert path.read_bytes() == b"".join(log)


def test_recovery_without_discarded_bytes_writes_no_extra_file(tmp_path: Path) -> None:
    path, lines = torn(tmp_path, b"")
    assert recover(path, signer(Random(1))).discarded is None
    assert unverified(path, lines, len(lines)) == ""
    assert [entry.name for entry in tmp_path.iterdir()] == ["log.jsonl"]


def test_recovery_leaves_tampered_log_unchanged(tmp_path: Path) -> None:
    path, lines = torn(tmp_path)
    lines[3] = lines[3].replace(b"quad", b"kwad")
    path.write_bytes(b"".join(lines))
    done = recover(path, signer(Random(1)))
    assert (done.done, done.found.state) == (False, LogState.TAMPERED)
    assert path.read_bytes() == b"".join(lines)
    assert [entry.name for entry in tmp_path.iterdir()] == ["log.jsonl"]


def test_a_log_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    path, _ = torn(tmp_path)
    with alone(path), pytest.raises(InUse):
        recover(path, signer(Random(1)))
    assert recover(path, signer(Random(1))).done


def test_other_discarded_octets_stay(tmp_path: Path) -> None:
    path, _ = torn(tmp_path)
    (tmp_path / "log.discarded").write_bytes(b"others")
    assert recover(path, signer(Random(1))).discarded == tmp_path / "log.discarded.2"
    assert (tmp_path / "log.discarded").read_bytes() == b"others"
    assert (tmp_path / "log.discarded.2").read_bytes() == b'{"_prev":'


@pytest.mark.parametrize("plan", [b"", b"x\ny\n", b'{"_prev":"', bytes(70_000)])
def test_invalid_recovery_plan_is_started_anew(tmp_path: Path, plan: bytes) -> None:
    path, lines = torn(tmp_path)
    (tmp_path / "log.recovering").write_bytes(plan)
    assert recover(path, signer(Random(1))).done
    assert unverified(path, lines, len(lines)) == ""
    assert not (tmp_path / "log.recovering").exists()


def test_the_end_of_another_log_is_not_taken_for_what_was_begun(tmp_path: Path) -> None:
    path, lines = torn(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    path_of_other, _ = torn(other, b"")
    log = writes(Random(8))
    path_of_other.write_bytes(b"".join(next(log)[0] for _ in range(30)))
    recover(path_of_other, signer(Random(1)))
    (tmp_path / "log.recovering").write_bytes(b"".join(path_of_other.read_bytes().splitlines(keepends=True)[-2:]))
    assert recover(path, signer(Random(1))).done
    assert unverified(path, lines, len(lines)) == ""


def test_a_link_to_elsewhere_is_not_written_to(tmp_path: Path) -> None:
    path, lines = torn(tmp_path)
    for name in ("log.discarded", "log.recovering"):
        (tmp_path / "elsewhere").touch()
        (tmp_path / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="symbolic links"):
        recover(path, signer(Random(1)))
    (tmp_path / "log.recovering").unlink()
    assert recover(path, signer(Random(1))).discarded == tmp_path / "log.discarded.2"
    assert (tmp_path / "elsewhere").read_bytes() == b""
    assert unverified(path, lines, len(lines)) == ""


def test_a_file_with_another_name_elsewhere_is_not_written_to(tmp_path: Path) -> None:
    """A user who can create links in the folder must not make a recovery write to a foreign file."""
    path, lines = torn(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.touch()
    (tmp_path / "log.discarded").hardlink_to(elsewhere)
    os.mkfifo(tmp_path / "log.discarded.2")
    (tmp_path / "log.recovering").hardlink_to(elsewhere)
    with pytest.raises(OSError, match="something else"):
        recover(path, signer(Random(1)))
    (tmp_path / "log.recovering").unlink()
    os.mkfifo(tmp_path / "log.recovering")
    with pytest.raises(OSError, match="something else"):
        recover(path, signer(Random(1)))
    (tmp_path / "log.recovering").unlink()
    assert recover(path, signer(Random(1))).discarded == tmp_path / "log.discarded.3"
    assert elsewhere.read_bytes() == b""
    assert unverified(path, lines, len(lines)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("what", ["died", "torn", "late", "refused", "failed", "short"])
def test_interrupted_recovery_can_be_repeated(tmp_path: Path, what: str) -> None:
    number, over = 0, False
    while not over:
        folder = tmp_path / str(number)
        folder.mkdir()
        more = b'{"_prev":"' + bytes(9_000)
        path, lines = torn(folder, more)
        disk = PowerDisk(lambda now, name, number=number: what if now == number else "")
        with suppress(Died, OSError):
            recover(path, signer(Random(number)), disk=disk)
        over = disk.operations <= number
        for power in (Random(number), None):
            if power is not None and what in ("died", "torn", "late"):
                disk.cut_power(power)
            done = recover(path, signer(Random(number + 1)))
            assert done.found.state in (LogState.TORN, LogState.CLOSED)
            assert unverified(path, lines, len(lines)) == ""
            recorded = json.loads(path.read_bytes().splitlines()[-2])
            assert recorded["discarded_bytes"] == len(more)
            kept = [entry.read_bytes() for entry in folder.iterdir() if "discarded" in entry.name]
            assert more in kept
            assert not (folder / "log.recovering").exists()
        number += 1
    assert number > 8


@pytest.mark.parametrize("full", [False, True])
def test_signed_record_is_written_after_earlier_records_are_synced(tmp_path: Path, full: bool) -> None:
    path, kept = tmp_path / "log.jsonl", list[bool]()

    def fault(number: int, name: str) -> str:
        if name == "write" and path.exists():
            ends = path.read_bytes().count(b"\n")
            if ends < len(lines) and is_signed(lines[ends]):
                kept.append(disk.synced(path) == path.read_bytes())
        return "refused" if full and name == "write" and number % 40 > 20 else ""

    log = writes(Random(3), seals=5)
    batches = [[next(log) for _ in range(3)] for _ in range(40)]
    lines = [line for batch in batches for line, _ in batch]
    disk = PowerDisk(fault)
    keeper = Keeper(EvidenceFile(path, disk))
    for batch in batches:
        keeper.take(batch, 0.0)
    keeper.close()
    assert path.read_bytes() == b"".join(lines)
    assert len(kept) > 15
    assert all(kept)
