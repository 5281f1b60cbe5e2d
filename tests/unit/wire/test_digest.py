"""Digests of different domains differ."""

import hashlib

from rtshcua.wire import digest

DOMAINS = [value for name, value in vars(digest).items() if name.isupper() and isinstance(value, bytes)]


def test_labels_differ_and_hold_no_separator():
    assert len(DOMAINS) == 7
    assert len(set(DOMAINS)) == len(DOMAINS)
    assert all(b"\0" not in label for label in DOMAINS)


def test_a_digest_is_sha256_over_label_zero_and_data():
    assert digest.digest(digest.POLICY, b"data") == hashlib.sha256(b"rtshcua/policy\x00data").digest()
    assert len({digest.digest(label, b"data") for label in DOMAINS}) == len(DOMAINS)
    assert all(len(digest.digest(label, b"")) == digest.DIGEST_BYTES for label in DOMAINS)
