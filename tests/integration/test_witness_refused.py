"""Witnesses that no flight can have. `test_flight_whole` has flights with witnesses."""

import os
import shutil
import time
from typing import Any

from rtshcua.diagnostics.exits import ExitCode
from virtual import case


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
