"""What a boundary's process keeps, over starts without its link's key, and when it is killed."""

import os
import signal
from pathlib import Path

from boundary import kept as keeping
from boundary.together import PIN, SIGNED_ROOT
from reference.world import START, VEHICLE, sealed
from rtshcua.adapters.boundary_process import BoundaryProcess, kept_file
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.isolated import Caller


def link_after(state: Path, key: Path | None) -> keeping.LinkState:
    """What is kept of the link after a start that opened a bundle, with or without the key."""
    process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, state, link_key=key, paced=True)
    assert isinstance(Caller(process.call).load(sealed(), START), bytes)
    process.close()
    return keeping.read(kept_file(state, VEHICLE)).link


def test_a_start_without_the_key_leaves_the_links_timestamps_as_they_were(tmp_path: Path) -> None:
    """Else a frame that was recorded before counts as new where the clock was set back."""
    key = tmp_path / "link.key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    used = link_after(tmp_path, key)
    assert used.timestamp > 0
    assert link_after(tmp_path, None) == used


def test_a_mission_that_another_bundle_gave_back_stays_given_back_when_it_is_killed(tmp_path: Path) -> None:
    """Nothing was sent of it, and the other bundle is refused."""
    process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, tmp_path, paced=True)
    caller = Caller(process.call)
    assert isinstance(caller.load(sealed(), START), bytes)
    assert keeping.read(kept_file(tmp_path, VEHICLE)).opened
    assert isinstance(caller.load(b"no bundle", START), Refusal)
    os.kill(process.pid, signal.SIGKILL)
    process.close()
    assert not keeping.read(kept_file(tmp_path, VEHICLE)).opened
