"""Ed25519 keys (RFC 8032), each bound to one duty."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, Self

import msgspec
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from rtshcua.model.flat.contract import SourceKind
from rtshcua.wire import digest
from rtshcua.wire.untrusted import Untrusted

#: length of a key identifier, a public key and a seed in bytes
KID_BYTES: Final = 16
PUBLIC_BYTES: Final = 32
SEED_BYTES: Final = 32

#: the field's prime, and the y of each point of small order: anybody can make signatures for such a key
_P: Final = 2**255 - 19
_Y: Final = (
    0x05FC536D880238B13933C6D305ACDFD5F098EFF289F4C345B027B2C28F95E826  # of the points of order 8, and its negative
)
_SMALL_ORDER: Final = frozenset({0, 1, _P - 1, _Y, _P - _Y})

#: means every role, policy or vehicle; a source is always named
ANY: Final = "*"

_SOURCES: Final = frozenset(kind.name.lower() for kind in SourceKind)


class Duty(StrEnum):
    """The one duty of a key: a key trusted for one duty signs nothing else (The Update Framework, section 2.1,
    roles).
    """

    ROOT = "root"  # signs trust roots, which name all other keys
    POLICY = "policy"  # signs policies
    MISSION = "mission"  # signs missions, for the roles and through the sources that the root lists
    APPROVAL = "approval"  # answers a `confirm`
    LOG = "log"  # signs evidence
    WITNESS = "witness"  # cosigns the checkpoints of logs, away from the vehicle
    BOUNDARY = "boundary"  # signs the enforcement boundary's statements of its own evidence

    @property
    def label(self) -> bytes:
        """The label that is signed with every payload, so that a signature made for one duty verifies for no other."""
        return b"rtshcua/duty/" + self.value.encode()


class WrongDuty(Untrusted):
    """A key was used for another duty than its own; `slug` is `wrong-duty`."""

    def __init__(self, has: Duty, asked: Duty) -> None:
        super().__init__("wrong-duty", f"the key is for `{has}`, not for `{asked}`")
        self.has = has
        self.asked = asked


def key_id(duty: Duty, public: bytes) -> bytes:
    """The name of a key, 16 bytes. It depends on the duty too, so a key with a changed duty is unknown."""
    return digest.digest(digest.KEY, duty.label + b"\0" + public)[:KID_BYTES]


def is_strong(point: bytes) -> bool:
    """Whether a point (32 bytes) is in canonical form and not of small order; membership of the curve is not
    checked.
    """
    y = int.from_bytes(point, "little") & ((1 << 255) - 1)  # the top bit is the sign of x
    return y < _P and y not in _SMALL_ORDER


def verified(public: bytes, signature: bytes, message: bytes) -> bool:
    """Whether the key of `public` (32 bytes) signed `message`; a signature with s >= L is refused (RFC 8032, 5.1.7).

    A key, or the first half of a signature, that is not strong is refused too: OpenSSL accepts these, other
    libraries do not.
    """
    if not is_strong(public) or not is_strong(signature[:PUBLIC_BYTES]):
        return False
    try:
        Ed25519PublicKey.from_public_bytes(public).verify(signature, message)
    except InvalidSignature:
        return False
    return True


class VerificationKey(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A public key as the trust root names it.

    `roles`, `sources` (`agent`, `operator`, ...) and `vehicles` (identities) are those that the key is authorised
    for. A mission key signs missions under `policies` (names) only, and an approval key belongs to one `person` in
    one role. An empty list authorises for nothing, and `*` means every role, policy or vehicle. `expires_us` is
    UTC in microseconds, None if the key expires with the root.
    """

    duty: Duty
    public: bytes
    roles: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    vehicles: tuple[str, ...] = ()
    expires_us: int | None = None
    development: bool = False
    policies: tuple[str, ...] = ()
    person: str = ""

    def __post_init__(self) -> None:
        if len(self.public) != PUBLIC_BYTES:
            raise ValueError(f"a public key is {PUBLIC_BYTES} bytes, not {len(self.public)}")
        if not is_strong(self.public):
            raise ValueError("a public key must be in canonical form and not of small order")
        if unknown := sorted(set(self.sources) - _SOURCES):
            raise ValueError(f"`{unknown[0]}` is not a source")

    @property
    def kid(self) -> bytes:
        """The key's name: see `key_id`."""
        return key_id(self.duty, self.public)

    def verify(self, signature: bytes, message: bytes) -> bool:
        """Whether this key made `signature` over exactly `message`: see `verified`."""
        return verified(self.public, signature, message)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SigningKey:
    """A private key and its one duty. It never displays its secret; Python cannot guarantee to erase it."""

    duty: Duty
    development: bool
    private: Ed25519PrivateKey
    public: bytes = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "public", self.private.public_key().public_bytes_raw())

    @classmethod
    def from_seed(cls, seed: bytes, *, duty: Duty, development: bool = False) -> Self:
        """The key of a 32-byte secret seed, which the caller must draw from the system's random source."""
        return cls(duty, development, Ed25519PrivateKey.from_private_bytes(seed))

    @property
    def kid(self) -> bytes:
        """The key's name: see `key_id`."""
        return key_id(self.duty, self.public)

    def sign(self, message: bytes, *, duty: Duty) -> bytes:
        """Sign `message` (64 bytes). Raises `WrongDuty` unless `duty` is this key's."""
        if duty is not self.duty:
            raise WrongDuty(self.duty, duty)
        return self.private.sign(message)

    def verification(
        self,
        *,
        roles: tuple[str, ...] = (),
        sources: tuple[str, ...] = (),
        vehicles: tuple[str, ...] = (),
        expires_us: int | None = None,
        policies: tuple[str, ...] = (),
        person: str = "",
    ) -> VerificationKey:
        """The public half, as a trust root would name it."""
        return VerificationKey(
            self.duty, self.public, roles, sources, vehicles, expires_us, self.development, policies, person
        )

    def __repr__(self) -> str:
        mark = " development" if self.development else ""
        return f"<{self.duty} signing key {self.kid.hex()}{mark}>"
