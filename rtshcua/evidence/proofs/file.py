"""The file of a proof (docs/proofs.md): three kinds in the one layout of c2sp.org/tlog-proof.

    <kind>
    extra <base64>
    index <number>                  (consistency: `old`)
    <base64 of a hash>              (one line each, maybe none)
                                    (an empty line)
    <the signed note of a checkpoint>

Only the one form of each file is read: what a reader ignores could be changed unseen. The `extra` is deterministic
CBOR: what a proof carries beside the Merkle path, so that it verifies alone. The layout authenticates none of it; every
part of it is verified (`check`).
"""

from enum import StrEnum
from typing import Final, NamedTuple

import msgspec

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import base64, strict_base64
from rtshcua.wire import artefact, names
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted

#: a longer file is refused unread, in octets
MAX_PROOF: Final = 8 << 20

_EXTRA: Final = "extra "
_HASH: Final = 32  # octets
_MOST_HASHES: Final = 128  # no tree of 2**53 leaves needs more
_MOST_DIGITS: Final = 16


class ProofKind(StrEnum):
    """What a file proves; the value is its first line."""

    INCLUSION = "c2sp.org/tlog-proof@v1"  # a record is in the log
    CONSISTENCY = "rtshcua/consistency-proof@v1"  # one checkpoint's log begins with another's
    RECORD = "rtshcua/record-proof@v1"  # a signed record is of the log, by its own signature

    @property
    def word(self) -> str:
        """What stands before the number."""
        return "old" if self is ProofKind.CONSISTENCY else "index"


class ProofFile(NamedTuple):
    """A proof as it is written. `number` is a record's, or the size of the older tree; `extra` see `ProofMaterial`."""

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
    """The proof in a file, or what is wrong with it. Nothing of it is to be trusted yet."""
    if len(data) > MAX_PROOF:
        return Flaw("proof/too-long", "the file is too long for a proof", f"{len(data)} bytes", f"{MAX_PROOF} bytes")
    try:
        head, blank, note = data.decode().partition("\n\n")
    except UnicodeDecodeError:
        return Flaw("proof/malformed", "it is not UTF-8")
    lines = head.split("\n", _MOST_HASHES + 3)
    try:
        kind = ProofKind(lines[0])
    except ValueError:
        return Flaw("proof/malformed", "it is not a proof: its first line names no kind that there is", lines[0][:80])
    if not blank or not 3 <= len(lines) <= _MOST_HASHES + 3:
        return Flaw("proof/malformed", "it has not the lines of a proof: extra, number, hashes, and a checkpoint")
    number = lines[2].removeprefix(kind.word + " ")
    if not (number.isascii() and number.isdigit() and len(number) <= _MOST_DIGITS):
        return Flaw("proof/malformed", f"its third line is not `{kind.word}` and a number", lines[2][:80])
    path = tuple(map(strict_base64, lines[3:]))
    file = ProofFile(kind, strict_base64(lines[1].removeprefix(_EXTRA)), int(number), path, note)
    if any(len(node) != _HASH for node in path) or file.encode() != data:
        return Flaw("proof/malformed", "it is not written in the one form that this proof has")
    return file


class ProofMaterial(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """`root` is the signed trust root. `chain` has the notes from one that the log key signed up to, and without, that
    of the proof: each names the key that signs the next. `signed` is the line of the record that carries the proof's
    checkpoint, with the checkpoint as null. `record` is the line that is shown.
    """

    chain: tuple[str, ...]
    root: bytes
    signed: bytes
    record: bytes = b""

    def encode(self) -> bytes:
        """The canonical octets. Raises `CborError` when they would be too many for a reader."""
        return artefact.pack(names.PROOF, self)


def read_extra(data: bytes) -> ProofMaterial | Flaw:
    """The extra of a proof, or what is wrong with it."""
    try:
        extra = msgspec.convert(artefact.unwrap(names.PROOF, data), ProofMaterial, builtin_types=(bytes,))
        if extra.encode() == data:
            return extra
    except (Untrusted, CborError, msgspec.ValidationError) as error:
        return Flaw("proof/extra", f"what the proof carries cannot be read: {error}")
    return Flaw("proof/extra", "what the proof carries is not written in its one form")
