"""What a proof carries beside the Merkle path, so that it verifies alone: the `extra` of its file, deterministic CBOR.

It is not authenticated by the layout; every part of it is verified (`check`).
"""

from typing import TypeAlias

import msgspec

from rtshcua.evidence.finding import Flaw
from rtshcua.wire import artefact, names
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted

#: the name of a field, and: `f` of one that is withheld; salt and value of a shown one (docs/log-format.md, section 6)
Field: TypeAlias = tuple[str, tuple[bytes, ...]]


class Extra(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """`root` is the signed trust root. `chain` has the notes from one that the log key signed up to, and without, that
    of the proof: each names the key that signs the next. `signed` is the line of the record that carries the proof's
    checkpoint, with the checkpoint as null. `record` is the line that is shown; `fields` are those of a line that is
    shown in part.
    """

    chain: tuple[str, ...]
    root: bytes
    signed: bytes
    record: bytes = b""
    fields: tuple[Field, ...] = ()

    def encode(self) -> bytes:
        """The canonical octets. Raises `CborError` when they would be too many for a reader."""
        return artefact.wrap(names.PROOF, msgspec.to_builtins(self, builtin_types=(bytes,)))


def read_extra(data: bytes) -> Extra | Flaw:
    """The extra of a proof, or what is wrong with it."""
    try:
        extra = msgspec.convert(artefact.unwrap(names.PROOF, data), Extra, builtin_types=(bytes,))
        if extra.encode() == data:
            return extra
    except (Untrusted, CborError, msgspec.ValidationError) as error:
        return Flaw("proof/extra", f"what the proof carries cannot be read: {error}")
    return Flaw("proof/extra", "what the proof carries is not written in its one form")
