"""The state that a flight leaves for the next one."""

import json
from pathlib import Path
from random import Random

import pytest

from reference.crashed import LOG_KEY, signer, writes
from rtshcua.adapters.store.recovery import InUse, recover
from rtshcua.app.fly.previous_log import LogBefore


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path, lines = tmp_path / "log.jsonl", writes(Random(2))
    path.write_bytes(b"".join(next(lines)[0] for _ in range(12)))
    return path


def past(tmp_path: Path) -> LogBefore:
    return LogBefore.settle(tmp_path / "state", "quad-07", LOG_KEY)


def test_a_log_under_way_is_held_and_then_ended_by_the_next(tmp_path: Path, log: Path) -> None:
    first = past(tmp_path)
    assert (first.hash, first.note) == (None, "")
    first.begin(log)
    with pytest.raises(InUse):
        recover(log, signer(Random(1)))
    second = past(tmp_path)
    assert second.hash is None
    assert "is still being written" in second.note
    first._held.close()  # as the system does when the process dies
    third = past(tmp_path)
    assert "it was recovered with 12 records" in third.note
    assert json.loads(log.read_bytes().splitlines()[-1])["ending"] == "recovered"
    assert past(tmp_path).hash == third.hash


def test_a_log_that_was_closed_is_named_by_the_next(tmp_path: Path, log: Path) -> None:
    first = past(tmp_path)
    first.begin(log)
    first.end("ab" * 32)
    second = past(tmp_path)
    assert (second.hash, second.note) == ("ab" * 32, "")
    assert recover(log, signer(Random(1))).done  # not locked


def test_airborne_vehicle_does_not_wait_for_the_state_folder(tmp_path: Path, log: Path) -> None:
    grounded = past(tmp_path)
    (tmp_path / "state").touch()  # no folder, and none can be made
    with pytest.raises(OSError, match=r"exists|Not a directory"):
        grounded.begin(log)
    grounded._held.close()
    flying = past(tmp_path)
    flying.begin(log, aloft=True)
    assert "cannot name this one" in flying.note
    flying.end("ab" * 32)


def test_unrecorded_end_is_read_from_the_log(tmp_path: Path, log: Path) -> None:
    first = past(tmp_path)
    first.begin(log)
    last = recover_unheld(log)
    state = tmp_path / "state" / "logs" / "vehicle-quad-07.new"
    state.mkdir()
    first.end(last)
    state.rmdir()
    assert past(tmp_path).hash == last


def recover_unheld(log: Path) -> str:
    """Recover a locked log, as its flight would."""
    copy = log.with_name("copy.jsonl")
    copy.write_bytes(log.read_bytes())
    last = recover(copy, signer(Random(1))).last
    log.write_bytes(copy.read_bytes())
    return last
