"""What a boundary's process keeps of a link with a key outlives starts without that key."""

from pathlib import Path

from boundary import kept as keeping
from boundary.together import PIN, SIGNED_ROOT
from reference.world import START, VEHICLE, sealed
from rtshcua.adapters.boundary_process import BoundaryProcess, kept_file
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
