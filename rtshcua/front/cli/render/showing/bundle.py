"""Show a bundle: its signatures and complete contents."""

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.documents import claimed
from rtshcua.decision.checks.home_fit import exceeded
from rtshcua.front.cli.render.showing.page import TextPage, named
from rtshcua.front.cli.render.showing.policy import show_mission, show_policy
from rtshcua.model.flat.home_limits import TRUSTZONE_M
from rtshcua.wire.bundle import open_bundle
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted


def show_bundle(page: TextPage, data: bytes, now_us: int) -> dict[str, object]:
    """Add a bundle to the page, and return it as JSON. Raises `Untrusted`."""
    trusted, verdict = _verdict(data, now_us)
    what = claimed(data, trusted=trusted)
    page.head(f"Bundle of {len(data)} bytes")
    page.row("digest", what.digest.hex())
    page.row("policy", f"digest {what.policy_digest.hex()}, key {what.policy_kid.hex()}")
    page.row("mission", f"key {what.mission_kid.hex()}")
    page.row("signatures", verdict)
    unfit = exceeded(what.policy, what.mission, len(data), TRUSTZONE_M)
    small = "`--mode trustzone-m` and `optee`"
    page.row("memory", f"too large for {small}: {', '.join(unfit)}" if unfit else "fits every mode")
    show_mission(page, what.mission, what.policy)
    show_policy(page, what.policy)
    return {
        "kind": "bundle",
        "digest": what.digest.hex(),
        "policy_digest": what.policy_digest.hex(),
        "policy_key": what.policy_kid.hex(),
        "mission_key": what.mission_kid.hex(),
        "trusted": trusted,
        "verdict": verdict,
        "too_large_for": {"trustzone-m": unfit, "optee": unfit} if unfit else {},
        "mission": named(what.mission),
        "policy": named(what.policy),
    }


def _verdict(data: bytes, now_us: int) -> tuple[bool, str]:
    """Return whether the key store's root trusts the bundle now, and a text about it."""
    store = KeyStore(data_folder())
    try:
        root = open_root(store.root(), pinned=store.pin(), now_us=now_us)
        open_bundle(data, root=root, vehicle=None, now_us=now_us)
    except Untrusted as error:
        return False, f"not trusted here: {error}"
    return True, f"verified under the {'development' if root.development else 'trust'} root of your key store"
