"""What MAVLink signing keeps on the disk: the link's key, and the timestamps that no restart may use again.

    FILE                                                       the key: 32 octets, or 64 hexadecimal digits; mode 0600
    <state folder>/link/vehicle-<identity>/<fingerprint>       JSON: the local timestamp, and each stream's last one
    memory (`adapters.store.memory`)                           each stream's last one, after each frame

"The current timestamp should be stored regularly in persistent storage" (guide, "Timestamp Handling"). Our own is
stored `RESERVE_S` ahead of what was used, again every `EVERY_S`, and when a peer's frame makes our time leap, by a
thread of its own: nothing that flies may wait for a disk. So after a crash our first timestamp is above all that we
sent. A peer's last timestamp is kept as it was, never ahead: ArduPilot counts one a frame, so a reserve of 3 s would
refuse it for an hour. After a crash of the process at most one frame can be heard again, after one of the machine those
of the last `EVERY_S`. An orderly end stores the exact figures.
"""

import hashlib
import json
import mmap
import os
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final
from urllib.parse import quote

from rtshcua.adapters.store.memory import memory_file, open_memory
from rtshcua.adapters.store.reading import exposed, open_regular, read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, lock, make_folder, replace, write_new
from rtshcua.mavlink.signing import KEY_OCTETS, LAST, MOST_STREAMS, UNIT_US, SignedLink, SigningState, Stream

EVERY_S: Final = 1.0
RESERVE_S: Final = 3.0
_LONGEST: Final = 1_024
_LARGEST: Final = 1 << 20  # octets of a state


#: the slug for a key in use by another run
IN_USE: Final = "in-use"


class LinkKeyError(Exception):
    """A key file, or the stored state of its key, cannot be used: `exposed`, `malformed`, `in-use`, `damaged`."""

    def __init__(self, slug: str, text: str, help: str | None = None) -> None:
        super().__init__(text)
        self.slug = slug
        self.help = help


def open_link_key(path: Path) -> BinaryIO:
    """Open the file of a key, which only its owner may read. It is not read here, because another process may do the
    signing. Raises LinkKeyError and OSError.
    """
    file = open_regular(path)
    wrong = no_link_key(path) if os.fstat(file.fileno()).st_size > _LONGEST else _exposed(path, file)
    if wrong is not None:  # a file without a key is reported as that, not by its mode
        file.close()
        raise wrong
    return file


def _exposed(path: Path, file: BinaryIO) -> LinkKeyError | None:
    why = exposed(file)
    if why is None:
        return None
    return LinkKeyError("exposed", f"other users may read the key `{path}`: {why}", f"`chmod 600 {path}`")


def read_link_key(path: Path) -> bytes:
    """The key in a file. Raises LinkKeyError and OSError."""
    with open_regular(path) as file:
        key = _key_in(file.read(_LONGEST + 1))
        wrong = no_link_key(path) if key is None else _exposed(path, file)
    if key is None or wrong is not None:
        raise wrong or no_link_key(path)
    return key


def _key_in(data: bytes) -> bytes | None:
    """The key in a file's content, as octets or hexadecimal digits."""
    if len(data) != KEY_OCTETS:
        try:
            data = bytes.fromhex(data.decode("ascii"))
        except ValueError:
            return None
    return data if len(data) == KEY_OCTETS and any(data) else None  # zeros switch signing off (SETUP_SIGNING)


def no_link_key(path: Path) -> LinkKeyError:
    """The error for a file without a key."""
    what = f"{KEY_OCTETS} octets, or {2 * KEY_OCTETS} hexadecimal digits, not all 0"
    return LinkKeyError("malformed", f"`{path}` is not a link key", f"{what}; `rtshcua keys link` makes one")


def write_link_key(path: Path, key: bytes) -> None:
    """Write a key to a new file. Raises FileExistsError, and OSError."""
    write_new(path, key.hex().encode() + b"\n", mode=PRIVATE_FILE)


def fingerprint(key: bytes) -> str:
    """A name for a key that reveals nothing about it."""
    return hashlib.sha256(b"rtshcua/link-key\0" + key).hexdigest()[:16]


