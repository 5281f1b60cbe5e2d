"""What a log rests on: the trust root under the pinned key, the bundle under that root, and the log key's duty."""

from base64 import b64decode, b64encode
from typing import NamedTuple

from rtshcua.decision.in_force import InForce
from rtshcua.decision.prepare import Malformed, prepare, prepare_mission
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Genesis
from rtshcua.wire.bundle import Bundle, open_bundle
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted


class Basis(NamedTuple):
    """What the decisions of a log are derived from."""

    root: TrustRoot
    policy: PreparedPolicy
    in_force: InForce

    @property
    def bundle(self) -> Bundle:
        """The bundle; after a replacement, with the mission that was in force at the end."""
        return self.in_force.bundle

    @property
    def invocations(self) -> tuple[PreparedInvocation, ...]:
        """The invocations of the mission that is in force."""
        return self.in_force.invocations


def establish(genesis: Genesis, pinned: bytes) -> Basis | Flaw:
    """The basis of a log, or what is not to be trusted about it.

    `pinned` is the root's public key (32 bytes) or its `kid` (16 bytes). Everything is judged as of the genesis' UTC:
    what has expired since was good when it flew.
    """
    root_bytes, bundle_bytes = octets(genesis.root), octets(genesis.bundle)
    if root_bytes is None or bundle_bytes is None:
        return Flaw("genesis/base64", "the trust root or the bundle is not canonical base64")
    try:
        root = open_root(root_bytes, pinned=pinned, now_us=genesis.utc_us)
    except Untrusted as error:
        return Flaw(f"trust/root-{error.slug}", f"the trust root is not to be trusted: {error}")
    key = root.keys_for(Duty.LOG).get(bytes.fromhex(genesis.log_kid))
    if key is None:
        text = "the log's key has no duty `log` in the trust root: whoever signed this log was not entitled to"
        return Flaw("trust/log-key", text, genesis.log_kid, " or ".join(kid.hex() for kid in root.keys_for(Duty.LOG)))
    refusal = key_refusal(key, vehicle=genesis.vehicle, now_us=genesis.utc_us)
    if refusal is not None:
        text = f"the log's key might not sign for vehicle `{genesis.vehicle}` then: {refusal}"
        return Flaw("trust/log-key", text, genesis.log_kid)
    try:
        bundle = open_bundle(bundle_bytes, root=root, vehicle=genesis.vehicle, now_us=genesis.utc_us)
    except Untrusted as error:
        return Flaw(f"trust/bundle-{error.slug}", f"the bundle is not to be trusted: {error}")
    return _prepared(genesis, root, bundle)


def _prepared(genesis: Genesis, root: TrustRoot, bundle: Bundle) -> Basis | Flaw:
    if genesis.mission != bundle.mission.name:
        return Flaw(
            "genesis/mission", "the log names another mission than its bundle", genesis.mission, bundle.mission.name
        )
    policy = prepare(bundle.policy)
    if isinstance(policy, Malformed):
        return Flaw("trust/bundle-malformed", f"the bundle's policy makes no sense: {policy.what}")
    invocations = prepare_mission(bundle.mission, policy)
    if isinstance(invocations, Malformed):
        return Flaw("trust/bundle-malformed", f"the bundle's mission makes no sense: {invocations.what}")
    return Basis(root, policy, InForce(bundle, policy, invocations, root, genesis.vehicle))


def octets(text: str) -> bytes | None:
    """The bytes of canonical base64: what a lenient reader ignores could be changed unseen."""
    try:
        data = b64decode(text, validate=True)
    except ValueError:
        return None
    return data if b64encode(data).decode() == text else None
