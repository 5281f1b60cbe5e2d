"""The boundary's key and its sessions in a run."""

from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.flying import refusal_of
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.vehicle_records import BoundaryStore
from rtshcua.app.fly.start_boundary import HeldByBoundary, StartedBoundary, boundary_key
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot, open_root
from virtual import case

NOW_US = case.flat.ISSUED


@pytest.fixture
def store() -> KeyStore:
    assert app.main(["keys", "init"]) == ExitCode.OK
    return KeyStore(data_folder())


def root(store: KeyStore) -> TrustRoot:
    return open_root(store.root(), pinned=store.pin(), now_us=0)


def opened(store: KeyStore) -> Callable[[Duty, Path | None], SigningKey]:
    """The passphrase source of its keys."""
    return lambda duty, path: unlock(store, duty, path=path)


def slug(store: KeyStore, of: TrustRoot, path: Path | None = None) -> str:
    return refusal_of(boundary_key(of, "quad-07", NOW_US, opened(store), path)).slug


def test_the_key_store_s_key_or_another_file(store: KeyStore) -> None:
    own = store.signing_key(Duty.BOUNDARY)
    path = store.key_path(Duty.BOUNDARY)
    for given in (None, path):
        found = boundary_key(root(store), "quad-07", NOW_US, opened(store), given)
        assert isinstance(found, SigningKey)
        assert found.kid == own.kid


def test_root_without_boundary_key_requires_none(store: KeyStore) -> None:
    of = root(store)
    others = tuple(key for key in of.keys if key.duty is not Duty.BOUNDARY)
    elsewhere = replace(store.signing_key(Duty.BOUNDARY).verification(vehicles=("quad-08",)))
    for keys in (others, (*others, elsewhere)):
        assert boundary_key(replace(of, keys=keys), "quad-07", NOW_US, opened(store), None) is None


def test_no_key_or_another_is_refused(store: KeyStore) -> None:
    of = root(store)
    stranger = replace(case.BOUNDARY_KEY.verification(vehicles=("*",)))
    others = tuple(key for key in of.keys if key.duty is not Duty.BOUNDARY)
    assert slug(store, replace(of, keys=(*others, stranger))) == "unknown-key"
    assert slug(store, of, store.key_path(Duty.LOG)) == "wrong-duty"
    store.key_path(Duty.BOUNDARY).unlink()
    assert slug(store, of) == "no-boundary-key"


def session_of(store: BoundaryStore, key: SigningKey | HeldByBoundary | None, *, aloft: bool) -> StartedBoundary:
    session = StartedBoundary.open(store, key, aloft=aloft)
    assert isinstance(session, StartedBoundary)
    return session


def test_sessions_follow_one_another(tmp_path: Path) -> None:
    store = BoundaryStore(tmp_path, "quad-07")
    first = session_of(store, case.BOUNDARY_KEY, aloft=False)
    assert first.key == (case.BOUNDARY_KEY, 1, START)
    first.begun(b"a" * 32, 1)
    broken_off = session_of(store, case.BOUNDARY_KEY, aloft=False)
    assert broken_off.key == (case.BOUNDARY_KEY, 2, b"a" * 32)
    first.ended(b"b" * 32)
    assert session_of(store, case.BOUNDARY_KEY, aloft=False).key == (case.BOUNDARY_KEY, 2, b"b" * 32)


def test_restored_state_folder_is_noted_by_the_boundary_count(tmp_path: Path) -> None:
    store = BoundaryStore(tmp_path, "quad-07")
    store.keep(2, b"a" * 32)
    session = session_of(store, case.BOUNDARY_KEY, aloft=False)
    session.begun(b"b" * 32, 8)
    assert "counts 2 sessions of the boundary, and its process 7" in session.note
    assert store.kept() == (8, b"b" * 32), "and goes on from there"
    same = session_of(store, case.BOUNDARY_KEY, aloft=False)
    same.begun(b"c" * 32, 9)
    assert not same.note


def test_a_key_that_the_boundary_has_is_not_held_here(tmp_path: Path) -> None:
    session = session_of(BoundaryStore(tmp_path, "quad-07"), HeldByBoundary(), aloft=False)
    assert session.key == (None, 1, START)
    session.begun(b"a" * 32, 1)
    assert BoundaryStore(tmp_path, "quad-07").kept() == (1, b"a" * 32)


def test_run_stops_on_the_ground_if_no_session_begins(tmp_path: Path) -> None:
    store = BoundaryStore(tmp_path, "quad-07")
    with pytest.raises(OSError, match="cannot store the start of its session"):
        session_of(store, case.BOUNDARY_KEY, aloft=False).begun(START, None)
    session_of(store, case.BOUNDARY_KEY, aloft=True).begun(START, None)


def test_no_session_is_stored_without_a_key(tmp_path: Path) -> None:
    session = session_of(BoundaryStore(tmp_path, "quad-07"), None, aloft=False)
    session.begun(b"a" * 32, None)
    session.ended(b"b" * 32)
    assert (session.key, list(tmp_path.iterdir())) == (None, [])


def test_unreadable_state_does_not_block_an_airborne_vehicle(tmp_path: Path) -> None:
    store = BoundaryStore(tmp_path, "quad-07")
    store.keep(1, b"a" * 32)
    store.path.write_bytes(b"x")
    refused = refusal_of(StartedBoundary.open(store, case.BOUNDARY_KEY, aloft=False))
    assert (refused.slug, refused.code) == ("damaged", ExitCode.INPUT)
    session = session_of(store, case.BOUNDARY_KEY, aloft=True)
    assert session.key == (case.BOUNDARY_KEY, 0, START)
    assert "brought down anyway" in session.note
    session.begun(b"a" * 32, 0)
    session.ended(b"b" * 32)
    assert store.path.read_bytes() == b"x"
    store.path.unlink()
    sound = session_of(store, case.BOUNDARY_KEY, aloft=True)
    store.path.mkdir()
    with pytest.raises(OSError, match="not a regular file"):
        session_of(store, case.BOUNDARY_KEY, aloft=False)
    sound.begun(b"a" * 32, None)
    sound.ended(b"b" * 32)
