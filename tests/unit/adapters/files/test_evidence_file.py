"""The evidence file under a disk that refuses, takes half, or fails to sync: no line is lost, no chain broken."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.adapters.files import evidence
from rtshcua.adapters.files.evidence import EvidenceFile

FULL = OSError(errno.ENOSPC, "No space left on device")
real_write, real_truncate = os.write, os.ftruncate


class Disk:
    """Takes at most `step` bytes a call, and nothing beyond `room` bytes in all."""

    def __init__(self, room: int, step: int = 1 << 30) -> None:
        self.room, self.step = room, step

    def write(self, handle: int, data: bytes) -> int:
        take = min(len(data), self.step, self.room)
        if not take:
            raise FULL
        self.room -= take
        return real_write(handle, data[:take])

    def truncate(self, handle: int, length: int) -> None:
        self.room += os.fstat(handle).st_size - length
        real_truncate(handle, length)


@pytest.fixture
def use(monkeypatch: pytest.MonkeyPatch) -> Callable[[Disk], None]:
    def use(disk: Disk) -> None:
        monkeypatch.setattr(evidence.os, "write", disk.write)
        monkeypatch.setattr(evidence.os, "ftruncate", disk.truncate)

    return use


def test_lines_are_appended(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log")
    log.append(b"one\n", durable=False)
    log.append(b"two\n", durable=True)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\n"
    log.close()
    log.close()
    assert (tmp_path / "log").stat().st_mode & 0o777 == 0o644


def test_another_log_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"old\n")
    with pytest.raises(FileExistsError):
        EvidenceFile(tmp_path / "log")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(FileExistsError):
        EvidenceFile(tmp_path / "link")
    assert (tmp_path / "log").read_bytes() == b"old\n"


def test_what_someone_else_appends_is_not_overwritten(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log")
    with (tmp_path / "log").open("ab") as other:
        other.write(b"other\n")
    log.append(b"mine\n", durable=False)
    log.close()
    assert (tmp_path / "log").read_bytes() == b"other\nmine\n"


def test_a_durable_line_is_synced_and_another_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(evidence, "sync_data", synced.append)
    log = EvidenceFile(tmp_path / "log")
    log.append(b"one\n", durable=False)
    assert not synced
    log.append(b"two\n", durable=True)
    assert len(synced) == 1


def test_a_system_that_takes_one_byte_at_a_time(tmp_path: Path, use: Callable[[Disk], None]) -> None:
    use(Disk(1000, step=1))
    log = EvidenceFile(tmp_path / "log")
    log.append(b"one\n", durable=False)
    log.append(b"two\n", durable=False)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\n"


def test_a_refused_line_waits_and_is_written_later_in_its_place(tmp_path: Path, use: Callable[[Disk], None]) -> None:
    disk = Disk(6)
    use(disk)
    log = EvidenceFile(tmp_path / "log")
    log.append(b"one\n", durable=False)
    for count, line in enumerate((b"two\n", b"three\n"), 1):
        with pytest.raises(OSError, match="No space left"):
            log.append(line, durable=False)
        assert log.waiting == count
        assert (tmp_path / "log").read_bytes() == b"one\n"
    disk.room = 100
    log.append(b"four\n", durable=False)
    assert log.waiting == 0
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\nthree\nfour\n"


def test_what_waits_is_written_on_closing(tmp_path: Path, use: Callable[[Disk], None]) -> None:
    disk = Disk(0)
    use(disk)
    log = EvidenceFile(tmp_path / "log")
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", durable=True)
    disk.room = 100
    log.close()
    assert (tmp_path / "log").read_bytes() == b"one\n"


def test_closing_on_a_full_disk_says_so_and_closes(tmp_path: Path, use: Callable[[Disk], None]) -> None:
    use(Disk(0))
    log = EvidenceFile(tmp_path / "log")
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", durable=False)
    with pytest.raises(OSError, match="No space left"):
        log.close()
    log.close()


def test_a_line_that_cannot_be_cut_off_goes_on_where_it_stopped(
    tmp_path: Path, use: Callable[[Disk], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = Disk(2)
    use(disk)

    def refuse(handle: int, length: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(evidence.os, "ftruncate", refuse)
    log = EvidenceFile(tmp_path / "log")
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", durable=False)
    assert (tmp_path / "log").read_bytes() == b"on"
    disk.room = 100
    log.append(b"two\n", durable=False)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\n"


def test_after_a_failed_sync_no_durable_line_is_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails_once(handle: int) -> None:
        monkeypatch.setattr(evidence, "sync_data", os.fsync)
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(evidence, "sync_data", fails_once)
    log = EvidenceFile(tmp_path / "log")
    for line in (b"one\n", b"two\n"):
        with pytest.raises(OSError, match="Input/output"):
            log.append(line, durable=True)
    log.append(b"three\n", durable=False)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\nthree\n"
    with pytest.raises(OSError, match="Input/output"):
        log.close()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        EvidenceFile(tmp_path / "none" / "log")


@given(
    lines=st.lists(st.binary(min_size=1, max_size=6), max_size=12),
    rooms=st.lists(st.integers(0, 12), min_size=12, max_size=12),
    step=st.integers(1, 8),
)
def test_whatever_the_disk_does_the_file_is_a_prefix_of_the_lines(
    lines: list[bytes], rooms: list[int], step: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("disk") / "log"
    disk = Disk(0, step)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence.os, "write", disk.write)
        patch.setattr(evidence.os, "ftruncate", disk.truncate)
        log = EvidenceFile(path)
        for count, (line, room) in enumerate(zip(lines, rooms, strict=False), 1):
            disk.room += room
            try:
                log.append(line, durable=False)
                assert log.waiting == 0
            except OSError:
                assert log.waiting
            assert path.read_bytes() == b"".join(lines[: count - log.waiting])
        disk.room = 1000
        log.close()
        assert path.read_bytes() == b"".join(lines)
