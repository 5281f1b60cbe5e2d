"""The replay store with a crash at each disk operation: an opened mission stays opened."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.store.opened_missions import FileReplayStore
from rtshcua.onboard.ports import MissionOpening

ONE, TWO = bytes(32), b"\x01" * 32
MOST = 60


class Crash(BaseException):
    """The machine stops here."""


class Disk:
    """Allows a number of changes, and crashes before or during the next one."""

    def __init__(self, patch: pytest.MonkeyPatch, changes: int, *, half: bool) -> None:
        self._left, self._half = changes, half
        for name in ("open", "write", "fsync", "fdatasync", "replace", "unlink", "mkdir"):
            patch.setattr(os, name, self._counted(getattr(os, name), name))

    def _counted(self, real: Callable[..., Any], name: str) -> Callable[..., Any]:
        def change(*given: Any, **more: Any) -> Any:
            if self._left == 0:
                self._left = -1
                if self._half and name == "write":
                    real(given[0], given[1][: len(given[1]) // 2])
                raise Crash
            if self._left < 0:
                raise Crash
            self._left -= 1
            return real(*given, **more)

        return change


def survived(tmp_path: Path, changes: int, *, half: bool) -> tuple[bool, bool]:
    """Whether the second opening succeeded, and whether it counts as opened after the crash."""
    store = FileReplayStore(tmp_path, "quad-07")
    assert store.open_once(ONE, 1000, 10, "bridge", 7) is MissionOpening.OPENED
    through = True
    with pytest.MonkeyPatch.context() as patch:
        Disk(patch, changes, half=half)
        try:
            FileReplayStore(tmp_path, "quad-07").open_once(TWO, 9000, 2000, "bridge", 8)  # prunes the first
        except Crash:
            through = False
    after = FileReplayStore(tmp_path, "quad-07")
    assert after.open_once(ONE, 1000, 10, "bridge", 8) is MissionOpening.REPLAYED, "the first came back"
    second = after.open_once(TWO, 9000, 2000, "bridge", 8)
    assert not (through and second is MissionOpening.OPENED), "it was opened twice"
    assert after.open_once(TWO, 9000, 2000, "bridge", 8) is MissionOpening.REPLAYED
    assert after.open_once(b"\x02" * 32, 9000, 2000, "bridge", 7) is MissionOpening.OLD_POLICY
    return through, second is MissionOpening.REPLAYED


@pytest.mark.parametrize("half", [False, True])
def test_replay_store_survives_a_crash_at_any_point(tmp_path: Path, half: bool) -> None:
    seen = []
    for changes in range(MOST):
        seen.append(survived(tmp_path / str(changes), changes, half=half))
        if seen[-1][0]:
            break
    assert seen[-1] == (True, True)
    assert len(seen) > 10, "it did something to the disk"
    assert {through for through, _ in seen[:-1]} == {False}


def test_a_version_that_a_crash_left_on_disk_alone_stays_in_force(tmp_path: Path) -> None:
    """The version is raised before the mission opens: after a crash in between, an older one is refused too."""
    for changes in range(MOST):
        folder = tmp_path / str(changes)
        FileReplayStore(folder, "quad-07")
        with pytest.MonkeyPatch.context() as patch:
            Disk(patch, changes, half=False)
            try:
                FileReplayStore(folder, "quad-07").open_once(ONE, 9000, 10, "bridge", 8)
                return
            except Crash:
                pass
        after = FileReplayStore(folder, "quad-07")
        opened = after.open_once(ONE, 9000, 10, "bridge", 8)
        assert opened in (MissionOpening.OPENED, MissionOpening.REPLAYED)
        assert after.open_once(TWO, 9000, 10, "bridge", 7) is MissionOpening.OLD_POLICY
    raise AssertionError("it never got through")
