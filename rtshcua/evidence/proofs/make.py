"""Proofs made of a log: read once for its signed records, and once more for the hashes, in bounded memory.

What comes out was verified as its reader will, but for the pin; so no proof is made of a log that does not hold.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import Range, consistency_ranges, inclusion_ranges, proof_of
from rtshcua.evidence.proofs.check import check_proof
from rtshcua.evidence.proofs.cose_receipt import check_receipt, make_receipt
from rtshcua.evidence.proofs.disclosure import Disclosure
from rtshcua.evidence.proofs.extra import Extra, Field
from rtshcua.evidence.proofs.file import Kind, ProofFile
from rtshcua.evidence.proofs.search import Found, find
from rtshcua.evidence.records import Close, encode, unsigned
from rtshcua.wire import cose
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted

#: gives the lines of the log from its beginning, each time that it is called
Lines = Callable[[], Iterable[bytes]]


def prove_inclusion(lines: Lines, number: int, at: int | None = None) -> bytes | Flaw:
    """The proof that record `number` is in the log: under the signed record `at`, or else the first one after it.

    The close, after which there is none, is proven by its own signature; so is any signed record for which `at` is its
    own number.
    """
    found = find(lines(), number, at)
    if isinstance(found, Flaw):
        return found
    signed = found.signed
    if signed.seq == number:
        return _made(Kind.RECORD, found, number, [])
    path = _path(inclusion_ranges(number, signed.seq), leaves(lines))
    return path if isinstance(path, Flaw) else _made(Kind.INCLUSION, found, number, path, record=found.line)


def receipt_of(
    lines: Lines, number: int, at: int | None, *, kid: bytes, signer: Callable[[bytes], bytes]
) -> bytes | Flaw:
    """The COSE receipt (`cose_receipt`) of record `number`, under the same signed record as its inclusion proof, which
    is verified first. `signer` signs by the log key, whose name in the trust root is `kid`.
    """
    found = find(lines(), number, at)
    if isinstance(found, Flaw):
        return found
    size = found.signed.seq
    if size < 2 or size == number:
        text = f"a tree of {size} records has no receipt for record {number}"
        return Flaw("proof/number", text, str(number), "an earlier record, or `--at` a later signed one")
    path = _path(inclusion_ranges(number, size), leaves(lines))
    if isinstance(path, Flaw):
        return path
    checked = _made(Kind.INCLUSION, found, number, path, record=found.line)
    if isinstance(checked, Flaw):
        return checked
    origin = found.chain[-1].partition("\n")[0]
    data = make_receipt(found.line, number, size, path, origin=origin, root=found.root, kid=kid, signer=signer)
    received = check_receipt(data, cose.unverified(found.root).kid)
    return received if isinstance(received, Flaw) else data


def prove_consistency(lines: Lines, old: int, at: int | None = None) -> bytes | Flaw:
    """The proof that the log, as the signed record `at` or else the last one vouches for it, begins with what the
    signed record `old` vouched for.
    """
    found = find(lines(), None, at, since=old)
    if isinstance(found, Flaw):
        return found
    size = found.signed.seq
    if size <= old:
        return Flaw("proof/number", f"the log has no signed record after record {old}", str(size))
    path = _path(consistency_ranges(old, size), leaves(lines))
    return path if isinstance(path, Flaw) else _made(Kind.CONSISTENCY, found, old, path)


def prove_disclosure(lines: Lines, number: int, secret: bytes, withheld: Collection[str]) -> bytes | Flaw:
    """The proof of a record of a closed log of which some fields are withheld. `secret` is the log's.

    `_prev` is withheld too: it would let the record before be guessed.
    """
    found = find(lines(), number, None, closed=True)
    if isinstance(found, Flaw):
        return found
    if not isinstance(found.signed, Close) or found.signed.disclosure is None:
        text = "no record of this log can be shown in part: its close does not provide for it"
        return Flaw("proof/disclosure", text, found.signed.type)
    if number >= found.signed.seq:
        return Flaw("proof/number", "the close itself cannot be shown in part", str(number))
    disclosure = Disclosure(secret)
    salted = (disclosure.leaf(index, line) for index, line in enumerate(lines()))
    path = _path(inclusion_ranges(number, found.signed.seq), salted)
    if isinstance(path, Flaw):
        return path
    fields = disclosure.shown(number, found.line, {*withheld, "_prev"})
    made = _made(Kind.DISCLOSURE, found, number, path, fields=fields)
    if isinstance(made, Flaw) and made.slug == "proof/path":
        return Flaw(
            "proof/secret",
            "the secret is not that of this log, or the log was changed, or the close states other fields",
        )
    return made


def _made(
    kind: Kind, found: Found, number: int, path: list[bytes], record: bytes = b"",
    fields: tuple[Field, ...] = (),
) -> bytes | Flaw:  # fmt: skip
    signed = encode(unsigned(found.signed))
    *chain, note = found.chain
    try:
        extra = Extra(tuple(chain), found.root, signed, record, fields).encode()
        pinned = cose.unverified(found.root).kid
    except (CborError, Untrusted) as error:
        return Flaw("proof/log", f"no proof can be made of this log: {error}")
    data = ProofFile(kind, extra, number, tuple(path), note).encode()
    checked = check_proof(data, pinned)
    return checked if isinstance(checked, Flaw) else data


def _path(ranges: Sequence[Range], hashes: Iterable[bytes]) -> list[bytes] | Flaw:
    try:
        return proof_of(ranges, hashes)
    except (ValueError, RecursionError):
        return Flaw("proof/log", "a line of the log is none, or the log was cut while it was read")


def leaves(lines: Lines) -> Iterator[bytes]:
    """The leaf hashes of a log."""
    return map(leaf_hash, lines())
