"""The evidence writer: nobody waits for the disk, no line is lost or out of order, and what is kept is told truly."""

import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.adapters.files import evidence
from rtshcua.adapters.files.evidence import EvidenceFile
from rtshcua.adapters.files.writer import TIMES_MOST, EvidenceWriter

real_write, real_sync = os.write, evidence.sync_data
PATIENCE_S = 20.0


class Disk:
    """Writes and syncs wait until they are let through; either may fail."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.write, self.sync = Event(), Event()
        self.write.set()
        self.sync.set()
        self.refuses: list[int] = []
        self.fails_to_sync = False
        self.synced = 0
        patch.setattr(evidence.os, "write", self._write)
        patch.setattr(evidence, "sync_data", self._sync)

    def _write(self, handle: int, data: bytes) -> int:
        assert self.write.wait(PATIENCE_S)
        if self.refuses:
            raise OSError(self.refuses.pop(), "No space left on device")
        return real_write(handle, data)

    def _sync(self, handle: int) -> None:
        assert self.sync.wait(PATIENCE_S)
        if self.fails_to_sync:
            raise OSError(errno.EIO, "Input/output error")
        real_sync(handle)
        self.synced += 1


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log"


@pytest.fixture
def writer(disk: Disk, path: Path) -> Iterator[EvidenceWriter]:
    made = EvidenceWriter(EvidenceFile(path), most_waiting=4, sync_s=0.001)
    yield made
    disk.write.set()
    disk.sync.set()
    disk.fails_to_sync = False
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made._file, "close", lambda: None)
        made.close()


def until(holds: Callable[[], bool]) -> None:
    """Let the thread run until something holds; it does so at once, or never."""
    pause, left = Event(), 2_000
    while not holds():
        left -= 1
        assert left, "it never came"
        pause.wait(0.01)


def test_lines_are_kept_in_their_order(writer: EvidenceWriter, path: Path) -> None:
    numbers = [writer.append(line, durable) for line, durable in ((b"one\n", False), (b"two\n", True))]
    assert numbers == [1, 2]
    until(lambda: writer.kept == 2)
    assert path.read_bytes() == b"one\ntwo\n"
    assert writer.trouble() is None


def test_nobody_waits_for_a_disk_that_stands_still(writer: EvidenceWriter, disk: Disk, path: Path) -> None:
    disk.write.clear()
    assert [writer.append(b"x\n", False) for _ in range(4)] == [1, 2, 3, 4]
    assert (writer.kept, writer.waiting) == (0, 4)
    disk.write.set()
    until(lambda: writer.kept == 4)
    assert path.read_bytes() == b"x\n" * 4


def test_a_durable_line_is_kept_when_it_is_synced_and_another_when_it_is_written(disk: Disk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path), sync_s=60.0)
    disk.sync.clear()
    writer.append(b"plain\n", False)
    until(lambda: writer.kept == 1)
    writer.append(b"durable\n", True)
    until(lambda: writer._taken == 2 and writer._file.waiting == 0)
    assert writer.kept == 1
    disk.sync.set()
    until(lambda: writer.kept == 2)
    writer.close()


def test_what_nobody_asked_to_sync_is_synced_after_a_while(writer: EvidenceWriter, disk: Disk) -> None:
    writer.append(b"plain\n", False)
    until(lambda: disk.synced == 1)


def test_a_full_queue_is_a_failure_and_loses_nothing(writer: EvidenceWriter, disk: Disk, path: Path) -> None:
    disk.write.clear()
    for _ in range(4):
        writer.append(b"x\n", False)
    with pytest.raises(OSError, match="does not keep up"):
        writer.append(b"y\n", False)
    disk.write.set()
    until(lambda: writer.kept == 5)
    assert writer.append(b"z\n", False) == 6
    until(lambda: writer.kept == 6)
    assert path.read_bytes() == b"x\n" * 4 + b"y\nz\n"


def test_a_disk_that_never_comes_back_ends_the_log_and_leaves_no_hole(
    writer: EvidenceWriter, disk: Disk, path: Path
) -> None:
    disk.write.clear()
    most = 4 * TIMES_MOST
    for number in range(most + 3):
        try:
            writer.append(b"%d\n" % number, False)
        except OSError:
            assert number >= 4
    disk.write.set()
    until(lambda: writer.kept == most)
    with pytest.raises(OSError, match="ends before this"):
        writer.append(b"late\n", False)
    assert path.read_bytes() == b"".join(b"%d\n" % number for number in range(most))
    assert writer.waiting == 4


def test_a_refused_line_is_told_once_and_written_as_soon_as_it_can_be(
    writer: EvidenceWriter, disk: Disk, path: Path
) -> None:
    disk.refuses = [errno.ENOSPC] * 3
    writer.append(b"one\n", False)
    until(lambda: writer.kept == 1)
    assert writer.trouble() == "No space left on device"
    assert writer.trouble() is None
    assert path.read_bytes() == b"one\n"


def test_a_durable_line_before_a_refused_one_is_synced_before_it_is_kept(
    writer: EvidenceWriter, disk: Disk, path: Path
) -> None:
    disk.write.clear()
    disk.sync.clear()
    writer.append(b"one\n", True)
    until(writer._queue.empty)
    writer.append(b"two\n", True)
    writer.append(b"three\n", False)
    disk.write.set()
    disk.sync.set()
    until(lambda: writer.kept == 3)
    assert path.read_bytes() == b"one\ntwo\nthree\n"


def test_after_a_failed_sync_nothing_more_counts_as_kept(writer: EvidenceWriter, disk: Disk, path: Path) -> None:
    disk.fails_to_sync = True
    writer.append(b"one\n", True)
    until(lambda: writer._doubtful)
    assert writer.trouble() == "Input/output error"
    disk.fails_to_sync = False
    writer.append(b"two\n", True)
    until(lambda: path.read_bytes() == b"one\ntwo\n")
    assert writer.kept == 0
    assert writer.trouble() is None


def test_closing_writes_what_waits_and_says_what_is_kept(disk: Disk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path))
    disk.write.clear()
    for _ in range(3):
        writer.append(b"x\n", False)
    disk.write.set()
    writer.close()
    writer.close()
    assert (writer.waiting, path.read_bytes()) == (0, b"x\n" * 3)
    with pytest.raises(OSError, match="ends before this"):
        writer.append(b"late\n", False)


def test_closing_on_a_full_disk_says_so(disk: Disk, path: Path) -> None:
    writer = EvidenceWriter(EvidenceFile(path))
    disk.refuses = [errno.ENOSPC] * 9
    writer.append(b"x\n", False)
    with pytest.raises(OSError, match="No space left"):
        writer.close()
    assert writer.waiting == 1


@given(
    lines=st.lists(st.tuples(st.binary(min_size=1, max_size=6), st.booleans()), max_size=12),
    refusals=st.lists(st.booleans(), max_size=24),
)
def test_whatever_the_disk_does_the_file_holds_the_lines(
    lines: list[tuple[bytes, bool]], refusals: list[bool], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("disk") / "log"
    left = list(refusals)

    def write(handle: int, data: bytes) -> int:
        if left and left.pop():
            raise OSError(errno.ENOSPC, "No space left on device")
        return real_write(handle, data[:2])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence.os, "write", write)
        patch.setattr(evidence, "sync_data", lambda handle: None)
        writer = EvidenceWriter(EvidenceFile(path), sync_s=0.000_1)
        for line, durable in lines:
            before = writer.append(line, durable)
            assert writer.kept <= before
        left.clear()
        writer.close()
    assert path.read_bytes() == b"".join(line for line, _ in lines)
    assert writer.waiting == 0
