"""The segments of a closed log, found from its end; and one segment hashed, apart from all others.

Nothing is concluded here: who puts the parts together (`quick`) holds them against what was signed.
"""

from array import array
from binascii import hexlify
from collections.abc import Callable
from hashlib import sha256
from typing import Final, NamedTuple

from rtshcua.evidence.epochs import MOST_RECORDS
from rtshcua.evidence.merkle import leaf_hash, node_hash
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Close, Effect, Genesis, Recover, Seal
from rtshcua.evidence.witnessing.anchors import ANCHORED

#: gives so many octets of a log from an offset on, fewer where it ends
Octets = Callable[[int, int], bytes]

#: a signed record that is longer than this, or a segment, is read by nobody who is in a hurry; in octets
_LONGEST_LINE: Final = 1 << 20
LONGEST_SEGMENT: Final = 1 << 27
_GUESS: Final = 1 << 12  # octets that most signed records fit into

_AT = b'","at_us":'
_ANCHOR = b'"event":"' + ANCHORED.encode() + b'"'
_CHECKPOINT = b',"checkpoint":'  # no text holds it, for a quote inside a text stands behind a backslash


class Leaves(NamedTuple):
    """The lines of a segment as leaves of the tree.

    `number` is that of the first line. `first` is what it names as the line before it and `last` what the line after
    the segment must name, both hexadecimal; `last_us` is the monotonic time of the last line, `nodes` the largest
    perfect subtrees, each with its height, that the lines make up where they stand in the tree. `anchors` are the notes
    of anchors that were recorded.
    """

    number: int
    records: int
    first: bytes
    last: bytes
    last_us: int
    nodes: tuple[tuple[int, bytes], ...]
    anchors: tuple[str, ...]


class Part(NamedTuple):
    """A segment's digest (SHA-256, hexadecimal), and its leaves where somebody looked."""

    digest: str
    leaves: Leaves | None


def find(octets: Octets, size: int) -> "array[int] | None":
    """Where the signed records of a closed log begin, the genesis first and the close last; None if it is not so."""
    offset = _last_line(octets, size)
    found = array("Q")
    while offset:
        line = signed_line(octets, offset)
        record = None if line is None else read(line)
        found.append(offset)
        if not isinstance(record, Close if len(found) == 1 else Seal | Recover) or not 0 < record.bytes <= offset:
            return None
        offset -= record.bytes
    found.append(0)
    found.reverse()
    return found if len(found) > 1 else None


def _last_line(octets: Octets, size: int) -> int:
    """Where the last line begins; 0 where that is not seen."""
    for length in (_GUESS, _LONGEST_LINE):
        start = max(size - length, 0)
        line = octets(start, size - start)
        if line.endswith(b"\n") and (before := line.rfind(b"\n", 0, -1)) >= 0:
            return start + before + 1
    return 0


def signed_line(octets: Octets, offset: int, longest: int = _LONGEST_LINE) -> bytes | None:
    """The line at an offset, newline included; None where it is longer than a signed record."""
    length = _GUESS
    while True:
        data = octets(offset, length)
        end = data.find(b"\n")
        if end >= 0:
            return data[: end + 1]
        if len(data) < length or length >= longest:
            return None
        length <<= 4


def scan(data: bytes) -> Part | None:
    """The part of a segment's octets; None where something is out of place."""
    if b"\r" in data or data.count(b"\n") > MOST_RECORDS + 1 or data.count(_CHECKPOINT) != 1:
        return None
    lines = data.splitlines(keepends=True)  # these end in newlines alone
    signed = read(lines[0])
    leaves = [leaf_hash(line) for line in lines]
    links = hexlify(b"".join(leaves))
    last_us = _at_us(lines[-1])
    linked = b"".join([line[10:74] for line in lines[1:]]) == links[:-64]
    if not isinstance(signed, Genesis | Seal | Recover) or not linked or last_us is None:
        return None
    count = len(leaves)
    nodes = tuple(_nodes(leaves, signed.seq))
    found = Leaves(signed.seq, count, lines[0][10:74], links[-64:], last_us, nodes, _anchors(data))
    return Part(sha256(data).hexdigest(), found)


def _at_us(line: bytes) -> int | None:
    digits = line[74 + len(_AT) : 74 + len(_AT) + 17].partition(b",")[0]
    return int(digits) if line.startswith(_AT, 74) and digits.isdigit() else None


def _anchors(data: bytes) -> tuple[str, ...]:
    found = []
    at = data.find(_ANCHOR)
    while at >= 0:
        end = data.find(b"\n", at) + 1 or len(data)
        record = read(data[data.rfind(b"\n", 0, at) + 1 : end])
        if isinstance(record, Effect):
            found.append(record.detail)
        at = data.find(_ANCHOR, end)
    return tuple(found)


def _nodes(level: list[bytes], first: int) -> list[tuple[int, bytes]]:
    """The perfect subtrees, each with its height, that leaves from number `first` on make up, from left to right."""
    left: list[tuple[int, bytes]] = []
    right: list[tuple[int, bytes]] = []
    height = 0
    while level:
        if first & 1:
            left.append((height, level.pop(0)))
            first += 1
        if len(level) & 1:
            right.append((height, level.pop()))
        pairs = iter(level)
        level = [node_hash(one, other) for one, other in zip(pairs, pairs, strict=True)]
        first >>= 1
        height += 1
    return left + right[::-1]


class Peaks:
    """The tree of the leaves so far, put together from perfect subtrees; `size` counts leaves."""

    __slots__ = ("_peaks", "size")

    def __init__(self) -> None:
        self.size = 0
        self._peaks: list[bytes] = []

    def push(self, height: int, node: bytes) -> None:
        """Adds a perfect subtree of 2**height leaves; `size` is a multiple of that."""
        bits = self.size >> height
        while bits & 1:
            node = node_hash(self._peaks.pop(), node)
            bits >>= 1
        self._peaks.append(node)
        self.size += 1 << height

    def root(self) -> bytes:
        """The root hash of all leaves so far (RFC 9162, section 2.1.1); there is at least one."""
        *rest, node = self._peaks
        while rest:
            node = node_hash(rest.pop(), node)
        return node
