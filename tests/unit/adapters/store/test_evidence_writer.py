"""The evidence writer: the flight never waits for the disk, no line is lost, and stored lines are counted correctly."""

import errno
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.faulty_disk import FaultyDisk, until
from rtshcua.adapters.store.evidence_file import TIMES_MOST, EvidenceFile, EvidenceWriter, Keeper
from rtshcua.model.durability import BUFFERED, SYNCED, SYNCED_FIRST, WRITTEN


@pytest.fixture
def disk() -> FaultyDisk:
    return FaultyDisk()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log"


@pytest.fixture
def writer(disk: FaultyDisk, path: Path) -> Iterator[EvidenceWriter]:
    made = EvidenceWriter(EvidenceFile(path, disk), most_waiting=4, sync_s=0.001)
    yield made
    disk.heal()
    with suppress(OSError):
        made.close()


def test_lines_are_kept_in_their_order(writer: EvidenceWriter, path: Path) -> None:
    numbers = [writer.append(line, durability) for line, durability in ((b"one\n", WRITTEN), (b"two\n", SYNCED))]
    assert numbers == [1, 2]
    until(lambda: writer.kept == 2)
    assert path.read_bytes() == b"one\ntwo\n"
    assert writer.trouble() is None


def test_stalled_disk_blocks_nobody(writer: EvidenceWriter, disk: FaultyDisk, path: Path) -> None:
    disk.open["write"].clear()
    assert [writer.append(b"x\n", WRITTEN) for _ in range(4)] == [1, 2, 3, 4]
    assert (writer.kept, writer.waiting) == (0, 4)
    disk.open["write"].set()
    until(lambda: writer.kept == 4)
    assert path.read_bytes() == b"x\n" * 4


def test_synced_first_line_is_synced_at_once(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk), sync_s=60.0, sync_after_s=60.0)
    disk.open["sync"].clear()
    for line, durability in ((b"plain\n", WRITTEN), (b"later\n", SYNCED)):
        writer.append(line, durability)
    until(lambda: writer.kept == 2)
    assert disk.synced == 0
    writer.append(b"first\n", SYNCED_FIRST)
    until(lambda: writer.kept == 3)
    assert writer.synced == 0
    disk.open["sync"].set()
    until(lambda: writer.synced == 3)
    writer.close()


def test_synced_line_is_synced_in_time_under_load(disk: FaultyDisk, path: Path) -> None:
    keeper = Keeper(EvidenceFile(path, disk), sync_after_s=0.5)
    for tenth in range(12):
        keeper.take([(b"plain\n", WRITTEN)], tenth / 10)
    assert disk.synced == 0
    keeper.take([(b"promised\n", SYNCED)], 2.0)
    for tenth in range(21, 25):
        keeper.take([(b"plain\n", WRITTEN)], tenth / 10)
    assert (disk.synced, keeper.synced) == (0, 0)
    keeper.take([(b"plain\n", WRITTEN)], 2.5)
    assert (disk.synced, keeper.synced) == (1, keeper.written)
    keeper.close()


def test_late_line_is_reported_and_then_counts_as_failed(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk), sync_after_s=0.001, stuck_s=0.02)
    disk.open["sync"].clear()
    writer.append(b"promised\n", SYNCED_FIRST)
    told: list[str | None] = []
    until(lambda: told.append(writer.late()) or any(told))
    assert (told[-1], writer.late()) == ("a write did not reach the disk within 1000 ms", None)
    until(lambda: told.append(writer.trouble()) or told[-1] is not None)
    assert (told[-1], writer.trouble()) == ("the disk has not answered for 0.02 s", None)
    disk.open["sync"].set()
    until(lambda: writer.synced == 1)
    assert (writer.late(), writer.trouble()) == (None, None)
    writer.close()


def test_written_lines_are_synced_when_idle(writer: EvidenceWriter, disk: FaultyDisk) -> None:
    writer.append(b"plain\n", WRITTEN)
    until(lambda: disk.synced == 1)


def test_a_full_queue_is_a_failure_and_loses_nothing(writer: EvidenceWriter, disk: FaultyDisk, path: Path) -> None:
    disk.open["write"].clear()
    for _ in range(4):
        writer.append(b"x\n", WRITTEN)
    with pytest.raises(OSError, match="is too slow for the log"):
        writer.append(b"y\n", WRITTEN)
    disk.open["write"].set()
    until(lambda: writer.kept == 5)
    assert writer.append(b"z\n", WRITTEN) == 6
    until(lambda: writer.kept == 6)
    assert path.read_bytes() == b"x\n" * 4 + b"y\nz\n"


def test_a_disk_that_never_comes_back_ends_the_log_and_leaves_no_hole(
    writer: EvidenceWriter, disk: FaultyDisk, path: Path
) -> None:
    disk.open["write"].clear()
    most = 4 * TIMES_MOST
    for number in range(most + 3):
        try:
            writer.append(b"%d\n" % number, WRITTEN)
        except OSError:
            assert number >= 4
    disk.open["write"].set()
    until(lambda: writer.kept == most)
    with pytest.raises(OSError, match="ends before this"):
        writer.append(b"late\n", WRITTEN)
    assert path.read_bytes() == b"".join(b"%d\n" % number for number in range(most))
    assert writer.waiting == 4


