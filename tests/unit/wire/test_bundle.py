"""Bundles open under the right root and for the right vehicle; every other case has its slug."""

import msgspec
import pytest

from reference.bundle_case import HOUR, MISSION, NOW, POLICY, STEP, STRANGER, THE_MISSION, THE_POLICY, root, sealed
from rtshcua.model.flat.mission import Mission
from rtshcua.wire import artefact, bundle, cose, names
from rtshcua.wire.binding import bind
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted


def slug(data: bytes, *, trust: TrustRoot | None = None, vehicle: str | None = "quad-07", now: int = NOW) -> str:
    with pytest.raises(Untrusted) as refused:
        bundle.open_bundle(data, root=root() if trust is None else trust, vehicle=vehicle, now_us=now)
    assert str(refused.value)
    return refused.value.slug


def test_sealed_bundle_opens_unchanged() -> None:
    opened = bundle.open_bundle(sealed(), root=root(), vehicle="quad-07", now_us=NOW)
    assert opened.policy == THE_POLICY
    assert opened.mission.name == "look"
    assert opened.policy_key.kid == POLICY.kid
    assert opened.mission_key.kid == MISSION.kid
    assert opened.mission.policy_digest == opened.policy_digest
    assert bundle.open_bundle(sealed(), root=root(), vehicle=None, now_us=NOW) == opened


def test_the_same_parts_and_keys_give_the_same_bytes() -> None:
    assert sealed() == sealed()


def test_a_bundle_for_another_vehicle() -> None:
    assert slug(sealed(), vehicle="quad-08") == "wrong-vehicle"


def test_claimed_vehicle_is_read_unverified() -> None:
    assert bundle.claimed_vehicle(sealed(key=STRANGER)) == "quad-07"
    with pytest.raises(Untrusted):
        bundle.claimed_vehicle(b"no bundle")


def test_a_key_that_was_revoked() -> None:
    trust = root()
    without = tuple(key for key in trust.keys if key.kid != MISSION.kid)
    assert slug(sealed(), trust=msgspec.structs.replace(trust, keys=without, revoked=(MISSION.kid,))) == "revoked-key"


def test_a_mission_for_another_vehicle_than_its_policy() -> None:
    assert slug(sealed(mission=msgspec.structs.replace(THE_MISSION, vehicle="quad-08"))) == "wrong-vehicle"


def test_a_mission_beside_another_policy() -> None:
    first, _ = bundle.envelopes(sealed(policy=msgspec.structs.replace(THE_POLICY, version=8)))
    _, second = bundle.envelopes(sealed())
    assert slug(artefact.wrap(names.BUNDLE, (first, second))) == "wrong-policy"


def test_a_mission_that_names_another_version() -> None:
    assert slug(sealed(mission=msgspec.structs.replace(THE_MISSION, policy_version=6))) == "wrong-policy"


def test_unknown_mission_key_is_refused() -> None:
    assert slug(sealed(key=STRANGER)) == "unknown-key"


def test_envelopes_in_each_others_place() -> None:
    first, second = bundle.envelopes(sealed())
    assert slug(artefact.wrap(names.BUNDLE, (second, first))) == "wrong-content-type"


def test_a_policy_key_that_expired() -> None:
    assert slug(sealed(), now=NOW + HOUR) == "key-expired"


@pytest.mark.parametrize(
    ("speaks", "expected"),
    [
        ({"roles": ("trainee",)}, "wrong-role"),
        ({"sources": ("operator",)}, "wrong-source"),
        ({"vehicles": ("quad-08",)}, "wrong-vehicle"),
    ],
)
def test_unauthorised_mission_key_is_refused(speaks: dict[str, tuple[str, ...]], expected: str) -> None:
    assert slug(sealed(), trust=root(**speaks)) == expected


@pytest.mark.parametrize("change", [{"role": 1}, {"role": -1}, {"source": 9}])
def test_step_with_unknown_role_or_source_is_refused(change: dict[str, int]) -> None:
    step = msgspec.structs.replace(STEP, **change)
    assert slug(sealed(mission=msgspec.structs.replace(THE_MISSION, invocations=(step,)))) == "malformed"


def test_a_binding_that_does_not_cover_its_step() -> None:
    def weaken(bound: Mission) -> Mission:
        step = msgspec.structs.replace(bound.invocations[0], on_inadmissible=2)
        return msgspec.structs.replace(bound, invocations=(step,))

    assert slug(sealed(after=weaken)) == "binding-mismatch"


def test_a_payload_of_the_wrong_shape() -> None:
    first, _ = bundle.envelopes(sealed())
    payload = artefact.wrap(names.MISSION, ("look", 3))
    second = cose.sign1(payload, key=MISSION, duty=Duty.MISSION, content_type=names.MISSION.content_type)
    assert slug(artefact.wrap(names.BUNDLE, (first, second))) == "malformed"


def test_a_payload_that_leaves_a_default_out() -> None:
    """Structs with defaults also decode from shorter arrays, so only canonical bytes are accepted."""
    payload = bundle.mission_payload(bind(THE_MISSION, b"\0" * 32))
    body = list(artefact.unwrap(names.MISSION, payload))  # type: ignore[arg-type]
    step = list(body[9][0])  # type: ignore[index]
    contract = list(step[10])
    contract[2] = contract[2][:3]  # the motion without its time
    step[10] = tuple(contract)
    body[9] = (tuple(step),)
    with pytest.raises(bundle.BundleError, match="not the bytes"):
        bundle.parse(names.MISSION, artefact.wrap(names.MISSION, tuple(body)), Mission)


@pytest.mark.parametrize("data", [b"", b"\x80", artefact.wrap(names.POLICY, ()), artefact.wrap(names.BUNDLE, (b"",))])
def test_garbage_is_not_a_bundle(data: bytes) -> None:
    assert slug(data) in {"malformed", "unknown-format"}


def test_a_bundle_that_is_too_large_is_not_read() -> None:
    assert slug(bytes(bundle.MAX_BUNDLE + 1)) == "too-large"


def test_the_same_mission_in_another_envelope_is_the_same_mission() -> None:
    """Otherwise a second signature of the policy would let a mission fly twice."""
    other = SigningKey.from_seed(b"q" * 32, duty=Duty.POLICY)
    plain = root()
    trust = msgspec.structs.replace(plain, keys=(*plain.keys, other.verification(vehicles=("quad-07",))))
    first = sealed()
    again = cose.sign1(
        bundle.policy_payload(THE_POLICY), key=other, duty=Duty.POLICY, content_type=names.POLICY.content_type
    )
    second = artefact.wrap(names.BUNDLE, (again, bundle.envelopes(first)[1]))
    one, two = (bundle.open_bundle(data, root=trust, vehicle="quad-07", now_us=NOW) for data in (first, second))
    assert one.digest != two.digest
    assert one.mission_digest == two.mission_digest
