"""The trust root: pinned, self-signed, expiring, and replaced one version at a time."""

import hashlib

import msgspec
import pytest

from rtshcua.model.flat.limits import MAX_KEYS, MAX_REVOKED
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.keys import ANY, Duty, SigningKey, VerificationKey, WrongDuty
from rtshcua.wire.trust import (
    MAX_ROOT,
    RootError,
    Thresholds,
    TrustRoot,
    follow,
    key_refusal,
    open_root,
    open_successor,
    proposer_refusal,
    speaker_refusal,
)
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows


def signing_key(number, duty, *, development=False):
    return SigningKey.from_seed(bytes([number]) * 32, duty=duty, development=development)


ROOT = signing_key(1, Duty.ROOT)
NEXT = signing_key(2, Duty.ROOT)
POLICY = signing_key(3, Duty.POLICY)
AGENT = signing_key(4, Duty.MISSION)
AGENT_KEY = AGENT.verification(
    roles=("operator",), sources=("agent",), vehicles=("quad-07",), expires_us=500, policies=("field",)
)
KEYS = (ROOT.verification(), POLICY.verification(vehicles=(ANY,)), AGENT_KEY)
TRUST = TrustRoot(1, False, 100, 1000, KEYS)
SIGNED = TRUST.sign(ROOT)


def changed(root=TRUST, **fields):
    return msgspec.structs.replace(root, **fields)


def envelope(payload, key=ROOT):
    return cose.sign1(payload, key=key, duty=Duty.ROOT, content_type=names.ROOT.content_type)


def refusal(function, *args, **more):
    with pytest.raises(Untrusted) as refused:
        function(*args, **more)
    return refused.value.slug


def opening(data, pinned=ROOT.public, now_us=200):
    return refusal(open_root, data, pinned=pinned, now_us=now_us)


@pytest.mark.parametrize("pinned", [ROOT.public, ROOT.kid])
def test_a_pinned_root_is_opened(pinned):
    assert open_root(SIGNED, pinned=pinned, now_us=200) == TRUST


def test_the_format_is_stable():
    assert TRUST.sign(ROOT) == SIGNED
    assert artefact.unwrap(names.ROOT, TRUST.encode())["keys"][2] == {
        "duty": "mission",
        "public": AGENT.public,
        "roles": ("operator",),
        "sources": ("agent",),
        "vehicles": ("quad-07",),
        "expires_us": 500,
        "development": False,
        "policies": ("field",),
        "person": "",
    }
    assert hashlib.sha256(SIGNED).hexdigest() == "10c61ba87b667b64570329e0368b00c1288c5fd32d2aad4cc3cd292ce7475fae"


def test_keys_are_found_by_duty():
    assert TRUST.keys_for(Duty.MISSION) == {AGENT.kid: AGENT_KEY}
    assert TRUST.keys_for(Duty.LOG) == {}


def test_another_pin_is_refused():
    assert opening(SIGNED, pinned=NEXT.public) == "unknown-key"
    assert opening(SIGNED, pinned=NEXT.kid) == "unknown-key"
    assert opening(SIGNED, pinned=bytes(32)) == "unknown-key"  # a pin of small order, for which anybody could sign
    with pytest.raises(ValueError, match="a pin is 32 or 16 bytes, not 3"):
        open_root(SIGNED, pinned=b"pin", now_us=200)


def test_only_a_development_root_is_trusted_unpinned():
    developer = signing_key(9, Duty.ROOT, development=True)
    root = TrustRoot(1, True, 100, 1000, (developer.verification(),))
    assert open_root(root.sign(developer), pinned=None, now_us=200) == root
    assert opening(SIGNED, pinned=None) == "unpinned"


def test_expiry():
    assert open_root(SIGNED, pinned=ROOT.public, now_us=999) == TRUST
    assert opening(SIGNED, now_us=1000) == "expired"
    root = changed(keys=(ROOT.verification(expires_us=300),))
    assert open_root(root.sign(ROOT), pinned=ROOT.kid, now_us=299) == root
    assert opening(root.sign(ROOT), now_us=300) == "key-expired"


def test_a_root_names_the_key_that_signed_it():
    assert refusal(TRUST.sign, NEXT) == "not-self-signed"
    assert opening(envelope(TRUST.encode(), NEXT), pinned=NEXT.public) == "not-self-signed"
    assert opening(envelope(TRUST.encode(), NEXT), pinned=NEXT.kid) == "unknown-key"
    with pytest.raises(WrongDuty):
        TRUST.sign(POLICY)


def test_a_tampered_root_is_refused():
    claimed = cose.unverified(SIGNED)
    forged = SIGNED.replace(claimed.payload, changed(expires_at_us=2000).encode())
    assert opening(forged) == opening(forged, pinned=ROOT.kid) == "bad-signature"