def test_refused_line_is_reported_once_and_retried(writer: EvidenceWriter, disk: FaultyDisk, path: Path) -> None:
    disk.once["write"] = [errno.ENOSPC] * 3
    writer.append(b"one\n", WRITTEN)
    until(lambda: writer.kept == 1)
    assert writer.trouble() == "No space left on device"
    assert writer.trouble() is None
    assert path.read_bytes() == b"one\n"


def test_lines_that_wait_together_are_synced_together(writer: EvidenceWriter, disk: FaultyDisk, path: Path) -> None:
    disk.open["write"].clear()
    disk.open["sync"].clear()
    writer.append(b"one\n", SYNCED_FIRST)
    until(writer._queue.empty)
    writer.append(b"two\n", SYNCED_FIRST)
    writer.append(b"three\n", WRITTEN)
    disk.open["write"].set()
    disk.open["sync"].set()
    until(lambda: writer.synced == 3)
    assert path.read_bytes() == b"one\ntwo\nthree\n"


def test_no_line_counts_as_kept_after_a_failed_sync(writer: EvidenceWriter, disk: FaultyDisk, path: Path) -> None:
    disk.failing["sync"] = errno.EIO
    writer.append(b"one\n", SYNCED_FIRST)
    told: list[str | None] = []
    until(lambda: told.append(writer.trouble()) or any(told))
    assert told[-1] == "Input/output error"
    disk.heal()
    writer.append(b"two\n", SYNCED_FIRST)
    until(lambda: path.read_bytes() == b"one\ntwo\n")
    assert (writer.kept, writer.synced) == (1, 0)
    assert writer.trouble() is None


def test_close_writes_waiting_lines(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk))
    disk.open["write"].clear()
    for _ in range(3):
        writer.append(b"x\n", WRITTEN)
    disk.open["write"].set()
    writer.close()
    writer.close()
    assert (writer.waiting, path.read_bytes()) == (0, b"x\n" * 3)
    with pytest.raises(OSError, match="ends before this"):
        writer.append(b"late\n", WRITTEN)


def test_closing_on_a_full_disk_says_so(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk))
    disk.failing["write"] = errno.ENOSPC
    writer.append(b"x\n", WRITTEN)
    with pytest.raises(OSError, match="No space left"):
        writer.close()
    assert writer.waiting == 1


def test_settle_waits_until_all_is_on_disk(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk), sync_s=0.001, close_s=0.05)
    writer.append(b"one\n", SYNCED_FIRST)
    writer.append(b"two\n", WRITTEN)
    writer.settle()
    assert (writer.synced, path.read_bytes()) == (2, b"one\ntwo\n")
    disk.open["sync"].clear()
    writer.append(b"three\n", SYNCED_FIRST)
    with pytest.raises(OSError, match=r"has not answered for 0\.05 s"):
        writer.settle()
    disk.heal()
    writer.settle()
    disk.failing["write"] = errno.EROFS
    writer.append(b"four\n", WRITTEN)
    with pytest.raises(OSError, match="Read-only file system"):
        writer.settle()
    with pytest.raises(OSError, match="does not accept all data"):
        writer.settle()
    disk.heal()
    writer.close()
    assert writer.synced == 4


def test_waiting_buffered_lines_do_not_fail(disk: FaultyDisk, path: Path) -> None:
    keeper = Keeper(EvidenceFile(path, disk))
    keeper.take([(b"buffered\n", BUFFERED)], 0.0)
    assert (keeper.failing, keeper.busy, keeper.written) == (False, True, 0)
    disk.room = 0
    keeper.take([(b"written\n", WRITTEN)], 0.1)
    assert keeper.failing
    disk.heal()
    keeper.take([], 0.4)
    assert (keeper.failing, keeper.synced) == (False, 2)
    keeper.close()


def test_a_disk_that_hangs_is_not_waited_for_for_ever(disk: FaultyDisk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path, disk), close_s=0.01)
    disk.open["write"].clear()
    writer.append(b"x\n", WRITTEN)
    with pytest.raises(OSError, match=r"has not answered for 0\.01 s"):
        writer.close()
    assert writer.waiting == 1
    disk.heal()
    until(lambda: writer.waiting == 0 and "close" in disk.calls)


@given(
    lines=st.lists(st.tuples(st.binary(min_size=1, max_size=6), st.integers(BUFFERED, SYNCED_FIRST)), max_size=12),
    refusals=st.lists(st.booleans(), max_size=24),
)
def test_whatever_the_disk_does_the_file_holds_the_lines(
    lines: list[tuple[bytes, int]], refusals: list[bool], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("disk") / "log"
    disk = FaultyDisk(step=2)
    disk.once["write"] = [errno.ENOSPC if refused else None for refused in refusals]  # type: ignore[misc]
    writer = EvidenceWriter(EvidenceFile(path, disk), sync_s=0.000_1)
    for line, durability in lines:
        before = writer.append(line, durability)
        assert writer.synced <= writer.kept <= before
    disk.heal()
    writer.close()
    assert path.read_bytes() == b"".join(line for line, _ in lines)
    assert (writer.waiting, writer.synced) == (0, len(lines))
