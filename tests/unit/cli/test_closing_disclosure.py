"""The close of a flight carries the root from which records are shown in part, where the whole log is on the disk."""

import errno
import json
from pathlib import Path

import pytest

from reference.faulty_disk import FaultyDisk
from reference.sealed_log import LOG_KEY, SECRET, now, sign
from reference.seeds import epoch_seeds
from rtshcua.adapters.files.evidence import EvidenceFile
from rtshcua.adapters.files.logs import disclosure_of, write_secret
from rtshcua.adapters.files.telemetry import TelemetryFile
from rtshcua.adapters.files.writer import EvidenceWriter
from rtshcua.cli import closing
from rtshcua.evidence.chain import Recorder
from rtshcua.evidence.durability import SYNCED_FIRST, WRITTEN
from rtshcua.evidence.proofs.disclosure import disclosure_root
from rtshcua.onboard.ports import Ending


class Ended:
    """A flight of some records, about to be closed."""

    def __init__(self, folder: Path) -> None:
        self.log = folder / "log.jsonl"
        self.notes: list[str] = []
        self.disk = FaultyDisk()
        self.recorder = Recorder(sign, LOG_KEY.public, epoch_seeds())
        self.sink = EvidenceWriter(EvidenceFile(self.log, self.disk), close_s=0.5)
        self.frames = TelemetryFile(folder / "telemetry.tlog")
        genesis = self.recorder.genesis(
            now(0), bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software"
        )
        self.lines = [genesis, *(self.recorder.effect(now(n), "said") for n in range(1, 20))]
        for line in self.lines:
            self.sink.append(line, WRITTEN)
        write_secret(folder, SECRET)

    def close(self) -> str | None:
        heard: list[bytes] = []
        closing.close_log(
            self.recorder, self.sink, self.frames, lambda: now(30), Ending.COMPLETED, self.notes.append, heard.append,
            lambda: disclosure_of(self.log, self.recorder.count),
        )  # fmt: skip
        found: str | None = json.loads(heard[0])["disclosure"]
        return found


@pytest.fixture
def ended(tmp_path: Path) -> Ended:
    return Ended(tmp_path)


def test_the_root_is_that_of_all_lines_before_the_close(ended: Ended) -> None:
    assert ended.close() == disclosure_root(ended.lines, SECRET).hex()
    assert ended.notes == []


def test_there_is_none_of_a_long_log(ended: Ended, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closing, "_MOST_SHOWN", 19)
    assert ended.close() is None
    assert ended.notes == ["no record of this log can be shown in part: there are too many"]


@pytest.mark.parametrize("method", ["write", "sync"])
def test_there_is_none_where_the_disk_fails(method: str, ended: Ended) -> None:
    ended.sink.settle()
    ended.disk.failing[method] = errno.EIO
    ended.sink.append(ended.recorder.effect(now(25), "said"), SYNCED_FIRST)
    assert ended.close() is None


def test_there_is_none_without_a_secret(ended: Ended) -> None:
    (ended.log.parent / "log.secret").unlink()
    assert ended.close() is None