@rows(
    ("fields", "slug"),
    [
        ({"version": 0}, "malformed"),
        ({"expires_at_us": 100}, "malformed"),
        ({"thresholds": Thresholds(root=2)}, "unsupported-threshold"),
        ({"thresholds": Thresholds(log=3)}, "unsupported-threshold"),
        ({"thresholds": Thresholds(mission=0)}, "malformed"),
        ({"thresholds": Thresholds(witness=0)}, "malformed"),
        ({"thresholds": Thresholds(witness=2)}, "unreachable-threshold"),
        ({"keys": (*KEYS, ROOT.verification())}, "shared-key"),
        ({"keys": KEYS[:1] * (MAX_KEYS + 1)}, "malformed"),
        ({"revoked": tuple(n.to_bytes(8) for n in range(MAX_REVOKED + 1))}, "malformed"),
        ({"keys": (*KEYS, VerificationKey(Duty.LOG, POLICY.public))}, "shared-key"),
        ({"keys": (*KEYS, signing_key(5, Duty.LOG, development=True).verification())}, "development-key"),
    ],
    ids=str,
)
def test_a_root_that_contradicts_itself_is_neither_signed_nor_opened(fields, slug):
    root = changed(**fields)
    assert refusal(root.sign, ROOT) == slug
    assert opening(envelope(root.encode())) == slug


def approving(number=6, **fields):
    """An approval key, by default of Ada as supervisor."""
    usual = {"roles": ("supervisor",), "sources": ("operator",), "vehicles": ("quad-07",), "person": "ada"}
    return signing_key(number, Duty.APPROVAL).verification(**(usual | fields))


@rows(
    ("key", "slug"),
    [
        (signing_key(6, Duty.LOG).verification(person="ada"), "malformed"),
        (signing_key(6, Duty.MISSION).verification(policies=("field",), person="ada"), "malformed"),
        (signing_key(6, Duty.POLICY).verification(policies=("field",)), "malformed"),
        (approving(policies=("field",)), "malformed"),
        (approving(person=""), "whose-approval"),
        (approving(person="Ada"), "whose-approval"),
        (approving(person="ad a"), "whose-approval"),
        (approving(person="-ada"), "whose-approval"),
        (approving(person="\u0430da"), "whose-approval"),  # a Cyrillic letter
        (approving(person="a" * 65), "whose-approval"),
        (approving(roles=()), "whose-approval"),
        (approving(roles=(ANY,)), "whose-approval"),
        (approving(roles=("supervisor", "operator")), "whose-approval"),
        (approving(sources=()), "whose-approval"),
        (approving(sources=("agent",)), "whose-approval"),
        (approving(sources=("agent", "operator")), "whose-approval"),
    ],
)
def test_persons_and_policies_belong_to_their_duties(key, slug):
    root = changed(keys=(*KEYS, key))
    assert refusal(root.sign, ROOT) == slug
    assert opening(envelope(root.encode())) == slug


def test_all_approval_keys_of_a_person_are_of_that_person():
    ada, again, other = approving(), approving(7, roles=("operator",)), approving(8, person="0.b_-" + "b" * 59)
    root = changed(keys=(*KEYS, ada, other, again))
    assert open_root(root.sign(ROOT), pinned=ROOT.public, now_us=200) == root
    assert root.person(ada) == root.person(again) != root.person(other)


WITNESSES = tuple(signing_key(20 + number, Duty.WITNESS) for number in range(2))


@pytest.mark.parametrize("threshold", [1, 2])
def test_witnesses_may_have_a_threshold(threshold):
    keys = (*KEYS, WITNESSES[0].verification(vehicles=(ANY,)), WITNESSES[1].verification(vehicles=("quad-07",)))
    root = changed(keys=keys, thresholds=Thresholds(witness=threshold))
    opened = open_root(root.sign(ROOT), pinned=ROOT.public, now_us=200)
    assert opened == root
    assert opened.witness_threshold == threshold
    assert opened.witnesses("quad-07", 200) == {key.public for key in WITNESSES}
    assert opened.witnesses("quad-08", 200) == {WITNESSES[0].public}
    more = changed(root, thresholds=Thresholds(witness=3))
    assert refusal(more.sign, ROOT) == "unreachable-threshold"


def test_without_a_threshold_one_witness_is_enough():
    """As in an older root without this field."""
    assert b"witness" not in TRUST.encode()
    assert TRUST.witness_threshold == 1
    assert TRUST.witnesses("quad-07", 200) == set()
    expired = changed(keys=(*KEYS, WITNESSES[0].verification(vehicles=(ANY,), expires_us=150)))
    assert expired.witnesses("quad-07", 149) == {WITNESSES[0].public}
    assert expired.witnesses("quad-07", 150) == set()


