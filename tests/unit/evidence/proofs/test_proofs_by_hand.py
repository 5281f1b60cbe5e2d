"""Verifies proofs and receipts as docs/proofs.md says, with hashlib, cbor2 and cryptography, without code of
`rtshcua`.
"""

import json
from base64 import b64decode
from hashlib import sha256
from typing import Any

import cbor2
import pytest
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from reference.sealed_log import LOG_KEY, PIN, sealed_log, sign
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.make import prove_consistency, prove_inclusion, receipt_of

LOG = sealed_log(epochs=4, records=6)


def split(data: bytes) -> tuple[list[str], dict[str, Any], str]:
    head, _, note = data.decode().partition("\n\n")
    kind, extra, *rest = head.split("\n")
    name, version, body = cbor2.loads(b64decode(extra.removeprefix("extra ")))
    assert (name, version) == ("rtshcua/proof", 1)
    return [kind, *rest], body, note


def trusted_log_key(envelope: bytes) -> bytes:
    """The public key for duty `log` that the pinned root key signed."""
    protected, _, payload, signature = cbor2.loads(envelope).value
    signed = cbor2.dumps(["Signature1", protected, b"rtshcua/duty/root", payload], canonical=True)
    Ed25519PublicKey.from_public_bytes(PIN).verify(signature, signed)
    (key,) = [key for key in cbor2.loads(payload)[2]["keys"] if key["duty"] == "log"]
    public: bytes = key["public"]
    return public


def open_chain(body: dict[str, Any], note: str) -> list[list[str]]:
    """The lines of the checkpoints, each signed by the key that the previous one names."""
    public, heads = trusted_log_key(body["root"]), []
    for each in (*body["chain"], note):
        text, _, signature = each.rpartition("\n\n")
        octets = b64decode(signature.split(" ")[2])
        name = text.split("\n")[0]
        assert octets[:4] == sha256(name.encode() + b"\n\x01" + public).digest()[:4]
        Ed25519PublicKey.from_public_bytes(public).verify(octets[4:], text.encode() + b"\n")
        heads.append(text.split("\n"))
        if heads[-1][4].startswith("key "):
            public = b64decode(heads[-1][4].removeprefix("key "))
    assert b64decode(heads[-1][3].removeprefix("record ")) == sha256(b"\0" + body["signed"]).digest()
    return heads


def climb(leaf: bytes, index: int, size: int, path: list[bytes]) -> bytes:
    """The root, by the recursive definition: the last hash of the path stands beside the half with the leaf."""
    if size == 1:
        assert not path
        return leaf
    half = 1 << (size - 1).bit_length() - 1
    if index < half:
        return sha256(b"\1" + climb(leaf, index, half, path[:-1]) + path[-1]).digest()
    return sha256(b"\1" + path[-1] + climb(leaf, index - half, size - half, path[:-1])).digest()


@pytest.mark.parametrize("number", [0, 1, 9, 20, 26])
def test_inclusion(number: int) -> None:
    made = prove_inclusion(lambda: LOG.lines, number)
    assert isinstance(made, bytes)
    (kind, index, *path), body, note = split(made)
    assert (kind, index) == ("c2sp.org/tlog-proof@v1", f"index {number}")
    head = open_chain(body, note)[-1]
    assert body["record"] == LOG.lines[number]
    leaf = sha256(b"\0" + body["record"]).digest()
    assert climb(leaf, number, int(head[1]), [b64decode(each) for each in path]) == b64decode(head[2])


def test_consistency_is_between_the_roots_that_were_signed() -> None:
    made = prove_consistency(lambda: LOG.lines, LOG.signed[1])
    assert isinstance(made, bytes)
    (kind, old, *path), body, note = split(made)
    assert (kind, old) == ("rtshcua/consistency-proof@v1", f"old {LOG.signed[1]}")
    heads = {head[1]: b64decode(head[2]) for head in open_chain(body, note)}
    # 7 leaves of 28: [0,4) and [4,6) and [6] give the old root; with [7], [8,16), [16,28) the new one
    six, seven, four_six, four, eight, rest = [b64decode(each) for each in path]

    def node(left: bytes, right: bytes) -> bytes:
        return sha256(b"\1" + left + right).digest()

    assert heads["7"] == node(four, node(four_six, six))
    eights = node(four, node(four_six, node(six, seven)))
    assert heads[str(LOG.signed[-1])] == node(node(eights, eight), rest)


def test_a_receipt_of_rfc_9942() -> None:
    made = receipt_of(lambda: LOG.lines, 9, None, kid=LOG_KEY.kid, signer=sign)
    assert not isinstance(made, Flaw)
    message = cbor2.loads(made)
    assert message.tag == 18
    protected, unprotected, payload, signature = message.value
    headers = cbor2.loads(protected)
    assert (headers[1], headers[395], payload) == (-19, 1, None)
    size, index, path = cbor2.loads(unprotected[396][-1][0])
    root = climb(sha256(b"\0" + unprotected["rtshcua/record"]).digest(), index, size, path)
    public = Ed25519PublicKey.from_public_bytes(trusted_log_key(unprotected["rtshcua/root"]))
    public.verify(signature, cbor2.dumps(["Signature1", protected, b"", root], canonical=True))
    with pytest.raises(InvalidSignature):
        public.verify(signature, cbor2.dumps(["Signature1", protected, b"", bytes(32)], canonical=True))
    checkpoint = json.loads(LOG.lines[LOG.signed[2]])["checkpoint"].split("\n")
    assert (str(size), root) == (checkpoint[1], b64decode(checkpoint[2]))
