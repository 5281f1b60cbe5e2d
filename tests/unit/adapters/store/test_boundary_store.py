"""The state that a boundary keeps between sessions."""

from pathlib import Path

import pytest

from rtshcua.adapters.store.vehicle_records import BoundarySession, BoundaryStore, DamagedState
from rtshcua.wire.boundary_chain import START


def test_boundary_store_returns_last_session(tmp_path: Path) -> None:
    store = BoundaryStore(tmp_path, "quad/07")
    assert store.kept() == BoundarySession(0, START)
    store.keep(1, b"a" * 32)
    store.keep(2, b"b" * 32)
    assert BoundaryStore(tmp_path, "quad/07").kept() == BoundarySession(2, b"b" * 32)
    assert BoundaryStore(tmp_path, "quad-08").kept() == BoundarySession(0, START)
    assert store.path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("data", [b"", b"1\n", b"1 " + b"0" * 63 + b"\n", b"-1 " + b"0" * 64 + b"\n", b"\xff"])
def test_damage_is_told(tmp_path: Path, data: bytes) -> None:
    store = BoundaryStore(tmp_path, "quad-07")
    store.keep(1, b"a" * 32)
    store.path.write_bytes(data)
    with pytest.raises(DamagedState, match="previous session"):
        store.kept()