def test_a_threshold_above_one_says_so():
    with pytest.raises(RootError, match="`policy` requires 2 signatures; only 1 is supported"):
        changed(thresholds=Thresholds(policy=2)).sign(ROOT)


def body(**changes):
    fields = artefact.unwrap(names.ROOT, TRUST.encode()) | changes
    return artefact.wrap(names.ROOT, {key: value for key, value in fields.items() if value is not ...})


def key_body(**changes):
    fields = artefact.unwrap(names.ROOT, TRUST.encode())["keys"][0] | changes
    return body(keys=[fields])


@rows(
    "payload",
    [
        body(version="1"),
        body(version=True),
        body(development=0),
        body(surplus=1),
        body(version=...),
        body(thresholds=...),  # the default would have the same meaning, but other bytes
        body(keys=None),
        key_body(public=ROOT.public[1:]),
        key_body(public="Hm1KxwV0OhW9nULkYcfkvaoQdbzKcsQyCVzcLpsbNDM="),  # as text
        key_body(duty="pilot"),
        key_body(sources=("pilot",)),
        key_body(surplus=1),
        artefact.wrap(names.ROOT, 1),
        b"",
    ],
)
def test_malformed_payloads(payload):
    assert opening(envelope(payload)) == opening(envelope(payload), pinned=ROOT.kid) == "malformed"


def test_another_format_or_version_is_refused():
    other = artefact.wrap(names.POLICY, artefact.unwrap(names.ROOT, TRUST.encode()))
    assert opening(envelope(other)) == "unknown-format"
    for version in (1, 3):
        other = artefact.wrap(names.Artefact("rtshcua/root", version), None)
        assert opening(envelope(other)) == "unknown-version"


def test_a_huge_root_is_refused_unread():
    assert opening(b"\xd2" + bytes(MAX_ROOT + 1)) == "malformed"


def succession(data, now_us=200, current=TRUST):
    return refusal(open_successor, data, current=current, now_us=now_us)


def test_a_root_key_is_changed_in_two_steps():
    both = changed(version=2, keys=(ROOT.verification(), NEXT.verification()))
    second = open_successor(both.sign(ROOT), current=TRUST, now_us=500)
    assert second == both
    third = changed(version=3, keys=(NEXT.verification(),))
    assert open_successor(third.sign(NEXT), current=second, now_us=200) == third
    assert succession(changed(version=2, keys=(NEXT.verification(),)).sign(NEXT)) == "unknown-key"


def test_an_expired_root_can_be_replaced_but_not_by_an_expired_one():
    renewed = changed(version=2, expires_at_us=9000)
    assert open_successor(renewed.sign(ROOT), current=TRUST, now_us=5000) == renewed
    assert succession(changed(version=2).sign(ROOT), now_us=5000) == "expired"


def test_versions_rise_one_by_one():
    assert succession(SIGNED) == "rollback"
    assert succession(SIGNED, current=changed(version=3)) == "rollback"
    assert succession(changed(version=3).sign(ROOT)) == "version-gap"


def test_another_root_of_the_same_version_is_a_fork():
    assert succession(changed(expires_at_us=2000).sign(ROOT)) == "fork"
    assert succession(changed(expires_at_us=2000).sign(ROOT), current=changed(version=2)) == "rollback"


def revoking(*names, **fields):
    return changed(**{"version": 2, "revoked": names, "keys": (ROOT.verification(), NEXT.verification())} | fields)


def test_revoked_key_stays_revoked():
    second = open_successor(revoking(AGENT.kid).sign(ROOT), current=TRUST, now_us=200)
    assert (TRUST.revocations, second.revocations) == (frozenset(), {AGENT.kid})
    assert succession(revoking(POLICY.kid, version=3).sign(ROOT), current=second) == "unrevoked"
    assert succession(changed(version=3).sign(ROOT), current=second) == "unrevoked"
    third = revoking(AGENT.kid, POLICY.kid, version=3)
    assert open_successor(third.sign(NEXT), current=second, now_us=200) == third


def test_revoked_root_key_signs_no_new_root():
    second = revoking(ROOT.kid, keys=(NEXT.verification(),))
    assert refusal(second.sign, ROOT) == "not-self-signed"
    both = revoking(ROOT.kid, version=3)  # names it twice
    assert succession(envelope(both.encode(), NEXT), current=second) == "revoked-key"
    assert succession(changed(version=3).sign(ROOT), current=second) == "revoked-key"


@rows(
    ("names", "slug"),
    [
        ((), "malformed"),
        ((AGENT.kid, AGENT.kid), "malformed"),
        ((b"short",), "malformed"),
        ((NEXT.kid,), "revoked-key"),
        ((bytes(8), bytes(7)), "malformed"),
    ],
)
def test_a_root_revokes_keys_each_once_and_trusts_none_of_them(names, slug):
    assert refusal(revoking(*names).sign, ROOT) == slug
    assert opening(envelope(revoking(*names).encode())) == slug


