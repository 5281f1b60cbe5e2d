"""Refused witnesses. `test_flight_whole` has flights with witnesses."""

import os
import shutil
import time
from typing import Any

from rtshcua.diagnostics.exits import ExitCode
from virtual import case
from virtual.forked import Forked


def test_root_without_witnesses_is_refused(commands: Forked, ground: Any) -> None:
    shutil.rmtree(ground.store.folder)
    now_us = time.time_ns() // 1_000
    ground.store.create(
        lambda: os.urandom(32), development=True, passphrase=None, now_us=now_us, expires_us=now_us + case.YEAR_US,
        witnesses=0,
    )  # fmt: skip
    done = commands.run(["run", ground.bundle(), "--witness", "udpout:127.0.0.1:15000"], ground.folder, 60)
    assert done.code == ExitCode.UNTRUSTED
    assert "names no witness for this vehicle" in done.err


def test_malformed_addresses_are_refused(commands: Forked, ground: Any) -> None:
    for address in ("nowhere", "udpin:127.0.0.1:15000"):
        done = commands.run(["run", ground.bundle(), "--witness", address], ground.folder, 60)
        assert done.code == ExitCode.USAGE
