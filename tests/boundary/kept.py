"""Reads the file in which a boundary's process keeps what must outlive it (boundary/enforcement/kept.h)."""

from hashlib import sha256
from pathlib import Path
from struct import Struct
from typing import NamedTuple

from rtshcua.mavlink.signing import MOST_STREAMS
from rtshcua.mavlink.signing import SigningState as LinkState

LAYOUT, MOST_OPENED, MOST_POLICIES = 0x7274736863756103, 4_094, 256
#: layout, turn, restarts, floor, and how many missions, policies and streams there are
HEAD, OPENED, VERSION, STREAM = Struct("<QQQqQQQ"), Struct("<32sq"), Struct("<32sq"), Struct("<BBB5xq")
_SESSION, _TIMESTAMP, _CHECK = Struct("<32sq"), Struct("<q"), 32
_SESSION_AT = HEAD.size + (MOST_OPENED + 1) * OPENED.size  # behind whose it is, and since when
_VERSIONS_AT = _SESSION_AT + _SESSION.size
_LINK_AT = _VERSIONS_AT + MOST_POLICIES * VERSION.size
_STREAMS_AT = _LINK_AT + _TIMESTAMP.size
SLOT = _STREAMS_AT + MOST_STREAMS * STREAM.size + _CHECK


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
    return max(_slot(data[at : at + SLOT]) for at in range(0, len(data), SLOT) if _is_whole(data[at : at + SLOT]))


def spoil_older(path: Path) -> None:
    """Damage the older slot."""
    data = bytearray(path.read_bytes())
    if len(data) == 2 * SLOT:
        first, second = (_slot(bytes(data[at : at + SLOT])).turn for at in (0, SLOT))
        data[(SLOT if first > second else 0) + HEAD.size] ^= 1
        path.write_bytes(data)


def _is_whole(slot: bytes) -> bool:
    return sha256(slot[:-_CHECK]).digest() == slot[-_CHECK:]


def _slot(slot: bytes) -> Kept:
    layout, turn, restarts, floor_us, missions, policies, streams = HEAD.unpack_from(slot)
    assert layout == LAYOUT, hex(layout)
    opened = dict(OPENED.unpack_from(slot, HEAD.size + at * OPENED.size) for at in range(missions))
    versions = dict(VERSION.unpack_from(slot, _VERSIONS_AT + at * VERSION.size) for at in range(policies))
    digest, session = _SESSION.unpack_from(slot, _SESSION_AT)
    heard = [STREAM.unpack_from(slot, _STREAMS_AT + at * STREAM.size) for at in range(streams)]
    (timestamp,) = _TIMESTAMP.unpack_from(slot, _LINK_AT)
    link = LinkState(timestamp, {(system, component, by): last for system, component, by, last in heard})
    return Kept(turn, restarts, floor_us, opened, versions, (session, digest), link)
