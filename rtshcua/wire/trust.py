"""The trust root: which keys are trusted, for which duty, role, source and vehicle, and until when.

After The Update Framework (specification 1.0, sections 2.1, 4.3 and 5.3): a root names the root keys too and is signed
by one of them; versions only rise, one by one, and each root is signed by a key of the one before it.
"""

import re
from collections.abc import Sequence
from typing import Final, Self

import msgspec

from rtshcua.model.flat.limits import MAX_KEYS, MAX_REVOKED
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.keys import ANY, KID_BYTES, PUBLIC_BYTES, Duty, SigningKey, VerificationKey, is_strong
from rtshcua.wire.untrusted import Untrusted

#: the source of a human answer; a key that is only authorised through an agent answers nothing
HUMAN: Final = "operator"
#: the form of people's names: each name has one spelling, so that two names are two people
PERSON: Final = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")

#: length of the name of a link's key in bytes, as in `revoked`: it signs frames and is not named in a root
LINK_ID_BYTES: Final = 8

#: a larger root is refused unread, in bytes
MAX_ROOT: Final = 1 << 20


class RootError(Untrusted):
    """A trust root that is refused.

    `malformed`, `whose-approval`, `unsupported-threshold`, `unreachable-threshold`, `shared-key`, `development-key`,
    `not-self-signed`, `expired`, `key-expired`, `unpinned`, `unknown-key`, `rollback`, `fork`, `version-gap`,
    `development-root`, `revoked-key`, `unrevoked`, `damaged`.
    """


