"""The refusals of `load`."""

import pytest
from msgspec.structs import replace

from reference.flat_case import BATTERY, INVOCATIONS, ISSUED, MISSION, POLICY, SIGNALS, H
from reference.world import FLIGHT, MISSION_KEY, POLICY_KEY, ROOT, SESSION_KEY, START, VEHICLE, loaded, sealed, try_load
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import MAX_SLOTS
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire import binding, bundle
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.request import MAX_AGE_US
from virtual.rows import rows


def refusal(data: bytes, **changed: object) -> Refusal:
    arguments = {
        "root": ROOT,
        "vehicle": VEHICLE,
        "now": START,
        "mode": EnforcementMode.SOFTWARE,
        "session_key": SESSION_KEY,
        "flight": FLIGHT,
        "peer_is_own_simulator": False,
    }
    result = load(data, **(arguments | changed))  # type: ignore[arg-type]
    assert isinstance(result, Refusal)
    return result


def test_a_good_bundle_is_in_force() -> None:
    of = loaded()
    assert of.vehicle == VEHICLE
    assert of.mode is EnforcementMode.SOFTWARE
    assert of.expires_us == ISSUED + H // 2


def test_mode_none_flies_the_own_simulator_only() -> None:
    assert refusal(sealed(), mode=EnforcementMode.NONE).slug == "mode-refused"
    assert isinstance(try_load(sealed(), EnforcementMode.NONE, own_simulator=True), Loaded)


def test_a_bundle_for_another_vehicle_is_refused() -> None:
    assert refusal(sealed(), vehicle="quad-08").slug == "wrong-vehicle"


def test_an_expired_key_is_refused() -> None:
    expiring = replace(POLICY_KEY.verification(vehicles=(VEHICLE,)), expires_us=START.utc_us)
    root = replace(ROOT, keys=(expiring, *ROOT.keys[1:]))
    assert refusal(sealed(), root=root).slug == "key-expired"
    assert isinstance(try_load(sealed()), Loaded)


@pytest.mark.parametrize(
    ("roles", "sources", "slug"),
    [
        (("supervisor",), ("agent",), "wrong-role"),
        (("operator",), ("operator",), "wrong-source"),
        ((), (), "wrong-source"),
    ],
)
def test_a_mission_key_without_the_role_or_source_is_refused(
    roles: tuple[str, ...], sources: tuple[str, ...], slug: str
) -> None:
    key = MISSION_KEY.verification(roles=roles, sources=sources, vehicles=(VEHICLE,))
    root = replace(ROOT, keys=(ROOT.keys[0], key, ROOT.keys[2]))
    assert refusal(sealed(), root=root).slug == slug


def test_an_unknown_key_is_refused() -> None:
    stranger = SigningKey.from_seed(bytes(32), duty=Duty.MISSION)
    payload = bundle.policy_payload(POLICY)
    mission = bundle.mission_payload(binding.bind(MISSION, bundle.policy_digest(payload)))
    assert refusal(bundle.seal(payload, mission, policy_key=POLICY_KEY, mission_key=stranger)).slug == "unknown-key"


@rows("at", [0, 30, 200, 2_000, -100, -1])
def test_a_bundle_with_a_changed_byte_is_refused(at: int) -> None:
    data = bytearray(sealed())
    data[at] ^= 1
    assert refusal(bytes(data)).slug in {
        "malformed",
        "bad-signature",
        "unknown-key",
        "unknown-format",
        "unknown-version",
    }


@pytest.mark.parametrize("data", [b"", b"\x00", b"\xff" * 100, sealed()[:-1], sealed() + b"\0"])
def test_garbage_bundle_is_malformed(data: bytes) -> None:
    assert refusal(data).slug == "malformed"


def test_policy_with_oversized_requests_is_refused() -> None:
    slots = POLICY.slots
    more = tuple(replace(SIGNALS[BATTERY], name=f"s{n}", slot=n) for n in range(slots, MAX_SLOTS + 1))
    wide = replace(POLICY, signals=(*POLICY.signals, *more), slots=MAX_SLOTS + 1)
    assert "number of slots" in refusal(sealed(wide)).text
    fits = replace(POLICY, signals=(*POLICY.signals, *more[:-1]), slots=MAX_SLOTS)
    assert isinstance(try_load(sealed(fits)), Loaded)
    lasting = replace(POLICY, signals=(replace(SIGNALS[0], stale_us=MAX_AGE_US), *SIGNALS[1:]))
    assert "staleness" in refusal(sealed(lasting)).text


def test_signed_malformed_bundle_is_refused() -> None:
    assert "no contingency" in refusal(sealed(replace(POLICY, contingency=()))).text
    assert refusal(sealed(mission=replace(MISSION, invocations=()))).slug == "malformed"
    assert refusal(sealed(replace(POLICY, slots=POLICY.slots + 1))).slug == "malformed"
    wrong_skill = replace(INVOCATIONS[0], skill=99)
    assert refusal(sealed(mission=replace(MISSION, invocations=(wrong_skill,)))).slug == "malformed"


def test_a_session_key_of_another_length_is_a_fault() -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        refusal(sealed(), session_key=b"short")


def test_bundle_may_be_loaded_before_its_issue() -> None:
    early = Now(0, 0, 0)
    assert isinstance(
        load(
            sealed(),
            root=ROOT,
            vehicle=VEHICLE,
            now=early,
            mode=EnforcementMode.SOFTWARE,
            session_key=SESSION_KEY,
            flight=FLIGHT,
            peer_is_own_simulator=False,
        ),
        Loaded,
    ), "whether a step is fresh is decided when it is asked for"
