"""The trust in a log: its trust root under the pinned key, and the duty of its log key under that root."""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import Genesis
from rtshcua.wire.keys import Duty, VerificationKey
from rtshcua.wire.trust import TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted


def rooted(genesis: Genesis, pinned: bytes) -> TrustRoot | Flaw:
    """The trust root of a genesis, if the pinned key signed it and it trusts the log key; else the flaw.

    `pinned` is the root's public key (32 bytes) or its `kid` (16 bytes). Keys are judged at the genesis' UTC, even
    if they have expired since.
    """
    data = octets(genesis.root)
    if data is None or octets(genesis.bundle) is None:
        return Flaw("genesis/base64", "the trust root or the bundle is not canonical base64")
    root = trusted_root(data, pinned, genesis.utc_us)
    if isinstance(root, Flaw):
        return root
    keys = root.keys_for(Duty.LOG)
    key = keys.get(bytes.fromhex(genesis.log_kid))
    if key is None:
        text = "the log's key has no duty `log` in the trust root: the signer of this log was not authorised"
        return Flaw("trust/log-key", text, genesis.log_kid, " or ".join(kid.hex() for kid in keys))
    return may_not_sign(key, genesis.vehicle, genesis.utc_us) or root


def trusted_root(data: bytes, pinned: bytes, now_us: int) -> TrustRoot | Flaw:
    """The trust root in an envelope, under the pinned key."""
    try:
        return open_root(data, pinned=pinned, now_us=now_us)
    except Untrusted as error:
        return Flaw(f"trust/root-{error.slug}", f"the trust root is not trusted: {error}")


def may_not_sign(key: VerificationKey, vehicle: str, now_us: int) -> Flaw | None:
    """Why a log key was not authorised to sign the logs of a vehicle at a UTC time; None if it was."""
    refusal = key_refusal(key, vehicle=vehicle, now_us=now_us)
    if refusal is None:
        return None
    return Flaw(
        "trust/log-key",
        f"the log's key was not authorised for vehicle `{vehicle}` at the time: {refusal}",
        key.kid.hex(),
    )
