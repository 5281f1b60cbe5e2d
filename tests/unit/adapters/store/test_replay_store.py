"""A bundle opens only once, also after a crash, with two processes, and with the clock set back."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtshcua.adapters.store import opened_missions as replay
from rtshcua.adapters.store.opened_missions import FileReplayStore
from rtshcua.onboard.ports import MissionOpening

ONE, TWO, THREE = bytes(32), b"\x01" * 32, b"\x02" * 32
POLICY = ("bridge", 7)
OPENED, REPLAYED, OLD_POLICY, DAMAGED = (
    MissionOpening.OPENED,
    MissionOpening.REPLAYED,
    MissionOpening.OLD_POLICY,
    MissionOpening.DAMAGED,
)


def test_mission_opens_once(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(ONE, 1000, 10, *POLICY) is REPLAYED
    assert store.open_once(TWO, 1000, 10, *POLICY) is OPENED
    assert FileReplayStore(tmp_path, "quad-07").open_once(ONE, 2000, 20, *POLICY) is REPLAYED


def test_mission_given_back_opens_again_at_same_policy(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 1000, 10, *POLICY) is OPENED
    store.give_back(ONE)
    store.give_back(ONE)
    assert store.open_once(TWO, 1000, 10, *POLICY) is REPLAYED
    assert store.open_once(ONE, 1000, 10, "bridge", 6) is OLD_POLICY
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED


def test_expired_mission_stays_used_when_given_back(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 9000, 1001, *POLICY) is OPENED
    store.give_back(ONE)
    assert store.open_once(ONE, 1000, 10, *POLICY) is REPLAYED


def test_vehicles_have_separate_replay_stores(tmp_path: Path) -> None:
    for vehicle in ("quad-07", "quad-08", "..", "", "a/b", "quad 07"):
        assert FileReplayStore(tmp_path, vehicle).open_once(ONE, 1000, 10, *POLICY) is OPENED, vehicle
    assert {path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob("*")} == {"replay"}


def test_expired_markers_are_pruned(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 2000, 1000, *POLICY) is OPENED  # it expires at the end of this microsecond
    assert (store.folder / ONE.hex()).exists()
    assert store.open_once(THREE, 3000, 1001, *POLICY) is OPENED
    assert sorted(path.name for path in store.folder.iterdir()) == sorted(
        [TWO.hex(), THREE.hex(), "floor", "floor-policies"]
    )


def test_clock_set_back_does_not_reopen_missions(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 9000, 1001, *POLICY) is OPENED
    assert not (store.folder / ONE.hex()).exists()
    assert store.open_once(ONE, 1000, 10, *POLICY) is REPLAYED
    assert store.open_once(THREE, 1001, 10, *POLICY) is OPENED
    assert store.open_once(b"\x03" * 32, 99_000, 20_000, *POLICY) is OPENED
    assert store.open_once(THREE, 1001, 10, *POLICY) is REPLAYED
    assert store.open_once(b"\x04" * 32, 9000, 10, *POLICY) is REPLAYED


def test_a_marker_that_a_crash_left_empty_still_counts(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(b"\x05" * 32, 1_000, 10, *POLICY) is OPENED
    (store.folder / ONE.hex()).touch()
    assert store.open_once(ONE, 1000, 10, *POLICY) is REPLAYED
    assert store.open_once(TWO, 1_000_000, 500_000, *POLICY) is OPENED
    assert store.open_once(ONE, 1_000_000, 500_000, *POLICY) is REPLAYED


@pytest.mark.parametrize("beside", ["a marker", "a floor"])
def test_versions_that_are_gone_are_damage(tmp_path: Path, beside: str) -> None:
    """Otherwise a withdrawn policy could fly again."""
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    if beside == "a floor":
        assert store.open_once(TWO, 3000, 2000, *POLICY) is OPENED
        (store.folder / TWO.hex()).unlink()
    (store.folder / "floor-policies").unlink()
    assert store.open_once(THREE, 9000, 10, "bridge", 1) is DAMAGED


def test_unfinished_floor_file_is_ignored(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    (store.folder / "floor.new").write_bytes(b"1")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 5000, 2000, *POLICY) is OPENED
    assert (store.folder / "floor").read_bytes() == b"1000\n"


def test_mission_is_not_opened_if_the_disk_refuses_the_marker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = FileReplayStore(tmp_path, "quad-07")

    def fails(handle: int) -> None:
        raise OSError("no sync")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fails)
        with pytest.raises(OSError, match="no sync"):
            store.open_once(ONE, 1000, 10, *POLICY)


def test_marker_and_folder_are_synced_before_a_mission_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    synced: list[str] = []
    real = os.fsync

    def record(handle: int) -> None:
        synced.append(str(Path(f"/proc/self/fd/{handle}").readlink()))
        real(handle)

    monkeypatch.setattr(os, "fsync", record)
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert {str(store.folder), str(store.folder / ONE.hex())} <= set(synced)


def test_of_many_processes_one_opens_it(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from rtshcua.adapters.store.opened_missions import FileReplayStore\n"
        "sys.stdin.read(1); print(FileReplayStore(Path(sys.argv[1]), 'quad-07').open_once(bytes(32), 9, 1, 'p', 1))"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    started = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    answers = [process.communicate("x")[0].strip() for process in started]
    assert sorted(answers) == ["opened", "replayed", "replayed", "replayed"]


def test_the_lock_is_given_back(tmp_path: Path) -> None:
    handles = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0  # noqa: PTH208
    store = FileReplayStore(tmp_path, "quad-07")
    for number in range(20):
        store.open_once(bytes([number]) * 32, 1000, 10, *POLICY)
    if handles:
        assert len(os.listdir("/proc/self/fd")) == handles  # noqa: PTH208
    assert replay.PRIVATE_FILE == 0o600
    assert all(path.stat().st_mode & 0o077 == 0 for path in store.folder.iterdir())


def test_policy_versions_only_rise(tmp_path: Path) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, "bridge", 7) is OPENED
    assert store.open_once(TWO, 1000, 10, "bridge", 6) is OLD_POLICY
    assert store.open_once(TWO, 1000, 10, "other", 6) is OPENED
    assert store.open_once(THREE, 1000, 10, "bridge", 8) is OPENED
    again = FileReplayStore(tmp_path, "quad-07")
    assert again.open_once(b"\x03" * 32, 9000, 5000, "bridge", 7) is OLD_POLICY
    assert again.open_once(b"\x03" * 32, 9000, 5000, "bridge", 8) is OPENED, "what was refused was not opened"
    assert FileReplayStore(tmp_path, "quad-08").open_once(TWO, 1000, 10, "bridge", 6) is OPENED


def test_the_version_is_on_disk_before_the_mission_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = FileReplayStore(tmp_path, "quad-07")

    def fails(*_: object, **__: object) -> None:
        raise OSError("no room")

    with monkeypatch.context() as patch:
        patch.setattr(replay, "write_new", fails)
        with pytest.raises(OSError, match="no room"):
            store.open_once(ONE, 1000, 10, "bridge", 8)
    assert store.open_once(TWO, 1000, 10, "bridge", 7) is OLD_POLICY
    assert store.open_once(ONE, 1000, 10, "bridge", 8) is OPENED


@pytest.mark.parametrize(
    ("name", "data"),
    [
        *(("floor", data) for data in (b"", b"\n", b"1000", b"x\n", b"1_0\n", b"9" * 5000 + b"\n", b"\xff\n")),
        *(("floor-policies", data) for data in (b"", b"[]", b"{}", b"null", b"7", b'[["bridge", 6]]', b"[" * 99_999)),
        *(("floor-policies", data) for data in (b'{"bridge": "7"}', b'{"bridge": true}', b'{"bridge": null}', b"\xff")),
    ],
)
def test_damage_is_told_from_absence_and_opens_nothing(tmp_path: Path, name: str, data: bytes) -> None:
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, *POLICY) is OPENED
    assert store.open_once(TWO, 9000, 2000, *POLICY) is OPENED
    (store.folder / name).write_bytes(data)
    before = sorted(path.name for path in store.folder.iterdir())
    assert store.open_once(THREE, 9000, 2000, *POLICY) is MissionOpening.DAMAGED
    assert replay.looked_up(tmp_path, "quad-07", THREE, 9000, *POLICY) is MissionOpening.DAMAGED
    assert store.open_once(TWO, 9000, 2000, *POLICY) is REPLAYED, "its own marker says so"
    assert (store.folder / name).read_bytes() == data
    assert sorted(path.name for path in store.folder.iterdir()) == before
    (store.folder / name).unlink()
    lost = DAMAGED if name == "floor-policies" else OPENED  # versions come before markers; a floor may be missing
    assert store.open_once(THREE, 9000, 2000, *POLICY) is lost
