"""The basis of a log: the trust root under the pinned key, the bundle under that root, and the log key's duty."""

from functools import lru_cache
from typing import NamedTuple

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.decision.session import InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import Genesis
from rtshcua.evidence.rooted import rooted
from rtshcua.wire.bundle import Bundle, open_bundle
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted


class Basis(NamedTuple):
    """The trust root, policy and mission from which the decisions of a log are derived."""

    root: TrustRoot
    policy: PreparedPolicy
    in_force: InForce

    @property
    def bundle(self) -> Bundle:
        """The bundle; after a replacement, with the mission in force."""
        return self.in_force.bundle

    @property
    def invocations(self) -> tuple[PreparedInvocation, ...]:
        """The invocations of the mission in force."""
        return self.in_force.invocations


def establish(genesis: Genesis, pinned: bytes, *, bundle: bytes | None = None) -> Basis | Flaw:
    """Return the basis of a log, or the flaw because of which it is not trusted.

    `pinned` is the root's public key (32 bytes) or its `kid` (16 bytes). Validity is checked at the UTC of the genesis,
    so a later expiry does not matter. `bundle` is the expected bundle, if known.
    """
    trusted = _trusted(genesis, pinned)
    if isinstance(trusted, Flaw):
        return trusted
    root, opened = trusted
    if bundle not in (None, octets(genesis.bundle)):
        return Flaw("genesis/other-bundle", "the log is not of the expected bundle")
    prepared = _prepared(genesis, pinned)
    if isinstance(prepared, Flaw):
        return prepared
    policy, invocations = prepared
    boot = bytes.fromhex(genesis.boot)
    in_force = InForce(opened, policy, invocations, root, genesis.vehicle, boot, genesis.received_us)
    return Basis(root, policy, in_force)


# The quick verifier, the careful one and each proof open the same genesis, and opening its bundle takes longer than
# reading a short log.
_kept = lru_cache(maxsize=8)


def forget() -> None:
    """Forget the bundles that were opened: for measurements of what opening them takes."""
    _trusted.cache_clear()
    _prepared.cache_clear()


@_kept
def _trusted(genesis: Genesis, pinned: bytes) -> tuple[TrustRoot, Bundle] | Flaw:
    """Return the root and the bundle in a genesis, if they are trusted."""
    root, data = rooted(genesis, pinned), octets(genesis.bundle)
    if isinstance(root, Flaw):
        return root
    assert data is not None
    try:
        return root, open_bundle(data, root=root, vehicle=genesis.vehicle, now_us=genesis.utc_us)
    except Untrusted as error:
        return Flaw(f"trust/bundle-{error.slug}", f"the bundle is not trusted: {error}")


@_kept
def _prepared(genesis: Genesis, pinned: bytes) -> tuple[PreparedPolicy, tuple[PreparedInvocation, ...]] | Flaw:
    """Return the prepared policy and mission of the bundle in a genesis."""
    trusted = _trusted(genesis, pinned)
    if isinstance(trusted, Flaw):
        return trusted
    _, bundle = trusted
    if genesis.mission != bundle.mission.name:
        return Flaw(
            "genesis/mission", "the log names another mission than its bundle", genesis.mission, bundle.mission.name
        )
    policy = prepare(bundle.policy)
    if isinstance(policy, Refusal):
        return Flaw("trust/bundle-malformed", f"the bundle's policy is invalid: {policy.text}")
    invocations = prepare_mission(bundle.mission, policy)
    if isinstance(invocations, Refusal):
        return Flaw("trust/bundle-malformed", f"the bundle's mission is invalid: {invocations.text}")
    return policy, invocations
