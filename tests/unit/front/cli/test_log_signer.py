"""Only one process holds the log key: this one, or the boundary."""

import gc

import pytest

from rtshcua.app.fly.verify_bundle import LogNotSigned, LogSigner
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire.keys import Duty, SigningKey

SEED, TEXT = bytes(range(32)), b"a checkpoint"


def key() -> SigningKey:
    return SigningKey.from_seed(SEED, duty=Duty.LOG)


@pytest.mark.slow
def test_this_process_signs_until_the_key_is_handed_over() -> None:
    signer = LogSigner(key())
    assert signer.sign(TEXT) == key().sign(TEXT, duty=Duty.LOG)
    signer.hand_over(lambda text: text + b" signed")
    assert signer.sign(TEXT) == b"a checkpoint signed"
    assert (signer.kid, signer.public) == (key().kid, key().public)
    with pytest.raises(LookupError):
        signer.key()
    gc.collect()
    assert not [each for each in gc.get_referrers(signer.public) if isinstance(each, SigningKey)], "it was let go"
    signer.use(key())
    assert signer.sign(TEXT) == key().sign(TEXT, duty=Duty.LOG)


def test_flight_requires_the_boundarys_signature() -> None:
    signer = LogSigner(key())
    signer.hand_over(lambda _: Refusal("not-its-log", "the boundary refuses the call"))
    with pytest.raises(LogNotSigned, match="does not sign the log") as refused:
        signer.sign(TEXT)
    assert refused.value.refusal.slug == "boundary-not-its-log"
