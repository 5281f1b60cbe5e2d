"""Records shown in part (docs/log-format.md, section 6): a second tree, over salted hashes of each field.

A reader of one record learns the fields that are shown and, of the others, hashes that nobody can guess the fields of
without the log's secret.
"""

from collections.abc import Collection, Iterable
from hashlib import sha256

import msgspec

from rtshcua.evidence.merkle import leaf_hash, root_of
from rtshcua.evidence.proofs.file import Field
from rtshcua.evidence.records import Close, Decision, Effect, Genesis, Recover, Seal
from rtshcua.wire.digest import hmac_halves

SECRET_BYTES = 32

#: the names of the fields of a record, in their order, by its type
FIELDS = {
    kind.__name__.lower(): kind.__struct_encode_fields__ for kind in (Genesis, Decision, Effect, Seal, Recover, Close)
}

_fields = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode


class Disclosure:
    """Works out the leaves of the disclosure tree of one log, whose secret (32 octets) is given."""

    __slots__ = ("_inner", "_outer")

    def __init__(self, secret: bytes) -> None:
        if len(secret) != SECRET_BYTES:
            raise ValueError(f"the secret of a log has {SECRET_BYTES} bytes, not {len(secret)}")
        self._inner, self._outer = hmac_halves(secret)

    def leaf(self, number: int, line: bytes) -> bytes:
        """d_n of a line, newline included or not. Raises ValueError for what is not a JSON object."""
        return combined([field_hash(salt, key, value) for key, salt, value in self._salted(number, line)])

    def shown(self, number: int, line: bytes, withheld: Collection[str]) -> tuple[Field, ...]:
        """The fields of a line, those in `withheld` as their hash alone."""
        return tuple(
            (key, (field_hash(salt, key, value),) if key in withheld else (salt, value))
            for key, salt, value in self._salted(number, line)
        )

    def _salted(self, number: int, line: bytes) -> Iterable[tuple[str, bytes, bytes]]:
        begin = self._inner.copy()
        begin.update(b"%d\0" % number)
        for key, value in _fields(line).items():
            inner, outer = begin.copy(), self._outer.copy()
            inner.update(key.encode())
            outer.update(inner.digest())
            yield key, outer.digest(), bytes(value)


def disclosure_root(lines: Iterable[bytes], secret: bytes) -> bytes:
    """The root over all lines before a close, which that close then carries. Raises ValueError for a line that is none.

    It takes some 3 us a field: it is worked out once, when the flight is over.
    """
    disclosure = Disclosure(secret)
    return root_of(disclosure.leaf(number, line) for number, line in enumerate(lines))


def field_hash(salt: bytes, key: str, value: bytes) -> bytes:
    """f = SHA-256(salt || key || 0x00 || value)."""
    return sha256(salt + key.encode() + b"\0" + value).digest()


def combined(hashes: Iterable[bytes]) -> bytes:
    """d_n = SHA-256(0x00 || f_1 || ... || f_k)."""
    return leaf_hash(b"".join(hashes))
