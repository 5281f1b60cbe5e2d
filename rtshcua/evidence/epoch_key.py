"""Epochs: when one ends, and the key that signs its end (docs/log-format.md, sections 2 and 3).

Each epoch has an Ed25519 key of its own. The signed record before the epoch names it, and it is dropped after it
has signed the record that ends the epoch. Whoever takes the vehicle over later holds only the key of the present
epoch and cannot rewrite what was sealed before. "Dropped" means that no reference remains: Python cannot guarantee
to erase the octets.
"""

from typing import Final

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

#: an epoch is sealed after this many lines, or after this time, in us of monotonic time
EPOCH_RECORDS: Final = 1_024
EPOCH_US: Final = 10_000_000
#: The tolerance of a verifier, because a busy machine seals late.
MOST_RECORDS: Final = 2_048
LONGEST_US: Final = 20_000_000


class EpochKey:
    """The key of one epoch, made from a secret seed of 32 bytes. It never displays its secret."""

    __slots__ = ("_private", "public")

    def __init__(self, seed: bytes) -> None:
        self._private = Ed25519PrivateKey.from_private_bytes(seed)
        self.public = self._private.public_key().public_bytes_raw()

    def sign(self, data: bytes) -> bytes:
        """The signature, 64 bytes (RFC 8032)."""
        return self._private.sign(data)

    def __repr__(self) -> str:
        return f"<epoch key {self.public.hex()}>"
