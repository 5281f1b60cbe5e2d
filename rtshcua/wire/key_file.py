"""A signing key as a file's bytes: two header lines, then one PKCS#8 block (RFC 5958, RFC 7468).

    duty: policy
    development: no
    -----BEGIN ENCRYPTED PRIVATE KEY-----

Relabelling a file makes a key that no root knows, for the key's name covers its duty. Only a development key may lie
there unencrypted. Encrypting draws a salt from the system, so the bytes differ from one time to the next; it stretches
the passphrase by 2,048 rounds of PBKDF2 only (what `cryptography` does for PKCS#8), so the passphrase has to be long.
"""

import re
from typing import Final

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from rtshcua.wire.keys import Duty, SigningKey, WrongDuty
from rtshcua.wire.untrusted import Untrusted

#: no key file is larger, in bytes
MAX_KEY_FILE: Final = 4096

_FILE: Final = re.compile(
    rb"duty: (?P<duty>" + "|".join(Duty).encode() + rb")\n"
    rb"development: (?P<development>yes|no)\n"
    rb"(?P<pem>-----BEGIN (?P<kind>(?:ENCRYPTED )?PRIVATE KEY)-----\n"
    rb"(?:[A-Za-z0-9+/=]{1,64}\n)+"
    rb"-----END (?P=kind)-----\n)"
)


class KeyFileError(Untrusted):
    """A key file that does not serve: `malformed`, `unencrypted`, `passphrase-needed`, `wrong-passphrase`."""


def dump_signing_key(key: SigningKey, *, passphrase: bytes | None) -> bytes:
    """The file's bytes. Raises `KeyFileError` (`unencrypted`) for a key without passphrase, unless for development."""
    if not passphrase and not key.development:
        raise KeyFileError("unencrypted", "only a development key may be written without a passphrase")
    block = key.private.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption(),
    )
    return f"duty: {key.duty}\ndevelopment: {'yes' if key.development else 'no'}\n".encode() + block


def load_signing_key(data: bytes, *, duty: Duty, passphrase: bytes | None) -> SigningKey:
    """The key in a file's bytes. Raises `WrongDuty` if it is for another duty, and `KeyFileError`."""
    found = _FILE.fullmatch(data) if len(data) <= MAX_KEY_FILE else None
    if found is None:
        raise KeyFileError("malformed", "not a key file: two header lines and one PKCS#8 block are expected")
    has, development = Duty(found["duty"].decode()), found["development"] == b"yes"
    if has is not duty:
        raise WrongDuty(has, duty)
    encrypted = found["kind"].startswith(b"ENCRYPTED")
    if not encrypted and not development:
        raise KeyFileError("unencrypted", "the key is neither encrypted nor marked for development")
    if encrypted and not passphrase:
        raise KeyFileError("passphrase-needed", "the key is encrypted: a passphrase is needed")
    return SigningKey(duty, development, _private(found["pem"], passphrase if encrypted else None))


def _private(block: bytes, passphrase: bytes | None) -> Ed25519PrivateKey:
    try:
        private = serialization.load_pem_private_key(block, passphrase)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        if passphrase is None:
            raise KeyFileError("malformed", "the key's PKCS#8 block is damaged") from None
        raise KeyFileError("wrong-passphrase", "the passphrase does not open the key, or it is damaged") from None
    if not isinstance(private, Ed25519PrivateKey):
        raise KeyFileError("malformed", "the key is not an Ed25519 key")
    return private
