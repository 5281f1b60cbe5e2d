"""The key store: private, written atomically, and each key used for its own duty only."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.adapters.store import folders, keystore
from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore, KeyStoreError, read_root
from rtshcua.wire import key_file
from rtshcua.wire.key_file import KeyFileError
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted

NOW = 1_750_000_000_000_000
LATER = NOW + 1_000_000


@pytest.fixture(autouse=True)
def _cheap_guesses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make passphrases cheap to check, because these tests encrypt many keys."""
    monkeypatch.setattr(key_file, "COST", key_file.COSTS[0])


@pytest.fixture
def seeds() -> Callable[[], bytes]:
    numbers = iter(range(1, 256))
    return lambda: bytes([next(numbers)]) * 32


@pytest.fixture
def store(tmp_path: Path, seeds: Callable[[], bytes]) -> KeyStore:
    store = KeyStore(tmp_path / "data")
    store.create(seeds, development=True, passphrase=None, now_us=NOW, expires_us=LATER)
    return store


def test_every_duty_has_its_key_and_the_root_names_it(store: KeyStore) -> None:
    root = open_root(store.root(), pinned=store.pin(), now_us=NOW)
    assert root.development
    for duty in Duty:
        names = {Duty.MISSION: PROPOSERS, Duty.APPROVAL: ("owner-operator",)}
        keys = [store.signing_key(duty, whose=whose) for whose in names.get(duty, ("",))]
        assert {(key.duty, key.development) for key in keys} == {(duty, True)}
        assert list(root.keys_for(duty)) == [key.kid for key in keys]
    assert store.pin() == store.signing_key(Duty.ROOT).kid


def test_a_mission_key_is_for_one_source_and_for_named_roles_and_policies(
    tmp_path: Path, seeds: Callable[[], bytes]
) -> None:
    store = KeyStore(tmp_path)
    root = store.create(
        seeds, development=True, passphrase=None, now_us=NOW, expires_us=LATER, roles=("pilot",), policies=("field",)
    )
    for source in PROPOSERS:
        key = root.keys_for(Duty.MISSION)[store.signing_key(Duty.MISSION, whose=source).kid]
        assert (key.sources, key.roles, key.policies) == ((source,), ("pilot",), ("field",))


def test_key_folder_is_private(store: KeyStore) -> None:
    assert store.folder.stat().st_mode & 0o777 == 0o700
    assert {file.stat().st_mode & 0o777 for file in store.folder.iterdir()} == {0o600}
    assert [path.name for path in store.folder.parent.iterdir()] == ["keys"]


def test_keys_that_are_not_for_development_are_encrypted(tmp_path: Path, seeds: Callable[[], bytes]) -> None:
    store = KeyStore(tmp_path)
    with pytest.raises(KeyFileError) as refused:
        store.create(seeds, development=False, passphrase=None, now_us=NOW, expires_us=LATER)
    assert refused.value.slug == "unencrypted"
    assert list(tmp_path.iterdir()) == []
    store.create(seeds, development=False, passphrase=b"correct horse", now_us=NOW, expires_us=LATER)
    with pytest.raises(KeyFileError) as refused:
        store.signing_key(Duty.LOG)
    assert refused.value.slug == "passphrase-needed"
    key = store.signing_key(Duty.LOG, passphrase=b"correct horse")
    root = open_root(store.root(), pinned=store.pin(), now_us=NOW)
    assert (root.development, key.development) == (False, False)
    assert key.kid in root.keys_for(Duty.LOG)


def slug_of(action: Callable[[], object]) -> str:
    with pytest.raises(Untrusted) as refused:
        action()
    return refused.value.slug


def test_keys_are_not_made_twice(store: KeyStore, seeds: Callable[[], bytes]) -> None:
    before = store.root()
    again = lambda: store.create(seeds, development=True, passphrase=None, now_us=NOW, expires_us=LATER)  # noqa: E731
    assert slug_of(again) == "exists"
    assert store.root() == before


def test_no_keys(tmp_path: Path) -> None:
    store = KeyStore(tmp_path)
    assert not store.exists()
    for action in (store.root, store.pin, lambda: store.signing_key(Duty.LOG)):
        assert slug_of(action) == "no-keys"


def test_a_key_that_others_may_read_is_refused(store: KeyStore) -> None:
    store.key_path(Duty.LOG).chmod(0o640)
    assert slug_of(lambda: store.signing_key(Duty.LOG)) == "exposed"


def test_a_key_under_another_name_is_for_its_own_duty(store: KeyStore) -> None:
    store.key_path(Duty.LOG).unlink()
    store.key_path(Duty.POLICY).rename(store.key_path(Duty.LOG))
    assert slug_of(lambda: store.signing_key(Duty.LOG)) == "wrong-duty"


@pytest.mark.parametrize("data", [b"", b"\xff" * 100, b"x" * 1_000_000])
def test_malformed_key_file_is_refused(data: bytes, store: KeyStore) -> None:
    store.key_path(Duty.LOG).write_bytes(data)
    assert slug_of(lambda: store.signing_key(Duty.LOG)) == "malformed"


def test_oversized_root_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "root").write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(KeyStoreError) as refused:
        read_root(tmp_path / "root")
    assert refused.value.slug == "too-large"


def test_a_crash_while_making_them_leaves_nothing(
    tmp_path: Path, seeds: Callable[[], bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    store = KeyStore(tmp_path)

    def full(path: Path, data: bytes, *, mode: int) -> None:
        raise OSError("full")

    monkeypatch.setattr(keystore, "write_new", full)
    with pytest.raises(OSError, match="full"):
        store.create(seeds, development=True, passphrase=None, now_us=NOW, expires_us=LATER)
    assert not store.exists()
    assert list(tmp_path.iterdir()) == []


def test_the_data_folder_is_the_users_unless_overridden(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path))
    assert folders.data_folder() == tmp_path
    assert folders.state_folder() == tmp_path / "state"
    monkeypatch.delenv("RTSHCUA_DATA_DIR")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert folders.data_folder().name == "rtshcua"
    assert tmp_path in folders.data_folder().parents
