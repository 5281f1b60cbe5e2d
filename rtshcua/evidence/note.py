"""C2SP signed notes (c2sp.org/signed-note) with Ed25519, which carry checkpoints (c2sp.org/tlog-checkpoint).

The checkpoint of a log has up to three extension lines: the record that carries it, the key that signs the next
one, and the previous checkpoint (docs/log-format.md, section 2).
"""

from base64 import b64decode, b64encode
from collections.abc import Callable
from hashlib import sha256
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.wire.keys import verified

ED25519: Final = b"\x01"
MARK: Final = "\u2014 "  # an em dash opens a signature line
ID_BYTES: Final = 4
_SIGNATURE_BYTES: Final = 64
_HASH_BYTES: Final = 32
_RECORD, _KEY, _AFTER = "record ", "key ", "after "
_LONGEST_SIZE: Final = 16  # digits
_PARTS: Final = {"note/unsigned": "note", "note/malformed": "note", "note/key": "key", "note/signature": "signature"}


class Checkpoint(NamedTuple):
    """The head of a tree: its origin, the number of leaves, and its root hash.

    `record` is the leaf hash of the record that carries it, without the checkpoint; `key` the Ed25519 public key
    of the next epoch, None at the end of a log; `after` the `digest` of the previous checkpoint in the log, None
    in the first. A trusted checkpoint therefore covers everything before it, including the records that carry
    checkpoints.
    """

    origin: str
    size: int
    root: bytes
    record: bytes
    key: bytes | None
    after: bytes | None = None

    def text(self) -> str:
        """The text that is signed."""
        key = "" if self.key is None else f"{_KEY}{base64(self.key)}\n"
        after = "" if self.after is None else f"{_AFTER}{base64(self.after)}\n"
        return f"{self.origin}\n{self.size}\n{base64(self.root)}\n{_RECORD}{base64(self.record)}\n{key}{after}"

    def digest(self) -> bytes:
        """SHA-256 of the text, which the next checkpoint names."""
        return sha256(self.text().encode()).digest()


def key_id(name: str, public: bytes, kind: bytes = ED25519) -> bytes:
    """The first four bytes of SHA-256(name || 0x0A || kind || public key)."""
    return sha256(name.encode() + b"\n" + kind + public).digest()[:ID_BYTES]


def signature_line(name: str, signature: bytes) -> str:
    """The line of a signature, which begins with its key id."""
    return f"{MARK}{name} {base64(signature)}\n"


def sign(checkpoint: Checkpoint, public: bytes, signer: Callable[[bytes], bytes]) -> str:
    """The note of a checkpoint, signed in the name of its origin by `signer`, a signer with the key of `public`."""
    text, name = checkpoint.text(), checkpoint.origin
    return f"{text}\n{signature_line(name, key_id(name, public) + signer(text.encode()))}"


def split(note: str) -> tuple[str, list[str]]:
    """The signed text of a note and its signature lines, each with its newline; no lines for anything but a note."""
    body, blank, rest = note.rpartition("\n\n")
    if not blank or not rest.endswith("\n"):
        return note, []
    return body + "\n", rest.splitlines(keepends=True)


def read_signature(line: str) -> tuple[str, bytes]:
    """Name and signature (key id first) of a signature line; empty if the line is malformed or not canonical."""
    name, _, encoded = line.removeprefix(MARK).removesuffix("\n").rpartition(" ")
    signature = strict_base64(encoded)
    return (name, signature) if line == signature_line(name, signature) and name and " " not in name else ("", b"")


def open_note(note: str, origin: str, public: bytes) -> Checkpoint | Flaw:
    """The checkpoint of a note with one valid signature by `public` in the name of `origin`, or the flaw.

    Exactly one signature: the format allows more, which a reader ignores, but a record must not contain parts that
    can be changed unnoticed.
    """
    text, signatures = split(note)
    if not signatures:
        return Flaw("note/unsigned", "the checkpoint has no signature")
    name, signature = read_signature(signatures[0])
    if len(signatures) != 1 or len(signature) != ID_BYTES + _SIGNATURE_BYTES:
        return Flaw("note/malformed", "the checkpoint does not end with one Ed25519 signature line")
    if name != origin or signature[:ID_BYTES] != key_id(origin, public):
        return Flaw("note/key", "the checkpoint is signed by another key, or in another name", name, origin)
    if not verified(public, signature[ID_BYTES:], text.encode()):
        return Flaw("note/signature", "the signature of the checkpoint is wrong")
    return parse(text)


def parse(text: str) -> Checkpoint | Flaw:
    """The checkpoint of a signed text."""
    lines = text.split("\n")
    if len(lines) in (5, 6, 7) and lines[1].isascii() and lines[1].isdigit() and len(lines[1]) <= _LONGEST_SIZE:
        root, record = strict_base64(lines[2]), strict_base64(lines[3].removeprefix(_RECORD))
        key, after = (_extension(lines[4:-1], name) for name in (_KEY, _AFTER))
        checkpoint = Checkpoint(lines[0], int(lines[1]), root, record, key, after)
        lengths = {len(each) for each in (root, record, key, after) if each is not None}
        if checkpoint.text() == text and lengths == {_HASH_BYTES}:
            return checkpoint
    return Flaw("note/malformed", "the signed text is not a checkpoint of origin, size, root, record, key and after")


def renamed(flaw: Flaw, prefix: str) -> Flaw:
    """A flaw of `open_note` or `parse` with the slug prefix of the caller: `seal/...`, `proof/...`."""
    return flaw._replace(slug=f"{prefix}/{_PARTS[flaw.slug]}")


def _extension(lines: list[str], name: str) -> bytes | None:
    return next((strict_base64(line.removeprefix(name)) for line in lines if line.startswith(name)), None)


def octets(text: str) -> bytes | None:
    """The bytes of canonical base64, None for anything else: a lenient reader would ignore changes."""
    try:
        data = b64decode(text, validate=True)
    except ValueError:
        return None
    return data if base64(data) == text else None


def strict_base64(text: str) -> bytes:
    """As `octets`, but empty bytes where the text is not canonical base64."""
    return octets(text) or b""


def base64(data: bytes) -> str:
    """The base64 of bytes."""
    return b64encode(data).decode()
