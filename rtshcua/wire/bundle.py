"""A bundle: the policy's envelope and the mission's, nested as signed bytes.

Each envelope is a COSE_Sign1 around an artefact whose body is the flat form. Payloads are verified before they are
parsed, and their digests are those of the signed bytes.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeVar

from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.struct import Flat
from rtshcua.model.step_number import step_words
from rtshcua.wire import artefact, binding, cose, digest, names
from rtshcua.wire.cose import EnvelopeError, Opened
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.names import Artefact
from rtshcua.wire.trust import TrustRoot, key_refusal, proposer_refusal
from rtshcua.wire.untrusted import Untrusted

#: a larger bundle is refused unread, in bytes
MAX_BUNDLE: Final = 16 << 20
#: the most CBOR items that are decoded of an unverified policy or mission
MAX_UNVERIFIED: Final = 1 << 17

_F = TypeVar("_F", bound=Flat)


class BundleError(Untrusted):
    """A bundle that is refused.

    `too-large`, `malformed`, `wrong-policy`, `wrong-vehicle`, `key-expired`, `wrong-source`, `wrong-role`,
    `key-other-policy`, `id-mismatch`, `binding-mismatch`; and, of its envelopes, the slugs of `EnvelopeError` and
    `ArtefactError`.
    """


@dataclass(frozen=True, slots=True)
class Bundle:
    """A verified bundle: its parts, the digests that name them, and the keys that signed them.

    `mission_digest` names what flies once: another envelope around the same signed mission is not another mission.
    """

    policy: Policy
    mission: Mission
    policy_digest: bytes
    mission_digest: bytes
    digest: bytes
    policy_key: VerificationKey
    mission_key: VerificationKey


def policy_payload(policy: Policy) -> bytes:
    """The bytes of a policy that a policy key signs."""
    return artefact.pack(names.POLICY, policy)


def mission_payload(mission: Mission) -> bytes:
    """The bytes of a mission that a mission key signs."""
    return artefact.pack(names.MISSION, mission)


def policy_digest(payload: bytes) -> bytes:
    """The digest by which the mission and every binding refer to the policy."""
    return digest.digest(digest.POLICY, payload)


def seal(policy: bytes, mission: bytes, *, policy_key: SigningKey, mission_key: SigningKey) -> bytes:
    """Sign both payloads and nest them. Raises `WrongDuty` for a key of another duty."""
    envelope = cose.sign1(policy, key=policy_key, duty=Duty.POLICY, content_type=names.POLICY.content_type)
    return seal_under(envelope, mission, mission_key=mission_key)


def seal_under(envelope: bytes, mission: bytes, *, mission_key: SigningKey) -> bytes:
    """Sign a mission's payload, and nest it with the envelope of a policy that was signed before.

    Raises `WrongDuty` for a key of another duty.
    """
    signed = cose.sign1(mission, key=mission_key, duty=Duty.MISSION, content_type=names.MISSION.content_type)
    return artefact.wrap(names.BUNDLE, (envelope, signed))


def open_bundle(data: bytes, *, root: TrustRoot, vehicle: str | None, now_us: int) -> Bundle:
    """Verify a bundle under a trust root, for `vehicle` (None: the one that it names), at a UTC time; then parse it.

    Raises `BundleError`, `EnvelopeError` and `ArtefactError`.
    """
    first, second = envelopes(data)
    signed_policy = open_envelope(first, root, Duty.POLICY, names.POLICY)
    signed_mission = open_envelope(second, root, Duty.MISSION, names.MISSION)
    policy = parse(names.POLICY, signed_policy.payload, Policy)
    mission = parse(names.MISSION, signed_mission.payload, Mission)
    bundle = Bundle(
        policy,
        mission,
        policy_digest=policy_digest(signed_policy.payload),
        mission_digest=digest.digest(digest.MISSION, signed_mission.payload),
        digest=digest.digest(digest.BUNDLE, data),
        policy_key=signed_policy.key,
        mission_key=signed_mission.key,
    )
    check_bundle(bundle, policy.vehicle.identity if vehicle is None else vehicle, now_us)
    return bundle


def claimed_vehicle(data: bytes) -> str:
    """The identity of the vehicle that an unverified bundle names, to find that vehicle's stored state.

    Raises `BundleError`, `EnvelopeError` and `ArtefactError`.
    """
    first, _ = envelopes(data)
    return parse_unverified(names.POLICY, cose.unverified(first, limit=MAX_BUNDLE).payload, Policy).vehicle.identity


def check_bundle(bundle: Bundle, vehicle: str, now_us: int, *, after: bytes = b"") -> None:
    """Check that the parts belong together, and that their keys are authorised for them on this vehicle. `after` is
    as for `bind`.

    Raises `BundleError`.
    """
    _check_belonging(bundle, after)
    _check_entitled(bundle, vehicle, now_us)


def envelopes(data: bytes) -> tuple[bytes, bytes]:
    """The policy's and the mission's envelope, unopened. Raises `BundleError` and `ArtefactError`."""
    if len(data) > MAX_BUNDLE:
        raise BundleError("too-large", f"the bundle is {len(data)} bytes; the limit is {MAX_BUNDLE}")
    match artefact.unwrap(names.BUNDLE, data):
        case (bytes(policy), bytes(mission)):
            return policy, mission
    raise BundleError("malformed", "a bundle must contain two envelopes, the policy's and the mission's")


def parse(kind: Artefact, payload: bytes, shape: type[_F]) -> _F:
    """The flat form in a verified payload. Raises `BundleError` and `ArtefactError`."""
    return artefact.unpack(kind, payload, shape, BundleError, f"`{kind.name}`")


def parse_unverified(kind: Artefact, payload: bytes, shape: type[_F]) -> _F:
    """The flat form in an unverified payload: as `parse`, with a limit on the work of decoding it."""
    return artefact.unpack(kind, payload, shape, BundleError, f"`{kind.name}`", items=MAX_UNVERIFIED)


def open_envelope(envelope: bytes, root: TrustRoot, duty: Duty, kind: Artefact, limit: int = MAX_BUNDLE) -> Opened:
    """The payload of an artefact that a key of the root signed for a duty. Raises `EnvelopeError`.

    All keys of the root are candidates, so that a key of another duty, an unknown key and a revoked key are
    distinguished.
    """
    signer = cose.unverified(envelope, limit=limit).kid
    if signer in root.revocations:
        raise EnvelopeError("revoked-key", f"key {signer.hex()} is revoked by the trust root")
    keys = {key.kid: key for key in root.keys}
    return cose.open1(envelope, keys=keys, duty=duty, content_type=kind.content_type, limit=limit)


def _check_belonging(bundle: Bundle, after: bytes) -> None:
    policy, mission = bundle.policy, bundle.mission
    if mission.policy_digest != bundle.policy_digest:
        raise BundleError("wrong-policy", "the mission was signed for another policy than the one in this bundle")
    if (mission.policy, mission.policy_version) != (policy.name, policy.version):
        raise BundleError(
            "wrong-policy",
            f"the mission is for `{mission.policy}@{mission.policy_version}`, the policy is "
            f"`{policy.name}@{policy.version}`",
        )
    if mission.vehicle != policy.vehicle.identity:
        raise BundleError(
            "wrong-vehicle", f"the mission is for `{mission.vehicle}`, the policy for `{policy.vehicle.identity}`"
        )
    unbound = binding.first_unbound(mission)
    if unbound is not None:
        raise BundleError("binding-mismatch", f"the binding of {step_words(unbound)} does not match its fields")
    misnamed = binding.first_misnamed(mission, after=after)
    if misnamed is not None:
        raise BundleError(
            "id-mismatch", f"the id of {step_words(misnamed)} does not match the one computed from the mission"
        )


def _check_entitled(bundle: Bundle, vehicle: str, now_us: int) -> None:
    identity = bundle.policy.vehicle.identity
    if identity != vehicle:
        raise BundleError("wrong-vehicle", f"the bundle is for `{identity}`, this vehicle is `{vehicle}`")
    refusal = key_refusal(bundle.policy_key, vehicle=vehicle, now_us=now_us)
    if refusal:
        raise BundleError(
            refusal, f"the policy's key {bundle.policy_key.kid.hex()} is not authorised for `{vehicle}` now"
        )
    check_proposer(bundle.mission_key, bundle.policy, bundle.mission.invocations, now_us)


def check_proposer(key: VerificationKey, policy: Policy, invocations: Iterable[Invocation], now_us: int) -> None:
    """Check that a mission key is authorised to sign each of these steps under a policy, on its vehicle. Raises
    `BundleError`.
    """
    vehicle = policy.vehicle.identity
    for invocation in invocations:
        role, source = _speaker(policy, invocation)
        refusal = proposer_refusal(key, role=role, source=source, policy=policy.name, vehicle=vehicle, now_us=now_us)
        if refusal:
            raise BundleError(
                refusal,
                f"the mission's key {key.kid.hex()} is not authorised for role `{role}` through `{source}` "
                f"under `{policy.name}` on `{vehicle}`",
            )


def _speaker(policy: Policy, invocation: Invocation) -> tuple[str, str]:
    """The names of an invocation's role and source."""
    if not 0 <= invocation.role < len(policy.roles) or invocation.source not in SourceKind._value2member_map_:
        raise BundleError(
            "malformed", f"{step_words(invocation.step)} has a role or source that the policy does not declare"
        )
    return policy.roles[invocation.role], SourceKind(invocation.source).name.lower()