def test_a_link_key_is_revoked_by_its_fingerprint():
    root = revoking(bytes(8))
    assert open_root(root.sign(ROOT), pinned=ROOT.kid, now_us=200) == root
    assert TrustRoot.decode(root.encode()) == root


SECOND, THIRD = (changed(version=number, keys=(*KEYS, NEXT.verification())).sign(ROOT) for number in (2, 3))
FOURTH = changed(version=4, expires_at_us=9000, keys=(NEXT.verification(),), revoked=(ROOT.kid,)).sign(NEXT)


def following(*chain, current=SIGNED, now_us=200):
    return refusal(follow, chain, current=current, now_us=now_us)


@rows("begun", range(4))
def test_a_chain_is_followed_from_wherever_one_stands(begun):
    chain = (SIGNED, SECOND, THIRD, FOURTH)
    assert follow(chain, current=chain[begun], now_us=5000) == FOURTH, "those between may have expired"
    assert follow(chain[begun + 1 :], current=chain[begun], now_us=5000 if begun < 3 else 200) == FOURTH
    assert follow((), current=FOURTH, now_us=200) == FOURTH


def test_a_chain_with_a_hole_a_fork_or_an_old_end_is_not_followed():
    assert following(THIRD) == following(SECOND, FOURTH, current=SIGNED) == "version-gap"
    assert following(FOURTH) == following(SECOND, FOURTH) == "version-gap"
    assert following(changed(version=2, keys=(NEXT.verification(),)).sign(NEXT)) == "unknown-key"
    assert following(SECOND, current=THIRD) == following(SIGNED, SECOND, current=THIRD) == "rollback"
    fork = changed(version=3, expires_at_us=2000, keys=(*KEYS, NEXT.verification())).sign(ROOT)
    assert following(fork, FOURTH, current=THIRD) == following(SECOND, THIRD, fork) == "fork"
    late = envelope(changed(version=5).encode())
    assert following(late, current=FOURTH) == "revoked-key"
    assert following(SECOND, THIRD, now_us=5000) == "expired"
    assert following(SIGNED, now_us=5000) == "expired"


def test_development_is_never_a_successor():
    assert succession(changed(version=2, development=True).sign(ROOT)) == "development-root"
    developer = changed(development=True)
    promoted = changed(version=2)
    assert open_successor(promoted.sign(ROOT), current=developer, now_us=200) == promoted


def speaking(key=AGENT_KEY, *, role="operator", source="agent", vehicle="quad-07", now_us=200):
    return speaker_refusal(key, role=role, source=source, vehicle=vehicle, now_us=now_us)


def test_agent_host_acts_as_agent_only():
    assert speaking() is None
    assert speaking(source="operator") == "wrong-source"
    assert speaking(role="supervisor") == "wrong-role"
    assert speaking(vehicle="quad-08") == "wrong-vehicle"
    assert speaking(now_us=499) is None
    assert speaking(now_us=500) == "key-expired"


def proposing(key=AGENT_KEY, *, policy="field", source="agent"):
    return proposer_refusal(key, role="operator", source=source, policy=policy, vehicle="quad-07", now_us=200)


def test_a_mission_key_is_for_named_policies():
    assert proposing() is None
    assert proposing(policy="laxer") == "key-other-policy"
    assert proposing(source="operator", policy="laxer") == "wrong-source"
    assert proposing(msgspec.structs.replace(AGENT_KEY, policies=())) == "key-other-policy"
    assert proposing(msgspec.structs.replace(AGENT_KEY, policies=(ANY,)), policy="laxer") is None


def test_any_stands_for_roles_and_vehicles_but_never_for_sources():
    key = AGENT.verification(roles=(ANY,), sources=("operator",), vehicles=(ANY,))
    assert speaking(key, role="whoever", source="operator", vehicle="whatever") is None
    assert speaking(key, source="agent") == "wrong-source"
    with pytest.raises(ValueError, match="`\\*` is not a source"):
        AGENT.verification(sources=(ANY,))


def test_empty_lists_allow_nothing():
    assert key_refusal(POLICY.verification(), vehicle="quad-07", now_us=0) == "wrong-vehicle"
    assert key_refusal(POLICY.verification(vehicles=("quad-07",)), vehicle="quad-07", now_us=0) is None
    assert speaking(AGENT.verification(vehicles=(ANY,), sources=("agent",))) == "wrong-role"
    assert speaking(AGENT.verification(vehicles=(ANY,), roles=(ANY,))) == "wrong-source"
