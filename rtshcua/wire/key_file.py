"""A signing key as a file's bytes: header lines, then the key.

    duty: policy
    development: no
    scrypt: 17 8 1 6b...
    sealed: ABC...=

An encrypted key is its seed of 32 bytes under ChaCha20-Poly1305 (RFC 8439), with the lines before as associated data,
the nonce 0, and a key that scrypt (RFC 7914) makes of the passphrase: `scrypt` has log2 of its N, its r and p, and a
salt of 32 bytes, hexadecimal. The salt is drawn from the system for each file, so that key is used once. One guess at
a passphrase takes 128 MiB and, on one core of today, about 0.4 s (docs/flying/keys.md).

An unencrypted key is one PKCS#8 block (RFC 5958, RFC 7468) in place of the last two lines. Only a development key may
lie there so. An encrypted PKCS#8 block is read too: earlier versions wrote it, under 2,048 rounds of PBKDF2.

Relabelling a file makes a key that no root knows, for the key's name covers its duty.
"""

import re
from base64 import b64decode, b64encode
from typing import Final

from cryptography.exceptions import InvalidTag, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

from rtshcua.wire.keys import Duty, SigningKey, WrongDuty
from rtshcua.wire.untrusted import Untrusted

#: the largest key file, in bytes
MAX_KEY_FILE: Final = 4096

#: log2 of the N of scrypt for new keys, and its range for existing keys
COST = 17
COSTS: Final = range(14, 19)
_BLOCK, _LANES = 8, 1  # r and p of scrypt
_NONCE: Final = bytes(12)  # a key that is used once needs no other

_LABELS: Final = (
    rb"duty: (?P<duty>" + "|".join(Duty).encode() + rb")\n"
    rb"development: (?P<development>yes|no)\n"
)  # fmt: skip
_SEALED: Final = re.compile(
    rb"(?P<head>" + _LABELS + rb"scrypt: (?P<cost>[1-9][0-9]) 8 1 (?P<salt>[0-9a-f]{64})\n)"
    rb"sealed: (?P<sealed>[A-Za-z0-9+/]{64})\n"
)
_FILE: Final = re.compile(
    _LABELS + rb"(?P<pem>-----BEGIN (?P<kind>(?:ENCRYPTED )?PRIVATE KEY)-----\n"
    rb"(?:[A-Za-z0-9+/=]{1,64}\n)+"
    rb"-----END (?P=kind)-----\n)"
)


class KeyFileError(Untrusted):
    """A key file that cannot be used: `malformed`, `unencrypted`, `passphrase-needed`, `wrong-passphrase`, `memory`."""


def dump_signing_key(key: SigningKey, *, passphrase: bytes | None) -> bytes:
    """The file's bytes. Raises `KeyFileError` (`unencrypted`) for a key without passphrase that is not a development
    key.
    """
    head = f"duty: {key.duty}\ndevelopment: {'yes' if key.development else 'no'}\n".encode()
    if passphrase:
        salt = ChaCha20Poly1305.generate_key()
        head += f"scrypt: {COST} {_BLOCK} {_LANES} {salt.hex()}\n".encode()
        sealed = _cipher(passphrase, salt, COST).encrypt(_NONCE, key.private.private_bytes_raw(), head)
        return head + b"sealed: " + b64encode(sealed) + b"\n"
    if not key.development:
        raise KeyFileError("unencrypted", "only a development key may be written without a passphrase")
    return head + key.private.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _cipher(passphrase: bytes, salt: bytes, cost: int) -> ChaCha20Poly1305:
    try:
        made = Scrypt(salt=salt, length=32, n=1 << cost, r=_BLOCK, p=_LANES).derive(passphrase)
    except MemoryError:
        needed = (128 * _BLOCK << cost) >> 20
        raise KeyFileError("memory", f"deriving the key from its passphrase takes {needed} MiB of memory") from None
    return ChaCha20Poly1305(made)


def load_signing_key(data: bytes, *, duty: Duty, passphrase: bytes | None) -> SigningKey:
    """The key in a file's bytes. Raises `WrongDuty` if it is for another duty, and `KeyFileError`."""
    short = data if len(data) <= MAX_KEY_FILE else b""
    sealed = _SEALED.fullmatch(short)
    found = sealed or _FILE.fullmatch(short)
    if found is None or (sealed is not None and int(sealed["cost"]) not in COSTS):
        raise KeyFileError("malformed", "not a key file: expected header lines and one key")
    has, development = Duty(found["duty"].decode()), found["development"] == b"yes"
    if has is not duty:
        raise WrongDuty(has, duty)
    encrypted = sealed is not None or found["kind"].startswith(b"ENCRYPTED")
    if not encrypted and not development:
        raise KeyFileError("unencrypted", "the key is neither encrypted nor marked for development")
    if encrypted and not passphrase:
        raise KeyFileError("passphrase-needed", "the key is encrypted: a passphrase is needed")
    if sealed is not None and passphrase:
        return SigningKey(duty, development, _unsealed(sealed, passphrase))
    return SigningKey(duty, development, _private(found["pem"], passphrase if encrypted else None))


def _unsealed(found: re.Match[bytes], passphrase: bytes) -> Ed25519PrivateKey:
    cipher = _cipher(passphrase, bytes.fromhex(found["salt"].decode()), int(found["cost"]))
    try:
        seed = cipher.decrypt(_NONCE, b64decode(found["sealed"]), found["head"])
    except InvalidTag:
        raise KeyFileError("wrong-passphrase", "wrong passphrase, or the key is damaged") from None
    return Ed25519PrivateKey.from_private_bytes(seed)


def _private(block: bytes, passphrase: bytes | None) -> Ed25519PrivateKey:
    try:
        private = serialization.load_pem_private_key(block, passphrase)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        if passphrase is None:
            raise KeyFileError("malformed", "the key's PKCS#8 block is damaged") from None
        raise KeyFileError("wrong-passphrase", "wrong passphrase, or the key is damaged") from None
    if not isinstance(private, Ed25519PrivateKey):
        raise KeyFileError("malformed", "the key is not an Ed25519 key")
    return private
