"""A flight whose process is killed: the next run ends its log, names it, and goes on."""

import json
import signal
from pathlib import Path
from typing import Any

from rtshcua.evidence.merkle import leaf_hash


def records(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "log.jsonl").read_bytes().splitlines()]


def test_the_log_of_a_flight_that_was_killed_is_ended_by_the_next(ground: Any) -> None:
    first = ground.run(ground.bundle())
    first.until("dispatched")
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    killed = first.folder
    with (killed / "log.jsonl").open("ab") as log:
        log.write(b'{"_prev":"')
    before = (killed / "log.jsonl").read_bytes().splitlines(keepends=True)[:-1]
    second = ground.run(ground.bundle(name="second")).end()
    assert second.code == 0, second.stderr
    log = (killed / "log.jsonl").read_bytes().splitlines(keepends=True)
    assert log[:-2] == before
    assert [json.loads(line)["type"] for line in log[-2:]] == ["recover", "close"]
    assert json.loads(log[-2])["discarded_bytes"] == len(b'{"_prev":"')
    (other,) = [entry for entry in (ground.folder / "runs").iterdir() if entry != killed]
    assert records(other)[0]["before"] == leaf_hash(log[-1]).hex()
    assert [record["event"] for record in records(other)[1:3]] == ["simulated", "log-before"]
    assert f"{len(before)} records of it are kept" in records(other)[2]["detail"]
    for folder in (killed, other):
        verified = ground.start("verify-log", str(folder), "--json").end()
        assert verified.code == 0, verified.events
    third = ground.run(ground.bundle(name="third")).end()
    assert third.code == 0, third.stderr
    (last,) = [entry for entry in (ground.folder / "runs").iterdir() if entry not in (killed, other)]
    assert (
        records(last)[0]["before"] == leaf_hash((other / "log.jsonl").read_bytes().splitlines(keepends=True)[-1]).hex()
    )
    assert "log-before" not in [record["event"] for record in records(last) if record["type"] == "effect"]
