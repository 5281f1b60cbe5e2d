"""COSE receipts (RFC 9942): proof that a record is in a log, signed by the log key at the time of export.

COSE_Sign1, tag 18, whose detached payload is the root of the tree: a verifier computes it from the record and the
path, and then checks the signature over it. Algorithm Ed25519 (-19), verifiable data structure RFC9162_SHA256
(395: 1), its inclusion proof in the unprotected header (396: {-1: [[size, index, path]]}). The protected header
also names the key (4) and, as claims (RFC 9597, 15), the log's origin as the issuer (1) and the size of the tree
in decimal as the subject (2), because a path alone does not distinguish some sizes. The unprotected header also
contains the record's line and the signed trust root, under names of our own, so that the receipt can be verified
by itself.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import root_from_inclusion
from rtshcua.evidence.proofs.file import MAX_PROOF
from rtshcua.evidence.proofs.trust import LogName, name_of
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord
from rtshcua.evidence.rooted import may_not_sign, trusted_root
from rtshcua.wire import cbor
from rtshcua.wire.cbor import CborError
from rtshcua.wire.cose import ED25519
from rtshcua.wire.keys import Duty, VerificationKey
from rtshcua.wire.trust import TrustRoot

TAG_18: Final = b"\xd2"  # COSE_Sign1

_ALGORITHM, _KID, _CLAIMS, _VDS, _VDP = 1, 4, 15, 395, 396
_ISSUER, _SUBJECT = 1, 2
_RFC9162_SHA256: Final = 1
_INCLUSION: Final = -1
_RECORD, _ROOT = "rtshcua/record", "rtshcua/root"
_HASH: Final = 32
#: the most CBOR items of a receipt, of its header, and of its proof, whose path has at most 64 nodes
_ITEMS: Final = 128


class ReceiptClaim(NamedTuple):
    """The content of a valid receipt: record `number` is in the log of `name`, as the log key signed it at `size`
    records.
    """

    name: LogName
    number: int
    size: int
    record: AnyRecord
    log_key: VerificationKey
    root: TrustRoot


def make_receipt(
    line: bytes, number: int, size: int, path: Sequence[bytes], *, origin: str, root: bytes, kid: bytes,
    signer: Callable[[bytes], bytes],
) -> bytes:  # fmt: skip
    """The receipt of a line. `signer` signs by the log key, whose name is `kid`. Raises ValueError where the path is
    wrong or empty: RFC 9942 has no receipt for the only leaf of a tree.
    """
    head = root_from_inclusion(leaf_hash(line), number, size, path)
    if head is None or not path:
        raise ValueError(f"the path does not lead from leaf {number} of {size}")
    claims = {_ISSUER: origin, _SUBJECT: str(size)}
    protected = cbor.encode({_ALGORITHM: ED25519, _KID: kid, _CLAIMS: claims, _VDS: _RFC9162_SHA256})
    proof = cbor.encode((size, number, tuple(path)))
    unprotected = {_VDP: {_INCLUSION: (proof,)}, _RECORD: line, _ROOT: root}
    return TAG_18 + cbor.encode((protected, unprotected, None, signer(_signed(protected, head))))


def check_receipt(data: bytes, pinned: bytes) -> ReceiptClaim | Flaw:
    """The content of a receipt under the pinned root key (32 bytes) or its name (16), or the flaw."""
    try:
        value = cbor.decode(data[1:], limit=MAX_PROOF, items=_ITEMS) if data.startswith(TAG_18) else None
        match value:
            case (bytes(protected), {396: {-1: (bytes(proof),), **no_more}, **others}, None, bytes(signature)):
                parts = cbor.decode(protected, items=_ITEMS), cbor.decode(proof, items=_ITEMS)
                match others:
                    case {"rtshcua/record": bytes(line), "rtshcua/root": bytes(root)} if (
                        len(others) == 2 and not no_more
                    ):
                        return _check(protected, parts, line, root, signature, pinned)
    except CborError as error:
        return Flaw("proof/malformed", f"not a receipt: not canonical CBOR: {error}")
    return Flaw(
        "proof/malformed", "not a receipt of inclusion: expected a COSE_Sign1 with one proof, a record and a root"
    )


def _check(
    protected: bytes, parts: tuple[cbor.Value, cbor.Value], line: bytes, root: bytes, signature: bytes, pinned: bytes
) -> ReceiptClaim | Flaw:
    match parts:
        case (
            {1: -19, 4: bytes(kid), 15: {1: str(origin), 2: str(subject), **no_claims}, 395: 1, **no_more},
            (int(size), int(number), (*path,)),
        ) if (
            not no_claims
            and not no_more
            and path
            and all(type(node) is bytes and len(node) == _HASH for node in path)
            and type(size) is type(number) is int
            and subject == str(size)
        ):
            hashes = [node for node in path if isinstance(node, bytes)]
            return _verify(protected, kid, origin, (size, number, hashes), line, root, signature, pinned)
    return Flaw("proof/malformed", "the headers or the proof of the receipt do not conform to RFC 9942")


def _verify(
    protected: bytes, kid: bytes, origin: str, proof: tuple[int, int, list[bytes]], line: bytes, root: bytes,
    signature: bytes, pinned: bytes,
) -> ReceiptClaim | Flaw:  # fmt: skip
    size, number, path = proof
    record = read(line) if line.endswith(b"\n") else Flaw("", "the record is not a line")
    if isinstance(record, Flaw):
        return Flaw("proof/record", f"the receipt contains an invalid record: {record.text}")
    name = name_of(origin)
    if isinstance(name, Flaw):
        return name
    trusted = trusted_root(root, pinned, record.utc_us)
    if isinstance(trusted, Flaw):
        return trusted
    key = trusted.keys_for(Duty.LOG).get(kid)
    if key is None:
        return Flaw("trust/log-key", "the key of the receipt has no duty `log` in the trust root", kid.hex()[:64])
    flaw = may_not_sign(key, name.vehicle, record.utc_us)
    if flaw is not None:
        return flaw
    head = root_from_inclusion(leaf_hash(line), number, size, path)
    if head is None or record.seq != number:
        return Flaw("proof/path", f"the path does not lead from record {record.seq} to a root")
    if not key.verify(signature, _signed(protected, head)):
        return Flaw("proof/signature", f"the log key did not sign a log in which this is record {number}")
    return ReceiptClaim(name, number, size, record, key, trusted)


def _signed(protected: bytes, root: bytes) -> bytes:
    """The Sig_structure (RFC 9052, section 4.4), with no external data."""
    return cbor.encode(("Signature1", protected, b"", root))
