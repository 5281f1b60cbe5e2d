"""The file of a proof (docs/proofs.md): three kinds in the layout of c2sp.org/tlog-proof.

    <kind>
    extra <base64>
    index <number>                  (consistency: `old`)
    <base64 of a hash>              (one line each, maybe none)
                                    (an empty line)
    <the signed note of a checkpoint>

Only the canonical form of each file is read, because a reader must not ignore changes. `extra` is deterministic
CBOR with the data that a proof needs besides the Merkle path. The layout authenticates nothing; `check` verifies
every part.
"""

from enum import StrEnum
from typing import Final, NamedTuple

import msgspec

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import base64, strict_base64
from rtshcua.wire import artefact, names
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted

#: a larger file is refused unread, in octets
MAX_PROOF: Final = 8 << 20

_EXTRA: Final = "extra "
_HASH: Final = 32  # octets
_MOST_HASHES: Final = 128  # enough for a tree of 2**53 leaves
_MOST_DIGITS: Final = 16


class ProofKind(StrEnum):
    """The kind of a proof; the value is the first line of its file."""

    INCLUSION = "c2sp.org/tlog-proof@v1"  # a record is in the log
    CONSISTENCY = "rtshcua/consistency-proof@v1"  # the log at one checkpoint begins with the log at an earlier one
    RECORD = "rtshcua/record-proof@v1"  # a signed record is in the log, by its own signature

    @property
    def word(self) -> str:
        """The keyword before the number."""
        return "old" if self is ProofKind.CONSISTENCY else "index"


class ProofFile(NamedTuple):
    """A proof as written. `number` is a record's number, or the size of the older tree; `extra` see `ProofMaterial`."""

    kind: ProofKind
    extra: bytes
    number: int
    path: tuple[bytes, ...]
    note: str

    def encode(self) -> bytes:
        """The file."""
        lines = [self.kind.value, _EXTRA + base64(self.extra), f"{self.kind.word} {self.number}"]
        return "\n".join([*lines, *map(base64, self.path), "", self.note]).encode()


def read_proof(data: bytes) -> ProofFile | Flaw:
    """The proof in a file, or the flaw. The contents are not verified."""
    if len(data) > MAX_PROOF:
        return Flaw("proof/too-long", "the file is too large for a proof", f"{len(data)} bytes", f"{MAX_PROOF} bytes")
    try:
        head, blank, note = data.decode().partition("\n\n")
    except UnicodeDecodeError:
        return Flaw("proof/malformed", "the file is not UTF-8")
    lines = head.split("\n", _MOST_HASHES + 3)
    try:
        kind = ProofKind(lines[0])
    except ValueError:
        return Flaw("proof/malformed", "not a proof: the first line is not a known kind", lines[0][:80])
    if not blank or not 3 <= len(lines) <= _MOST_HASHES + 3:
        return Flaw("proof/malformed", "a proof needs the lines extra, number, hashes, and a checkpoint")
    number = lines[2].removeprefix(kind.word + " ")
    if not (number.isascii() and number.isdigit() and len(number) <= _MOST_DIGITS):
        return Flaw("proof/malformed", f"the third line is not `{kind.word}` and a number", lines[2][:80])
    path = tuple(map(strict_base64, lines[3:]))
    file = ProofFile(kind, strict_base64(lines[1].removeprefix(_EXTRA)), int(number), path, note)
    if any(len(node) != _HASH for node in path) or file.encode() != data:
        return Flaw("proof/malformed", "the proof is not in its canonical form")
    return file


class ProofMaterial(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """`root` is the signed trust root. `chain` has the notes from one that the log key signed up to the one before
    the proof's: each names the key that signs the next. `signed` is the line of the record that carries the
    proof's checkpoint, with the checkpoint as null. `record` is the line of the proven record.
    """

    chain: tuple[str, ...]
    root: bytes
    signed: bytes
    record: bytes = b""

    def encode(self) -> bytes:
        """The canonical octets. Raises `CborError` if they exceed the reader's limit."""
        return artefact.pack(names.PROOF, self)


def read_extra(data: bytes) -> ProofMaterial | Flaw:
    """The extra data of a proof, or the flaw."""
    try:
        extra = msgspec.convert(artefact.unwrap(names.PROOF, data), ProofMaterial, builtin_types=(bytes,))
        if extra.encode() == data:
            return extra
    except (Untrusted, CborError, msgspec.ValidationError) as error:
        return Flaw("proof/extra", f"the extra data cannot be decoded: {error}")
    return Flaw("proof/extra", "the extra data is not in its canonical form")
