"""The read-only lookup of the replay store by a rehearsal: the same answer, without an effect."""

from pathlib import Path

from rtshcua.adapters.store.opened_missions import FileReplayStore, looked_up
from rtshcua.onboard.ports import MissionOpening

DIGEST, LATER = bytes(32), 1 << 52


def test_lookup_predicts_the_opening_without_opening(tmp_path: Path) -> None:
    state = tmp_path / "state"
    assert looked_up(state, "quad", DIGEST, LATER, "city", 2) is MissionOpening.OPENED
    assert not state.exists()
    store = FileReplayStore(state, "quad")
    assert looked_up(state, "quad", DIGEST, LATER, "city", 2) is MissionOpening.OPENED
    assert store.open_once(DIGEST, LATER, 0, "city", 2) is MissionOpening.OPENED
    assert looked_up(state, "quad", DIGEST, LATER, "city", 2) is MissionOpening.REPLAYED
    assert looked_up(state, "quad", b"\x01" * 32, LATER, "city", 1) is MissionOpening.OLD_POLICY
    assert looked_up(state, "other", DIGEST, LATER, "city", 1) is MissionOpening.OPENED
