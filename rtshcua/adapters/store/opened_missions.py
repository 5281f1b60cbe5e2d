"""Which missions were opened on a vehicle: files that survive a crash.

    <state folder>/replay/vehicle-<identity>/<digest>         one marker a mission: its expiry in us, UTC
    <state folder>/replay/vehicle-<identity>/floor            the latest expiry among markers that were pruned
    <state folder>/replay/vehicle-<identity>/floor-policies   JSON: the highest version of each policy, by name

One process at a time looks and writes. Markers of expired missions are pruned; a mission that expires no later than one
that was pruned is refused, so setting the clock back opens nothing again. Policy versions only rise. The marker of a
mission of which nothing was sent is taken back when its run ends; after a crash it stays.

A file that is there and does not say what we write is damage, an empty one too, and opens nothing. The versions are
written before the first marker: where they are missing beside one, or beside a floor, they were lost, and that is
damage as well. Nothing here tells that the whole folder was put back to what it was earlier, emptied or removed.
"""

import fcntl
import json
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from rtshcua.adapters.store.reading import opened_folder, read_if_there, read_regular
from rtshcua.adapters.store.writing import (
    PRIVATE_FILE,
    PRIVATE_FOLDER,
    UNFINISHED,
    make_folder,
    replace,
    sync_folder,
    write_new,
)
from rtshcua.onboard.ports import MissionOpening

_FLOOR = "floor"
_POLICIES = "floor-policies"
_MARKER = re.compile(r"(?:[0-9a-f]{2}){1,128}")  # a name has 255 octets at most
_EXPIRY = re.compile(rb"[0-9]{1,20}\n")
_LARGEST = 16 << 20  # octets of a file here


class FileReplayStore:
    """The opened missions of the vehicle with the identity `vehicle`."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.folder = _folder(state, vehicle)
        make_folder(self.folder, mode=PRIVATE_FOLDER)

    def open_once(self, digest: bytes, expires_us: int, now_utc_us: int, policy: str, version: int) -> MissionOpening:
        """Return `OPENED` once for a mission, after that and its policy's version are on the disk. `expires_us` is the
        end of the mission's validity. `DAMAGED` changes nothing. Raises OSError when the disk refuses: the mission must
        not fly then.
        """
        marker = self.folder / digest.hex()
        with _alone(self.folder):
            refusal = _refusal(self.folder, digest, expires_us, policy, version)
            if refusal is not None:
                return refusal
            versions = _versions(self.folder)
            self._prune(now_utc_us)
            if versions.get(policy) != version:
                raised = json.dumps(versions | {policy: version}, sort_keys=True).encode()
                replace(self.folder / _POLICIES, raised, mode=PRIVATE_FILE)
            write_new(marker, b"%d\n" % expires_us, mode=PRIVATE_FILE)
        return MissionOpening.OPENED

    def give_back(self, digest: bytes) -> None:
        """Reopen a mission of which nothing was sent, once that is on the disk. Its policy's version stays. Raises
        OSError; then it may stay used.
        """
        with _alone(self.folder):
            (self.folder / digest.hex()).unlink(missing_ok=True)
            sync_folder(self.folder)

    def expect_room(self) -> None:
        """Check that a marker could be written, without writing one. Raises OSError."""
        probe = self.folder / f"{UNFINISHED}{secrets.token_hex(8)}"
        write_new(probe, b"0\n", mode=PRIVATE_FILE)
        probe.unlink()

    def _prune(self, now_utc_us: int) -> None:
        expired = {}
        for marker in self.folder.iterdir():
            expires_us = _expiry(marker)
            if expires_us is not None and expires_us < now_utc_us:
                expired[marker] = expires_us
        if not expired:
            return
        replace(self.folder / _FLOOR, b"%d\n" % max(_floor(self.folder), *expired.values()), mode=PRIVATE_FILE)
        for marker in expired:
            marker.unlink(missing_ok=True)
        sync_folder(self.folder)


def looked_up(state: Path, vehicle: str, digest: bytes, expires_us: int, policy: str, version: int) -> MissionOpening:
    """The result of `open_once`, without writing anything or using the mission. Raises OSError."""
    folder = _folder(state, vehicle)
    try:
        folder.stat()
    # every other error is reported: something else in place of the folder does not mean that it is missing
    except FileNotFoundError:
        return MissionOpening.OPENED
    with _alone(folder):
        return _refusal(folder, digest, expires_us, policy, version) or MissionOpening.OPENED


def _folder(state: Path, vehicle: str) -> Path:
    return state / "replay" / f"vehicle-{quote(vehicle, safe='')}"


def _refusal(folder: Path, digest: bytes, expires_us: int, policy: str, version: int) -> MissionOpening | None:
    if (folder / digest.hex()).exists():
        return MissionOpening.REPLAYED
    try:
        floor, versions = _floor(folder), _versions(folder)
    except _Damaged:
        return MissionOpening.DAMAGED
    if expires_us <= floor:
        return MissionOpening.REPLAYED
    return MissionOpening.OLD_POLICY if version < versions.get(policy, version) else None


class _Damaged(Exception):
    """An existing file with invalid content."""


def _floor(folder: Path) -> int:
    data = read_if_there(folder / _FLOOR, _LARGEST)
    if data is not None and _EXPIRY.fullmatch(data) is None:
        raise _Damaged
    return -1 if data is None else int(data)


def _versions(folder: Path) -> dict[str, int]:
    data = read_if_there(folder / _POLICIES, _LARGEST)
    if data is None:
        if any(map(_is_kept, folder.iterdir())):
            raise _Damaged
        return {}
    try:
        said = json.loads(data)
    except (ValueError, RecursionError):
        raise _Damaged from None
    if not isinstance(said, dict) or not said or any(type(version) is not int for version in said.values()):
        raise _Damaged
    return said


def _is_kept(path: Path) -> bool:
    """Whether a file shows that something was opened: a floor, or a marker, even if damaged by a crash."""
    return path.name == _FLOOR or _MARKER.fullmatch(path.name) is not None


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Lock the folder; the system unlocks it when the process dies."""
    with opened_folder(folder) as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def _expiry(marker: Path) -> int | None:
    """The expiry of a marker's bundle; None for one that a crash left without it: it is kept for ever."""
    try:
        bytes.fromhex(marker.name)  # other files here (floors, unfinished files) are not markers
        return int(read_regular(marker, _LARGEST))
    except ValueError:
        return None
