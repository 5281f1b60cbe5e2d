"""Receipts: the boundary's answer to a document."""

from typing import Final

import msgspec

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire import artefact, names
from rtshcua.wire.artefact import ArtefactError

#: the kind of a document
UNKNOWN, APPROVAL, RECALL, REPLACEMENT, CANCELLATION = range(5)
#: the slug of an accepted document
ACCEPTED: Final = "accepted"


class Receipt(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The result of a document: `slug` is `accepted` or the reason of the refusal, `text` is for a person.

    For an accepted approval: `step`, `role` (its number), `granted`, and `expires_us` (UTC). For an accepted
    replacement: `step`, the first that changed. `evidence` is the boundary's digest (`boundary_chain`) after it;
    empty if no boundary was involved.
    """

    kind: int
    slug: str
    text: str
    step: int = -1
    role: int = -1
    granted: int = -1
    expires_us: int = 0
    evidence: bytes = b""

    @property
    def accepted(self) -> bool:
        """Whether the document was accepted."""
        return self.slug == ACCEPTED


def encode(receipt: Receipt) -> bytes:
    """The octets of a receipt."""
    return artefact.pack(names.RECEIPT, receipt)


def decode(data: bytes) -> Receipt | Refusal:
    """Decode a receipt, or return what is wrong. Raises nothing."""
    try:
        receipt = msgspec.convert(artefact.unwrap(names.RECEIPT, data), Receipt, builtin_types=(bytes,))
    except (ArtefactError, msgspec.ValidationError) as error:
        return Refusal("malformed", str(error))
    return receipt if encode(receipt) == data else Refusal("malformed", "not the octets that this receipt encodes to")
