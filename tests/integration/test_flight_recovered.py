"""A run killed in the air: the next one lands and ends its log, and later logs continue from there."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.adapters.store.vehicle_records import opened_root
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.wire.keys import Duty

#: slow enough that delays of a busy machine stay below a permit's validity
SPEED = 3
BROKEN_OFF = b'{"_prev":"'


def lines(folder: Path) -> list[bytes]:
    return (folder / "log.jsonl").read_bytes().splitlines(keepends=True)


def records(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in lines(folder)]


@pytest.mark.slow
def test_next_run_lands_a_killed_flight_and_ends_its_log(ground: Any, port: int) -> None:
    def runs() -> set[Path]:
        return set((ground.folder / "runs").iterdir())

    ground.vehicle(port, SPEED)
    bundle, words = ground.bundle(), ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    (killed,) = runs()
    with (killed / "log.jsonl").open("ab") as log:
        log.write(BROKEN_OFF)
    before = lines(killed)[:-1]

    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    assert not [event for event in second.events if event["event"] == "dispatched" and event.get("step", -1) >= 0]
    assert [event for event in second.events if event["event"] == "resumed"]
    ended = lines(killed)
    assert ended[:-2] == before
    assert [json.loads(line)["type"] for line in ended[-2:]] == ["recover", "close"]
    assert json.loads(ended[-2])["discarded_bytes"] == len(BROKEN_OFF)
    (other,) = runs() - {killed}
    assert records(other)[0]["before"] == leaf_hash(ended[-1]).hex()
    (noted,) = [record for record in records(other) if record.get("event") == "log-before"]
    assert f"was recovered with {len(before)} records" in noted["detail"]
    for folder in (killed, other):
        verified = ground.start("verify-log", str(folder), "--json").end()
        assert verified.code == 0, verified.events

    assert ground.run(bundle, *words, speed=SPEED).end().code == 5, "a bundle flies once"
    assert runs() == {killed, other}
    fourth = ground.run(ground.bundle(name="another"), *words, speed=SPEED)
    fourth.until("plan")
    fourth.signal(signal.SIGINT)
    assert fourth.end().code == 130
    (last,) = runs() - {killed, other}
    assert records(last)[0]["before"] == leaf_hash(lines(other)[-1]).hex()
    assert "log-before" not in [record["event"] for record in records(last) if record["type"] == "effect"]


@pytest.mark.slow
def test_killed_flight_with_an_expired_root_lands(ground: Any, port: int) -> None:
    """An expired root allows nothing else, and its log is not trusted."""
    ground.vehicle(port, SPEED)
    bundle, words = ground.bundle(), ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    first = ground.run(bundle, *words, speed=SPEED)
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    store, root = ground.store, opened_root(ground.store.root())
    store.root_path.write_bytes(replace(root, expires_at_us=root.issued_at_us + 1).sign(store.signing_key(Duty.ROOT)))

    second = ground.run(bundle, *words, speed=SPEED).end()
    assert second.code == 6, second.stderr
    assert [event for event in second.events if event["event"] == "resumed"]
    assert "the vehicle is brought down anyway" in str(second.events)
