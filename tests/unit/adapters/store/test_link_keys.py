"""The link key and its timestamps on the disk: permissions, crashes, and errors that stop a run."""

import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.adapters.store import memory, signing
from rtshcua.adapters.store.signing import (
    LinkKeeper,
    LinkKeyError,
    LinkStore,
    fingerprint,
    read_link_key,
    write_link_key,
)
from rtshcua.mavlink.signing import EPOCH_US, SignedLink, SigningState, timestamp_of

KEY = bytes(range(32))
UTC = EPOCH_US + 10**15
STATE = SigningState(77, {(1, 1, 0): 70, (1, 68, 2): 60})


def put(path: Path, data: bytes, mode: int = 0o600) -> Path:
    path.write_bytes(data)
    path.chmod(mode)
    return path


def us_in(seconds: float) -> int:
    return int(seconds * 1_000_000)


def a_frame() -> bytes:
    return bytes([0xFD, 1, 0, 0, 0, 1, 191, 0, 0, 0, 7, 0, 0])


def a_vehicles_frame() -> bytes:
    return bytes([0xFD, 1, 0, 0, 0, 1, 1, 0, 0, 0, 7, 0, 0])


def slug(act: Callable[[], object]) -> str:
    with pytest.raises(LinkKeyError) as caught:
        act()
    return caught.value.slug


def test_a_key_is_written_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "link.key"
    write_link_key(path, KEY)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_link_key(path) == KEY
    with pytest.raises(FileExistsError):
        write_link_key(path, bytes(32))


@pytest.mark.parametrize(
    "data", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\r\n", b" " + KEY.hex().encode()]
)
def test_a_key_is_raw_or_hexadecimal(tmp_path: Path, data: bytes) -> None:
    assert read_link_key(put(tmp_path / "key", data)) == KEY


@pytest.mark.parametrize(
    "data",
    [b"", KEY[:31], KEY + b"\n", KEY.hex()[:-2].encode(), b"\xff" * 64, bytes(32), b"0" * 64, KEY.hex().encode() * 99],
)
def test_file_without_a_key_is_refused(tmp_path: Path, data: bytes) -> None:
    assert slug(lambda: read_link_key(put(tmp_path / "key", data))) == "malformed"


@pytest.mark.skipif(os.name != "posix", reason="modes are of POSIX")
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o644, 0o610])
def test_a_key_that_others_may_read_is_refused(tmp_path: Path, mode: int) -> None:
    with pytest.raises(LinkKeyError) as refused:
        read_link_key(put(tmp_path / "key", KEY, mode))
    assert (refused.value.slug, refused.value.help) == ("exposed", f"`chmod 600 {tmp_path / 'key'}`")


def test_a_key_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_link_key(tmp_path / "key")


def test_fingerprint_identifies_a_key_without_revealing_it() -> None:
    assert fingerprint(KEY) == fingerprint(bytes(KEY))
    assert fingerprint(KEY) != fingerprint(bytes(32))
    assert KEY.hex()[:8] not in fingerprint(KEY)


def test_link_state_is_loaded_by_vehicle_and_key(tmp_path: Path) -> None:
    store = LinkStore(tmp_path, "quad/07", KEY)
    assert store.load() == SigningState(0, {})
    store.save(STATE)
    assert store.load() == STATE
    store.save(STATE, ahead=5)
    assert store.load() == SigningState(82, STATE.streams), "the reserve is for our own timestamp"
    for other in (LinkStore(tmp_path, "quad-08", KEY), LinkStore(tmp_path, "quad/07", bytes(32))):
        assert other.load() == SigningState(0, {})
        other.close()
    assert stat.S_IMODE(store.path.stat().st_mode) == 0o600
    assert str(tmp_path / "link" / "vehicle-quad%2F07") == str(store.path.parent)
    store.close()


def test_second_run_on_a_link_key_is_refused(tmp_path: Path) -> None:
    store = LinkStore(tmp_path, "quad-07", KEY)
    assert slug(lambda: LinkStore(tmp_path, "quad-07", KEY)) == "in-use"
    store.close()
    LinkStore(tmp_path, "quad-07", KEY).close()


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b'{"timestamp": 1}', b'{"timestamp": "x", "streams": []}',
             b'{"timestamp": 1, "streams": [[1, 1]]}', b'{"timestamp": 1, "streams": 3}', b"\xff"],
)  # fmt: skip
def test_a_damaged_state_stops_the_run(tmp_path: Path, data: bytes) -> None:
    """Unknown timestamps must not be treated as unused."""
    store = LinkStore(tmp_path, "quad-07", KEY)
    put(store.path, data)
    assert slug(store.load) == "damaged"
    store.close()


def test_timestamps_stay_monotonic_after_a_crash(tmp_path: Path) -> None:
    """The clock is also set back, and only the state on the disk remains."""
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, store.load(), UTC, 0)
    heard = SignedLink(KEY, SigningState(0, {}), UTC, 0).sign(a_frame(), 0)
    assert link.accept(heard, 0)
    keeper = LinkKeeper(store, link, us_in)
    last = [link.sign(a_frame(), now_us) for now_us in range(0, 2_900_000, 100_000)][-1]
    left = store.load()  # the process dies here, and writes nothing more
    after = SignedLink(KEY, left, UTC - 10**12, 0)
    assert after.sign(a_frame(), 0)[-12:-6][::-1] > last[-12:-6][::-1]
    assert not after.accept(heard, 0)
    assert left.timestamp == timestamp_of(UTC) + 1 + 300_000
    keeper.close()


