"""Reads the file with the persistent state of a boundary's process (boundary/enforcement/kept.h)."""

from hashlib import sha256
from pathlib import Path
from struct import Struct
from typing import NamedTuple

from rtshcua.mavlink.signing import MOST_STREAMS
from rtshcua.mavlink.signing import SigningState as LinkState
from rtshcua.model.flat import home_limits

LAYOUT = 0x7274736863756103
#: layout, turn, restarts, floor, and the numbers of missions, policies and streams
HEAD, OPENED, VERSION, STREAM = Struct("<QQQqQQQ"), Struct("<32sq"), Struct("<32sq"), Struct("<BBB5xq")
_SESSION, _TIMESTAMP, _CHECK = Struct("<32sq"), Struct("<q"), 32


class Sizes:
    """Where everything is in one slot, by how many missions and policies are remembered."""

    def __init__(self, opened: int, policies: int) -> None:
        self.session = HEAD.size + (opened + 1) * OPENED.size  # after the owner and the time of creation
        self.versions = self.session + _SESSION.size
        self.link = self.versions + policies * VERSION.size
        self.streams = self.link + _TIMESTAMP.size
        self.slot = self.streams + MOST_STREAMS * STREAM.size + _CHECK


MOST_OPENED = 4_094
PROCESS = Sizes(MOST_OPENED, 256)
TRUSTZONE_M = Sizes(home_limits.TRUSTZONE_M["MOST_OPENED"], home_limits.TRUSTZONE_M["MOST_POLICIES"])
SLOT = PROCESS.slot


class Kept(NamedTuple):
    """The content of one slot. `opened` is the expiry of each mission by digest, `versions` are by SHA-256 of the
    name.
    """

    turn: int
    restarts: int
    floor_us: int
    opened: dict[bytes, int]
    versions: dict[bytes, int]
    session: tuple[int, bytes]
    link: LinkState


def read(path: Path) -> Kept:
    """The content of the newer intact slot."""
    data = path.read_bytes()
    assert len(data) in (SLOT, 2 * SLOT), len(data)
    return max(slot(data[at : at + SLOT]) for at in range(0, len(data), SLOT) if _is_whole(data[at : at + SLOT]))


def spoil_older(path: Path) -> None:
    """Damage the older slot."""
    data = bytearray(path.read_bytes())
    if len(data) == 2 * SLOT:
        first, second = (slot(bytes(data[at : at + SLOT])).turn for at in (0, SLOT))
        data[(SLOT if first > second else 0) + HEAD.size] ^= 1
        path.write_bytes(data)


def _is_whole(slot: bytes) -> bool:
    return sha256(slot[:-_CHECK]).digest() == slot[-_CHECK:]


def slot(data: bytes, sizes: Sizes = PROCESS) -> Kept:
    """What a slot says."""
    layout, turn, restarts, floor_us, missions, policies, streams = HEAD.unpack_from(data)
    assert layout == LAYOUT, hex(layout)
    opened = dict(OPENED.unpack_from(data, HEAD.size + at * OPENED.size) for at in range(missions))
    versions = dict(VERSION.unpack_from(data, sizes.versions + at * VERSION.size) for at in range(policies))
    digest, session = _SESSION.unpack_from(data, sizes.session)
    heard = [STREAM.unpack_from(data, sizes.streams + at * STREAM.size) for at in range(streams)]
    (timestamp,) = _TIMESTAMP.unpack_from(data, sizes.link)
    link = LinkState(timestamp, {(system, component, by): last for system, component, by, last in heard})
    return Kept(turn, restarts, floor_us, opened, versions, (session, digest), link)
