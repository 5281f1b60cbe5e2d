"""The last log of a vehicle, and the notes about it."""

import json
from pathlib import Path
from random import Random

import pytest

from reference.crashed import signer, unverified, writes
from rtshcua.adapters.store.recovery import InUse, Recovered, recover
from rtshcua.adapters.store.vehicle_records import LastLog, PreviousLog


@pytest.fixture
def last(tmp_path: Path) -> LastLog:
    return LastLog(tmp_path / "state", "quad 07/é")


def mend(path: Path) -> Recovered:
    return recover(path, signer(Random(1)))


def unfinished(folder: Path, more: bytes = b"") -> tuple[Path, list[bytes]]:
    path, log = folder / "log.jsonl", writes(Random(3))
    lines = [next(log)[0] for _ in range(20)]
    path.write_bytes(b"".join(lines) + more)
    return path, lines


def test_the_first_log_has_none_before_it(last: LastLog) -> None:
    assert last.settle(mend) == PreviousLog(None)


def test_a_closed_log_is_remembered_and_not_read_again(last: LastLog, tmp_path: Path) -> None:
    last.begin(tmp_path / "gone", None)
    last.end(tmp_path / "gone", None, "ab" * 32)
    assert last.settle(mend) == PreviousLog("ab" * 32, log=tmp_path / "gone")
    assert [entry.name for entry in last.path.parent.iterdir()] == ["vehicle-quad%2007%2F%C3%A9"]


@pytest.mark.parametrize(("more", "told"), [(b"", "it was recovered with 20 records"), (b"x", "1 octets discarded")])
def test_a_log_that_broke_off_is_recovered(last: LastLog, tmp_path: Path, more: bytes, told: str) -> None:
    path, lines = unfinished(tmp_path, more)
    last.begin(path, None)
    earlier = last.settle(mend)
    assert earlier.last == recover(path, signer(Random(2))).last
    assert told in earlier.note
    assert unverified(path, lines, len(lines)) == ""
    assert last.settle(mend) == PreviousLog(earlier.last, broken_off=path, log=path)


def test_a_log_that_never_began_is_passed_over(last: LastLog, tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b'{"_prev":"000')
    last.begin(tmp_path / "log.jsonl", "cd" * 32)
    assert last.settle(mend) == PreviousLog("cd" * 32, broken_off=tmp_path / "log.jsonl")


def test_tampered_log_is_reported_and_linked_to_its_last_good_record(last: LastLog, tmp_path: Path) -> None:
    path, lines = unfinished(tmp_path)
    path.write_bytes(b"".join(lines[:4] + lines[5:]))
    last.begin(path, None)
    earlier = last.settle(mend)
    assert earlier.last == json.loads(lines[4])["_prev"]
    assert "was tampered with and is left unchanged (record 4: " in earlier.note


def test_a_log_that_is_not_there_any_more_is_told(last: LastLog, tmp_path: Path) -> None:
    last.begin(tmp_path / "gone", "cd" * 32)
    earlier = last.settle(mend)
    assert earlier.last is None
    assert earlier.broken_off == tmp_path / "gone"
    assert earlier.gone
    assert earlier.note.endswith("is missing, so it is not known whether its flight ended")


def test_a_log_that_is_still_written_is_told(last: LastLog, tmp_path: Path) -> None:
    def busy(path: Path) -> Recovered:
        raise InUse(f"`{path.name}` is still being written")

    last.begin(tmp_path / "log.jsonl", None)
    earlier = last.settle(busy)
    assert earlier.note.endswith("`log.jsonl` is still being written")
    assert earlier.broken_off is None


@pytest.mark.parametrize(
    "data", [b"", b"x", b"[]", b"{}", b'{"log":1}', b'{"log":"a","last":1}', b'{"log":"a","before":"AB"}', b"\xff"]
)
def test_malformed_last_log_file_is_reported(last: LastLog, data: bytes) -> None:
    last.path.parent.mkdir(parents=True)
    last.path.write_bytes(data)
    earlier = last.settle(mend)
    assert earlier.last is None
    assert "the previous log is not known" in earlier.note
    assert earlier.note.endswith("it is damaged")