@pytest.mark.parametrize("moment", range(0, 150, 3))
def test_next_frame_of_ardupilot_is_accepted_after_a_kill(tmp_path: Path, moment: int) -> None:
    """ArduPilot's timestamp rises by one a frame (recorded), so one second of frames is a millisecond of timestamps."""
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, store.load(), UTC, 0)
    vehicle = SignedLink(KEY, SigningState(timestamp_of(UTC) + 6_000_000, {}), EPOCH_US, 0, as_library=True)
    keeper = LinkKeeper(store, link, us_in)
    heard = [vehicle.sign(a_vehicles_frame(), 0) for _ in range(moment)]
    assert all(link.accept(frame, 10_000 * at) for at, frame in enumerate(heard))
    left = store.load()  # the process is killed here: shared memory and the disk remain
    after = SignedLink(KEY, left, UTC + 10_000 * moment, 0)
    assert not any(after.accept(frame, 0) for frame in heard)
    assert after.accept(vehicle.sign(a_vehicles_frame(), 0), 0)
    keeper.close()


def test_disk_state_lags_at_most_one_second_without_shared_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "_FOLDER", tmp_path / "none")
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, store.load(), UTC, 0)
    vehicle = SignedLink(KEY, SigningState(timestamp_of(UTC), {}), EPOCH_US, 0, as_library=True)
    first, *others = (vehicle.sign(a_vehicles_frame(), 0) for _ in range(5))
    assert link.accept(first, 0)
    keeper = LinkKeeper(store, link, us_in)
    assert all(link.accept(frame, 0) for frame in others)
    after = SignedLink(KEY, store.load(), UTC, 0)
    assert not after.accept(first, 0)
    assert after.accept(others[-1], 0)
    assert store.heard.refused is None, "nothing is in the way"
    keeper.close()


@pytest.mark.parametrize("there", ["a link", "a folder", "two names"])
def test_memory_of_somebody_else_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: str) -> None:
    monkeypatch.setattr(memory, "_FOLDER", tmp_path)
    target, path = tmp_path / "target", memory.memory_file("name")
    target.write_bytes(b"as it was")
    match there:
        case "a link":
            path.symlink_to(target)
        case "a folder":
            path.mkdir()
        case "two names":
            path.hardlink_to(target)
    assert memory.open_memory("name", 256) is None
    heard = signing.HeardStamps("name")
    heard.start({(1, 1, 0): 100})
    assert heard.refused == path
    assert target.read_bytes() == b"as it was"


def test_memory_keeps_the_newest_streams_until_an_orderly_exit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_FOLDER", tmp_path)
    many = {(1, component, 0): 100 + component for component in range(20)}
    heard = signing.HeardStamps("name")
    heard.start(many)
    heard.remember((1, 200, 0), 500)
    heard.remember((1, 19, 0), 501)
    heard.close(forget=False)
    again = signing.HeardStamps("name")
    assert again.load() == {(1, each, 0): 100 + each for each in range(5, 19)} | {(1, 200, 0): 500, (1, 19, 0): 501}
    again.close(forget=True)
    again.remember((1, 1, 1), 7)  # too late: no effect
    assert list(tmp_path.iterdir()) == []


def test_an_orderly_end_keeps_the_exact_state(tmp_path: Path) -> None:
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, SigningState(5, {}), 0, 0)
    keeper = LinkKeeper(store, link, us_in)
    link.sign(a_frame(), 0)
    keeper.close()
    assert keeper.trouble is None
    again = LinkStore(tmp_path, "quad-07", KEY)
    assert again.load() == link.state == SigningState(6, {})
    again.close()


def test_the_thread_keeps_what_is_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signing, "EVERY_S", 0.001)
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, SigningState(5, {}), 0, 0)
    keeper = LinkKeeper(store, link, us_in)
    link.sign(a_frame(), 0)
    while store.load().timestamp != 6 + 300_000:
        keeper._thread.join(0.001)
    keeper.close()


def test_a_leap_of_time_is_kept_at_once(tmp_path: Path) -> None:
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, SigningState(5, {}), 0, 0)
    keeper = LinkKeeper(store, link, us_in)
    later = SignedLink(KEY, SigningState(10_000_000, {}), 0, 0)
    assert link.accept(later.sign(a_frame(), 0), 0)
    while store.load().timestamp != 10_000_001 + 300_000:
        keeper._thread.join(0.001)
    assert store.load().streams == {(1, 191, 0): 10_000_001}
    keeper.close()


def test_disk_failure_stops_a_run_only_before_it_starts(tmp_path: Path) -> None:
    store = LinkStore(tmp_path, "quad-07", KEY)
    link = SignedLink(KEY, SigningState(5, {}), 0, 0)

    def full(state: SigningState, ahead: int = 0) -> None:
        raise OSError(28, "no space left on device")

    keeper = LinkKeeper(store, link, us_in)
    store.save = full  # type: ignore[method-assign]
    assert len(link.sign(a_frame(), 0)) == len(a_frame()) + 13
    keeper.close()
    assert keeper.trouble is not None
    with pytest.raises(OSError, match="no space"):
        LinkKeeper(store, link, us_in)
