"""The evidence file on a disk that refuses, writes partly, or fails to sync: no line is lost."""

import errno
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.faulty_disk import FaultyDisk
from rtshcua.adapters.store.evidence_file import MOST_BUFFERED, EvidenceFile
from rtshcua.model.durability import BUFFERED, SYNCED, SYNCED_FIRST, WRITTEN


def test_lines_are_appended(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log")
    log.append(b"one\n", WRITTEN)
    log.append(b"two\n", SYNCED_FIRST)
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


def test_foreign_appended_data_is_not_overwritten(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log")
    with (tmp_path / "log").open("ab") as other:
        other.write(b"other\n")
    log.append(b"mine\n", WRITTEN)
    log.close()
    assert (tmp_path / "log").read_bytes() == b"other\nmine\n"


def test_a_line_of_the_highest_class_is_synced_and_another_is_not(tmp_path: Path) -> None:
    disk = FaultyDisk()
    log = EvidenceFile(tmp_path / "log", disk)
    log.append(b"one\n", WRITTEN)
    log.append(b"two\n", SYNCED)
    assert not disk.synced
    log.append(b"three\n", SYNCED_FIRST)
    assert disk.synced == 1


def test_buffered_lines_are_written_with_what_comes_after_them(tmp_path: Path) -> None:
    disk, path = FaultyDisk(), tmp_path / "log"
    log = EvidenceFile(path, disk)
    log.append(b"one\n", BUFFERED)
    log.append(b"two\n", BUFFERED)
    assert (log.waiting, path.read_bytes()) == (2, b"")
    log.append(b"three\n", WRITTEN)
    assert (log.waiting, path.read_bytes(), disk.calls.count("write")) == (0, b"one\ntwo\nthree\n", 1)
    for _ in range(MOST_BUFFERED):
        log.append(b"x\n", BUFFERED)
    assert (log.waiting, disk.calls.count("write")) == (0, 2)
    log.append(b"last\n", BUFFERED)
    log.close()
    assert path.read_bytes().endswith(b"x\nlast\n")


def test_a_system_that_takes_one_byte_at_a_time(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log", FaultyDisk(step=1))
    log.append(b"one\n", WRITTEN)
    log.append(b"two\n", WRITTEN)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\n"


def test_a_refused_line_waits_and_is_written_later_in_its_place(tmp_path: Path) -> None:
    disk = FaultyDisk(6)
    log = EvidenceFile(tmp_path / "log", disk)
    log.append(b"one\n", WRITTEN)
    for count, line in enumerate((b"two\n", b"three\n"), 1):
        with pytest.raises(OSError, match="No space left"):
            log.append(line, WRITTEN)
        assert log.waiting == count
        assert (tmp_path / "log").read_bytes() == b"one\n"
    disk.room = 100
    log.append(b"four\n", WRITTEN)
    assert log.waiting == 0
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\nthree\nfour\n"


def test_waiting_lines_are_written_on_close(tmp_path: Path) -> None:
    disk = FaultyDisk(0)
    log = EvidenceFile(tmp_path / "log", disk)
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", SYNCED_FIRST)
    disk.room = 100
    log.close()
    assert (tmp_path / "log").read_bytes() == b"one\n"


def test_closing_on_a_full_disk_says_so_and_closes(tmp_path: Path) -> None:
    log = EvidenceFile(tmp_path / "log", FaultyDisk(0))
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", WRITTEN)
    with pytest.raises(OSError, match="No space left"):
        log.close()
    log.close()


def test_partial_line_is_continued_if_it_cannot_be_truncated(tmp_path: Path) -> None:
    disk = FaultyDisk(2)
    disk.failing["truncate"] = errno.EIO
    log = EvidenceFile(tmp_path / "log", disk)
    with pytest.raises(OSError, match="No space left"):
        log.append(b"one\n", WRITTEN)
    assert (tmp_path / "log").read_bytes() == b"on"
    disk.room = 100
    log.append(b"two\n", WRITTEN)
    assert (tmp_path / "log").read_bytes() == b"one\ntwo\n"


def test_after_a_failed_sync_no_durable_line_is_believed(tmp_path: Path) -> None:
    disk = FaultyDisk()
    disk.once["sync"] = [errno.EIO]
    log = EvidenceFile(tmp_path / "log", disk)
    for line in (b"one\n", b"two\n"):
        with pytest.raises(OSError, match="Input/output"):
            log.append(line, SYNCED_FIRST)
    log.append(b"three\n", WRITTEN)
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
    disk = FaultyDisk(0, step)
    log = EvidenceFile(path, disk)
    for count, (line, room) in enumerate(zip(lines, rooms, strict=False), 1):
        disk.room += room
        try:
            log.append(line, WRITTEN)
            assert log.waiting == 0
        except OSError:
            assert log.waiting
        assert path.read_bytes() == b"".join(lines[: count - log.waiting])
    disk.room = 1000
    log.close()
    assert path.read_bytes() == b"".join(lines)
