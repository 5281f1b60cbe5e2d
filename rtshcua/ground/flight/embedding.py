"""Embeds a log in a page, where the reader's own browser verifies it, and makes redacted logs for readers who may not
have the whole one.

`templates/verify.js` is the other side: it reads what these functions write.
"""

import json
import struct
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterable
from importlib.resources import files
from typing import Final

from rtshcua.evidence.merkle import MerkleTree, leaf_hash
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import is_signed

#: the most octets of a log that is embedded; a browser stops decompressing there (`MOST_OCTETS` of verify.js)
MOST_OCTETS: Final = 1 << 27

#: RFC 1952, section 2.3: deflate, no flags, no time, unknown system
_HEADER: Final = b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\xff"
#: zlib's usual level: the best one takes twice the time for less than one per cent
_LEVEL: Final = 6
_GZIP: Final = 16 + zlib.MAX_WBITS
#: in this order, they are one module script
_SCRIPTS: Final = ("vendor/noble-ed25519.js", "verify.js", "verify_page.js")


def embed(data: bytes) -> str:
    """The text of a log, or of a redacted one, for a script element of type `application/gzip+base64`: base64 of gzip,
    without the time and the name of a file. Equal octets give equal texts with one version of zlib.

    Raises ValueError if the log has more than `MOST_OCTETS`.
    """
    if len(data) > MOST_OCTETS:
        raise ValueError(f"a log of {len(data)} octets cannot be embedded: the limit is {MOST_OCTETS}")
    deflate = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS)
    packed = deflate.compress(data) + deflate.flush()
    return b64encode(_HEADER + packed + struct.pack("<II", zlib.crc32(data), len(data))).decode()


def extract(text: str) -> bytes:
    """The octets that `embed` wrote. Raises ValueError for any other text, and for more than `MOST_OCTETS`."""
    packed = octets(text)
    if packed is None:
        raise ValueError("the embedded log is not base64")
    inflate = zlib.decompressobj(_GZIP)
    try:
        data = inflate.decompress(packed, MOST_OCTETS + 1)
    except zlib.error as error:
        raise ValueError(f"the embedded log cannot be decompressed: {error}") from None
    if len(data) > MOST_OCTETS:
        raise ValueError(f"the embedded log has more than {MOST_OCTETS} octets")
    if not inflate.eof or inflate.unused_data:
        raise ValueError("the embedded log is cut off, or followed by something")
    return data


def redact(lines: Iterable[bytes], may_stay: Callable[[bytes], bool], *, checkpoints: bool = False) -> bytes:
    """A redacted log: a JSON document (RFC 8785) with the leaves of all lines of a log, their root (RFC 9162), and the
    lines for which `may_stay` is true. `lines` are those of a verified log, each with its newline.

    `checkpoints`: also the checkpoints of all signed records. They show that the leaves are those of a signed log; they
    name the vehicle, the flight and its keys.

    A leaf hides its line only from a reader who cannot guess it: one who can list the possible lines finds the right
    one by hashing them.
    """
    tree = MerkleTree()
    leaves: list[str] = []
    kept: list[tuple[int, str]] = []
    notes: list[tuple[int, str]] = []
    for number, line in enumerate(lines):
        leaf = leaf_hash(line)
        tree.push(leaf)
        leaves.append(b64encode(leaf).decode())
        if may_stay(line):
            kept.append((number, line[:-1].decode()))
        if checkpoints and is_signed(line):
            notes.append((number, json.loads(line)["checkpoint"]))
    document = {
        "checkpoints": notes, "format": "rtshcua/redacted-log", "leaves": leaves, "lines": kept,
        "root": b64encode(tree.root()).decode(), "version": 1,
    }  # fmt: skip
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


def script() -> str:
    """The text of the page's one script, an inline `<script type="module">`: a library for signatures, the verifier,
    and what connects it with the page (`templates/verify_page.js` lists the elements that it needs). It loads nothing,
    so a Content-Security-Policy may permit its SHA-256 alone.
    """
    folder = files("rtshcua.ground.flight") / "templates"
    return "\n".join((folder / name).read_text(encoding="utf-8") for name in _SCRIPTS)
