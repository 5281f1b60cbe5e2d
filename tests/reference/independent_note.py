"""Notes of docs/log-format.md: checkpoints and the signatures below them, read with the standard library alone."""

import hashlib
import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass

from reference.independent_records import Malformed, unbase64
from reference.independent_root import holds

_SIZE = re.compile(r"0|[1-9][0-9]{0,15}", re.ASCII)


class Broken(Exception):
    """A log violates its format; the text is the reason."""


@dataclass(frozen=True)
class Note:
    """A checkpoint and the signatures below it: names and decoded base64."""

    text: bytes
    origin: str
    size: int
    root: bytes
    record: bytes
    key: bytes | None
    after: bytes | None
    signatures: list[tuple[str, bytes]]


def read_note(note: str) -> Note:
    """Parse a note. Raises `Broken` for any deviation from its form."""
    head, gap, below = note.partition("\n\n")
    lines = head.split("\n")
    if not gap or len(lines) not in (4, 5, 6) or not below.endswith("\n"):
        raise Broken("note: not a text, an empty line and signatures")
    origin, size, root, record, *more = lines
    key = [more.pop(0)[4:]] if more and more[0].startswith("key ") else []
    after = [more.pop(0)[6:]] if more and more[0].startswith("after ") else []
    if not _SIZE.fullmatch(size) or not record.startswith("record ") or more:
        raise Broken("note: not the lines of a checkpoint")
    signatures = []
    for line in below[:-1].split("\n"):
        dash, name, blob = [*line.split(" "), "", "", ""][:3]
        if line.count(" ") != 2 or dash != "\u2014" or not name:
            raise Broken("note: not a signature line")
        signatures.append((name, _octets(blob)))
    parts = [_octets(each) for each in (root, record[7:], *key, *after)]
    if any(len(part) != 32 for part in parts):
        raise Broken("note: not 32 octets")
    text = (head + "\n").encode("utf-8", "replace")
    named = parts[2] if key else None, parts[-1] if after else None
    return Note(text, origin, int(size), parts[0], parts[1], *named, signatures)


def _octets(text: str) -> bytes:
    try:
        return unbase64(text)
    except Malformed as error:
        raise Broken("note: not base64") from error


def notes_of(files: Iterable[bytes]) -> Iterable[str]:
    """The notes of files of anchors: each is text, empty line, signatures, and is ended by an empty line."""
    for data in files:
        parts = data.decode("utf-8", "strict").split("\n\n")
        if parts.pop() != "" or len(parts) % 2:
            raise Broken("anchors: not notes that empty lines end")
        for text, below in zip(parts[::2], parts[1::2], strict=True):
            yield f"{text}\n\n{below}\n"


def cosigned(text: bytes, name: str, blob: bytes, public: bytes) -> bool:
    """Whether a witness's signature line (c2sp.org/tlog-cosignature) holds over the text of a checkpoint."""
    if not claimed(name, blob, public):
        return False
    (time,) = struct.unpack(">Q", blob[4:12])
    return holds(public, blob[12:], b"cosignature/v1\ntime %d\n" % time + text)


def claimed(name: str, blob: bytes, public: bytes) -> bool:
    """Whether a signature line claims to be from a witness. If that is false, the whole note is rejected."""
    return len(blob) == 76 and blob[:4] == ident(name, 4, public)


def ident(name: str, kind: int, public: bytes) -> bytes:
    """The first octets of a signature, which identify the key."""
    return hashlib.sha256(name.encode("utf-8", "replace") + b"\n" + bytes([kind]) + public).digest()[:4]
