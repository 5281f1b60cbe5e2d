"""Flights on the simulated vehicle that witnesses watch over UDP, and what their logs then prove."""

import json
import os
import shutil
import signal
import socket
import time
from typing import Any

from rtshcua.diagnostics.exits import ExitCode
from virtual import case


def two_witnesses(ground: Any) -> None:
    """The keys made anew, with two witnesses, both of whom must have cosigned."""
    shutil.rmtree(ground.store.folder)
    now_us = time.time_ns() // 1_000
    ground.store.create(
        lambda: os.urandom(32), development=True, passphrase=None, now_us=now_us, expires_us=now_us + case.YEAR_US,
        witnesses=2, witness_threshold=2,
    )  # fmt: skip


def a_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def witness(ground: Any, name: str, port: int) -> Any:
    words = ["--connect", f"udpin:127.0.0.1:{port}", "--key", str(ground.store.folder / name), "--json"]
    run = ground.start("witness", *words)
    run.until("ready")
    return run


def audited(ground: Any, folder: Any, *words: str) -> tuple[int | None, dict[str, Any]]:
    run = ground.start("verify-log", str(folder / "log.jsonl"), "--audit", "--json", *words)
    out = run.process.stdout.read()
    return run.process.wait(60), json.loads(out)


def test_a_flight_that_two_witnesses_watch(ground: Any) -> None:
    two_witnesses(ground)
    ports = [a_port(), a_port()]
    watching = [witness(ground, name, port) for name, port in zip(("witness.key", "witness-2.key"), ports, strict=True)]
    words = [word for port in ports for word in ("--witness", f"udpout:127.0.0.1:{port}")]
    run = ground.run(ground.bundle(), *words).end()
    assert run.code == ExitCode.OK, run.stderr
    count = len(run.log())
    for each in watching:
        each.until("cosigned", size=count - 1)
    assert run.effects().count("anchored") >= 4
    code, found = audited(ground, run.folder)
    assert code == ExitCode.OK
    assert found["anchored"] == count
    # Without what stands beside the log it is anchored as far as its own records say, and says what is not.
    (run.folder / "log.anchors").unlink()
    code, found = audited(ground, run.folder)
    assert code == ExitCode.OK
    assert 0 < found["anchored"] < count
    # Who holds the log's keys still cannot cut it: the witness remembers.
    for each in watching:
        each.signal(signal.SIGINT)
        assert each.end().code == ExitCode.OK
    log = run.folder / "log.jsonl"
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[: count // 2]))
    cut = ground.start("witness", str(log), "--json").end()
    assert cut.code == ExitCode.ANCHOR


def test_a_flight_whose_witness_is_not_there(ground: Any) -> None:
    """It flies all the same, and what it could not do is said."""
    run = ground.run(ground.bundle(), "--witness", f"udpout:127.0.0.1:{a_port()}", speed=20).end()
    assert run.code == ExitCode.OK, run.stderr
    assert any("did not cosign the end of the log" in str(event) for event in run.events)
    assert "anchored" not in run.effects()
    code, found = audited(ground, run.folder)
    assert code == ExitCode.OK
    assert found["anchored"] == 0


def test_a_root_without_witnesses(ground: Any) -> None:
    shutil.rmtree(ground.store.folder)
    now_us = time.time_ns() // 1_000
    ground.store.create(
        lambda: os.urandom(32), development=True, passphrase=None, now_us=now_us, expires_us=now_us + case.YEAR_US,
        witnesses=0,
    )  # fmt: skip
    run = ground.run(ground.bundle(), "--witness", "udpout:127.0.0.1:15000").end()
    assert run.code == ExitCode.UNTRUSTED
    assert "names no witness of this vehicle" in run.stderr


def test_addresses_that_are_none(ground: Any) -> None:
    for address in ("nowhere", "udpin:127.0.0.1:15000"):
        assert ground.run(ground.bundle(), "--witness", address).end().code == ExitCode.USAGE
