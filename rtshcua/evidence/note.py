"""C2SP signed notes (c2sp.org/signed-note), Ed25519, that carry checkpoints (c2sp.org/tlog-checkpoint)."""

from base64 import b64decode, b64encode
from collections.abc import Callable
from hashlib import sha256
from typing import NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.wire.keys import VerificationKey

ED25519 = b"\x01"
MARK = "\u2014 "  # an em dash opens a signature line
_KEY_ID, _SIGNATURE = 4, 64  # bytes


class Checkpoint(NamedTuple):
    """The head of a tree: whose it is, how many leaves it has, and its root hash."""

    origin: str
    size: int
    root: bytes

    def text(self) -> str:
        """The text that is signed."""
        return f"{self.origin}\n{self.size}\n{b64encode(self.root).decode()}\n"


def key_id(name: str, public: bytes) -> bytes:
    """The first four bytes of SHA-256(name || 0x0A || 0x01 || public key)."""
    return sha256(name.encode() + b"\n" + ED25519 + public).digest()[:_KEY_ID]


def sign(checkpoint: Checkpoint, public: bytes, signer: Callable[[bytes], bytes]) -> str:
    """The note of a checkpoint, signed in the name of its origin by `signer`, which holds the key of `public`."""
    text = checkpoint.text()
    signature = key_id(checkpoint.origin, public) + signer(text.encode())
    return f"{text}\n{MARK}{checkpoint.origin} {b64encode(signature).decode()}\n"


def open_note(note: str, origin: str, key: VerificationKey) -> Checkpoint | Flaw:
    """The checkpoint of a note that bears one signature, valid, by `key` in the name of `origin`; or what is wrong.

    One signature exactly: the format allows others, which a reader ignores, but nothing writes them here, and what is
    ignored could be changed unseen.
    """
    body, blank, last = note.rpartition("\n\n")
    if not blank or not last:
        return Flaw("close/unsigned", "the checkpoint bears no signature")
    name, _, encoded = last.removeprefix(MARK).removesuffix("\n").partition(" ")
    signature = _strict_base64(encoded)
    if last != f"{MARK}{name} {encoded}\n" or len(signature) != _KEY_ID + _SIGNATURE:
        return Flaw("close/note", "the checkpoint does not end with one Ed25519 signature line")
    if name != origin or signature[:_KEY_ID] != key_id(origin, key.public):
        return Flaw("close/key", "the checkpoint is signed by another key, or in another name", name, origin)
    text = body + "\n"
    if not key.verify(signature[_KEY_ID:], text.encode()):
        return Flaw("close/signature", "the log key did not sign this checkpoint")
    return _parse(text)


def _parse(text: str) -> Checkpoint | Flaw:
    lines = text.split("\n")
    if len(lines) == 4 and lines[1].isascii() and lines[1].isdigit() and len(lines[1]) < 16:
        checkpoint = Checkpoint(lines[0], int(lines[1]), _strict_base64(lines[2]))
        if checkpoint.text() == text:
            return checkpoint
    return Flaw("close/note", "the signed text is not a checkpoint of origin, size and root")


def _strict_base64(text: str) -> bytes:
    """The bytes of canonical base64, none for what is not: unused bits could be changed unseen."""
    try:
        data = b64decode(text, validate=True)
    except ValueError:
        return b""
    return data if b64encode(data).decode() == text else b""
