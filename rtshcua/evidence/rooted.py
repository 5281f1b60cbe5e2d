"""The trust of a log: its root under the pinned key, and the duty of its log key under that root."""

from base64 import b64decode, b64encode

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Genesis
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted


def rooted(genesis: Genesis, pinned: bytes) -> TrustRoot | Flaw:
    """The trust root of a genesis, if the pinned key signed it and it trusts the log key; or what is wrong.

    `pinned` is the root's public key (32 bytes) or its `kid` (16 bytes). Everything is judged as of the genesis' UTC:
    what has expired since was good when it flew.
    """
    data = octets(genesis.root)
    if data is None or octets(genesis.bundle) is None:
        return Flaw("genesis/base64", "the trust root or the bundle is not canonical base64")
    try:
        root = open_root(data, pinned=pinned, now_us=genesis.utc_us)
    except Untrusted as error:
        return Flaw(f"trust/root-{error.slug}", f"the trust root is not to be trusted: {error}")
    keys = root.keys_for(Duty.LOG)
    key = keys.get(bytes.fromhex(genesis.log_kid))
    if key is None:
        text = "the log's key has no duty `log` in the trust root: whoever signed this log was not entitled to"
        return Flaw("trust/log-key", text, genesis.log_kid, " or ".join(kid.hex() for kid in keys))
    refusal = key_refusal(key, vehicle=genesis.vehicle, now_us=genesis.utc_us)
    if refusal is not None:
        text = f"the log's key might not sign for vehicle `{genesis.vehicle}` then: {refusal}"
        return Flaw("trust/log-key", text, genesis.log_kid)
    return root


def octets(text: str) -> bytes | None:
    """The bytes of canonical base64: what a lenient reader ignores could be changed unseen."""
    try:
        data = b64decode(text, validate=True)
    except ValueError:
        return None
    return data if b64encode(data).decode() == text else None