class Thresholds(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How many keys of a duty must sign: for witnesses up to their number, for the other duties 1.

    Other values are not supported; the fields exist so that a larger one is refused and not ignored. A missing
    `witness` means 1: the field came later, and a root without it keeps its bytes.
    """

    root: int = 1
    policy: int = 1
    mission: int = 1
    approval: int = 1
    log: int = 1
    witness: int | msgspec.UnsetType = msgspec.UNSET


class TrustRoot(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A trust root. `version` counts from 1; times are UTC in microseconds; `development` marks a root for
    development.

    `revoked` are the names of keys that are never trusted again: the `kid` of a key that a root named (16 bytes),
    or the fingerprint of a link's key (8 bytes). The field came later, and a root that revokes nothing keeps its
    bytes.
    """

    version: int
    development: bool
    issued_at_us: int
    expires_at_us: int
    keys: tuple[VerificationKey, ...]
    thresholds: Thresholds = Thresholds()
    revoked: tuple[bytes, ...] | msgspec.UnsetType = msgspec.UNSET

    @property
    def revocations(self) -> frozenset[bytes]:
        """The names of the keys that are never trusted again."""
        return frozenset() if isinstance(self.revoked, msgspec.UnsetType) else frozenset(self.revoked)

    def keys_for(self, duty: Duty) -> dict[bytes, VerificationKey]:
        """The keys of a duty by `kid`, expired ones included: see `key_refusal`."""
        return {key.kid: key for key in self.keys if key.duty is duty}

    def witnesses(self, vehicle: str, now_us: int) -> frozenset[bytes]:
        """The public keys of the witnesses of a vehicle's logs at a UTC time."""
        keys = self.keys_for(Duty.WITNESS).values()
        return frozenset(key.public for key in keys if key_refusal(key, vehicle=vehicle, now_us=now_us) is None)

    def person(self, key: VerificationKey) -> int:
        """The number of the person who owns this approval key: the same for all keys of one person."""
        return next(number for number, each in enumerate(self.keys) if each.person == key.person)

    @property
    def witness_threshold(self) -> int:
        """How many witnesses must have cosigned a checkpoint that counts as anchored."""
        witness = self.thresholds.witness
        return 1 if isinstance(witness, msgspec.UnsetType) else witness

    def encode(self) -> bytes:
        """The payload that a root key signs."""
        return artefact.pack(names.ROOT, self)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """The root in an unverified payload. Raises `RootError` and `ArtefactError`."""
        root = artefact.unpack(names.ROOT, payload, cls, RootError, "trust root")
        _check(root)
        return root

    def sign(self, key: SigningKey) -> bytes:
        """The signed root. Raises `WrongDuty`, and `RootError` for a root that would be refused."""
        _check(self)
        envelope = cose.sign1(self.encode(), key=key, duty=Duty.ROOT, content_type=names.ROOT.content_type)
        _check_signer(self, key.kid)
        return envelope


def open_root(data: bytes, *, pinned: bytes | None, now_us: int) -> TrustRoot:
    """The root in a signed envelope, if the pinned root key signed it and it has not expired.

    `pinned` is the root's public key (32 bytes) or that key's `kid` (16 bytes). With None, only a development root
    is trusted, without a pin. Raises `RootError`, `ArtefactError` and `EnvelopeError`.
    """
    if pinned is not None and len(pinned) == PUBLIC_BYTES:
        pins = (VerificationKey(Duty.ROOT, pinned),) if is_strong(pinned) else ()
        return _open(data, {key.kid: key for key in pins}, now_us)
    # Only the root itself contains the key, so it is parsed first, by a total and strict decoder, then verified.
    claimed = _claimed(data)
    trusted = claimed.keys_for(Duty.ROOT)
    if pinned is None:
        if not claimed.development:
            raise RootError("unpinned", "a root that is not for development requires a pinned key")
    elif len(pinned) == KID_BYTES:
        trusted = {kid: key for kid, key in trusted.items() if kid == pinned}
    else:
        raise ValueError(f"a pin is {PUBLIC_BYTES} or {KID_BYTES} bytes, not {len(pinned)}")
    return _open(data, trusted, now_us)


def open_successor(data: bytes, *, current: TrustRoot, now_us: int) -> TrustRoot:
    """The root that replaces `current` (which may have expired): signed by a root key of both, one version higher.

    A root key is therefore changed in two steps: name the old and the new key, signed by the old; then drop the
    old key, signed by the new. Revoked keys stay revoked. Raises `RootError`, `ArtefactError` and `EnvelopeError`.
    """
    signer, claimed = cose.unverified(data, limit=MAX_ROOT).kid, _claimed(data)
    if (
        claimed.version > current.version + 1
    ):  # checked before the signature, because the missing version may name its key
        raise RootError("version-gap", f"root version {current.version + 1} is missing before {claimed.version}")
    if signer in current.revocations:
        raise RootError(
            "revoked-key", f"root key {signer.hex()} signed it, which root version {current.version} revokes"
        )
    root = _open(data, current.keys_for(Duty.ROOT), now_us)
    if root.version == current.version and root != current:
        raise RootError("fork", f"this root of version {root.version} differs from the one in force")
    if root.version <= current.version:
        raise RootError("rollback", f"root version {root.version} does not follow version {current.version}")
    if root.development and not current.development:
        raise RootError("development-root", "a development root may not replace one that is not")
    if not current.revocations <= root.revocations:
        raise RootError(
            "unrevoked", f"root version {root.version} does not revoke a key that version {current.version} revokes"
        )
    return root


def follow(chain: Sequence[bytes], *, current: bytes, now_us: int) -> bytes:
    """The last root of a chain that continues `current`, which is trusted: each newer root succeeds the one before.

    As in The Update Framework (5.3.3 to 5.3.10), no version may be missing, and intermediate roots may have
    expired. Older roots at the beginning of the chain are skipped. Raises `RootError`, `ArtefactError` and
    `EnvelopeError`.
    """
    trusted, root = current, _claimed(current)
    for number, data in enumerate(chain, start=1):
        if data == trusted or (number < len(chain) and _claimed(data).version < root.version):
            continue
        root, trusted = open_successor(data, current=root, now_us=0), data
    if now_us >= root.expires_at_us:
        raise RootError("expired", f"root version {root.version} has expired")
    return trusted


def _claimed(data: bytes) -> TrustRoot:
    """The content of an unverified root."""
    return TrustRoot.decode(cose.unverified(data, limit=MAX_ROOT).payload)


def key_refusal(key: VerificationKey, *, vehicle: str, now_us: int) -> str | None:
    """Why `key` is not authorised for `vehicle` at a UTC time: `key-expired`, `wrong-vehicle`; None if it is."""
    if key.expires_us is not None and now_us >= key.expires_us:
        return "key-expired"
    if vehicle not in key.vehicles and ANY not in key.vehicles:
        return "wrong-vehicle"
    return None


def speaker_refusal(key: VerificationKey, *, role: str, source: str, vehicle: str, now_us: int) -> str | None:
    """Why `key` is not authorised for `role` through `source`; None if it is.

    As `key_refusal`, and `wrong-source`, `wrong-role`. This prevents an agent's host from posing as an operator:
    its key lists the operator's role through `agent` only.
    """
    if refusal := key_refusal(key, vehicle=vehicle, now_us=now_us):
        return refusal
    if source not in key.sources:
        return "wrong-source"
    if role not in key.roles and ANY not in key.roles:
        return "wrong-role"
    return None


def proposer_refusal(
    key: VerificationKey, *, role: str, source: str, policy: str, vehicle: str, now_us: int
) -> str | None:
    """Why `key` may not sign a step for `role` through `source` under a policy of that name; None if it may.

    As `speaker_refusal`, and `key-other-policy`: a proposer under one policy may not choose a laxer one.
    """
    if refusal := speaker_refusal(key, role=role, source=source, vehicle=vehicle, now_us=now_us):
        return refusal
    return None if policy in key.policies or ANY in key.policies else "key-other-policy"


def _open(data: bytes, keys: dict[bytes, VerificationKey], now_us: int) -> TrustRoot:
    opened = cose.open1(data, keys=keys, duty=Duty.ROOT, content_type=names.ROOT.content_type, limit=MAX_ROOT)
    root = TrustRoot.decode(opened.payload)
    signer = _check_signer(root, opened.key.kid)
    if now_us >= root.expires_at_us:
        raise RootError("expired", f"root version {root.version} has expired")
    if signer.expires_us is not None and now_us >= signer.expires_us:
        raise RootError("key-expired", f"the key that signed root version {root.version} has expired")
    return root


def _check_signer(root: TrustRoot, kid: bytes) -> VerificationKey:
    signer = root.keys_for(Duty.ROOT).get(kid)
    if signer is None:
        raise RootError("not-self-signed", f"key {kid.hex()} is not one of the root keys in this root")
    return signer


def _check(root: TrustRoot) -> None:
    """Refuse a root that contradicts itself, independent of its signature."""
    if len(root.keys) > MAX_KEYS or len(root.revocations) > MAX_REVOKED:
        text = f"a root may name at most {MAX_KEYS} keys and revoke at most {MAX_REVOKED}"
        raise RootError("malformed", text)
    if root.version < 1 or root.expires_at_us <= root.issued_at_us:
        raise RootError("malformed", "the version must be at least 1, and the expiry later than the issue")
    for duty in Duty:
        if duty is Duty.BOUNDARY:  # a vehicle has one boundary
            continue
        threshold = root.witness_threshold if duty is Duty.WITNESS else getattr(root.thresholds, duty)
        if duty is Duty.WITNESS and threshold > 1:
            _check_witnesses(root, threshold)
        elif threshold > 1:
            raise RootError("unsupported-threshold", f"`{duty}` requires {threshold} signatures; only 1 is supported")
        if threshold < 1:
            raise RootError("malformed", f"`{duty}` requires {threshold} signatures; at least 1 is needed")
    if len({key.public for key in root.keys}) != len(root.keys):
        raise RootError("shared-key", "a public key is named twice; each key has one duty")
    for key in root.keys:
        _check_bound(key)
    _check_revoked(root)
    if not root.development and any(key.development for key in root.keys):
        raise RootError("development-key", "only a development root may name a development key")


def _check_revoked(root: TrustRoot) -> None:
    revoked = root.revoked
    if isinstance(revoked, msgspec.UnsetType):
        return
    if not revoked or len({*revoked}) != len(revoked) or {*map(len, revoked)} - {KID_BYTES, LINK_ID_BYTES}:
        raise RootError("malformed", "`revoked` must list each key once, by its name")
    for key in root.keys:
        if key.kid in revoked:
            raise RootError("revoked-key", f"key {key.kid.hex()} is both trusted and revoked")


def _check_bound(key: VerificationKey) -> None:
    """Check that an approval key belongs to one person, in one role and in person: one key must not answer for two
    people.
    """
    if (key.person and key.duty is not Duty.APPROVAL) or (key.policies and key.duty is not Duty.MISSION):
        raise RootError("malformed", f"a key of duty `{key.duty}` cannot have a person or policies")
    if key.duty is not Duty.APPROVAL:
        return
    if not PERSON.fullmatch(key.person):
        text = f"approval key {key.kid.hex()} needs a person, named by lower-case letters, digits, `.`, `_` and `-`"
        raise RootError("whose-approval", text)
    if len(key.roles) != 1 or ANY in key.roles or key.sources != (HUMAN,):
        raise RootError("whose-approval", f"the approval key of `{key.person}` must be for exactly one role, in person")


def _check_witnesses(root: TrustRoot, threshold: int) -> None:
    count = len(root.keys_for(Duty.WITNESS))
    if threshold > count:
        text = f"`{Duty.WITNESS}` requires {threshold} signatures, but the root names {count} keys for it"
        raise RootError("unreachable-threshold", text)
