"""What a boundary keeps from one session to the next: how many there were, and the digest of its own evidence.

    <state folder>/boundary/vehicle-<identity>      "<session> <digest, hexadecimal>\n"

It is written when a session begins, with the digest after its first entry, and again when the session ends in order,
with its last one: so a session names the one before, and whether that ended. Nothing here tells that the whole folder
was put back to what it was earlier, or removed: only a witness outside does.
"""

import re
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace
from rtshcua.wire.boundary_chain import START

_KEPT = re.compile(rb"([0-9]{1,18}) ([0-9a-f]{64})\n")
_LARGEST = 1 << 10  # octets of the file


class Kept(NamedTuple):
    """The number of a session, from 1 on, and a digest; 0 and zero octets before the first."""

    session: int
    digest: bytes


class DamagedState(Exception):
    """The file is there, and does not say what we write into it."""


class BoundaryStore:
    """The sessions of the boundary on the vehicle called `vehicle` (its identity)."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "boundary" / f"vehicle-{quote(vehicle, safe='')}"

    def kept(self) -> Kept:
        """What was kept last. Raises DamagedState, and OSError."""
        data = read_if_there(self.path, _LARGEST)
        if data is None:
            return Kept(0, START)
        said = _KEPT.fullmatch(data)
        if said is None:
            raise DamagedState(f"`{self.path}` is damaged: which session of the boundary came before is not known")
        return Kept(int(said[1]), bytes.fromhex(said[2].decode()))

    def keep(self, session: int, digest: bytes) -> None:
        """Keep the digest of a session; it is on the disk then. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        replace(self.path, b"%d %s\n" % (session, digest.hex().encode()), mode=PRIVATE_FILE)