class HeardStamps:
    """The last timestamp of each stream, in memory that outlives this process; empty without such memory."""

    _SLOT: Final = struct.Struct("<BBB5xQ")  # system, component, link; the timestamp, 0 in a free slot

    def __init__(self, name: str) -> None:
        self._name = name
        self._memory: mmap.mmap | None = None
        self._slots: dict[Stream, int] = {}

    def load(self) -> dict[Stream, int]:
        """The timestamps of an earlier process."""
        if self._memory is None and memory_file(self._name).exists():
            self._memory = self._open()
        if self._memory is None:
            return {}
        return {(a, b, c): last for a, b, c, last in self._SLOT.iter_unpack(self._memory[:]) if 0 < last <= LAST}

    @property
    def refused(self) -> Path | None:
        """The file in place of the memory that does not belong to this user; then there is no memory."""
        path = memory_file(self._name)
        return path if self._memory is None and os.path.lexists(path) else None

    def start(self, streams: dict[Stream, int]) -> None:
        """Store these, and nothing else."""
        self._memory = self._memory or self._open()
        if self._memory is None:
            return
        newest = sorted(streams, key=streams.__getitem__, reverse=True)[:MOST_STREAMS]
        self._slots = {stream: slot for slot, stream in enumerate(newest)}
        for slot in range(MOST_STREAMS):
            stream = newest[slot] if slot < len(newest) else (0, 0, 0)
            self._SLOT.pack_into(self._memory, slot * self._SLOT.size, *stream, streams.get(stream, 0))

    def remember(self, stream: Stream, timestamp: int) -> None:
        """Store the timestamp of an accepted frame. A new stream takes the place of the oldest."""
        memory, size = self._memory, self._SLOT.size
        if memory is None:
            return
        slot = self._slots.get(stream)
        if slot is None:
            lasts = [last for *_, last in self._SLOT.iter_unpack(memory[:])]
            slot = lasts.index(min(lasts))
            self._slots = {each: place for each, place in self._slots.items() if place != slot} | {stream: slot}
        self._SLOT.pack_into(memory, slot * size, *stream, timestamp)

    def _open(self) -> mmap.mmap | None:
        return open_memory(self._name, MOST_STREAMS * self._SLOT.size)

    def close(self, *, forget: bool) -> None:
        """Release the memory; `forget` it where all of it is on the disk."""
        if self._memory is not None:
            self._memory.close()
            self._memory = None
            if forget:
                with suppress(OSError):
                    memory_file(self._name).unlink()


class LinkStore:
    """The state of one key on one vehicle. One process holds it at a time, until it is closed or dies."""

    def __init__(self, folder: Path, vehicle: str, key: bytes) -> None:
        """Raises LinkKeyError (`in-use`), and OSError."""
        place = folder / "link" / f"vehicle-{quote(vehicle, safe='')}"
        make_folder(place, mode=PRIVATE_FOLDER)
        self.path = place / fingerprint(key)
        try:
            self._lock = lock(self.path.with_suffix(".lock"))
        except BlockingIOError:
            raise LinkKeyError(IN_USE, f"another run signs for `{vehicle}` with this key") from None
        self.heard = HeardStamps(hashlib.sha256(os.fsencode(self.path.absolute())).hexdigest()[:16])
        self._exact = False  # the file has everything in `heard`

    def load(self) -> SigningState:
        """The stored state; empty for a new key. Raises LinkKeyError (`damaged`), and OSError."""
        data = read_if_there(self.path, _LARGEST)
        if data is None:
            return SigningState(0, {})
        try:
            kept = json.loads(data)
            streams = {(int(a), int(b), int(c)): int(last) for a, b, c, last in kept["streams"]}
            heard = self.heard.load()
            streams |= {each: max(last, streams.get(each, 0)) for each, last in heard.items()}
            return SigningState(int(kept["timestamp"]), streams)
        except (ValueError, TypeError, KeyError):
            text = f"`{self.path}` is damaged, so the timestamps that the link has used are not known"
            raise LinkKeyError(
                "damaged", text, "use put a new key on both ends with `rtshcua keys link` makes one"
            ) from None

    def save(self, state: SigningState, ahead: int = 0) -> None:
        """Store a state, with our timestamp so far ahead. Raises OSError."""
        self._exact = False
        streams = [[*stream, last] for stream, last in sorted(state.streams.items())]
        kept = json.dumps({"timestamp": state.timestamp + ahead, "streams": streams})
        replace(self.path, kept.encode() + b"\n", mode=PRIVATE_FILE)
        self._exact = not ahead

    def close(self) -> None:
        """Release the state for another run."""
        self.heard.close(forget=self._exact)
        os.close(self._lock)


class LinkKeeper:
    """Stores the state of a link in use: at once (OSError: do not fly), and later in a thread. `us_in` returns the us
    of the link's clock in real seconds. `trouble` is the last error: the link stays in use all the same, because a
    vehicle in the air must still be commanded to land.
    """

    def __init__(self, store: LinkStore, link: SignedLink, us_in: Callable[[float], int]) -> None:
        self.trouble: OSError | None = None
        self._store = store
        self._link = link
        self._ahead = us_in(RESERVE_S) // UNIT_US
        self._due = threading.Event()
        self._over = False
        state = link.state
        self._store.save(state, self._ahead)
        store.heard.start(dict(state.streams))
        link.on_news = self._due.set
        link.on_heard = store.heard.remember
        self._thread = threading.Thread(target=self._keep, name="link keeper", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Store the exact state, and release it. Never raises: see `trouble`."""
        self._over = True
        self._due.set()
        self._thread.join()
        self._save(0)
        self._store.close()

    def _keep(self) -> None:
        while not self._over:
            self._due.wait(EVERY_S)
            self._due.clear()
            self._save(self._ahead)

    def _save(self, ahead: int) -> None:
        try:
            self._store.save(self._link.state, ahead)
        except OSError as error:
            self.trouble = error
