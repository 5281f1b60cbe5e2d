"""Threat: a key that is trusted for one duty is used for another.

The attacker holds one key and may build envelopes byte by byte, without our signer, claiming any duty and any
name.
"""

from itertools import permutations

import pytest

from rtshcua.wire import cbor, cose, names
from rtshcua.wire.key_file import dump_signing_key, load_signing_key
from rtshcua.wire.keys import Duty, SigningKey, WrongDuty
from rtshcua.wire.trust import TrustRoot, open_root
from virtual.rows import rows

ARTEFACTS = {
    Duty.ROOT: names.ROOT,
    Duty.POLICY: names.POLICY,
    Duty.MISSION: names.MISSION,
    Duty.APPROVAL: names.APPROVAL,
    Duty.LOG: names.LOG,
    Duty.WITNESS: names.RECEIPT,  # in production it signs no envelope
    Duty.BOUNDARY: names.STATEMENT,
}
KEYS = {
    duty: SigningKey.from_seed(bytes([number]) * 32, duty=duty, development=True) for number, duty in enumerate(Duty)
}
ROOT = TrustRoot(1, True, 0, 1000, tuple(key.verification() for key in KEYS.values()))
TRUSTED = {key.kid: key for key in ROOT.keys}
PAYLOAD = b"whatever the attacker likes"
CROSSED = list(permutations(Duty, 2))


def forged(key, *, label, content_type, kid):
    """An envelope as the attacker makes it: the private key is used directly."""
    protected = cbor.encode({1: cose.ED25519, 3: content_type, 4: kid})
    signature = key.private.sign(cbor.encode(["Signature1", protected, label, PAYLOAD]))
    return b"\xd2" + cbor.encode([protected, {}, PAYLOAD, signature])


def refusal(envelope, duty, keys=TRUSTED):
    with pytest.raises(cose.EnvelopeError) as refused:
        cose.open1(envelope, keys=keys, duty=duty, content_type=ARTEFACTS[duty].content_type)
    return refused.value.slug


@rows("duty", list(Duty))
def test_control_envelopes_verify(duty):
    """The twin of all that follows: with nothing crossed, the same hand-made bytes are what we make and accept."""
    key, content_type = KEYS[duty], ARTEFACTS[duty].content_type
    envelope = forged(key, label=duty.label, content_type=content_type, kid=key.kid)
    assert envelope == cose.sign1(PAYLOAD, key=key, duty=duty, content_type=content_type)
    assert cose.open1(envelope, keys=TRUSTED, duty=duty, content_type=content_type).payload == PAYLOAD


@rows(("has", "wanted"), CROSSED)
def test_tools_refuse_to_sign_for_wrong_duty(has, wanted):
    with pytest.raises(WrongDuty):
        KEYS[has].sign(PAYLOAD, duty=wanted)
    with pytest.raises(WrongDuty):
        cose.sign1(PAYLOAD, key=KEYS[has], duty=wanted, content_type=ARTEFACTS[wanted].content_type)
    with pytest.raises(WrongDuty):
        load_signing_key(dump_signing_key(KEYS[has], passphrase=None), duty=wanted, passphrase=None)


@rows(("has", "wanted"), CROSSED)
def test_forged_envelopes_are_refused(has, wanted):
    key, content_type = KEYS[has], ARTEFACTS[wanted].content_type
    # all claims as wanted, but the key's own name
    assert refusal(forged(key, label=wanted.label, content_type=content_type, kid=key.kid), wanted) == "wrong-duty"
    # under the name of the key that should have signed
    borrowed = forged(key, label=wanted.label, content_type=content_type, kid=KEYS[wanted].kid)
    assert refusal(borrowed, wanted) == "bad-signature"
    # the key relabelled for the wanted duty: a name that the root does not know
    relabelled = SigningKey(wanted, True, key.private)
    assert refusal(cose.sign1(PAYLOAD, key=relabelled, duty=wanted, content_type=content_type), wanted) == "unknown-key"


@rows(("has", "wanted"), CROSSED)
def test_envelope_is_refused_for_another_duty(has, wanted):
    genuine = cose.sign1(PAYLOAD, key=KEYS[has], duty=has, content_type=ARTEFACTS[has].content_type)
    assert refusal(genuine, wanted) == "wrong-content-type"
    # even if one content type were used for both, and one public key were trusted for both under a name that fits
    shared = cose.sign1(PAYLOAD, key=KEYS[has], duty=has, content_type=ARTEFACTS[wanted].content_type)
    assert refusal(shared, wanted) == "wrong-duty"
    both = SigningKey(wanted, True, KEYS[has].private).verification()
    claimed = cose.unverified(shared)
    assert not both.verify(
        claimed.signature, cbor.encode(["Signature1", claimed.protected, wanted.label, claimed.payload])
    )


@pytest.mark.parametrize("duty", [duty for duty in Duty if duty is not Duty.ROOT])
def test_root_signed_by_other_key_is_refused(duty):
    """A root that names the attacker's key as root key, signed by that very key, is not the pinned one."""
    attacker = SigningKey(Duty.ROOT, True, KEYS[duty].private)
    mine = TrustRoot(2, True, 0, 1000, (attacker.verification(),)).sign(attacker)
    for pinned in (KEYS[Duty.ROOT].public, KEYS[Duty.ROOT].kid):
        with pytest.raises(cose.EnvelopeError) as refused:
            open_root(mine, pinned=pinned, now_us=1)
        assert refused.value.slug == "unknown-key"
