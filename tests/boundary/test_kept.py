"""The stored state of a boundary's process, after starts without its link's key, and after kills."""

import os
import signal
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from boundary import kept as keeping
from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from reference.world import MISSION, POLICY, START, VEHICLE, sealed
from rtshcua.adapters.boundary.home import kept_file
from rtshcua.adapters.boundary.process import BoundaryProcess
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.signing import EPOCH_US, SignedLink, SigningState, timestamp_in, timestamp_of
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.enforcement.isolated import Caller, IsolatedGate


def link_after(state: Path, key: Path | None) -> keeping.LinkState:
    """The stored state of the link after a start that opened a bundle, with or without the key."""
    process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, state, link_key=key, paced=True)
    assert isinstance(Caller(process.call).load(sealed(), START), bytes)
    process.close()
    return keeping.read(kept_file(state, VEHICLE)).link


def test_start_without_link_key_keeps_timestamps(tmp_path: Path) -> None:
    """Otherwise a recorded frame would be accepted as new after the clock was set back."""
    key = tmp_path / "link.key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    used = link_after(tmp_path, key)
    assert used.timestamp > 0
    assert link_after(tmp_path, None) == used


def test_released_mission_stays_released_after_kill(tmp_path: Path) -> None:
    """Nothing was sent of it, and the other bundle is refused."""
    process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, tmp_path, paced=True)
    caller = Caller(process.call)
    assert isinstance(caller.load(sealed(), START), bytes)
    assert keeping.read(kept_file(tmp_path, VEHICLE)).opened
    assert isinstance(caller.load(b"no bundle", START), Refusal)
    os.kill(process.pid, signal.SIGKILL)
    process.close()
    assert not keeping.read(kept_file(tmp_path, VEHICLE)).opened


@pytest.mark.parametrize("heard", [1, 40])
def test_next_frame_is_accepted_after_kill(tmp_path: Path, heard: int) -> None:
    """ArduPilot's timestamp rises by one a frame: the stored one must not be ahead of the last received one."""
    key = tmp_path / "link.key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    vehicle = SignedLink(key.read_bytes(), SigningState(timestamp_of(time.time_ns() // 1_000), {}), EPOCH_US, 0)
    beat = Codec(1, 1).pack(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))

    def begin() -> tuple[BoundaryProcess, IsolatedGate]:
        process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, tmp_path, link_key=key, paced=True)
        return process, IsolatedGate(Caller(process.call, signs=True), Commands(POLICY, MISSION))

    process, gate = begin()
    frames = [vehicle.sign(beat, 0) for _ in range(heard)]
    now_us = monotonic_ns() // 1_000
    assert all(gate.accept(frame, now_us) for frame in frames)
    while keeping.read(kept_file(tmp_path, VEHICLE)).link.streams.get((1, 1, 0), 0) < timestamp_in(frames[0]):
        gate.accept(frames[0], monotonic_ns() // 1_000)  # a replay; each call lets it store due state
    os.kill(process.pid, signal.SIGKILL)
    process.close()
    process, gate = begin()
    now_us = monotonic_ns() // 1_000
    assert not gate.accept(frames[0], now_us)
    assert gate.accept(vehicle.sign(beat, 0), now_us)
    process.close()
